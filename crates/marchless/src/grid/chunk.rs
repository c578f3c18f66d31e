//! [`GridChunk`]: the samples of one chunk. They are shared and copied on write, or one voxel stands for all.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::{GridError, MAX_CHUNK_CELLS, MIN_CHUNK_CELLS, SamplePool};
use crate::sample::{Voxel, Weight};
use crate::source::{BOUND_MARGIN, Bound, Source, SourceRegion};

/// Chunks per axis of the boxes that a [`Source`] bounds as a whole; see [`GridChunk::from_source`].
pub const BOUND_BOX_CHUNKS: i32 = 4;

/// The samples of one chunk. Cloning is cheap, and the clone is unaffected by later edits.
#[derive(Clone, Debug, PartialEq)]
pub enum GridChunk<W = i16> {
    /// All samples equal this voxel.
    Uniform(Voxel<W>),
    /// One sample per lattice point.
    Samples(Arc<GridSamples<W>>),
}

/// The samples of a [`GridChunk`], `[n·n·n]` each, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSamples<W = i16> {
    /// Signed distances.
    pub weights: Vec<W>,
    /// Materials.
    pub materials: Vec<u8>,
}

impl<W: Weight> GridChunk<W> {
    /// A uniform chunk of air.
    pub const AIR: Self = Self::Uniform(Voxel::AIR);

    /// The base samples of the chunk at chunk position `position`: those of `source`, without edits. Runs on any
    /// thread.
    ///
    /// The first of these steps that gives an answer decides:
    /// 1. [`Source::bound`] of the [box](Self::bound_box) of [`BOUND_BOX_CHUNKS`]³ chunks that holds the chunk, grown
    ///    by 4 points: [`GridChunk::box_without_sampling`];
    /// 2. [`Source::bound`] of the chunk, grown by 4 points: [`GridChunk::without_sampling_in`];
    /// 3. [`Source::bound_closely`] of the chunk;
    /// 4. [`Source::fill`].
    ///
    /// A bound makes the chunk uniform, so two legal bounds of one region may give different samples. The fixed order
    /// makes the result depend on the arguments alone, not on which steps a caller takes on its own, or when. The
    /// samples that a bound replaces are too far from the surface to affect it, for isovalues within ±3 voxels.
    ///
    /// `cells`: 8 to 62 per axis, clamped. `spacing`: world units per voxel. A position whose lattice points do not fit
    /// in `i32` gives the nearest chunk that does; no grid accepts such a position.
    pub fn from_source(source: &(impl Source + ?Sized), position: [i32; 3], cells: u32, spacing: f64) -> Self {
        Self::from_source_counted(source, position, cells, spacing).0
    }

