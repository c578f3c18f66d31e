//! AVX2: signs 32 at a time, cases 32 at a time by comparing broadcast bits, indices eight at a time by a permutation.
#![expect(
    unsafe_code,
    reason = "the instructions exist only where the processor has them; loads and stores take raw pointers"
)]

use core::{arch::x86_64::*, mem::MaybeUninit};

use super::{CODES, Job, Simd, Tables, all, portable::Portable};

pub(super) fn is_available() -> bool {
    all!("avx2", "bmi1", "bmi2", "lzcnt", "popcnt")
}

/// # Safety
/// [`is_available`] must hold.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn run<J: Job>(job: J) -> J::Output {
    job.run::<Avx2>()
}

/// Used within [`run`] alone, so that the instructions are there.
pub(super) struct Avx2;

impl Simd for Avx2 {
    #[inline(always)]
    fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
        // SAFETY: within `run`; the load is all of the 32 weights.
        unsafe {
            let weights = _mm256_loadu_si256(weights.as_ptr().cast());
            _mm256_movemask_epi8(_mm256_cmpgt_epi8(_mm256_set1_epi8(threshold), weights)) as u32
        }
    }

    #[inline(always)]
    fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
        // SAFETY: within `run`; both loads lie within the 32 weights.
        unsafe {
            let threshold = _mm256_set1_epi16(threshold);
            let load = |index: usize| _mm256_loadu_si256(weights.as_ptr().add(16 * index).cast());
            let below = |index| _mm256_cmpgt_epi16(threshold, load(index));
            // Packing goes by halves of 128 bits; the permutation puts them back in order.
            let packed = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packs_epi16(below(0), below(1)));
            _mm256_movemask_epi8(packed) as u32
        }
    }

    #[inline(always)]
    fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
        // SAFETY: within `run`; all loads lie within the 32 weights.
        unsafe {
            let threshold = _mm256_set1_ps(threshold);
            let load = |index: usize| _mm256_loadu_ps(weights.as_ptr().add(8 * index));
            let below = |index| _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(load(index), threshold));
            let halves = [_mm256_packs_epi32(below(0), below(1)), _mm256_packs_epi32(below(2), below(3))];
            let order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
            let packed = _mm256_permutevar8x32_epi32(_mm256_packs_epi16(halves[0], halves[1]), order);
            _mm256_movemask_epi8(packed) as u32
        }
    }

    #[inline(always)]
    fn positions(word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize {
        Portable::positions(word, base, row, positions, rows)
    }

    #[inline(always)]
    fn cases(corners: [u64; 8], mut active: u64, cases: &mut [u16; 64]) -> usize {
        let count = active.count_ones() as usize;
        let mut dense = [0u8; 64];
        // SAFETY: within `run`; each store is one half of the 64 bytes.
        unsafe {
            let spread = _mm256_setr_epi64x(0, 0x0101_0101_0101_0101, 0x0202_0202_0202_0202, 0x0303_0303_0303_0303);
            let bit = _mm256_set1_epi64x(0x8040_2010_0804_0201u64 as i64);
            for half in 0..2 {
                if active >> (32 * half) as u32 == 0 {
                    continue;
                }
                let mut bytes = _mm256_setzero_si256();
                for (corner, signs) in corners.iter().enumerate() {
                    let signs = _mm256_shuffle_epi8(_mm256_set1_epi32((signs >> (32 * half)) as i32), spread);
                    let set = _mm256_cmpeq_epi8(_mm256_and_si256(signs, bit), bit);
                    bytes = _mm256_or_si256(bytes, _mm256_and_si256(set, _mm256_set1_epi8((1u8 << corner) as i8)));
                }
                _mm256_storeu_si256(dense.as_mut_ptr().add(32 * half).cast(), bytes);
            }
        }
        for case in cases {
            if active == 0 {
                break;
            }
            *case = u16::from(dense[active.trailing_zeros() as usize % 64]);
            active &= active - 1;
        }
        count
    }

    #[inline(always)]
    fn triangles(tables: &Tables, codes: &[u16], counters: &mut [u32; 8], indices: &mut [MaybeUninit<u32>]) -> usize {
        assert!(indices.len() >= 16 * codes.len(), "16 indices are written for each code");
        let mut end = 0;
        // SAFETY: within `run`; a code is below `CODES`, and `end` grows by 15 a code at most, so that the 16 indices from it on
        // lie within what was asserted.
        unsafe {
            let mut running = _mm256_loadu_si256(counters.as_ptr().cast());
            for &code in codes {
                let code = usize::from(code) % CODES;
                let row = tables.vertices[code].as_ptr();
                for half in 0..2 {
                    let vertices = _mm256_cvtepu8_epi32(_mm_loadl_epi64(row.add(8 * half).cast()));
                    // The permutation looks at bits 0 to 2 only.
                    let indices_of_half = _mm256_add_epi32(
                        _mm256_permutevar8x32_epi32(running, vertices),
                        _mm256_srli_epi32::<4>(vertices),
                    );
                    _mm256_storeu_si256(indices.as_mut_ptr().add(end + 8 * half).cast(), indices_of_half);
                }
                let steps = _mm256_cvtepu8_epi32(_mm_loadl_epi64(tables.steps[code].as_ptr().cast()));
                running = _mm256_add_epi32(running, steps);
                end += usize::from(tables.counts[code]);
            }
            _mm256_storeu_si256(counters.as_mut_ptr().cast(), running);
        }
        end
    }
}
