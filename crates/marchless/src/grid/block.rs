//! [`Neighbourhood`]: a snapshot of a chunk and its 26 neighbours; [`Block`]: the samples its mesh is made from.

use alloc::vec;
use alloc::vec::Vec;

use super::Chunk;
use super::border::{Border, larger, layer_indices};
use crate::buffer::MeshBuffer;
use crate::lattice::{Samples, Shape};
use crate::mesher::{MeshError, MeshSettings, Mesher};
use crate::sample::{Voxel, Weight};

/// A chunk and its 26 neighbours as they are now: all that its mesh depends on, unaffected by later edits, to be
/// sent to another thread.
#[derive(Clone, Debug)]
pub struct Neighbourhood<W = i16> {
    /// x fastest, the chunk itself in the middle; `None` beyond the bounds.
    pub(super) chunks: [Option<Chunk<W>>; 27],
    pub(super) cells: u32,
    /// The middle chunk's lowest lattice point.
    pub(super) origin: [i64; 3],
    /// Of a bounded grid.
    pub(super) border: Option<Border>,
}

/// The index of the middle one of 27.
const CENTRE: usize = 13;

impl<W: Weight> Neighbourhood<W> {
    /// Whether it is certain, without looking at single samples, that the chunk has no surface: it lies beyond the
    /// bounds, or all that its mesh reads is one weight (at the border of a bounded grid, the one farthest outside).
    pub fn is_uniform(&self) -> bool {
        let Some(Chunk::Uniform(first)) = &self.chunks[CENTRE] else {
            return self.chunks[CENTRE].is_none();
        };
        self.chunks.iter().all(|chunk| match chunk {
            Some(Chunk::Uniform(voxel)) => voxel.weight == first.weight,
            Some(Chunk::Samples(_)) => false,
            None => first.weight == W::OUTSIDE,
        })
    }

    /// Gathers the samples that the chunk's mesh is made from: its own, one layer below and two above.
    /// Allocates nothing once `out` has held a block of this size.
    pub fn block(&self, out: &mut Block<W>) {
        let n = self.cells as usize;
        out.resize(self.cells);
        // Where each of three neighbours along an axis lies in the block, from which of its samples on, and how many.
        let spans =
            [Span { to: 0, from: n - 1, len: 1 }, Span { to: 1, from: 0, len: n }, Span { to: n + 1, from: 0, len: 2 }];
        for (index, chunk) in self.chunks.iter().enumerate() {
            let spans = [spans[index % 3], spans[index / 3 % 3], spans[index / 9]];
            match chunk {
                Some(Chunk::Samples(samples)) => {
                    copy(&mut out.weights, &samples.weights, n, spans);
                    copy(&mut out.materials, &samples.materials, n, spans);
                }
                Some(Chunk::Uniform(voxel)) => out.rows(spans, |_, weights, materials| {
                    weights.fill(voxel.weight);
                    materials.fill(voxel.material);
                }),
                None => out.rows(spans, |[x, y, z], weights, materials| {
                    for (i, (weight, material)) in weights.iter_mut().zip(materials).enumerate() {
                        let voxel = self.beyond([x + i, y, z]);
                        (*weight, *material) = (voxel.weight, voxel.material);
                    }
                }),
            }
        }
    }

    /// Meshes the chunk: positions are in cells from its lowest lattice point. `block` is scratch; in a uniform
    /// neighbourhood it is left as it is, and `out` empty.
    ///
    /// # Errors
    /// As [`Mesher::mesh`]; `out` is then empty.
    pub fn mesh(
        &self,
        mesher: &mut Mesher,
        block: &mut Block<W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        if self.is_uniform() && settings.isovalue.is_finite() {
            out.clear();
            return Ok(());
        }
        self.block(block);
        if let Some(border) = self.border.and_then(|border| border.raised(settings.isovalue)) {
            block.clip(&border, self.origin.map(|v| v - 1));
        }
        mesher.mesh(block.samples(), settings, out)
    }

    /// The voxel at a point of the block that lies beyond the bounds.
    fn beyond(&self, point: [usize; 3]) -> Voxel<W> {
        match &self.border {
            Some(border) => border.beyond(core::array::from_fn(|axis| self.origin[axis] - 1 + point[axis] as i64)),
            None => Voxel::AIR,
        }
    }
}

/// The samples of one chunk and of the padding around it, `n + 3` per axis; kept by the caller and reused.
#[derive(Clone, Debug)]
pub struct Block<W = i16> {
    shape: Shape,
    weights: Vec<W>,
    materials: Vec<u8>,
}

impl<W: Weight> Block<W> {
    /// A block of a single sample of air, until [`Neighbourhood::block`] fills it.
    pub fn new() -> Self {
        let shape = Shape::cube(1).expect("one sample is a shape");
        Self { shape, weights: vec![W::OUTSIDE], materials: vec![0] }
    }

    /// The samples, padded.
    pub fn samples(&self) -> Samples<'_, W> {
        Samples::new(self.shape, &self.weights)
            .and_then(|samples| samples.with_materials(&self.materials))
            .expect("a block's samples fill its shape")
            .padded()
    }

    /// Intersects the samples with a border. `origin`: the block's lowest lattice point.
    fn clip(&mut self, border: &Border, origin: [i64; 3]) {
        let size = self.shape.size()[0] as usize;
        for (axis, layer, least) in border.layers::<W>(origin, size) {
            for index in layer_indices(axis, layer, size) {
                self.weights[index] = larger(self.weights[index], least);
            }
        }
    }

    /// Makes room for a chunk of `cells` cells per axis.
    fn resize(&mut self, cells: u32) {
        self.shape = Shape::cube(cells + 3).expect("a chunk's cells are few");
        self.weights.resize(self.shape.len(), W::OUTSIDE);
        self.materials.resize(self.shape.len(), 0);
    }

    /// Calls `change` with every row of a box: the position of its first sample in the block, weights, materials.
    fn rows(&mut self, [x, y, z]: [Span; 3], mut change: impl FnMut([usize; 3], &mut [W], &mut [u8])) {
        let [_, along_y, along_z] = self.shape.strides();
        for k in z.to..z.to + z.len {
            for j in y.to..y.to + y.len {
                let start = x.to + along_y * j + along_z * k;
                let row = start..start + x.len;
                change([x.to, j, k], &mut self.weights[row.clone()], &mut self.materials[row]);
            }
        }
    }
}

impl<W: Weight> Default for Block<W> {
    fn default() -> Self {
        Self::new()
    }
}

/// `len` samples in a row, from one place to another.
#[derive(Clone, Copy)]
struct Span {
    to: usize,
    from: usize,
    len: usize,
}

/// Copies a box out of the cube `source` of `n` samples per axis into the cube `target` of `n + 3` samples per axis.
fn copy<T: Copy>(target: &mut [T], source: &[T], n: usize, [x, y, z]: [Span; 3]) {
    for k in 0..z.len {
        for j in 0..y.len {
            let to = x.to + (n + 3) * (y.to + j + (n + 3) * (z.to + k));
            let from = x.from + n * (y.from + j + n * (z.from + k));
            // Calling out to copy one or two samples, as most rows are, would cost more than all the long rows.
            match x.len {
                1 => target[to] = source[from],
                2 => (target[to], target[to + 1]) = (source[from], source[from + 1]),
                len => target[to..to + len].copy_from_slice(&source[from..from + len]),
            }
        }
    }
}
