//! Pass 1: the signs of one slab of samples, a bit each.

use alloc::vec::Vec;

use super::slabs::Lattice;
use crate::{sample::Weight, simd::Simd};

/// The signs of one slab: `words` a row, rows one after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Signs {
    /// Bit `x` of a row is sample `x`; unused bits of a row's last word are zero.
    signs: Vec<u64>,
    /// The same of each sample's neighbour at +x; of a row's last sample, its own.
    next: Vec<u64>,
    /// Whether all samples are inside, or outside, where all are the same; the words may then be old.
    uniform: Option<bool>,
}

impl Signs {
    pub(super) const fn new() -> Self {
        Self { signs: Vec::new(), next: Vec::new(), uniform: None }
    }

    pub(super) const fn uniform(&self) -> Option<bool> {
        self.uniform
    }

    pub(super) fn signs(&self) -> &[u64] {
        &self.signs
    }

    pub(super) fn next(&self) -> &[u64] {
        &self.next
    }

    /// Takes in the slab `plane`: all its samples, padding included.
    #[inline(always)]
    pub(super) fn fill<S: Simd, W: Weight>(&mut self, lattice: &Lattice, plane: &[W], threshold: W::Threshold) {
        self.uniform = uniform::<S, W>(plane, threshold);
        if self.uniform.is_some() {
            return;
        }
        self.resize(lattice);
        for (y, words) in self.signs.chunks_exact_mut(lattice.words).enumerate() {
            sign_row::<S, W>(&plane[lattice.origin + y * lattice.stride..], lattice.size[0], threshold, words);
        }
        self.shift(lattice);
    }

    /// Makes sure that the words are there, for a slab beside one with other signs.
    #[inline(always)]
    pub(super) fn spell_out(&mut self, lattice: &Lattice) {
        let Some(inside) = self.uniform else { return };
        self.resize(lattice);
        self.signs.fill(if inside { u64::MAX } else { 0 });
        for words in self.signs.chunks_exact_mut(lattice.words) {
            words[lattice.words - 1] &= lattice.last_word;
        }
        self.shift(lattice);
    }

    #[inline(always)]
    fn resize(&mut self, lattice: &Lattice) {
        self.signs.resize(lattice.words * lattice.size[1], 0);
        self.next.resize(lattice.words * lattice.size[1], 0);
    }

    /// Makes `next` from `signs`.
    #[inline(always)]
    fn shift(&mut self, lattice: &Lattice) {
        let last = lattice.last_word ^ lattice.last_word >> 1;
        if lattice.words == 1 {
            for (next, &word) in self.next.iter_mut().zip(&self.signs) {
                *next = word >> 1 | word & last;
            }
            return;
        }
        let rows = self.signs.chunks_exact(lattice.words);
        for (next, words) in self.next.chunks_exact_mut(lattice.words).zip(rows) {
            let ends = words.len() - 1;
            for k in 0..ends {
                next[k] = words[k] >> 1 | words[k + 1] << 63;
            }
            next[ends] = words[ends] >> 1 | words[ends] & last;
        }
    }
}

/// Whether all samples of a slab, padding included, have the same sign; most slabs of a terrain do, and cost no more
/// than reading them once. A slab that does not is found out at the first sample of the other sign.
#[inline(always)]
fn uniform<S: Simd, W: Weight>(plane: &[W], threshold: W::Threshold) -> Option<bool> {
    let inside = plane[plane.len() - 1].inside(threshold);
    let expected = if inside { u32::MAX } else { 0 };
    let (groups, rest) = plane.as_chunks::<128>();
    for group in groups {
        let mut others = 0;
        for weights in group.as_chunks::<32>().0 {
            others |= W::below::<S>(weights, threshold) ^ expected;
        }
        if others != 0 {
            return None;
        }
    }
    // The last of them once more where they are not whole groups of 32.
    if let Some(last) = plane.last_chunk::<32>() {
        let mut others = W::below::<S>(last, threshold) ^ expected;
        for weights in rest.as_chunks::<32>().0 {
            others |= W::below::<S>(weights, threshold) ^ expected;
        }
        return (others == 0).then_some(inside);
    }
    rest.iter().all(|weight| weight.inside(threshold) == inside).then_some(inside)
}

/// The signs of the first `len` samples of `row`; what is behind them is read, too, where it is there.
#[inline(always)]
fn sign_row<S: Simd, W: Weight>(row: &[W], len: usize, threshold: W::Threshold, words: &mut [u64]) {
    for (index, word) in words.iter_mut().enumerate() {
        let (weights, count) = (&row[64 * index..], len - 64 * index);
        *word = if count >= 64 {
            u64::from(half::<S, W>(weights, threshold)) | u64::from(half::<S, W>(&weights[32..], threshold)) << 32
        } else if count == 33 {
            // As many as a chunk of 32 cells has.
            u64::from(half::<S, W>(weights, threshold)) | u64::from(weights[32].inside(threshold)) << 32
        } else if count > 32 {
            let high = u64::from(half::<S, W>(&weights[32..], threshold)) << 32;
            (u64::from(half::<S, W>(weights, threshold)) | high) & ((1 << count) - 1)
        } else {
            u64::from(half::<S, W>(weights, threshold)) & ((1 << count) - 1)
        };
    }
}

/// The signs of the first 32 weights; of all where there are fewer.
#[inline(always)]
fn half<S: Simd, W: Weight>(weights: &[W], threshold: W::Threshold) -> u32 {
    match weights.first_chunk::<32>() {
        Some(weights) => W::below::<S>(weights, threshold),
        None => few(weights, threshold),
    }
}

#[cold]
fn few<W: Weight>(weights: &[W], threshold: W::Threshold) -> u32 {
    weights.iter().enumerate().fold(0, |signs, (index, weight)| signs | u32::from(weight.inside(threshold)) << index)
}
