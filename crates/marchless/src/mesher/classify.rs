//! Pass 1: the signs of one slab of samples, a bit each.

use alloc::vec::Vec;

use super::slabs::Lattice;
use crate::{sample::Weight, simd::Simd};

/// The signs of one slab: `words` a row.
#[derive(Clone, Debug, Default)]
pub(super) struct Signs {
    words: Vec<u64>,
    /// Whether all samples are inside, or outside, where all are the same; the words may then be old.
    uniform: Option<bool>,
}

impl Signs {
    pub(super) const fn new() -> Self {
        Self { words: Vec::new(), uniform: None }
    }

    pub(super) const fn uniform(&self) -> Option<bool> {
        self.uniform
    }

    /// All rows' words, one after the other. Unused bits of a row's last word are zero.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Takes in the slab `plane`: all its samples, padding included.
    #[inline(always)]
    pub(super) fn fill<S: Simd, W: Weight>(&mut self, lattice: &Lattice, plane: &[W], threshold: W::Threshold) {
        self.uniform = uniform::<S, W>(plane, threshold);
        if self.uniform.is_some() {
            return;
        }
        self.words.resize(lattice.words * lattice.size[1], 0);
        let rows = plane[lattice.origin..].chunks(lattice.stride);
        for (row, words) in rows.zip(self.words.chunks_exact_mut(lattice.words)) {
            sign_row::<S, W>(&row[..lattice.size[0]], threshold, words);
        }
    }

    /// Makes sure that the words are there, for a slab beside one with other signs.
    #[inline(always)]
    pub(super) fn spell_out(&mut self, lattice: &Lattice) {
        let Some(inside) = self.uniform else { return };
        self.words.resize(lattice.words * lattice.size[1], 0);
        for words in self.words.chunks_exact_mut(lattice.words) {
            words.fill(if inside { u64::MAX } else { 0 });
            words[lattice.words - 1] &= lattice.last_word;
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

/// The signs of one row.
#[inline(always)]
fn sign_row<S: Simd, W: Weight>(row: &[W], threshold: W::Threshold, words: &mut [u64]) {
    for (word, weights) in words.iter_mut().zip(row.chunks(64)) {
        let (whole, rest) = weights.as_chunks::<32>();
        *word = 0;
        for (half, weights) in whole.iter().enumerate() {
            *word |= u64::from(W::below::<S>(weights, threshold)) << (32 * half);
        }
        let start = 32 * whole.len();
        if rest.len() <= 4 {
            // A chunk of 32 cells has 33 samples a row.
            for (index, weight) in rest.iter().enumerate() {
                *word |= u64::from(weight.inside(threshold)) << (start + index);
            }
        } else {
            let mut padded = [rest[0]; 32];
            padded[..rest.len()].copy_from_slice(rest);
            let signs = W::below::<S>(&padded, threshold) & (u32::MAX >> (32 - rest.len()));
            *word |= u64::from(signs) << start;
        }
    }
}
