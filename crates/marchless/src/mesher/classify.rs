//! Pass 1: each sample's sign becomes one bit, a row at a time.

use alloc::vec::Vec;

use super::Layout;
use crate::{lattice::Samples, sample::Weight};

/// Fills `signs` with one bit a meshed sample, set where it is inside; unused bits of a row's last word are zero.
pub(super) fn classify<W: Weight>(
    samples: &Samples<'_, W>,
    layout: &Layout,
    threshold: W::Threshold,
    signs: &mut Vec<u64>,
) {
    signs.clear();
    signs.reserve(layout.rows() * layout.words);
    for z in 0..layout.size[2] {
        for y in 0..layout.size[1] {
            let row = &samples.weights()[layout.row_start(y, z)..][..layout.size[0]];
            signs.extend(row.chunks(64).map(|weights| sign_word(weights, threshold)));
        }
    }
}

/// The signs of up to 64 samples.
///
/// Each becomes a byte first, in a loop that the compiler turns into vector compares; one multiplication then
/// gathers the lowest bits of eight bytes.
#[inline(always)]
fn sign_word<W: Weight>(weights: &[W], threshold: W::Threshold) -> u64 {
    let mut bytes = [0u8; 64];
    for (byte, weight) in bytes.iter_mut().zip(weights) {
        *byte = u8::from(weight.inside(threshold));
    }
    let mut word = 0;
    for (index, &eight) in bytes.as_chunks::<8>().0[..weights.len().div_ceil(8)].iter().enumerate() {
        word |= (u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * index);
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::private::Sealed as _;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn words_equal_a_plain_loop(weights in proptest::collection::vec(any::<i16>(), 0..=64), isovalue in -129f32..129.0) {
            let plain = weights.iter().enumerate().fold(0, |word, (index, &weight)| {
                word | u64::from(f32::from(weight) / 256.0 < isovalue) << index
            });
            prop_assert_eq!(sign_word(&weights, i16::threshold(isovalue)), plain);
        }
    }
}
