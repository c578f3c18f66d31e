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

/// The parts of a block of samples that are read side by side.
const STREAMS: usize = 4;
/// The groups of 128 samples of each part.
const STREAM_GROUPS: usize = 32;
/// The shortest slice that is read in blocks, in samples: shorter ones are likely to be in a cache.
const MIN_STREAMED: usize = 3 * STREAMS * STREAM_GROUPS * 128;

/// The number of samples before the first one whose sign differs from sample 0's; all of them if none differs.
///
/// The result may be less than exact by up to 127, but never claims too much.
///
/// Long slices come from memory. They are read in four places at once: a processor's prefetcher stops at the end of a
/// page, and a single stream of reads waits for memory at each one. (256³ `f32` samples on a Xeon: 2.5 instead of 2.9
/// ms, and 5.1 instead of 7.1 ms beside other work.)
#[inline(always)]
pub(crate) fn uniform_prefix<S: Simd, W: Weight>(samples: &[W], threshold: W::Threshold) -> usize {
    let inside = samples[0].inside(threshold);
    let expected = if inside { u32::MAX } else { 0 };
    let streamed = if samples.len() >= MIN_STREAMED { uniform_blocks::<S, W>(samples, expected, threshold) } else { 0 };
    let (groups, rest) = samples[streamed..].as_chunks::<128>();
    for (index, group) in groups.iter().enumerate() {
        if different::<S, W>(group, expected, threshold) != 0 {
            return streamed + 128 * index;
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

/// The number of samples in the blocks before the first one with a sign that is not `expected`.
#[inline(always)]
fn uniform_blocks<S: Simd, W: Weight>(samples: &[W], expected: u32, threshold: W::Threshold) -> usize {
    let blocks = samples.as_chunks::<128>().0.as_chunks::<STREAM_GROUPS>().0.as_chunks::<STREAMS>().0;
    for (index, [a, b, c, d]) in blocks.iter().enumerate() {
        for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
            let ab = different::<S, W>(a, expected, threshold) | different::<S, W>(b, expected, threshold);
            let cd = different::<S, W>(c, expected, threshold) | different::<S, W>(d, expected, threshold);
            if ab | cd != 0 {
                return index * STREAMS * STREAM_GROUPS * 128;
            }
        }
    }
    blocks.len() * STREAMS * STREAM_GROUPS * 128
}

/// Not 0 if a sign in the group is not `expected`.
#[inline(always)]
fn different<S: Simd, W: Weight>(group: &[W; 128], expected: u32, threshold: W::Threshold) -> u32 {
    let mut different = 0;
    for weights in group.as_chunks::<32>().0 {
        different |= simd::below::<S, W>(weights, threshold) ^ expected;
    }
    different
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

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::{
        sample::private::Sealed,
        simd::{Backend, Job, dispatch},
    };

    struct Prefix<'a>(&'a [i8]);

    impl Job for Prefix<'_> {
        type Output = usize;

        #[inline(always)]
        fn run<S: Simd>(self) -> usize {
            uniform_prefix::<S, i8>(self.0, i8::threshold(0.0))
        }
    }

    #[test]
    fn prefixes_end_less_than_128_samples_before_the_first_other_sign() {
        for len in [1, 31, 32, 127, 128, 300, MIN_STREAMED - 1, MIN_STREAMED, MIN_STREAMED + 5000] {
            let mut samples = vec![1; len];
            assert_eq!(dispatch(Backend::fastest(), Prefix(&samples)), len);
            for first in [1, 127, 128, 4095, 4096, 16_383, 16_384, 20_000, 40_000, len / 2, len - 1] {
                if (1..len).contains(&first) {
                    samples[first] = -1;
                    let prefix = dispatch(Backend::fastest(), Prefix(&samples));
                    assert!(prefix <= first && first - prefix < 128, "{prefix} of {first} in {len}");
                    samples[first] = 1;
                }
            }
        }
    }
}
