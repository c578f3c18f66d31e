//! [`Split`]: splits the mesh of the whole volume, piece by piece, into one mesh per chunk.
//!
//! Nothing is meshed or computed twice: each triangle goes to the chunk of its cell, with its vertices unchanged. So
//! neighbours agree on their border to the last bit, and all chunks together have the triangles of the whole mesh.
//! (Refused: meshing each chunk from its own samples. Positions would be rounded differently than in the whole mesh,
//! and chunks would need a layer of padding that the volume's border does not have.)

use std::collections::{HashMap, TryReserveError};
use std::num::NonZeroU32;

use marchless::MeshBuffer;

use crate::error::Error;
use crate::input::Volume;
use crate::recent::Recent;

/// The most chunks that are accepted.
const MOST: u64 = 1_000_000;

/// The division of cells into chunks. Cells and chunks are counted along the axes of the file, the fastest first.
///
/// Cells of a margin around the volume belong to the chunks next to them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunks {
    /// Cells of the volume per axis; at least 1.
    cells: [u32; 3],
    /// The most cells of a chunk per axis.
    size: u32,
    /// Layers of samples around the volume.
    margin: u32,
    /// The number of chunks; at most [`MOST`].
    pub(crate) count: u64,
    /// The difference between the numbers of neighbours along each axis. Numbers run x fastest in any order of the
    /// file.
    strides: [u64; 3],
}

impl Chunks {
    /// # Errors
    /// [`Error::TooManyChunks`].
    pub(crate) fn new(size: NonZeroU32, margin: u32, volume: &Volume) -> Result<Self, Error> {
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
        Ok(Self { cells, size, margin, count: chunks as u64, strides })
    }

    /// The number of the chunk at this position, counted from 0.
    fn number(&self, chunk: [u32; 3]) -> u64 {
        (0..3).map(|axis| u64::from(chunk[axis]) * self.strides[axis]).sum()
    }

    /// The chunk along `axis` that has the mesher's cell `cell`.
    fn at(&self, axis: usize, cell: u32) -> u32 {
        cell.saturating_sub(self.margin).min(self.cells[axis] - 1) / self.size
    }

    /// The mesher's cells along `axis`.
    fn with_margin(&self, axis: usize) -> u32 {
        self.cells[axis] + 2 * self.margin
    }

    /// A chunk's first and last samples, which it shares with its neighbours, as the mesher counts them.
    fn samples(&self, chunk: [u32; 3]) -> [[u32; 3]; 2] {
        let first = [0, 1, 2].map(|axis| if chunk[axis] == 0 { 0 } else { chunk[axis] * self.size + self.margin });
        let last = [0, 1, 2].map(|axis| {
            let last = u64::from(chunk[axis] + 1) * u64::from(self.size);
            if last < u64::from(self.cells[axis]) { last as u32 + self.margin } else { self.with_margin(axis) }
        });
        [first, last]
    }
}

/// Splits the whole mesh while it is made. Holds the meshes of one layer of chunks.
pub(crate) struct Split {
    chunks: Chunks,
    recent: Recent<Vertex>,
    /// The current layer: the mesh of each chunk that has one, with the file's fastest axis first.
    layer: Vec<Option<Box<MeshBuffer>>>,
    /// The indices that vertices on borders have in chunks other than the [last](Vertex::last), by chunk and index in
    /// the whole mesh.
    names: HashMap<(u64, u32), u32>,
}

/// A vertex of the whole mesh.
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    /// The chunk of the latest triangle that uses it, and its index in that chunk's mesh.
    last: Option<(u64, u32)>,
}

/// A complete chunk that has a surface.
pub(crate) struct GridChunk {
    pub(crate) number: u64,
    /// Its first and last samples, as the mesher counts them.
    pub(crate) samples: [[u32; 3]; 2],
    /// Its part of the whole mesh, in grid units from the mesher's first sample.
    pub(crate) mesh: MeshBuffer,
}

impl Split {
    pub(crate) fn new(chunks: Chunks) -> Self {
        Self { chunks, recent: Recent::new(), layer: Vec::new(), names: HashMap::new() }
    }

    /// Adds the mesher's output for slab `slab`: the vertices on it and below it, and the triangles between it and the
    /// slab before. Returns the chunks that it completes.
    ///
    /// # Errors
    /// [`Error::MeshMemory`].
    pub(crate) fn take(&mut self, slab: u32, piece: &MeshBuffer) -> Result<Vec<GridChunk>, Error> {
        let vertices = piece.positions.iter().zip(&piece.normals);
        let vertices = vertices.map(|(&position, &normal)| Vertex { position, normal, last: None });
        self.recent.extend(vertices).map_err(|_| Error::MeshMemory)?;
        let Some(z) = slab.checked_sub(1) else { return Ok(Vec::new()) };
        let layer = self.chunks.at(2, z);

        let size = self.chunks.size;
        let [width, depth, _] = self.chunks.cells.map(|cells| cells.div_ceil(size) as usize);
        self.layer.resize_with(width * depth, || None);
        for triangle in piece.triangles() {
            let corners = triangle.map(|index| self.recent.get(index).map(|vertex| vertex.position));
            let [Some(a), Some(b), Some(c)] = corners else { return Err(Error::VertexMissing) };
            // No triangle lies within a face of its cell. (Beyond 16,384 samples, rounding can bring one there; then
            // it counts to the far side, if there is any.)
            let [x, y] = [0, 1].map(|axis| self.chunks.at(axis, a[axis].min(b[axis]).min(c[axis]) as u32));
            let number = self.chunks.number([x, y, layer]);
            let slot = self.layer.get_mut(x as usize + width * y as usize).ok_or(Error::VertexMissing)?;
            let mesh = slot.get_or_insert_default();
            mesh.indices.try_reserve(3).map_err(|_| Error::MeshMemory)?;
            for index in triangle {
                let vertex = self.recent.get_mut(index).ok_or(Error::VertexMissing)?;
                let name = vertex.name(index, number, mesh, &mut self.names).map_err(|_| Error::MeshMemory)?;
                mesh.indices.push(name);
            }
        }
        if slab < self.chunks.with_margin(2) && self.chunks.at(2, slab) == layer {
            return Ok(Vec::new());
        }
        self.names.clear();
        let parts = self.layer.drain(..).enumerate().filter_map(|(place, mesh)| {
            let chunk = [(place % width) as u32, (place / width) as u32, layer];
            let (number, samples) = (self.chunks.number(chunk), self.chunks.samples(chunk));
            Some(GridChunk { number, samples, mesh: *mesh? })
        });
        Ok(parts.collect())
    }
}

impl Vertex {
    /// The index of a vertex in the mesh of chunk `chunk`; adds the vertex if it is new there. `index` is its index in
    /// the whole mesh.
    fn name(
        &mut self,
        index: u32,
        chunk: u64,
        mesh: &mut MeshBuffer,
        names: &mut HashMap<(u64, u32), u32>,
    ) -> Result<u32, TryReserveError> {
        if let Some((last, name)) = self.last {
            if last == chunk {
                return Ok(name);
            }
            names.try_reserve(1)?;
            names.insert((last, index), name);
        }
        let name = match names.get(&(chunk, index)) {
            Some(&name) => name,
            None => {
                mesh.positions.try_reserve(1)?;
                mesh.normals.try_reserve(1)?;
                mesh.positions.push(self.position);
                mesh.normals.push(self.normal);
                mesh.positions.len() as u32 - 1
            }
        };
        self.last = Some((chunk, name));
        Ok(name)
    }
}
