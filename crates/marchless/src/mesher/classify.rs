//! Pass 1: the signs of one slab of samples, a bit each.

use alloc::vec::Vec;

use super::slabs::Lattice;
use crate::{
    sample::Weight,
    simd::{self, Simd},
};

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
        let width = lattice.size[0];
        if lattice.words == 1 {
            for (y, word) in self.signs.iter_mut().enumerate() {
                *word = sign_word::<S, W>(&plane[lattice.origin + y * lattice.stride..], width, threshold);
            }
        } else {
            for (y, words) in self.signs.chunks_exact_mut(lattice.words).enumerate() {
                let row = &plane[lattice.origin + y * lattice.stride..];
                sign_row::<S, W>(row, width, threshold, words);
            }
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

/// Whether all samples of a slab, padding included, have the same sign. Most slabs of a terrain do, and cost no more
/// than reading them once; in others, the first sample of the other sign is soon found.
#[inline(always)]
fn uniform<S: Simd, W: Weight>(plane: &[W], threshold: W::Threshold) -> Option<bool> {
    (alike::<S, W>(plane, threshold) == plane.len()).then(|| plane[0].inside(threshold))
}

/// How many samples have the same sign as the first; of those just before the first other one, a few may be left out.
#[inline(always)]
pub(super) fn alike<S: Simd, W: Weight>(samples: &[W], threshold: W::Threshold) -> usize {
    let inside = samples[0].inside(threshold);
    let expected = if inside { u32::MAX } else { 0 };
    let (groups, rest) = samples.as_chunks::<128>();
    for (index, group) in groups.iter().enumerate() {
        let mut others = 0;
        for weights in group.as_chunks::<32>().0 {
            others |= simd::below::<S, W>(weights, threshold) ^ expected;
        }
        if others != 0 {
            return 128 * index;
        }
    }
    let mut others = 0;
    for weights in rest.as_chunks::<32>().0 {
        others |= simd::below::<S, W>(weights, threshold) ^ expected;
    }
    match samples.last_chunk::<32>() {
        // Some of these once more.
        Some(last) => others |= simd::below::<S, W>(last, threshold) ^ expected,
        None => others |= u32::from(rest.iter().any(|weight| weight.inside(threshold) != inside)),
    }
    samples.len() - if others == 0 { 0 } else { rest.len() }
}

/// The signs of the first `count` samples, as many as fill all `words` but for a part of the last one; what is behind
/// them is read, too, where it is there.
#[inline(always)]
pub(crate) fn sign_row<S: Simd, W: Weight>(samples: &[W], count: usize, threshold: W::Threshold, words: &mut [u64]) {
    for (index, word) in words.iter_mut().enumerate() {
        *word = sign_word::<S, W>(&samples[64 * index..], (count - 64 * index).min(64), threshold);
    }
}

/// The signs of the first `count` samples, 1 to 64; what is behind them is read, too, where it is there.
#[inline(always)]
fn sign_word<S: Simd, W: Weight>(samples: &[W], count: usize, threshold: W::Threshold) -> u64 {
    let mask = u64::MAX >> (64 - count);
    if count == 33 {
        // As many as a chunk of 32 cells has.
        if let Some((low, rest)) = samples.split_first_chunk::<32>()
            && let Some(last) = rest.first()
        {
            return u64::from(simd::below::<S, W>(low, threshold)) | u64::from(last.inside(threshold)) << 32;
        }
    } else if count > 32 {
        if let Some(samples) = samples.first_chunk::<64>() {
            let mut signs = 0;
            for (half, samples) in samples.as_chunks::<32>().0.iter().enumerate() {
                signs |= u64::from(simd::below::<S, W>(samples, threshold)) << (32 * half);
            }
            return signs & mask;
        }
    } else if let Some(samples) = samples.first_chunk::<32>() {
        return u64::from(simd::below::<S, W>(samples, threshold)) & mask;
    }
    few(&samples[..count], threshold)
}

/// The same for the last samples of a slab.
#[cold]
#[inline(never)]
fn few<W: Weight>(samples: &[W], threshold: W::Threshold) -> u64 {
    samples.iter().enumerate().fold(0, |signs, (index, sample)| signs | u64::from(sample.inside(threshold)) << index)
}
