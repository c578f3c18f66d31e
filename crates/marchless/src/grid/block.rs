//! [`NeighbourhoodView`]: a chunk and its 26 neighbours; [`Neighbourhood`]: a snapshot of them; [`Block`]: the samples
//! that the chunk's mesh is made from.

use alloc::vec;
use alloc::vec::Vec;
use core::array;

use super::border::{Border, larger, layer_indices};
use super::{DEFAULT_CHUNK_CELLS, GridChunk, MAX_CHUNK_CELLS};
use crate::buffer::MeshBuffer;
use crate::lattice::{Samples, Shape};
use crate::mesher::{DualSettings, MeshError, MeshMethod, Mesher};
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

    /// Calls [`NeighbourhoodView::dual_block`].
    ///
    /// # Errors
    /// As [`MeshMethod::check`]; `out` is then unchanged.
    pub fn dual_block(&self, settings: &DualSettings, out: &mut Block<W>) -> Result<(), MeshError> {
        self.view().dual_block(settings, out)
    }

    /// Calls [`NeighbourhoodView::mesh`].
    ///
    /// # Errors
    /// As [`NeighbourhoodView::mesh`]; `out` is then empty.
    pub fn mesh(
        &self,
        mesher: &mut Mesher,
        block: &mut Block<W>,
        method: impl Into<MeshMethod>,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        self.view().mesh(mesher, block, method, out)
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

    /// Gathers the samples that the chunk's primal mesh at `isovalue` is made from: the chunk's own, one layer below
    /// and two above. At the border of a bounded grid, they are intersected with the border's box. Allocates nothing
    /// once `out` has held a block of this size.
    pub fn block(&self, isovalue: f32, out: &mut Block<W>) {
        // Margins that the compiler knows let it copy without calls.
        self.gather([1, 2], isovalue, out);
    }

    /// Gathers the samples that the chunk's dual mesh is made from: the chunk's own, and [`DualSettings::padding`] layers
    /// around them. Otherwise as [`block`](Self::block).
    ///
    /// # Errors
    /// As [`MeshMethod::check`]; `out` is then unchanged.
    pub fn dual_block(&self, settings: &DualSettings, out: &mut Block<W>) -> Result<(), MeshError> {
        let method = MeshMethod::from(settings);
        method.check(self.cells)?;
        self.gather(method.margins().map(|layers| layers as usize), settings.isovalue, out);
        Ok(())
    }

    /// Gathers the chunk's samples and those around it: `low` layers below and `high` above, at most as many as a chunk
    /// has.
    #[inline(always)]
    fn gather(&self, [low, high]: [usize; 2], isovalue: f32, out: &mut Block<W>) {
        let n = self.cells as usize;
        let size = low + n + high;
        out.resize(size);
        // The spans of the three neighbours along an axis.
        let spans = [
            Span { to: 0, from: n - low, len: low },
            Span { to: low, from: 0, len: n },
            Span { to: low + n, from: 0, len: high },
        ];
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
                    let to = size * (y.to + j + size * (z.to + k));
                    let from = strides.map(|stride| stride * n * (y.from + j + n * (z.from + k)));
                    join(&mut out.weights[to..][..size], weights, from, [low, high]);
                    join(&mut out.materials[to..][..size], materials, from, [low, high]);
                }
            }
        }
        let origin = self.origin.map(|v| v - low as i64);
        for index in (0..27).filter(|index| self.is_beyond(*index)) {
            let spans = [spans[index % 3], spans[index / 3 % 3], spans[index / 9]];
            out.rows(spans, |[x, y, z], weights, materials| {
                for (i, (weight, material)) in weights.iter_mut().zip(materials).enumerate() {
                    let voxel = self.beyond(origin, [x + i, y, z], isovalue);
                    (*weight, *material) = (voxel.weight, voxel.material);
                }
            });
        }
        if let Some(border) = &self.border {
            out.clip(border, origin, isovalue);
        }
    }

    /// Meshes the chunk with the primal or the dual mesher. Vertex positions are in cells from its lowest lattice
    /// point: 0 to the number of cells with the primal mesher, and from −1 on with the dual one. `block` is scratch
    /// memory. In a uniform neighbourhood, `out` is empty and `block` is not touched.
    ///
    /// # Errors
    /// As [`MeshMethod::check`], [`Mesher::mesh`] and [`Mesher::mesh_dual`]; `out` is then empty.
    pub fn mesh(
        &self,
        mesher: &mut Mesher,
        block: &mut Block<W>,
        method: impl Into<MeshMethod>,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        let method = method.into();
        out.clear();
        method.check(self.cells)?;
        if self.is_uniform() {
            return Ok(());
        }
        match method {
            MeshMethod::Primal(settings) => {
                self.block(settings.isovalue, block);
                mesher.mesh(block.samples(), &settings, out)
            }
            MeshMethod::Dual(settings) => {
                self.dual_block(&settings, block)?;
                mesher.mesh_dual(block.samples(), &settings, out)
            }
        }
    }

    /// The voxel at a point beyond the bounds. `origin`: the block's lowest lattice point, from which `point` counts.
    fn beyond(&self, origin: [i64; 3], point: [usize; 3], isovalue: f32) -> Voxel<W> {
        match &self.border {
            Some(border) => border.beyond(array::from_fn(|axis| origin[axis] + point[axis] as i64), isovalue),
            None => Voxel::AIR,
        }
    }
}

/// The samples of one chunk and of the padding around it: `n + 3` per axis for the primal mesher, and
/// `n + 2·padding` for the dual one ([`DualSettings::padding`]). The caller keeps and reuses a block.
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

    /// Resizes the block to `size` samples per axis.
    fn resize(&mut self, size: usize) {
        self.shape = Shape::cube(size as u32).expect("a chunk's samples are few");
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

/// Joins a row of three chunks: the last `low` samples of the first, all of the second, the first `high` of the third.
#[inline(always)]
fn join<T: Copy>(row: &mut [T], [before, own, after]: [&[T]; 3], from: [usize; 3], [low, high]: [usize; 2]) {
    let n = row.len() - low - high;
    row[..low].copy_from_slice(&before[from[0] + n - low..][..low]);
    let own = &own[from[1]..][..n];
    match own.as_array::<{ DEFAULT_CHUNK_CELLS as usize }>() {
        // A length that the compiler knows needs no call to `memcpy`.
        Some(own) => *row[low..].first_chunk_mut().expect("longer by the margins") = *own,
        None => row[low..][..n].copy_from_slice(own),
    }
    row[low + n..].copy_from_slice(&after[from[2]..][..high]);
}
