//! [`Split`]: the mesh of the whole volume, piece by piece, apart into one mesh per chunk.
//!
//! Nothing is meshed twice and nothing computed anew: a triangle goes to the chunk that its cell lies in, and takes its
//! vertices along as they are. So neighbours agree on their border to the last bit, and all chunks together have the
//! triangles of the whole mesh. (Refused: meshing each chunk from samples of its own. Its positions would be rounded
//! elsewhere than the whole mesh's, and it would need a layer of padding that the volume's border does not have.)

use std::collections::{BTreeMap, HashMap, TryReserveError};
use std::num::NonZeroU32;

use marchless::MeshBuffer;

use crate::error::Error;
use crate::input::Volume;
use crate::recent::Recent;

/// More than this many chunks are refused.
const MOST: u64 = 1_000_000;

/// Which cells belong to which chunk. Cells and chunks are counted along the axes of the file, the fastest first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunks {
    /// Cells of the volume per axis; at least 1.
    cells: [u32; 3],
    /// Cells of a chunk per axis, at most.
    size: u32,
    /// How many chunks there are; at most [`MOST`].
    pub(crate) count: u64,
    /// How far the numbers of neighbours are apart: x fastest, whatever the order of the file.
    strides: [u64; 3],
}

impl Chunks {
    /// # Errors
    /// [`Error::TooManyChunks`].
    pub(crate) fn new(size: NonZeroU32, volume: &Volume) -> Result<Self, Error> {
        let size = size.get();
        let cells = volume.lattice().map(|samples| samples - 1);
        let count =
            |size: u64| cells.iter().map(|&cells| u128::from(u64::from(cells).div_ceil(size))).product::<u128>();
        let chunks = count(size.into());
        if chunks > u128::from(MOST) {
            let mut least = u64::from(size) + 1;
            while count(least) > u128::from(MOST) {
                least += 1;
            }
            return Err(Error::TooManyChunks { cells: size, chunks, most: MOST, least });
        }
        let [a, b, c] = cells.map(|cells| u64::from(cells.div_ceil(size)));
        let strides = if volume.z_fastest { [c * b, c, 1] } else { [1, a, a * b] };
        Ok(Self { cells, size, count: chunks as u64, strides })
    }

    /// The number of the chunk at these positions, of which the first is 0.
    fn number(&self, chunk: [u32; 3]) -> u64 {
        (0..3).map(|axis| u64::from(chunk[axis]) * self.strides[axis]).sum()
    }

    /// The first and the last samples of a chunk, which it shares with its neighbours.
    fn samples(&self, chunk: [u32; 3]) -> [[u32; 3]; 2] {
        let first = chunk.map(|v| v * self.size);
        [first, [0, 1, 2].map(|axis| first[axis].saturating_add(self.size).min(self.cells[axis]))]
    }
}

/// Takes the whole mesh apart while it comes; holds what belongs to one layer of chunks.
pub(crate) struct Split {
    chunks: Chunks,
    recent: Recent<[[f32; 3]; 2]>,
    /// The chunks of the present layer that have a triangle, by their positions along the second and the first axis.
    layer: BTreeMap<[u32; 2], Part>,
}

/// The part of the mesh in one chunk.
#[derive(Default)]
struct Part {
    mesh: MeshBuffer,
    /// What the whole mesh's vertices are called here.
    names: HashMap<u32, u32>,
}

/// A chunk with a surface, all of it.
pub(crate) struct Chunk {
    pub(crate) number: u64,
    /// Its first and its last samples.
    pub(crate) samples: [[u32; 3]; 2],
    /// As the whole mesh has it: in grid units from the volume's first sample.
    pub(crate) mesh: MeshBuffer,
}

impl Split {
    pub(crate) const fn new(chunks: Chunks) -> Self {
        Self { chunks, recent: Recent::new(), layer: BTreeMap::new() }
    }

    /// Takes in what the mesher has made of slab `slab`: the vertices on it and below it, the triangles between it and
    /// the one before. Returns the chunks that are complete with it.
    ///
    /// # Errors
    /// [`Error::MeshMemory`].
    pub(crate) fn take(&mut self, slab: u32, piece: &MeshBuffer) -> Result<Vec<Chunk>, Error> {
        let vertices = piece.positions.iter().zip(&piece.normals).map(|(&position, &normal)| [position, normal]);
        self.recent.extend(vertices).map_err(|_| Error::MeshMemory)?;
        for triangle in piece.triangles() {
            let corners = triangle.map(|index| self.recent.get(index));
            let [Some(a), Some(b), Some(c)] = corners else { return Err(Error::VertexMissing) };
            // No triangle lies within a face of its cell. (Beyond 16,384 samples, rounding can bring one there; then
            // it counts to the far side.)
            let [x, y] = [0, 1].map(|axis| a[0][axis].min(b[0][axis]).min(c[0][axis]) as u32);
            let chunk = [y, x].map(|cell| cell / self.chunks.size);
            let part = self.layer.entry(chunk).or_default();
            part.add(triangle, [a, b, c]).map_err(|_| Error::MeshMemory)?;
        }
        if slab == 0 || (!slab.is_multiple_of(self.chunks.size) && slab < self.chunks.cells[2]) {
            return Ok(Vec::new());
        }
        let layer = (slab - 1) / self.chunks.size;
        let parts = std::mem::take(&mut self.layer).into_iter().map(|([y, x], part)| {
            let chunk = [x, y, layer];
            Chunk { number: self.chunks.number(chunk), samples: self.chunks.samples(chunk), mesh: part.mesh }
        });
        Ok(parts.collect())
    }
}

impl Part {
    /// Adds a triangle of these vertices (positions and normals).
    fn add(&mut self, triangle: [u32; 3], corners: [[[f32; 3]; 2]; 3]) -> Result<(), TryReserveError> {
        let Self { mesh, names } = self;
        mesh.indices.try_reserve(3)?;
        names.try_reserve(3)?;
        mesh.positions.try_reserve(3)?;
        mesh.normals.try_reserve(3)?;
        for (index, [position, normal]) in triangle.into_iter().zip(corners) {
            let name = *names.entry(index).or_insert_with(|| {
                mesh.positions.push(position);
                mesh.normals.push(normal);
                mesh.positions.len() as u32 - 1
            });
            mesh.indices.push(name);
        }
        Ok(())
    }
}
