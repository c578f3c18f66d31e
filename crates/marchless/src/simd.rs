//! Backends: the few steps of meshing for which a processor has better vector instructions than a compiler finds.
//!
//! There is one interface ([`Simd`]), one file per backend, and no `cfg(target_arch)` elsewhere. All code that is
//! generic over a backend is inlined into the functions that [`dispatch`] calls, which enable the instructions. So the
//! compiler vectorises the plain loops between these steps for the same processor. All backends give the same bits:
//! they use comparisons, copies, and operations that IEEE 754 rounds exactly, but no fused multiply-add and no
//! reciprocal estimates.
//!
//! Refused, with times for the signs of one row of 33 of 35 `i16` samples (AMD EPYC, Zen 4; 1.3 ns here with AVX2, 1.4
//! ns with AVX-512, 2.6 ns with SSE2):
//! - loops that the compiler vectorises: 3.5 ns, and no faster with AVX2 enabled;
//! - `wide`: 1.9 ns; it chooses its instructions at compile time, not at run time;
//! - `pulp`: 1.4 to 1.5 ns, but it has comparisons to bits and permutations only in its parts for single x86 levels;
//! - `fearless_simd`: 1.4 to 2.9 ns; as fast as this only where its `kernel!` leads to the same intrinsics, and it
//!   would serve for nothing else.

use core::{marker::PhantomData, mem::MaybeUninit};

use crate::cell::Face;
use crate::sample::Weight;
use crate::sample::private::{PerWeight, Sealed};

mod portable;
mod words;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod sse2;

pub(crate) use words::Words;

/// The instructions that meshing uses. All backends make the same meshes, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Backend {
    /// Words and plain loops; available on every machine.
    Portable,
    /// SSE2: every x86-64 target has it, except those without floating-point registers.
    Sse2,
    /// AVX2 with BMI1, BMI2, LZCNT and POPCNT: Intel since Haswell, AMD since Excavator.
    Avx2,
    /// AVX-512 F, BW, DQ, VL and VBMI2 on top of [`Backend::Avx2`]: Intel since Ice Lake, AMD since Zen 4.
    Avx512,
}

impl Backend {
    /// All backends, the slowest first.
    pub const ALL: &'static [Self] = &[Self::Portable, Self::Sse2, Self::Avx2, Self::Avx512];

    /// The short name of the backend, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Sse2 => "sse2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The fastest backend that is [available](Self::is_available).
    pub fn fastest() -> Self {
        Self::ALL.iter().rfind(|backend| backend.is_available()).copied().unwrap_or(Self::Portable)
    }

    /// True if the processor has these instructions. Without the feature `std`: true if the crate was compiled for
    /// them.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => cfg!(target_feature = "sse2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::is_available(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// `all!(NAME…)`: true if all these features can be used.
#[cfg(all(target_arch = "x86_64", feature = "std"))]
macro_rules! all {
    ($($feature:tt),*) => { true $(&& std::arch::is_x86_feature_detected!($feature))* };
}
#[cfg(all(target_arch = "x86_64", not(feature = "std")))]
macro_rules! all {
    ($($feature:tt),*) => { true $(&& cfg!(target_feature = $feature))* };
}
#[cfg(target_arch = "x86_64")]
use all;

/// Work that runs on a backend.
pub(crate) trait Job {
    type Output;
    /// Does the work. This function, and every function generic over `S` that it calls, must be `#[inline(always)]`.
    fn run<S: Simd>(self) -> Self::Output;
}

/// Runs `job` on `backend`, or on the portable one if that is not available.
pub(crate) fn dispatch<J: Job>(backend: Backend, job: J) -> J::Output {
    match backend {
        #[cfg(target_arch = "x86_64")]
        Backend::Sse2 if backend.is_available() => job.run::<sse2::Sse2>(),
        _ => dispatch_words(backend, job),
    }
}

/// [`dispatch`] for loops over words. It has no SSE2 version: the compiler finds all useful instructions there.
pub(crate) fn dispatch_words<J: Job>(backend: Backend, job: J) -> J::Output {
    match backend {
        #[cfg(target_arch = "x86_64")]
        Backend::Avx2 if backend.is_available() => {
            // SAFETY: the processor has the instructions.
            #[expect(unsafe_code, reason = "the one place where instructions are enabled")]
            unsafe {
                avx2::run(job)
            }
        }
        #[cfg(target_arch = "x86_64")]
        Backend::Avx512 if backend.is_available() => {
            // SAFETY: the processor has the instructions.
            #[expect(unsafe_code, reason = "the one place where instructions are enabled")]
            unsafe {
                avx512::run(job)
            }
        }
        _ => job.run::<portable::Portable>(),
    }
}

/// The steps that each backend implements. [`portable`] is the plain version; the tests compare the others with it.
pub(crate) trait Simd {
    /// The type of eight words in registers.
    type Eight: Eight;

