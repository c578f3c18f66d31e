//! From the signs of samples to bits.

use super::BitGrid;
use crate::{
    lattice::Samples,
    mesher::sign_row,
    sample::Weight,
    simd::{Job, Simd},
};

/// Samples whose signs become a grid.
pub struct SignRows<'a, W> {
    pub(super) samples: Samples<'a, W>,
    pub(super) padding: usize,
    pub(super) isovalue: f32,
    pub(super) grid: &'a mut BitGrid,
}

impl<W: Weight> Job for SignRows<'_, W> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { samples, padding, isovalue, grid } = self;
        let threshold = W::threshold(isovalue);
        let [nx, ny, _] = grid.shape.size().map(|size| size as usize);
        let [_, stride, slab] = samples.shape().strides();
        for (number, words) in grid.words.chunks_exact_mut(grid.row).enumerate() {
            let (y, z) = (number % ny, number / ny);
            let row = &samples.weights()[padding + (y + padding) * stride + (z + padding) * slab..];
            sign_row::<S, W>(row, nx, threshold, words);
        }
    }
}
