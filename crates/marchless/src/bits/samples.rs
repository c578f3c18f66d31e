//! Packs the signs of samples into bits.

use super::BitGrid;
use crate::{
    lattice::Samples,
    sample::{
        Weight,
        private::{PerWeight, Sealed},
    },
    signs::sign_row,
    simd::{Backend, Job, Simd, dispatch},
};

/// The job that packs the signs of samples into a grid.
pub(super) struct SignRows<'a, W> {
    pub(super) samples: Samples<'a, W>,
    pub(super) padding: usize,
    pub(super) isovalue: f32,
    pub(super) grid: &'a mut BitGrid,
}

impl<W: Weight> SignRows<'_, W> {
    /// Packs the signs with `backend`.
    pub(super) fn pack(self, backend: Backend) {
        W::call::<OnBackend>((backend, self));
    }
}

/// [`SignRows::pack`] for each type of weight.
struct OnBackend;

impl PerWeight for OnBackend {
    type Arguments<'a, W: Sealed> = (Backend, SignRows<'a, W>);
    type Output = ();

    fn of_i8((backend, rows): (Backend, SignRows<'_, i8>)) {
        dispatch(backend, rows);
    }

    fn of_i16((backend, rows): (Backend, SignRows<'_, i16>)) {
        dispatch(backend, rows);
    }

    fn of_f32((backend, rows): (Backend, SignRows<'_, f32>)) {
        dispatch(backend, rows);
    }
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
