//! [`BitsCache`]: the solid samples of a terrain, one bit each, chunk by chunk.
//!
//! Bits are derived once, on the thread that needs them first, and shared from then on. Samples lie behind an `Arc` and
//! are copied on write, so a changed address means changed samples. The cache holds a `Weak` to them; because of it, an
//! edit has to move the samples to another address even if nothing else holds them. Bits of dropped samples are pruned
//! once they may be half of all.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use bevy_ecs::prelude::*;
use marchless::bits::BitGrid;
use marchless::{GridChunk, GridSamples, Region, Samples, Shape, Weight as _};

use super::TerrainBitsError;
use super::part::SolidQuery;

/// The bits of a terrain's chunks, as far as queries have needed them.
#[derive(Component, Default)]
pub(crate) struct BitsCache(Mutex<CacheEntries>);

#[derive(Default)]
struct CacheEntries {
    chunks: BTreeMap<[i32; 3], CacheEntry>,
    /// Once there are this many entries, stale ones are pruned.
    prune_at: usize,
}

/// The number of entries below which stale ones are not looked for.
const FEW: usize = 64;

struct CacheEntry {
    /// The samples that the bits are derived from.
    samples: Weak<GridSamples<i16>>,
    settings: BitsSettings,
    bits: Arc<OnceLock<Derived>>,
}

/// The solid points of a chunk, derived from its samples.
#[derive(Debug)]
pub(super) enum Derived {
    /// All points (true) or none (false).
    Uniform(bool),
    /// The chunk's points; a row is one word.
    Mixed(BitGrid),
}

/// The solid points of a chunk, derived when first read. Cheap to clone, and unaffected by later edits.
#[derive(Clone, Debug)]
pub(super) enum ChunkBits {
    Uniform(bool),
    Lazy { samples: Arc<GridSamples<i16>>, settings: BitsSettings, bits: Arc<OnceLock<Derived>> },
}

/// The settings that a chunk's bits depend on, besides its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BitsSettings {
    isovalue: f32,
    cells: u32,
    /// For each axis, whether the chunk's lowest layer lies on the terrain's outermost plane, where all is air.
    lowest: [bool; 3],
}

impl BitsCache {
    /// The entry for the bits of a chunk with these samples, which may not be derived yet.
    fn entry(
        &self,
        position: [i32; 3],
        samples: &Arc<GridSamples<i16>>,
        settings: BitsSettings,
    ) -> Arc<OnceLock<Derived>> {
        let mut entries = self.lock();
        let is_current = |entry: &&CacheEntry| {
            core::ptr::eq(entry.samples.as_ptr(), Arc::as_ptr(samples)) && entry.settings == settings
        };
        if let Some(entry) = entries.chunks.get(&position).filter(is_current) {
            return entry.bits.clone();
        }
        let bits = Arc::<OnceLock<Derived>>::default();
        if entries.chunks.len() >= entries.prune_at {
            entries.chunks.retain(|_, entry| entry.samples.strong_count() > 0);
            entries.prune_at = 2 * entries.chunks.len() + FEW;
        }
        entries.chunks.insert(position, CacheEntry { samples: Arc::downgrade(samples), settings, bits: bits.clone() });
        bits
    }

    fn lock(&self) -> MutexGuard<'_, CacheEntries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ChunkBits {
    /// The solid points of the chunk at `position`, not derived yet.
    ///
    /// # Errors
    /// [`TerrainBitsError::NotFilled`].
    pub(super) fn new(
        SolidQuery { grid, cache, isovalue }: SolidQuery<'_>,
        position: [i32; 3],
    ) -> Result<Self, TerrainBitsError> {
        match grid.chunk(position) {
            None => Err(TerrainBitsError::NotFilled { chunk: position.into() }),
            Some(GridChunk::Uniform(voxel)) => Ok(Self::Uniform(voxel.weight.to_voxels() < isovalue)),
            Some(GridChunk::Samples(samples)) => {
                let lowest =
                    grid.bounds().map_or([false; 3], |bounds| [0, 1, 2].map(|axis| position[axis] == bounds.min[axis]));
                let settings = BitsSettings { isovalue, cells: grid.chunk_cells(), lowest };
                let bits = cache.entry(position, samples, settings);
                Ok(Self::Lazy { samples: samples.clone(), settings, bits })
            }
        }
    }

