//! [`NeighbourhoodView`]: a chunk and its 26 neighbours; [`Neighbourhood`]: a snapshot of them; [`Block`]: the samples
//! that the chunk's mesh is made from.

use alloc::vec;
use alloc::vec::Vec;
use core::array;

use super::border::{Border, larger, layer_indices};
use super::{DEFAULT_CHUNK_CELLS, GridChunk, MAX_CHUNK_CELLS};
use crate::buffer::MeshBuffer;
use crate::lattice::{Samples, Shape};
use crate::mesher::{MeshError, MeshSettings, Mesher};
use crate::sample::{Voxel, Weight};

/// A snapshot of a chunk and its 26 neighbours: all that its mesh depends on. Later edits do not affect it, and it may
/// be sent to another thread.
#[derive(Clone, Debug)]
pub struct Neighbourhood<W = i16> {
    /// x fastest, the chunk itself in the middle; `None` where a chunk is absent or beyond the bounds.
    pub(super) chunks: [Option<GridChunk<W>>; 27],
    /// Bit `i` is set if position `i` of `chunks` lies beyond the bounds. An absent chunk within the bounds is air.
    pub(super) beyond: u32,
    pub(super) cells: u32,
    /// The middle chunk's lowest lattice point.
    pub(super) origin: [i64; 3],
    /// The border of a bounded grid.
    pub(super) border: Option<Border>,
}

/// The index of the chunk itself in a neighbourhood's `chunks`.
const CENTRE: usize = 13;

impl<W: Weight> Neighbourhood<W> {
    /// A borrowed view of this neighbourhood.
    pub fn view(&self) -> NeighbourhoodView<'_, W> {
        let Self { ref chunks, beyond, cells, origin, border } = *self;
        NeighbourhoodView { chunks: chunks.each_ref().map(Option::as_ref), beyond, cells, origin, border }
    }

    /// Calls [`NeighbourhoodView::is_uniform`].
    pub fn is_uniform(&self) -> bool {
        self.view().is_uniform()
    }

    /// Calls [`NeighbourhoodView::block`].
    pub fn block(&self, isovalue: f32, out: &mut Block<W>) {
        self.view().block(isovalue, out);
    }

    /// Calls [`NeighbourhoodView::mesh`].
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
        self.view().mesh(mesher, block, settings, out)
    }
}

/// A chunk and its 26 neighbours, borrowed from their [`Grid`](super::Grid): all that its mesh depends on.
#[derive(Clone, Copy, Debug)]
pub struct NeighbourhoodView<'a, W = i16> {
    /// This field and the next ones are as in [`Neighbourhood`].
    pub(super) chunks: [Option<&'a GridChunk<W>>; 27],
    pub(super) beyond: u32,
    pub(super) cells: u32,
    pub(super) origin: [i64; 3],
    pub(super) border: Option<Border>,
}

impl<'a, W: Weight> NeighbourhoodView<'a, W> {
    /// The 27 chunks, x fastest, the chunk itself in the middle; `None` where a chunk is absent or beyond the bounds.
    pub const fn chunks(&self) -> &[Option<&'a GridChunk<W>>; 27] {
        &self.chunks
    }

    /// A snapshot of the chunks, which later edits do not affect.
    pub fn to_neighbourhood(&self) -> Neighbourhood<W> {
        let Self { chunks, beyond, cells, origin, border } = *self;
        Neighbourhood { chunks: chunks.map(Option::<&_>::cloned), beyond, cells, origin, border }
    }

    /// True if the chunk is certain to have no surface, without a look at single samples: it lies beyond the bounds, or
    /// all 27 chunks are uniform and of one weight. An absent chunk counts as uniform, of weight [`Weight::OUTSIDE`].
    pub fn is_uniform(&self) -> bool {
        let weight = |chunk: Option<&GridChunk<W>>| match chunk {
            Some(GridChunk::Uniform(voxel)) => Some(voxel.weight),
            Some(GridChunk::Samples(_)) => None,
            None => Some(W::OUTSIDE),
        };
        let first = weight(self.chunks[CENTRE]);
        self.is_beyond(CENTRE) || first.is_some() && self.chunks.iter().all(|chunk| weight(*chunk) == first)
    }

    const fn is_beyond(&self, index: usize) -> bool {
        self.beyond >> index & 1 == 1
    }

