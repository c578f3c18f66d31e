//! SSE2: sixteen signs at a time and four counters at a time; the rest is the portable backend's.
#![expect(unsafe_code, reason = "vector loads take raw pointers")]

use core::{arch::x86_64::*, mem::MaybeUninit};

use super::{CODES, Recipe, Simd, portable::Portable};

pub(super) struct Sse2;

impl Simd for Sse2 {
    type Eight = [u64; 8];

    #[inline(always)]
    fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
        // SAFETY: SSE2 is available; both loads lie within the 32 weights.
        unsafe {
            let threshold = _mm_set1_epi8(threshold);
            let load = |index: usize| _mm_loadu_si128(weights.as_ptr().add(16 * index).cast());
            let half = |index| _mm_movemask_epi8(_mm_cmplt_epi8(load(index), threshold)) as u32;
            half(0) | half(1) << 16
        }
    }

    #[inline(always)]
    fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
        // SAFETY: SSE2 is available; all loads lie within the 32 weights.
        unsafe {
            let threshold = _mm_set1_epi16(threshold);
            let below =
                |index: usize| _mm_cmplt_epi16(_mm_loadu_si128(weights.as_ptr().add(8 * index).cast()), threshold);
            let half = |index| _mm_movemask_epi8(_mm_packs_epi16(below(index), below(index + 1))) as u32;
            half(0) | half(2) << 16
        }
    }

    #[inline(always)]
    fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
        // SAFETY: SSE2 is available; all loads lie within the 32 weights.
        unsafe {
            let threshold = _mm_set1_ps(threshold);
            let below =
                |index: usize| _mm_castps_si128(_mm_cmplt_ps(_mm_loadu_ps(weights.as_ptr().add(4 * index)), threshold));
            let eight = |index| _mm_packs_epi32(below(index), below(index + 1));
            let half = |index| _mm_movemask_epi8(_mm_packs_epi16(eight(index), eight(index + 2))) as u32;
            half(0) | half(4) << 16
        }
    }

    #[inline(always)]
    fn nonzero(words: &[u64]) -> u64 {
        Portable::nonzero(words)
    }

    #[inline(always)]
    fn positions(word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize {
        Portable::positions(word, base, row, positions, rows)
    }

    #[inline(always)]
    fn cases(corners: [u64; 8], active: u64, cases: &mut [u16; 64]) -> usize {
        Portable::cases(corners, active, cases)
    }

    #[inline(always)]
    fn triangles(
        recipes: &[Recipe; CODES],
        codes: &[u16],
        counters: &mut [u32; 8],
        indices: &mut [MaybeUninit<u32>],
    ) -> usize {
        assert!(indices.len() >= 16 * codes.len(), "16 indices are written for each code");
        let mut end = 0;
        // SAFETY: SSE2 is available. The loads and stores are halves of the counters, all of the eight steps, and
        // quarters of `vertices`. The 15 entries of a cell are less than 32. `end` grows by at most 15 per code, so the
        // 15 indices from it on lie within the asserted length.
        unsafe {
            let zero = _mm_setzero_si128();
            let mut x = _mm_loadu_si128(counters.as_ptr().cast());
            let mut low = _mm_loadu_si128(counters.as_ptr().add(4).cast());
            // Indexed by the five bits of an entry: where bit 3 is set, the high side, whatever bit 4 is.
            let mut vertices = [0u32; 32];
            for &code in codes {
                let recipe = &recipes[usize::from(code) % CODES];
                let steps = _mm_unpacklo_epi8(_mm_loadl_epi64(recipe.steps.as_ptr().cast()), zero);
                _mm_storeu_si128(vertices.as_mut_ptr().cast(), x);
                _mm_storeu_si128(vertices.as_mut_ptr().add(4).cast(), low);
                x = _mm_add_epi32(x, _mm_unpacklo_epi16(steps, zero));
                low = _mm_add_epi32(low, _mm_unpackhi_epi16(steps, zero));
                _mm_storeu_si128(vertices.as_mut_ptr().add(12).cast(), low);
                _mm_storeu_si128(vertices.as_mut_ptr().add(28).cast(), low);
                for (index, &vertex) in recipe.vertices[..15].iter().enumerate() {
                    indices.get_unchecked_mut(end + index).write(*vertices.get_unchecked(usize::from(vertex)));
                }
                end += usize::from(recipe.count);
            }
            _mm_storeu_si128(counters.as_mut_ptr().cast(), x);
            _mm_storeu_si128(counters.as_mut_ptr().add(4).cast(), low);
        }
        end
    }
}
