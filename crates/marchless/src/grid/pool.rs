//! [`SamplePool`]: reusable memory for the copies of samples that edits make.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::{GridChunk, GridSamples};
use crate::sample::Voxel;

/// A pool of discarded samples, whose memory edits reuse when they write out or copy samples.
///
/// Many allocators return freed memory to the thread that allocated it. Without a pool, copies of samples that came
/// from other threads take new memory each time, and mapping its pages takes longer than copying.
#[derive(Debug)]
#[doc(hidden)]
pub struct SamplePool<W = i16>(Vec<Arc<GridSamples<W>>>);

/// The capacity of a pool, in chunks: the most that a small edit changes.
const CAPACITY: usize = 8;

impl<W> SamplePool<W> {
    /// An empty pool.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Adds a chunk's memory to the pool, unless a clone still shares it or the pool is full.
    pub fn keep(&mut self, chunk: GridChunk<W>) {
        if let GridChunk::Samples(mut samples) = chunk
            && self.0.len() < CAPACITY
            && Arc::get_mut(&mut samples).is_some()
        {
            self.0.push(samples);
        }
    }
}

impl<W: Clone> SamplePool<W> {
    /// `len` samples that all equal `voxel`.
    pub(super) fn filled(&mut self, voxel: Voxel<W>, len: usize) -> Arc<GridSamples<W>> {
        let Some(mut samples) = self.0.pop() else {
            return Arc::new(GridSamples { weights: vec![voxel.weight; len], materials: vec![voxel.material; len] });
        };
        let GridSamples { weights, materials } = Arc::make_mut(&mut samples);
        weights.clear();
        weights.resize(len, voxel.weight);
        materials.clear();
        materials.resize(len, voxel.material);
        samples
    }

    /// Gives the caller unshared samples to edit, as [`Arc::make_mut`] does: if clones share them, a copy replaces
    /// them.
    pub(super) fn make_mut<'a>(&mut self, samples: &'a mut Arc<GridSamples<W>>) -> &'a mut GridSamples<W> {
        if Arc::get_mut(samples).is_none()
            && let Some(mut copy) = self.0.pop()
            && let Some(target) = Arc::get_mut(&mut copy)
        {
            target.weights.clone_from(&samples.weights);
            target.materials.clone_from(&samples.materials);
            *samples = copy;
        }
        Arc::make_mut(samples)
    }
}

impl<W> Default for SamplePool<W> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(weight: i16) -> Arc<GridSamples> {
        Arc::new(GridSamples { weights: vec![weight; 512], materials: vec![7; 512] })
    }

    #[test]
    fn memory_is_used_again() {
        let mut pool = SamplePool::new();
        let old = samples(1);
        let address = old.weights.as_ptr();
        pool.keep(GridChunk::Samples(old.clone()));
        assert!(pool.0.is_empty(), "a clone shares the memory");
        pool.keep(GridChunk::AIR);
        pool.keep(GridChunk::Samples(old));
        let mut own = samples(2);
        let own_address = own.weights.as_ptr();
        assert_eq!(pool.make_mut(&mut own).weights.as_ptr(), own_address, "unshared samples are not copied");
        let clone = own.clone();
        pool.make_mut(&mut own).weights[3] = 5;
        assert_eq!((own.weights.as_ptr(), own.weights[2], own.weights[3], own.materials[3]), (address, 2, 5, 7));
        assert_eq!(clone, samples(2));
        let clone = own.clone();
        pool.make_mut(&mut own).weights[4] = 6;
        assert_eq!((own.weights[3], own.weights[4], clone.weights[4]), (5, 6, 2), "copied without pool memory");
        pool.keep(GridChunk::Samples(clone));
        let written = pool.filled(Voxel::new(8, 9), 343);
        assert_eq!(written.weights.as_ptr(), address);
        assert_eq!(*written, GridSamples { weights: vec![8; 343], materials: vec![9; 343] });
        assert_eq!(*pool.filled(Voxel::new(8, 9), 343), *written, "without pool memory");
        (0..2 * CAPACITY).for_each(|_| pool.keep(GridChunk::Samples(samples(3))));
        assert_eq!(pool.0.len(), CAPACITY);
    }
}
