//! AVX-512: signs by mask compares, lists by compression, indices sixteen at a time by a permutation.
#![expect(
    unsafe_code,
    reason = "the instructions exist only where the processor has them; loads and stores take raw pointers"
)]

use core::{arch::x86_64::*, mem::MaybeUninit};

use super::{CODES, Eight, FACE_CORNERS, Job, Recipe, Simd, all};

pub(super) fn is_available() -> bool {
    all!("avx512f", "avx512bw", "avx512dq", "avx512vl", "avx512vbmi2", "bmi1", "bmi2", "lzcnt", "popcnt")
}

/// # Safety
/// [`is_available`] must hold.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn run<J: Job>(job: J) -> J::Output {
    job.run::<Avx512>()
}

/// The AVX-512 backend. Only [`run`] uses it, so the instructions are available.
pub(super) struct Avx512;

impl Simd for Avx512 {
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
        // SAFETY: within `run`.
        unsafe { self::positions(word, base, row, positions, rows) }
    }

    #[inline(always)]
    fn cases(corners: [u64; 8], active: u64, cases: &mut [u16; 64]) -> usize {
        // SAFETY: within `run`.
        unsafe { self::cases(corners, active, cases) }
    }

    #[inline(always)]
    fn case_bytes(corners: [u64; 8]) -> [u8; 64] {
        // SAFETY: within `run`.
        unsafe { self::case_bytes(corners) }
    }

    #[inline(always)]
    fn larger_products(weights: &[f64; 8]) -> [u8; 2] {
        // SAFETY: within `run`.
        unsafe { self::larger_products(weights) }
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

/// Lanes 0–7. Only code within [`run`] uses them.
#[derive(Clone, Copy)]
pub(super) struct Words(__m512i);

impl Eight for Words {
    #[inline(always)]
    fn load(words: &[u64; 8]) -> Self {
        // SAFETY: within `run`; the load is all of the eight words.
        Self(unsafe { _mm512_loadu_si512(words.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, words: &mut [u64; 8]) {
        // SAFETY: within `run`; the store is all of the eight words.
        unsafe { _mm512_storeu_si512(words.as_mut_ptr().cast(), self.0) }
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: within `run`.
        Self(unsafe { _mm512_or_si512(self.0, other.0) })
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        // SAFETY: within `run`.
        Self(unsafe { _mm512_xor_si512(self.0, other.0) })
    }

    #[inline(always)]
    fn window<const START: usize>(first: Self, second: Self) -> Self {
        // SAFETY: within `run`.
        Self(unsafe {
            match START {
                1 => _mm512_alignr_epi64::<1>(second.0, first.0),
                2 => _mm512_alignr_epi64::<2>(second.0, first.0),
                4 => _mm512_alignr_epi64::<4>(second.0, first.0),
                6 => _mm512_alignr_epi64::<6>(second.0, first.0),
                _ => _mm512_alignr_epi64::<7>(second.0, first.0),
            }
        })
    }

    #[inline(always)]
    fn spread(self, sides: Self, from_low: Self, from_high: Self) -> Self {
        // SAFETY: within `run`.
        Self(unsafe {
            let low = _mm512_shldi_epi64::<1>(sides.0, _mm512_alignr_epi64::<7>(sides.0, sides.0));
            let high = _mm512_shrdi_epi64::<1>(sides.0, _mm512_alignr_epi64::<1>(sides.0, sides.0));
            let (low, high) = (_mm512_and_si512(low, from_low.0), _mm512_and_si512(high, from_high.0));
            _mm512_or_si512(_mm512_or_si512(low, high), self.0)
        })
    }
}

/// The bytes 0 to 63.
static COUNTING: [u8; 64] = {
    let (mut bytes, mut index) = ([0; 64], 0);
    while index < 64 {
        bytes[index] = index as u8;
        index += 1;
    }
    bytes
};

#[inline]
#[target_feature(enable = "avx512bw,avx512vl")]
fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
    // SAFETY: the load is all of the 32 weights.
    let weights = unsafe { _mm256_loadu_si256(weights.as_ptr().cast()) };
    _mm256_cmplt_epi8_mask(weights, _mm256_set1_epi8(threshold))
}

#[inline]
#[target_feature(enable = "avx512bw")]
fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
    // SAFETY: the load is all of the 32 weights.
    let weights = unsafe { _mm512_loadu_si512(weights.as_ptr().cast()) };
    _mm512_cmplt_epi16_mask(weights, _mm512_set1_epi16(threshold))
}

#[inline]
#[target_feature(enable = "avx512f")]
fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
    let threshold = _mm512_set1_ps(threshold);
    let below = |half: &[f32]| {
        debug_assert_eq!(half.len(), 16);
        // SAFETY: the load is all of the 16 weights.
        u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(unsafe { _mm512_loadu_ps(half.as_ptr()) }, threshold))
    };
    below(&weights[..16]) | below(&weights[16..]) << 16
}