    /// The weights below `threshold`, a bit each.
    fn below_i8(weights: &[i8; 32], threshold: i8) -> u32;
    /// The weights below `threshold`, a bit each.
    fn below_i16(weights: &[i16; 32], threshold: i16) -> u32;
    /// The weights below `threshold`, a bit each. NaN is not below.
    fn below_f32(weights: &[f32; 32], threshold: f32) -> u32;

    /// The nonzero words, a bit each. The number of words is a multiple of eight, at most 64.
    fn nonzero(words: &[u64]) -> u64;

    /// Writes `base` plus the number of each set bit of `word` to `positions`, lowest first, and `row` for each to
    /// `rows`. Returns the number of set bits. Items behind them may be overwritten.
    fn positions(word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize;

    /// Writes the case of each cell whose bit is set in `active` to `cases`, lowest first, and returns their number.
    /// Items behind them may be overwritten. Bit `x` of `corners[k]` is corner `k` of cell `x`.
    fn cases(corners: [u64; 8], active: u64, cases: &mut [u16; 64]) -> usize;

    /// The cases of 64 cells. Bit `x` of `corners[k]` is corner `k` of cell `x`.
    ///
    /// This is a transposition: 8 × 64 bits become 64 × 8, first within each byte of all eight words at once, then byte
    /// by byte. Each step swaps blocks on one side of the diagonal with those on the other.
    #[inline(always)]
    fn case_bytes(corners: [u64; 8]) -> [u8; 64] {
        // Written out, so that everything stays in registers.
        let words = swap_blocks::<4, 4>(corners, 0x0F0F_0F0F_0F0F_0F0F);
        let words = swap_blocks::<2, 2>(words, 0x3333_3333_3333_3333);
        let words = swap_blocks::<1, 1>(words, 0x5555_5555_5555_5555);
        let words = swap_blocks::<4, 32>(words, 0x0000_0000_FFFF_FFFF);
        let words = swap_blocks::<2, 16>(words, 0x0000_FFFF_0000_FFFF);
        let words = swap_blocks::<1, 8>(words, 0x00FF_00FF_00FF_00FF);
        let mut bytes = [0; 64];
        for (bytes, word) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(words) {
            *bytes = word.to_le_bytes();
        }
        bytes
    }

    /// The faces of a cell on which the product of the first and third corners' weights is larger than that of the
    /// second's and fourth's, and the faces on which it is smaller, a bit each. A face is in neither set if the larger
    /// product is infinite or one of them is NaN.
    #[inline(always)]
    fn larger_products(weights: &[f64; 8]) -> [u8; 2] {
        let (mut first_larger, mut second_larger, mut face) = (0, 0, 0);
        // Written so that the compiler unrolls it.
        while face < 6 {
            let [a, b, c, d] = FACE_CORNERS.map(|corners| corners[face] as usize);
            let (first, second) = (weights[a] * weights[c], weights[b] * weights[d]);
            first_larger |= u8::from((first > second) & (first < f64::INFINITY)) << face;
            second_larger |= u8::from((second > first) & (second < f64::INFINITY)) << face;
            face += 1;
        }
        [first_larger, second_larger]
    }

    /// Writes the triangles of cells, cell after cell. For each code its recipe makes 16 indices from the running
    /// `counters`; the next cell overwrites those behind [`Recipe::count`]. Returns the number of indices that are
    /// valid; all of them have been written.
    ///
    /// `indices` has at least 16 items per code.
    fn triangles(
        recipes: &[Recipe; CODES],
        codes: &[u16],
        counters: &mut [u32; 8],
        indices: &mut [MaybeUninit<u32>],
    ) -> usize;
}

/// The nonzero words among the first `count`, a bit each. Zeroes the words behind them up to a multiple of eight.
#[inline(always)]
pub(crate) fn nonzero_words<S: Simd>(words: &mut [u64; 64], count: usize) -> u64 {
    let len = count.next_multiple_of(8);
    words[count..len].fill(0);
    S::nonzero(&words[..len])
}

/// The samples of 32 that lie below the isovalue, a bit each.
#[inline(always)]
pub(crate) fn below<S: Simd, W: Weight>(weights: &[W; 32], threshold: W::Threshold) -> u32 {
    W::call::<Below<S>>((weights, threshold))
}

/// [`below`], by type of weight.
struct Below<S>(PhantomData<S>);

impl<S: Simd> PerWeight for Below<S> {
    type Arguments<'a, W: Sealed> = (&'a [W; 32], W::Threshold);
    type Output = u32;

