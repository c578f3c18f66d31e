//! [`Chunk`]: the samples of one chunk, shared and copied on write, or one voxel for all of them.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::border::{Border, larger, layer_indices};
use super::{GridError, MAX_CHUNK_CELLS, MIN_CHUNK_CELLS, SpareSamples};
use crate::sample::{Voxel, Weight};
use crate::source::{BOUND_MARGIN, Bound, Source, SourceRegion};

/// The samples of one chunk. Cloning is cheap, and the clone is unaffected by later edits.
#[derive(Clone, Debug, PartialEq)]
pub enum Chunk<W = i16> {
    /// All samples are this one.
    Uniform(Voxel<W>),
    /// One sample a lattice point.
    Samples(Arc<ChunkSamples<W>>),
}

/// The samples of a [`Chunk`], `[n·n·n]` each, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct ChunkSamples<W = i16> {
    /// Signed distances.
    pub weights: Vec<W>,
    /// Materials.
    pub materials: Vec<u8>,
}

impl<W: Weight> Chunk<W> {
    /// A chunk of air.
    pub const AIR: Self = Self::Uniform(Voxel::AIR);

    /// Samples `source` for the chunk at chunk position `position`; runs on any thread.
    ///
    /// The source is asked for a [close bound](Source::bound_closely) of the chunk first: the distances that are left out
    /// are too far from the surface to matter to it, for isovalues within ±3 voxels. `cells`: 8 to 62, clamped. `spacing`: world units per voxel. A position whose lattice points do not fit in `i32`
    /// gives the chunk nearest to it; no grid takes it.
    pub fn from_source(source: &(impl Source + ?Sized), position: [i32; 3], cells: u32, spacing: f64) -> Self {
        Self::from_source_counted(source, position, cells, spacing).0
    }

    /// The chunk at `position` where `source` is certain of it [without sampling](Source::bound); arguments as of
    /// [`Chunk::from_source`].
    pub fn without_sampling(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        Self::box_without_sampling(source, position, 1, cells, spacing)
    }

    /// The same for all chunks of a box: `chunks` per axis, `position` the lowest. They are all alike then.
    pub fn box_without_sampling(
        source: &(impl Source + ?Sized),
        position: [i32; 3],
        chunks: u32,
        cells: u32,
        spacing: f64,
    ) -> Option<Self> {
        Self::from_bound(source.bound(&source_region(position, chunks, cells, spacing).grown(BOUND_MARGIN)))
    }

    /// The chunk at `position`, and whether it took sampling; arguments as of [`Chunk::from_source`], whose result it is.
    pub fn from_source_counted(
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

    /// A chunk of `cells` cells per axis from its samples, uniform where they are all equal.
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

    /// The sample of index `x + n·(y + n·z)`; air beyond the last one.
    pub fn voxel(&self, index: usize) -> Voxel<W> {
        match self {
            Self::Uniform(voxel) => *voxel,
            Self::Samples(samples) => match (samples.weights.get(index), samples.materials.get(index)) {
                (Some(&weight), Some(&material)) => Voxel { weight, material },
                _ => Voxel::AIR,
            },
        }
    }

    /// The samples, to be changed: a uniform chunk is written out, a shared one copied.
    pub(crate) fn samples_mut(&mut self, cells: u32, spare: &mut SpareSamples<W>) -> &mut ChunkSamples<W> {
        if let Self::Uniform(voxel) = *self {
            *self = Self::Samples(spare.filled(voxel, (cells as usize).pow(3)));
        }
        match self {
            Self::Samples(samples) => spare.make_mut(samples),
            Self::Uniform(_) => unreachable!("written out above"),
        }
    }

    /// Intersects the samples with the border of a bounded grid. `origin`: the chunk's lowest lattice point.
    pub(crate) fn clip(&mut self, origin: [i32; 3], cells: u32, border: &Border) {
        let size = cells as usize;
        for (axis, layer, least) in border.layers::<W>(origin.map(i64::from), size) {
            // Looking first leaves shared samples shared, and a uniform chunk uniform, where nothing changes.
            let below = match self {
                Self::Uniform(voxel) => voxel.weight < least,
                Self::Samples(samples) => layer_indices(axis, layer, size).any(|index| samples.weights[index] < least),
            };
            if below {
                let weights = &mut self.samples_mut(cells, &mut SpareSamples::new()).weights;
                for index in layer_indices(axis, layer, size) {
                    weights[index] = larger(weights[index], least);
                }
            }
        }
    }

    /// # Errors
    /// [`GridError::SamplesLength`] where the samples are not those of a chunk of `cells` cells per axis.
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
            _ => Self::Samples(Arc::new(ChunkSamples { weights, materials })),
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
