//! Splits materials, one byte per point, into planes of bits.

use crate::{
    bits::BitGrid,
    simd::{Job, Simd},
};

/// The job that writes materials to planes.
pub(super) struct FillPlanes<'a> {
    /// One for each point of a plane.
    pub(super) materials: &'a [u8],
    /// All of one shape.
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
        // The shift makes the bit its byte's sign. Bits that come over from the byte below stay below the sign.
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
