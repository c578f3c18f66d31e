//! From bytes to planes of bits.

use crate::{
    bits::BitGrid,
    simd::{Job, Simd},
};

/// Materials that become planes, all of one shape.
pub(super) struct FillPlanes<'a> {
    /// As many as the planes have points.
    pub(super) materials: &'a [u8],
    pub(super) planes: &'a mut [BitGrid],
}

impl Job for FillPlanes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { materials, planes } = self;
        let (width, words) = (planes[0].shape.size()[0] as usize, planes[0].row);
        for (number, row) in materials.chunks_exact(width).enumerate() {
            for (index, group) in row.chunks(64).enumerate() {
                let mut bytes = [0; 64];
                bytes[..group.len()].copy_from_slice(group);
                for (k, plane) in planes.iter_mut().enumerate() {
                    plane.words[number * words + index] = bits::<S>(&bytes, k);
                }
            }
        }
    }
}

/// Bit `k` of each byte.
#[inline(always)]
fn bits<S: Simd>(bytes: &[u8; 64], k: usize) -> u64 {
    let mut word = 0;
    for (half, bytes) in bytes.as_chunks::<32>().0.iter().enumerate() {
        // Where it is the sign; what comes over from the byte below stays below that.
        let mut signs = [0; 32];
        for (signs, &eight) in signs.as_chunks_mut::<8>().0.iter_mut().zip(bytes.as_chunks::<8>().0) {
            let shifted = (u64::from_le_bytes(eight) << (7 - k)).to_le_bytes();
            for (sign, byte) in signs.iter_mut().zip(shifted) {
                *sign = byte.cast_signed();
            }
        }
        word |= u64::from(S::below_i8(&signs, 0)) << (32 * half);
    }
    word
}