    #[inline(always)]
    fn of_i8((weights, (threshold, all)): (&[i8; 32], (i8, bool))) -> u32 {
        S::below_i8(weights, threshold) | if all { u32::MAX } else { 0 }
    }

    #[inline(always)]
    fn of_i16((weights, (threshold, all)): (&[i16; 32], (i16, bool))) -> u32 {
        S::below_i16(weights, threshold) | if all { u32::MAX } else { 0 }
    }

    #[inline(always)]
    fn of_f32((weights, threshold): (&[f32; 32], f32)) -> u32 {
        S::below_f32(weights, threshold)
    }
}

/// Swaps the high part of each word with the low part of the word `APART` behind it. `low` selects the low part; the
/// high part lies `SHIFT` bits above.
#[inline(always)]
fn swap_blocks<const APART: usize, const SHIFT: u32>(words: [u64; 8], low: u64) -> [u64; 8] {
    core::array::from_fn(|index| {
        let (first, second) = (words[index & !APART], words[index | APART]);
        let change = (first >> SHIFT ^ second) & low;
        if index & APART == 0 { first ^ change << SHIFT } else { second ^ change }
    })
}

/// Eight words that are processed at once, in lanes 0–7. They are for loops that carry words from one step to the next:
/// the compiler does not vectorise those.
pub(crate) trait Eight: Copy {
    fn load(words: &[u64; 8]) -> Self;
    fn store(self, words: &mut [u64; 8]);

    fn or(self, other: Self) -> Self;
    fn xor(self, other: Self) -> Self;

    /// The lanes `START` to `START + 7` of the sixteen lanes of both. `START`: 1, 2, 4, 6 or 7.
    fn window<const START: usize>(first: Self, second: Self) -> Self;

    /// The union of each bit with its neighbours in `sides`: with the one below where `from_low` is set, and with the
    /// one above where `from_high` is set. The lanes are one row of bits, the lowest bit of lane 0 first. The results
    /// in the row's first and last bit have no meaning.
    fn spread(self, sides: Self, from_low: Self, from_high: Self) -> Self;
}

/// The first, second, third and fourth corner of each face, in order around it. The two faces that fill up the eight
/// lanes have equal products.
const FACE_CORNERS: [[u64; 8]; 4] = {
    let (mut corners, mut face) = ([[0; 8]; 4], 0);
    while face < 6 {
        let mut corner = 0;
        while corner < 4 {
            corners[corner][face] = Face::ALL[face].corners()[corner].index() as u64;
            corner += 1;
        }
        face += 1;
    }
    corners
};

/// The number of codes of cells. It is a power of two, so that a masked code needs no bounds check.
pub(crate) const CODES: usize = 1024;

/// The triangles that a code adds to the mesh, in half a cache line. `mesher/primal/triangles.rs` derives the recipes.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Recipe {
    /// The source of each of up to 15 indices: bits 0–2 name the counter, bit 3 is set if the vertex lies on the high
    /// side of the cell, bit 4 if it is the one behind the counter's.
    pub vertices: [u8; 16],
    /// The steps that the cell advances each counter by: 0 or 1.
    pub steps: [u8; 8],
    /// The number of indices, 0–15.
    pub count: u8,
}