#[inline]
#[target_feature(enable = "avx512f")]
fn nonzero(words: &[u64]) -> u64 {
    let mut nonzero = 0;
    for (index, eight) in words.as_chunks::<8>().0.iter().enumerate() {
        // SAFETY: the load is all of the eight words.
        let words = unsafe { _mm512_loadu_si512(eight.as_ptr().cast()) };
        nonzero |= u64::from(_mm512_test_epi64_mask(words, words)) << (8 * index);
    }
    nonzero
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,popcnt")]
fn positions(word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize {
    let count = word.count_ones() as usize;
    // SAFETY: the load is all of the 64 bytes.
    let bits = _mm512_maskz_compress_epi8(word, unsafe { _mm512_loadu_si512(COUNTING.as_ptr().cast()) });
    let (base, row) = (_mm512_set1_epi32(base as i32), _mm512_set1_epi32(row as i32));
    let mut store = |quarter: usize, bits: __m128i| {
        let quarter_of_positions = _mm512_add_epi32(base, _mm512_cvtepu8_epi32(bits));
        // SAFETY: each store is one quarter of the 64 positions or rows.
        unsafe {
            _mm512_storeu_si512(positions[16 * quarter..].as_mut_ptr().cast(), quarter_of_positions);
            _mm512_storeu_si512(rows[16 * quarter..].as_mut_ptr().cast(), row);
        }
    };
    store(0, _mm512_castsi512_si128(bits));
    if count > 16 {
        store(1, _mm512_extracti32x4_epi32::<1>(bits));
    }
    if count > 32 {
        store(2, _mm512_extracti32x4_epi32::<2>(bits));
        store(3, _mm512_extracti32x4_epi32::<3>(bits));
    }
    count
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,popcnt")]
fn cases(corners: [u64; 8], active: u64, cases: &mut [u16; 64]) -> usize {
    let count = active.count_ones() as usize;
    let mut bytes = _mm512_setzero_si512();
    for (corner, signs) in corners.into_iter().enumerate() {
        bytes = _mm512_mask_add_epi8(bytes, signs, bytes, _mm512_set1_epi8((1u8 << corner) as i8));
    }
    let bytes = _mm512_maskz_compress_epi8(active, bytes);
    let low = _mm512_cvtepu8_epi16(_mm512_castsi512_si256(bytes));
    // SAFETY: the store is one half of the 64 cases.
    unsafe { _mm512_storeu_si512(cases[..32].as_mut_ptr().cast(), low) }
    if count > 32 {
        let high = _mm512_cvtepu8_epi16(_mm512_extracti64x4_epi64::<1>(bytes));
        // SAFETY: the store is the other half.
        unsafe { _mm512_storeu_si512(cases[32..].as_mut_ptr().cast(), high) }
    }
    count
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn case_bytes(corners: [u64; 8]) -> [u8; 64] {
    let (mut dense, mut bytes) = ([0; 64], _mm512_setzero_si512());
    for (corner, signs) in corners.into_iter().enumerate() {
        bytes = _mm512_mask_add_epi8(bytes, signs, bytes, _mm512_set1_epi8((1u8 << corner) as i8));
    }
    // SAFETY: the store is all of the 64 bytes.
    unsafe { _mm512_storeu_si512(dense.as_mut_ptr().cast(), bytes) }
    dense
}

#[inline]
#[target_feature(enable = "avx512f")]
fn larger_products(weights: &[f64; 8]) -> [u8; 2] {
    // SAFETY: the loads are all of the eight weights, and of the eight faces' corners.
    let [a, b, c, d] = unsafe {
        let weights = _mm512_loadu_pd(weights.as_ptr());
        FACE_CORNERS
            .each_ref()
            .map(|of_faces| _mm512_permutexvar_pd(_mm512_loadu_si512(of_faces.as_ptr().cast()), weights))
    };
    let (first, second) = (_mm512_mul_pd(a, c), _mm512_mul_pd(b, d));
    let is_larger = |product, other| {
        let is_finite = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(product, _mm512_set1_pd(f64::INFINITY));
        _mm512_mask_cmp_pd_mask::<_CMP_GT_OQ>(is_finite, product, other)
    };
    [is_larger(first, second), is_larger(second, first)]
}

#[inline]
#[target_feature(enable = "avx512f")]
fn triangles(
    recipes: &[Recipe; CODES],
    codes: &[u16],
    counters: &mut [u32; 8],
    indices: &mut [MaybeUninit<u32>],
) -> usize {
    assert!(indices.len() >= 16 * codes.len(), "16 indices are written for each code");
    let mut end = 0;
    // Both halves hold the counters, so that bit 3 of a lane's number makes no difference.
    // SAFETY: the load is all of the counters.
    let mut running = _mm512_broadcast_i64x4(unsafe { _mm256_loadu_si256(counters.as_ptr().cast()) });
    for &code in codes {
        let recipe = &recipes[usize::from(code) % CODES];
        // SAFETY: the loads are all of the vertices and all of the eight steps. `end` grows by at most 15 per code, so
        // the 16 indices from it on lie within the asserted length.
        unsafe {
            let vertices = _mm512_cvtepu8_epi32(_mm_loadu_si128(recipe.vertices.as_ptr().cast()));
            let first = _mm512_permutexvar_epi32(vertices, running);
            let indices_of_cell = _mm512_add_epi32(first, _mm512_srli_epi32::<4>(vertices));
            _mm512_storeu_si512(indices.as_mut_ptr().add(end).cast(), indices_of_cell);
            let steps = _mm_loadl_epi64(recipe.steps.as_ptr().cast());
            running = _mm512_add_epi32(running, _mm512_cvtepu8_epi32(_mm_unpacklo_epi64(steps, steps)));
        }
        end += usize::from(recipe.count);
    }
    // SAFETY: the store is all of the counters.
    unsafe { _mm256_storeu_si256(counters.as_mut_ptr().cast(), _mm512_castsi512_si256(running)) }
    end
}