    /// The result of [`GridChunk::from_source`], and true if step 4 sampled the source. Takes the same arguments.
    pub fn from_source_counted(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> (Self, bool) {
        match Self::without_sampling(source, position, cells, spacing) {
            Some(chunk) => (chunk, false),
            None => Self::from_uncertain_source(source, position, cells, spacing),
        }
    }

    /// Steps 3 and 4 of [`GridChunk::from_source`], for a caller to whom [`GridChunk::without_sampling`] gave `None`.
    /// Returns the chunk, and true if step 4 sampled the source. Takes the same arguments as `from_source`.
    pub fn from_uncertain_source(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> (Self, bool) {
        let region = source_region(position, 1, cells, spacing);
        match Self::from_bound(source.bound_closely(&region)) {
            Some(chunk) => (chunk, false),
            None => (Self::sampled(source, &region), true),
        }
    }

    /// Steps 1 and 2 of [`GridChunk::from_source`]: its result if [`Source::bound`] decides it, `None` if steps 3 and 4
    /// must follow. Calls `bound` twice at most. Takes the same arguments as `from_source`.
    pub fn without_sampling(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        let corner = Self::bound_box(position).map(|v| v * BOUND_BOX_CHUNKS); // fits: no farther from 0 than `i32::MIN`
        let of_box = Self::box_without_sampling(source, corner, BOUND_BOX_CHUNKS as u32, cells, spacing);
        Self::without_sampling_in(of_box, source, position, cells, spacing)
    }

    /// The result of [`GridChunk::without_sampling`], for callers that cache step 1. `of_box`: the result of
    /// [`GridChunk::box_without_sampling`] for the [box](Self::bound_box) of `position`, with the same source, cells
    /// and spacing. Calls [`Source::bound`] once at most.
    ///
    /// ```
    /// use marchless::{BOUND_BOX_CHUNKS, GridChunk};
    ///
    /// let source = |[_, y, _]: [f64; 3]| y - 7.5;
    /// let position = [5, -1, 3];
    /// let corner = GridChunk::<i16>::bound_box(position).map(|v| v * BOUND_BOX_CHUNKS);
    /// assert_eq!(corner, [4, -4, 0]);
    /// let of_box = GridChunk::<i16>::box_without_sampling(&source, corner, BOUND_BOX_CHUNKS as u32, 16, 1.0);
    /// let chunk = GridChunk::without_sampling_in(of_box, &source, position, 16, 1.0);
    /// assert_eq!(chunk, GridChunk::without_sampling(&source, position, 16, 1.0));
    /// ```
    pub fn without_sampling_in(
        of_box: Option<Self>,
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        of_box.or_else(|| Self::box_without_sampling(source, position, 1, cells, spacing))
    }

    /// The uniform chunk that every chunk of a box equals, if [`Source::bound`] is certain of the box grown by 4
    /// points.
    ///
    /// `position`: the lowest chunk. `chunks`: chunks per axis. The other arguments are those of
    /// [`GridChunk::from_source`]. The result equals that of `from_source` for certain only if the box is a whole box
    /// of [`BOUND_BOX_CHUNKS`]³ chunks, aligned as in [`GridChunk::bound_box`]. For other boxes, the two may differ far
    /// from the surface.
    pub fn box_without_sampling(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        chunks: u32,
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        Self::from_bound(source.bound(&source_region(position, chunks, cells, spacing).grown(BOUND_MARGIN)))
    }

    /// The position, in boxes, of the box of [`BOUND_BOX_CHUNKS`]³ chunks that holds the chunk at `position`. The
    /// lowest chunk of a box is this position times `BOUND_BOX_CHUNKS`.
    pub fn bound_box(position: [i32; 3]) -> [i32; 3] {
        position.map(|v| v.div_euclid(BOUND_BOX_CHUNKS))
    }

    /// Steps 1 to 3 of [`GridChunk::from_source`]: its result if a bound decides it. Takes the same arguments.
    pub(crate) fn from_bounds(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        Self::without_sampling(source, position, cells, spacing)
            .or_else(|| Self::from_bound(source.bound_closely(&source_region(position, 1, cells, spacing))))
    }

    fn from_bound(bound: Bound) -> Option<Self> {
        match bound {
            Bound::Inside { material } => Some(Self::Uniform(Voxel::new(W::INSIDE, material))),
            Bound::Outside => Some(Self::AIR),
            Bound::Mixed => None,
        }
    }

    fn sampled(source: &(impl Source + ?Sized), region: &SourceRegion) -> Self {
        let mut distances = vec![0.0; region.len()];
        let mut materials = vec![0; region.len()];
        source.fill(region, &mut distances, &mut materials);
        Self::collapsed(distances.into_iter().map(W::from_voxels).collect(), materials)
    }

    /// A chunk of `cells` cells per axis made of these samples. It is uniform if they are all equal.
    ///
    /// `weights` and `materials`: `[n·n·n]` each, x fastest. `cells`: 8 to 62.
    ///
    /// # Errors
    /// [`GridError::ChunkCells`] and [`GridError::SamplesLength`].
    pub fn from_samples(weights: Vec<W>, materials: Vec<u8>, cells: u32) -> Result<Self, GridError> {
        super::check_cells(cells)?;
        check_lengths(&weights, &materials, cells)?;
        Ok(Self::collapsed(weights, materials))
    }

    /// The sample at index `x + n·(y + n·z)`; air beyond the last one.
    pub fn voxel(&self, index: usize) -> Voxel<W> {
        match self {
            Self::Uniform(voxel) => *voxel,
            Self::Samples(samples) => match (samples.weights.get(index), samples.materials.get(index)) {
                (Some(&weight), Some(&material)) => Voxel { weight, material },
                _ => Voxel::AIR,
            },
        }
    }

    /// The samples, to be edited. A uniform chunk is first written out, and shared samples are copied.
    pub(crate) fn samples_mut(&mut self, cells: u32, pool: &mut SamplePool<W>) -> &mut GridSamples<W> {
        if let Self::Uniform(voxel) = *self {
            *self = Self::Samples(pool.filled(voxel, (cells as usize).pow(3)));
        }
        match self {
            Self::Samples(samples) => pool.make_mut(samples),
            Self::Uniform(_) => unreachable!("written out above"),
        }
    }

    /// Checks the number of samples.
    ///
    /// # Errors
    /// [`GridError::SamplesLength`] if the samples are not those of a chunk of `cells` cells per axis.
    pub(crate) fn check(&self, cells: u32) -> Result<(), GridError> {
        match self {
            Self::Uniform(_) => Ok(()),
            Self::Samples(samples) => check_lengths(&samples.weights, &samples.materials, cells),
        }
    }

    fn collapsed(weights: Vec<W>, materials: Vec<u8>) -> Self {
        match (weights.first(), materials.first()) {
            (Some(&weight), Some(&material))
                if weights.iter().all(|w| *w == weight) && materials.iter().all(|m| *m == material) =>
            {
                Self::Uniform(Voxel { weight, material })
            }
            _ => Self::Samples(Arc::new(GridSamples { weights, materials })),
        }
    }
}

/// The lattice points of a box of chunks.
fn source_region(position: [i32; 3], chunks: u32, cells: u32, spacing: f64) -> SourceRegion {
    let cells = cells.clamp(MIN_CHUNK_CELLS, MAX_CHUNK_CELLS);
    let min = position.map(|v| v.saturating_mul(cells as i32));
    SourceRegion { min, size: [cells.saturating_mul(chunks); 3], level: 0, spacing }
}

fn check_lengths<W>(weights: &[W], materials: &[u8], cells: u32) -> Result<(), GridError> {
    let expected = (cells as usize).pow(3);
    if weights.len() == expected && materials.len() == expected {
        Ok(())
    } else {
        Err(GridError::SamplesLength { cells, expected, weights: weights.len(), materials: materials.len() })
    }
}