    /// Gathers the samples that the chunk's mesh at `isovalue` is made from: the chunk's own, one layer below and two
    /// above. At the border of a bounded grid, they are intersected with the border's box. Allocates nothing once `out`
    /// has held a block of this size.
    pub fn block(&self, isovalue: f32, out: &mut Block<W>) {
        let n = self.cells as usize;
        out.resize(self.cells);
        // The spans of the three neighbours along an axis.
        let spans =
            [Span { to: 0, from: n - 1, len: 1 }, Span { to: 1, from: 0, len: n }, Span { to: n + 1, from: 0, len: 2 }];
        // Every row is read from three chunks at once, since most of the time is spent waiting for memory.
        for (line, chunks) in self.chunks.as_chunks::<3>().0.iter().enumerate() {
            let [y, z] = [spans[line % 3], spans[line / 3]];
            let uniform =
                chunks.map(|chunk| if let Some(GridChunk::Uniform(voxel)) = chunk { *voxel } else { Voxel::AIR });
            let weights = uniform.map(|voxel| [voxel.weight; MAX_CHUNK_CELLS as usize]);
            let materials = uniform.map(|voxel| [voxel.material; MAX_CHUNK_CELLS as usize]);
            let samples =
                chunks.map(|chunk| if let Some(GridChunk::Samples(samples)) = chunk { Some(samples) } else { None });
            let weights = array::from_fn(|i| samples[i].map_or(&weights[i][..], |samples| &samples.weights));
            let materials = array::from_fn(|i| samples[i].map_or(&materials[i][..], |samples| &samples.materials));
            let strides = samples.map(|samples| usize::from(samples.is_some()));
            for k in 0..z.len {
                for j in 0..y.len {
                    let to = (n + 3) * (y.to + j + (n + 3) * (z.to + k));
                    let from = strides.map(|stride| stride * n * (y.from + j + n * (z.from + k)));
                    join(&mut out.weights[to..][..n + 3], weights, from);
                    join(&mut out.materials[to..][..n + 3], materials, from);
                }
            }
        }
        for index in (0..27).filter(|index| self.is_beyond(*index)) {
            let spans = [spans[index % 3], spans[index / 3 % 3], spans[index / 9]];
            out.rows(spans, |[x, y, z], weights, materials| {
                for (i, (weight, material)) in weights.iter_mut().zip(materials).enumerate() {
                    let voxel = self.beyond([x + i, y, z], isovalue);
                    (*weight, *material) = (voxel.weight, voxel.material);
                }
            });
        }
        // The blocks of inner chunks do not reach the samples that are clipped.
        if let Some(border) = &self.border
            && self.beyond != 0
        {
            out.clip(border, self.origin.map(|v| v - 1), isovalue);
        }
    }

    /// Meshes the chunk. Vertex positions are in cells from its lowest lattice point. `block` is scratch memory. In a
    /// uniform neighbourhood, `out` is empty and `block` is not touched.
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
        self.block(settings.isovalue, block);
        mesher.mesh(block.samples(), settings, out)
    }

    /// The voxel at a point of the block that lies beyond the bounds.
    fn beyond(&self, point: [usize; 3], isovalue: f32) -> Voxel<W> {
        match &self.border {
            Some(border) => {
                border.beyond(core::array::from_fn(|axis| self.origin[axis] - 1 + point[axis] as i64), isovalue)
            }
            None => Voxel::AIR,
        }
    }
}

/// The samples of one chunk and of the padding around it, `n + 3` per axis. The caller keeps and reuses a block.
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

    /// The samples, marked as [padded](Samples::padded).
    pub fn samples(&self) -> Samples<'_, W> {
        Samples::new(self.shape, &self.weights)
            .and_then(|samples| samples.with_materials(&self.materials))
            .expect("a block's samples fill its shape")
            .padded()
    }

    /// Intersects the samples with a border. `origin`: the block's lowest lattice point.
    fn clip(&mut self, border: &Border, origin: [i64; 3], isovalue: f32) {
        let size = self.shape.size()[0] as usize;
        for (axis, layer, least) in border.layers::<W>(origin, size, isovalue) {
            for index in layer_indices(axis, layer, size) {
                self.weights[index] = larger(self.weights[index], least);
            }
        }
    }

    /// Resizes the block for a chunk of `cells` cells per axis.
    fn resize(&mut self, cells: u32) {
        self.shape = Shape::cube(cells + 3).expect("a chunk's cells are few");
        self.weights.resize(self.shape.len(), W::OUTSIDE);
        self.materials.resize(self.shape.len(), 0);
    }

    /// Calls `change` with every row of a box: the position of the row's first sample in the block, its weights and its
    /// materials.
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

/// The part of one axis of a block that one chunk fills.
#[derive(Clone, Copy)]
struct Span {
    /// The first index in the block.
    to: usize,
    /// The first index in the chunk.
    from: usize,
    /// The number of samples.
    len: usize,
}

/// Joins a row of three chunks: the last sample of the first, all of the second, the first two of the third.
fn join<T: Copy>(row: &mut [T], [before, own, after]: [&[T]; 3], from: [usize; 3]) {
    let n = row.len() - 3;
    row[0] = before[from[0] + n - 1];
    let own = &own[from[1]..][..n];
    match own.as_array::<{ DEFAULT_CHUNK_CELLS as usize }>() {
        // A length that the compiler knows needs no call to `memcpy`.
        Some(own) => *row[1..].first_chunk_mut().expect("three longer") = *own,
        None => row[1..=n].copy_from_slice(own),
    }
    row[n + 1] = after[from[2]];
    row[n + 2] = after[from[2] + 1];
}
