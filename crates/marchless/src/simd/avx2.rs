//! AVX2: 32 signs at a time, 32 cases at a time by comparing broadcast bits, eight indices at a time by a permutation.
#![expect(
    unsafe_code,
    reason = "the instructions exist only where the processor has them; loads and stores take raw pointers"
)]

use core::{arch::x86_64::*, mem::MaybeUninit};

use super::{CODES, Eight, Job, Recipe, Simd, all, portable::Portable};

pub(super) fn is_available() -> bool {
    all!("avx2", "bmi1", "bmi2", "lzcnt", "popcnt")
}

/// # Safety
/// [`is_available`] must hold.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn run<J: Job>(job: J) -> J::Output {
    job.run::<Avx2>()
}

/// The AVX2 backend. Only [`run`] uses it, so the instructions are available.
pub(super) struct Avx2;

/// Lanes 0–3 and 4–7. Only code within [`run`] uses them.
#[derive(Clone, Copy)]
pub(super) struct Words([__m256i; 2]);

impl Eight for Words {
    #[inline(always)]
    fn load(words: &[u64; 8]) -> Self {
        let (halves, _) = words.as_chunks::<4>();
        // SAFETY: within `run`; each load is one half of the words.
        Self(unsafe { [_mm256_loadu_si256(halves[0].as_ptr().cast()), _mm256_loadu_si256(halves[1].as_ptr().cast())] })
    }

    #[inline(always)]
    fn store(self, words: &mut [u64; 8]) {
        let (halves, _) = words.as_chunks_mut::<4>();
        for (half, words) in halves.iter_mut().zip(self.0) {
            // SAFETY: within `run`; each store is one half of the words.
            unsafe { _mm256_storeu_si256(half.as_mut_ptr().cast(), words) }
        }
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        // SAFETY: within `run`.
        Self(unsafe { [_mm256_or_si256(a, c), _mm256_or_si256(b, d)] })
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        // SAFETY: within `run`.
        Self(unsafe { [_mm256_xor_si256(a, c), _mm256_xor_si256(b, d)] })
    }

    #[inline(always)]
    fn window<const START: usize>(first: Self, second: Self) -> Self {
        let ([a, b], [c, d]) = (first.0, second.0);
        // SAFETY: within `run`.
        Self(unsafe {
            match START {
                1 => [one_on(a, b), one_on(b, c)],
                2 => [_mm256_permute2x128_si256::<0x21>(a, b), _mm256_permute2x128_si256::<0x21>(b, c)],
                4 => [b, c],
                6 => [_mm256_permute2x128_si256::<0x21>(b, c), _mm256_permute2x128_si256::<0x21>(c, d)],
                _ => [three_on(b, c), three_on(c, d)],
            }
        })
    }

    #[inline(always)]
    fn spread(self, sides: Self, from_low: Self, from_high: Self) -> Self {
        let [a, b] = sides.0;
        // SAFETY: within `run`.
        Self(unsafe {
            [
                spread(self.0[0], [three_on(a, a), a, one_on(a, b)], from_low.0[0], from_high.0[0]),
                spread(self.0[1], [three_on(a, b), b, one_on(b, b)], from_low.0[1], from_high.0[1]),
            ]
        })
    }
}

/// [`Eight::spread`] for half of the lanes. The array holds the sides in the lanes before these, in these and behind
/// these.
#[inline]
#[target_feature(enable = "avx2")]
fn spread(centre: __m256i, [below, here, above]: [__m256i; 3], from_low: __m256i, from_high: __m256i) -> __m256i {
    let low = _mm256_or_si256(_mm256_slli_epi64::<1>(here), _mm256_srli_epi64::<63>(below));
    let high = _mm256_or_si256(_mm256_srli_epi64::<1>(here), _mm256_slli_epi64::<63>(above));
    let (low, high) = (_mm256_and_si256(low, from_low), _mm256_and_si256(high, from_high));
    _mm256_or_si256(_mm256_or_si256(low, high), centre)
}

/// The lanes 1–4 of the eight lanes of both.
#[inline]
#[target_feature(enable = "avx2")]
fn one_on(first: __m256i, second: __m256i) -> __m256i {
    _mm256_permute4x64_epi64::<0b00_11_10_01>(_mm256_blend_epi32::<0b11>(first, second))
}

