//! [`SlabSigns`]: the signs of one slab.

use alloc::vec::Vec;

use super::{
    classify::{sign_row, sign_word, uniform_sign},
    layout::SlabLayout,
};
use crate::{sample::Weight, simd::Simd};

/// The signs of one slab, row after row, each of [`SlabLayout::words`] words.
#[derive(Clone, Debug, Default)]
pub(crate) struct SlabSigns {
    /// Bit `x` of a row is sample `x`. The unused bits of a row's last word are zero.
    signs: Vec<u64>,
    /// Bit `x` of a row is sample `x + 1`. The last sample of a row stands in for its missing neighbour.
    next: Vec<u64>,
    /// The sign of all samples, if they have the same; true is inside. The words are then stale.
    uniform: Option<bool>,
}

impl SlabSigns {
    pub(super) const fn new() -> Self {
        Self { signs: Vec::new(), next: Vec::new(), uniform: None }
    }

    /// The sign of all samples, if they have the same; true is inside.
    pub(super) const fn uniform(&self) -> Option<bool> {
        self.uniform
    }

    /// The sign of each sample.
    pub(crate) fn signs(&self) -> &[u64] {
        &self.signs
    }

    /// The sign of each sample's neighbour at +x; a row's last sample has its own.
    pub(crate) fn next(&self) -> &[u64] {
        &self.next
    }

    /// The sign of one sample, of a uniform slab too: true is inside.
    pub(crate) fn is_inside(&self, layout: &SlabLayout, x: usize, y: usize) -> bool {
        self.uniform.unwrap_or_else(|| self.signs[y * layout.words + x / 64] >> (x % 64) & 1 == 1)
    }

    /// Reads all samples of a slab, padding included.
    #[inline(always)]
    pub(super) fn fill<S: Simd, W: Weight>(&mut self, layout: &SlabLayout, slab: &[W], threshold: W::Threshold) {
        self.uniform = uniform_sign::<S, W>(slab, threshold);
        if self.uniform.is_some() {
            return;
        }
        self.resize(layout);
        let width = layout.size[0];
        if layout.words == 1 {
            for (y, word) in self.signs.iter_mut().enumerate() {
                *word = sign_word::<S, W>(&slab[layout.origin + y * layout.stride..], width, threshold);
            }
        } else {
            for (y, words) in self.signs.chunks_exact_mut(layout.words).enumerate() {
                let row = &slab[layout.origin + y * layout.stride..];
                sign_row::<S, W>(row, width, threshold, words);
            }
        }
        self.shift(layout);
    }

    /// Writes the words of a uniform slab, for a neighbour with other signs.
    #[inline(always)]
    pub(super) fn write_out(&mut self, layout: &SlabLayout) {
        let Some(inside) = self.uniform else { return };
        self.resize(layout);
        self.signs.fill(if inside { u64::MAX } else { 0 });
        for words in self.signs.chunks_exact_mut(layout.words) {
            words[layout.words - 1] &= layout.last_word;
        }
        self.shift(layout);
    }

    #[inline(always)]
    fn resize(&mut self, layout: &SlabLayout) {
        self.signs.resize(layout.words * layout.size[1], 0);
        self.next.resize(layout.words * layout.size[1], 0);
    }

    /// Computes `next` from `signs`.
    #[inline(always)]
    fn shift(&mut self, layout: &SlabLayout) {
        let last = layout.last_sample();
        if layout.words == 1 {
            for (next, &word) in self.next.iter_mut().zip(&self.signs) {
                *next = word >> 1 | word & last;
            }
            return;
        }
        let rows = self.signs.chunks_exact(layout.words);
        for (next, words) in self.next.chunks_exact_mut(layout.words).zip(rows) {
            let end = words.len() - 1;
            for k in 0..end {
                next[k] = words[k] >> 1 | words[k + 1] << 63;
            }
            next[end] = words[end] >> 1 | words[end] & last;
        }
    }
}
