//! The signs of samples, one bit each, slab by slab: the first layer that all meshers share.
//!
//! A slab is one layer of samples across z. The signs of a row of samples along x are packed into 64-bit words. Which
//! edges the surface crosses are then `xor`s of neighbouring words. [`SignSweep`] moves through a volume and keeps the
//! signs of three slabs.

mod classify;
mod layout;
mod slab;
mod window;

pub(crate) use classify::{sign_row, uniform_prefix};
pub(crate) use layout::SlabLayout;
pub(crate) use slab::SlabSigns;
pub(crate) use window::{EdgeSlabs, Window};

use crate::{sample::Weight, simd::Simd};

/// The signs of three or more neighbouring slabs. They move up through a volume, one slab at a time.
///
/// The last slabs are the one below, the current one and the next one; farther ones below come first. The next one is
/// read early and in one go: gradients read single samples of it and then find them in the cache. (Refused: reading it
/// only for gradients; caves of 256³ `f32` samples then took 67 instead of 41 ms.)
#[derive(Clone, Debug)]
pub(crate) struct SignSweep<const SLABS: usize = 3> {
    slabs: [SlabSigns; SLABS],
}

impl<const SLABS: usize> SignSweep<SLABS> {
    pub(crate) const fn new() -> Self {
        Self { slabs: [const { SlabSigns::new() }; SLABS] }
    }

    /// Moves up by one slab. `first`: the current slab, if the sweep starts with it. `next`: the slab above, if there
    /// is one. Both are whole slabs, padding included.
    #[inline(always)]
    pub(crate) fn advance<S: Simd, W: Weight>(
        &mut self,
        layout: &SlabLayout,
        first: Option<&[W]>,
        next: Option<&[W]>,
        threshold: W::Threshold,
    ) {
        self.slabs.rotate_left(1);
        let [.., current, above] = &mut self.slabs[..] else { unreachable!("there are three slabs or more") };
        if let Some(first) = first {
            current.fill::<S, W>(layout, first, threshold);
        }
        if let Some(next) = next {
            above.fill::<S, W>(layout, next, threshold);
        }
    }

    /// Writes out the words of the slab below and of the current slab, and returns true, unless all signs of both are
    /// equal.
    #[inline(always)]
    pub(crate) fn write_out_pair(&mut self, layout: &SlabLayout) -> bool {
        let [.., below, current, _] = &mut self.slabs[..] else { unreachable!("there are three slabs or more") };
        if below.uniform().is_some() && below.uniform() == current.uniform() {
            return false;
        }
        below.write_out(layout);
        current.write_out(layout);
        true
    }

    /// The signs of the slab below and of the current slab.
    #[inline(always)]
    pub(crate) const fn pair(&self) -> [&SlabSigns; 2] {
        [&self.slabs[SLABS - 3], &self.slabs[SLABS - 2]]
    }

    /// The signs of all slabs, the lowest first.
    #[inline(always)]
    pub(crate) const fn all(&self) -> &[SlabSigns; SLABS] {
        &self.slabs
    }

    /// The signs of the current slab, unless all of them are equal.
    #[inline(always)]
    pub(crate) fn current_mixed(&self) -> Option<&SlabSigns> {
        self.slabs[SLABS - 2].uniform().is_none().then_some(&self.slabs[SLABS - 2])
    }
}

/// The number of edges that the surface crosses between samples with the signs `low` and samples with the signs `high`.
#[inline(always)]
pub(crate) fn crossing_count(low: &[u64], high: &[u64]) -> u64 {
    low.iter().zip(high).map(|(low, high)| u64::from((low ^ high).count_ones())).sum()
}