    /// The solid points; derives them on the first call.
    ///
    /// # Errors
    /// [`TerrainBitsError::Bits`] if there is not enough memory.
    pub(super) fn get(&self) -> Result<&Derived, TerrainBitsError> {
        match self {
            Self::Uniform(true) => Ok(&Derived::Uniform(true)),
            Self::Uniform(false) => Ok(&Derived::Uniform(false)),
            Self::Lazy { samples, settings, bits } => {
                if let Some(derived) = bits.get() {
                    return Ok(derived);
                }
                let derived = settings.derive(samples)?;
                Ok(bits.get_or_init(|| derived))
            }
        }
    }
}

impl BitsSettings {
    fn derive(&self, samples: &GridSamples<i16>) -> Result<Derived, TerrainBitsError> {
        let shape = Shape::cube(self.cells).expect("a chunk has samples");
        let samples = Samples::new(shape, &samples.weights).expect("the grid has checked their number");
        let mut bits = BitGrid::from_samples(samples, self.isovalue)?;
        // The terrain's outermost planes are air: meshes are cut off there.
        for axis in (0..3).filter(|axis| self.lowest[*axis]) {
            let mut layer = Region::new([0; 3], [self.cells as i32; 3]);
            layer.max[axis] = 1;
            bits.fill(layer, false);
        }
        Ok(match bits.count() {
            0 => Derived::Uniform(false),
            count if count == shape.len() => Derived::Uniform(true),
            _ => Derived::Mixed(bits),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use marchless::{Grid, Voxel};

    fn one_chunk() -> Grid<i16> {
        Grid::bounded(8, Region::new([0; 3], [1; 3])).unwrap()
    }

    fn place(grid: &Grid<i16>, cache: &BitsCache, isovalue: f32) -> Arc<OnceLock<Derived>> {
        match ChunkBits::new(SolidQuery { grid, cache, isovalue }, [0; 3]).expect("it is filled") {
            ChunkBits::Lazy { bits, .. } => bits,
            ChunkBits::Uniform(_) => panic!("it has samples"),
        }
    }

    #[test]
    fn bits_are_shared_until_the_samples_change() {
        let (mut grid, cache) = (one_chunk(), BitsCache::default());
        let solid = Voxel::new(-256, 0);
        grid.set([3, 3, 3], solid).unwrap();
        // Once the cache alone refers to the samples, once another grid holds them, too.
        for others in [vec![], vec![grid.clone()]] {
            let first = place(&grid, &cache, 0.0);
            assert!(Arc::ptr_eq(&first, &place(&grid, &cache, 0.0)), "asked for twice");
            let with_other_isovalue = place(&grid, &cache, 0.25);
            assert!(!Arc::ptr_eq(&first, &with_other_isovalue));
            grid.set([4, 4, 4], solid).unwrap();
            let after = place(&grid, &cache, 0.25);
            assert!(!Arc::ptr_eq(&with_other_isovalue, &after));
            grid.set([4, 4, 4], Voxel::AIR).unwrap();
            assert!(!Arc::ptr_eq(&after, &place(&grid, &cache, 0.25)), "as before, but not known to be");
            drop(others);
        }
    }

    #[test]
    fn bits_of_samples_that_are_gone_are_pruned() {
        let (mut grid, cache) = (Grid::new(8).unwrap(), BitsCache::default());
        for x in 0..1_000 {
            grid.set([8 * x, 0, 0], Voxel::new(-256, 0)).unwrap();
            ChunkBits::new(SolidQuery { grid: &grid, cache: &cache, isovalue: 0.0 }, [x, 0, 0]).unwrap();
            grid.remove_clean([x, 0, 0]);
        }
        assert!(cache.lock().chunks.len() <= FEW);
    }

    #[test]
    fn a_chunk_that_is_uniform_costs_no_bits() {
        let (mut grid, cache) = (one_chunk(), BitsCache::default());
        grid.insert([0; 3], GridChunk::AIR).unwrap();
        let bits = |grid: &Grid<i16>| ChunkBits::new(SolidQuery { grid, cache: &cache, isovalue: 0.0 }, [0; 3]);
        assert!(matches!(bits(&grid), Ok(ChunkBits::Uniform(false))));
        assert!(cache.lock().chunks.is_empty());
        // Samples that differ, but are all air.
        grid.set([3, 3, 3], Voxel::new(256, 0)).unwrap();
        assert!(matches!(bits(&grid).unwrap().get(), Ok(Derived::Uniform(false))));
    }
}