/// The lanes 3–6 of the eight lanes of both.
#[inline]
#[target_feature(enable = "avx2")]
fn three_on(first: __m256i, second: __m256i) -> __m256i {
    _mm256_permute4x64_epi64::<0b10_01_00_11>(_mm256_blend_epi32::<0b1100_0000>(second, first))
}

impl Simd for Avx2 {
    type Eight = Words;

    #[inline(always)]
    fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
        // SAFETY: within `run`.
        unsafe { below_i8(weights, threshold) }
    }

    #[inline(always)]
    fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
        // SAFETY: within `run`.
        unsafe { below_i16(weights, threshold) }
    }

    #[inline(always)]
    fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
        // SAFETY: within `run`.
        unsafe { below_f32(weights, threshold) }
    }

    #[inline(always)]
    fn nonzero(words: &[u64]) -> u64 {
        // SAFETY: within `run`.
        unsafe { nonzero(words) }
    }

    #[inline(always)]
    fn positions(word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize {
        Portable::positions(word, base, row, positions, rows)
    }

    #[inline(always)]
    fn cases(corners: [u64; 8], active: u64, cases: &mut [u16; 64]) -> usize {
        // SAFETY: within `run`.
        unsafe { self::cases(corners, active, cases) }
    }

    #[inline(always)]
    fn case_bytes(corners: [u64; 8]) -> [u8; 64] {
        let [a, b, c, d, e, f, g, h] = corners;
        // SAFETY: within `run`.
        unsafe { self::case_bytes(a, b, c, d, e, f, g, h) }
    }

    #[inline(always)]
    fn triangles(
        recipes: &[Recipe; CODES],
        codes: &[u16],
        counters: &mut [u32; 8],
        indices: &mut [MaybeUninit<u32>],
    ) -> usize {
        // SAFETY: within `run`.
        unsafe { self::triangles(recipes, codes, counters, indices) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
    // SAFETY: the load is all of the 32 weights.
    let weights = unsafe { _mm256_loadu_si256(weights.as_ptr().cast()) };
    _mm256_movemask_epi8(_mm256_cmpgt_epi8(_mm256_set1_epi8(threshold), weights)) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
    let threshold = _mm256_set1_epi16(threshold);
    let below = |half: &[i16]| {
        debug_assert_eq!(half.len(), 16);
        // SAFETY: the load is all of the 16 weights.
        _mm256_cmpgt_epi16(threshold, unsafe { _mm256_loadu_si256(half.as_ptr().cast()) })
    };
    // Packing works on halves of 128 bits; the permutation restores the order.
    let packed = _mm256_packs_epi16(below(&weights[..16]), below(&weights[16..]));
    _mm256_movemask_epi8(_mm256_permute4x64_epi64::<0b11_01_10_00>(packed)) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
    let threshold = _mm256_set1_ps(threshold);
    let below = |quarter: &[f32]| {
        debug_assert_eq!(quarter.len(), 8);
        // SAFETY: the load is all of the 8 weights.
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(unsafe { _mm256_loadu_ps(quarter.as_ptr()) }, threshold))
    };
    let low = _mm256_packs_epi32(below(&weights[..8]), below(&weights[8..16]));
    let high = _mm256_packs_epi32(below(&weights[16..24]), below(&weights[24..]));
    let order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    _mm256_movemask_epi8(_mm256_permutevar8x32_epi32(_mm256_packs_epi16(low, high), order)) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn nonzero(words: &[u64]) -> u64 {
    let mut nonzero = 0;
    for (index, four) in words.as_chunks::<4>().0.iter().enumerate() {
        // SAFETY: the load is all of the four words.
        let words = unsafe { _mm256_loadu_si256(four.as_ptr().cast()) };
        let zeros = _mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpeq_epi64(words, _mm256_setzero_si256())));
        nonzero |= ((zeros ^ 15) as u64) << (4 * index);
    }
    nonzero
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn cases(corners: [u64; 8], mut active: u64, cases: &mut [u16; 64]) -> usize {
    let count = active.count_ones() as usize;
    let mut dense = [0u8; 64];
    // Each byte of a half gets the byte that holds its bit, and keeps only the bit.
    let [a, b, c, d] = [0, 1, 2, 3].map(|byte| byte * 0x0101_0101_0101_0101);
    let (spread, bit) = (_mm256_setr_epi64x(a, b, c, d), _mm256_set1_epi64x(0x8040_2010_0804_0201u64 as i64));
    for (half, dense) in dense.as_chunks_mut::<32>().0.iter_mut().enumerate() {
        if active >> (32 * half) as u32 == 0 {
            continue;
        }
        let mut bytes = _mm256_setzero_si256();
        for (corner, signs) in corners.into_iter().enumerate() {
            let signs = _mm256_shuffle_epi8(_mm256_set1_epi32((signs >> (32 * half)) as i32), spread);
            let set = _mm256_cmpeq_epi8(_mm256_and_si256(signs, bit), bit);
            bytes = _mm256_or_si256(bytes, _mm256_and_si256(set, _mm256_set1_epi8((1u8 << corner) as i8)));
        }
        // SAFETY: the store is all of the 32 bytes.
        unsafe { _mm256_storeu_si256(dense.as_mut_ptr().cast(), bytes) }
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

/// The cases of 64 cells, as in the plain version but byte by byte first: each word then holds the corners of eight
/// cells.
///
/// It takes eight arguments because the compiler would load an array from memory, although its words are in registers.
#[inline]
#[target_feature(enable = "avx2")]
fn case_bytes(a: u64, b: u64, c: u64, d: u64, e: u64, f: u64, g: u64, h: u64) -> [u8; 64] {
    let even = _mm256_setr_epi64x(a as i64, c as i64, e as i64, g as i64);
    let odd = _mm256_setr_epi64x(b as i64, d as i64, f as i64, h as i64);
    // The bytes of two corners side by side, then those of four, then those of eight.
    let (low, high) = (_mm256_unpacklo_epi8(even, odd), _mm256_unpackhi_epi8(even, odd));
    let join = |fours| _mm256_shuffle_epi32::<0b11_01_10_00>(_mm256_permute4x64_epi64::<0b11_01_10_00>(fours));
    let halves = [join(_mm256_unpacklo_epi16(low, high)), join(_mm256_unpackhi_epi16(low, high))];
    let mut dense = [0; 64];
    for (half, dense) in halves.into_iter().zip(dense.as_chunks_mut::<32>().0) {
        let mut words = half;
        // Swap blocks of one, two and four bits across the diagonal.
        macro_rules! swap_blocks {
            ($shift:literal, $low:literal) => {
                let there = _mm256_srli_epi64::<$shift>(words);
                let change = _mm256_and_si256(_mm256_xor_si256(words, there), _mm256_set1_epi64x($low));
                words = _mm256_xor_si256(words, _mm256_xor_si256(change, _mm256_slli_epi64::<$shift>(change)));
            };
        }
        swap_blocks!(7, 0x00AA_00AA_00AA_00AA);
        swap_blocks!(14, 0x0000_CCCC_0000_CCCC);
        swap_blocks!(28, 0x0000_0000_F0F0_F0F0);
        // SAFETY: the store is all of the 32 bytes.
        unsafe { _mm256_storeu_si256(dense.as_mut_ptr().cast(), words) }
    }
    dense
}

#[inline]
#[target_feature(enable = "avx2")]
fn triangles(
    recipes: &[Recipe; CODES],
    codes: &[u16],
    counters: &mut [u32; 8],
    indices: &mut [MaybeUninit<u32>],
) -> usize {
    assert!(indices.len() >= 16 * codes.len(), "16 indices are written for each code");
    let mut end = 0;
    // SAFETY: the load is all of the counters.
    let mut running = unsafe { _mm256_loadu_si256(counters.as_ptr().cast()) };
    for &code in codes {
        let recipe = &recipes[usize::from(code) % CODES];
        for half in [0, 8] {
            // SAFETY: the load is half of the vertices. `end` grows by at most 15 per code, so the 16 indices from it
            // on lie within the asserted length.
            unsafe {
                let vertices = _mm256_cvtepu8_epi32(_mm_loadl_epi64(recipe.vertices.as_ptr().add(half).cast()));
                // The permutation uses bits 0 to 2 only.
                let first = _mm256_permutevar8x32_epi32(running, vertices);
                let indices_of_half = _mm256_add_epi32(first, _mm256_srli_epi32::<4>(vertices));
                _mm256_storeu_si256(indices.as_mut_ptr().add(end + half).cast(), indices_of_half);
            }
        }
        // SAFETY: the load is all of the eight steps.
        running =
            _mm256_add_epi32(running, _mm256_cvtepu8_epi32(unsafe { _mm_loadl_epi64(recipe.steps.as_ptr().cast()) }));
        end += usize::from(recipe.count);
    }
    // SAFETY: the store is all of the counters.
    unsafe { _mm256_storeu_si256(counters.as_mut_ptr().cast(), running) }
    end
}
