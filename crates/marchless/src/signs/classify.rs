//! From weights to sign bits.

use crate::{
    sample::Weight,
    simd::{self, Simd},
};

/// The sign that all samples of a slab have, padding included: true is inside. `None` if their signs differ.
///
/// Most slabs of a terrain are uniform and cost one read of their samples. In the others the first sample of the other
/// sign soon turns up.
#[inline(always)]
pub(super) fn uniform_sign<S: Simd, W: Weight>(slab: &[W], threshold: W::Threshold) -> Option<bool> {
    (uniform_prefix::<S, W>(slab, threshold) == slab.len()).then(|| slab[0].inside(threshold))
}

/// The number of samples before the first one whose sign differs from sample 0's; all of them if none differs.
///
/// The result may be less than exact by up to 127, but never claims too much.
#[inline(always)]
pub(crate) fn uniform_prefix<S: Simd, W: Weight>(samples: &[W], threshold: W::Threshold) -> usize {
    let inside = samples[0].inside(threshold);
    let expected = if inside { u32::MAX } else { 0 };
    let (groups, rest) = samples.as_chunks::<128>();
    for (index, group) in groups.iter().enumerate() {
        let mut different = 0;
        for weights in group.as_chunks::<32>().0 {
            different |= simd::below::<S, W>(weights, threshold) ^ expected;
        }
        if different != 0 {
            return 128 * index;
        }
    }
    let mut different = 0;
    for weights in rest.as_chunks::<32>().0 {
        different |= simd::below::<S, W>(weights, threshold) ^ expected;
    }
    match samples.last_chunk::<32>() {
        // This reads some samples a second time.
        Some(last) => different |= simd::below::<S, W>(last, threshold) ^ expected,
        None => different |= u32::from(rest.iter().any(|weight| weight.inside(threshold) != inside)),
    }
    samples.len() - if different == 0 { 0 } else { rest.len() }
}

/// Writes the signs of the first `count` samples to `words`. `count` fills all words except part of the last one.
///
/// Samples behind `count` are read too, if `samples` has them.
#[inline(always)]
pub(crate) fn sign_row<S: Simd, W: Weight>(samples: &[W], count: usize, threshold: W::Threshold, words: &mut [u64]) {
    for (index, word) in words.iter_mut().enumerate() {
        *word = sign_word::<S, W>(&samples[64 * index..], (count - 64 * index).min(64), threshold);
    }
}

/// The signs of the first `count` samples, 1 to 64. Samples behind them are read too, if `samples` has them.
#[inline(always)]
pub(super) fn sign_word<S: Simd, W: Weight>(samples: &[W], count: usize, threshold: W::Threshold) -> u64 {
    let mask = u64::MAX >> (64 - count);
    if count == 33 {
        // A row of a chunk of 32 cells.
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
    sign_word_at_end(&samples[..count], threshold)
}

/// [`sign_word`] for the last samples of a slab, which are too few for vector instructions.
#[cold]
#[inline(never)]
fn sign_word_at_end<W: Weight>(samples: &[W], threshold: W::Threshold) -> u64 {
    samples.iter().enumerate().fold(0, |signs, (index, sample)| signs | u64::from(sample.inside(threshold)) << index)
}
