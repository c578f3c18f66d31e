//! Words and plain loops: the oracle of the other backends, and the backend of machines without them.

use core::{array::from_fn, mem::MaybeUninit};

use super::{CODES, Eight, Recipe, Simd};

pub(super) struct Portable;

impl Simd for Portable {
    type Eight = [u64; 8];

    #[inline(always)]
    fn below_i8(weights: &[i8; 32], threshold: i8) -> u32 {
        below(weights, threshold)
    }

    #[inline(always)]
    fn below_i16(weights: &[i16; 32], threshold: i16) -> u32 {
        below(weights, threshold)
    }

    #[inline(always)]
    fn below_f32(weights: &[f32; 32], threshold: f32) -> u32 {
        below(weights, threshold)
    }

    #[inline(always)]
    fn nonzero(words: &[u64]) -> u64 {
        words.iter().enumerate().fold(0, |nonzero, (index, &word)| nonzero | u64::from(word != 0) << index)
    }

    #[inline(always)]
    fn positions(mut word: u64, base: u32, row: u32, positions: &mut [u32; 64], rows: &mut [u32; 64]) -> usize {
        let count = word.count_ones() as usize;
        for (position, at) in positions.iter_mut().zip(rows) {
            if word == 0 {
                break;
            }
            (*position, *at) = (base + word.trailing_zeros(), row);
            word &= word - 1;
        }
        count
    }

    #[inline(always)]
    fn cases(corners: [u64; 8], mut active: u64, cases: &mut [u16; 64]) -> usize {
        let count = active.count_ones() as usize;
        for case in cases {
            if active == 0 {
                break;
            }
            let x = active.trailing_zeros();
            *case = (0..8).map(|corner| ((corners[corner] >> x & 1) as u16) << corner).sum();
            active &= active - 1;
        }
        count
    }

    #[inline(always)]
    fn triangles(
        recipes: &[Recipe; CODES],
        codes: &[u16],
        counters: &mut [u32; 8],
        indices: &mut [MaybeUninit<u32>],
    ) -> usize {
        let (mut end, mut running) = (0, *counters);
        for &code in codes {
            let recipe = &recipes[usize::from(code) % CODES];
            let [a, b, c, d, e, f, g, h] = running;
            for (counter, step) in running.iter_mut().zip(recipe.steps) {
                *counter = counter.wrapping_add(step.into());
            }
            let [.., high_e, high_f, high_g, high_h] = running;
            let vertices = [a, b, c, d, e, f, g, h, 0, 0, 0, 0, high_e, high_f, high_g, high_h];
            for (index, vertex) in indices[end..end + 16].iter_mut().zip(recipe.vertices) {
                index.write(vertices[usize::from(vertex) % 16]);
            }
            end += usize::from(recipe.count);
        }
        *counters = running;
        end
    }
}

impl Eight for [u64; 8] {
    #[inline(always)]
    fn load(words: &[u64; 8]) -> Self {
        *words
    }

    #[inline(always)]
    fn store(self, words: &mut [u64; 8]) {
        *words = self;
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        from_fn(|lane| self[lane] | other[lane])
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        from_fn(|lane| self[lane] ^ other[lane])
    }

    #[inline(always)]
    fn window<const START: usize>(first: Self, second: Self) -> Self {
        from_fn(|lane| if lane + START < 8 { first[lane + START] } else { second[(lane + START) % 8] })
    }

    #[inline(always)]
    fn spread(self, sides: Self, from_low: Self, from_high: Self) -> Self {
        from_fn(|lane| {
            let low = sides[lane] << 1 | sides[(lane + 7) % 8] >> 63;
            let high = sides[lane] >> 1 | sides[(lane + 1) % 8] << 63;
            self[lane] | low & from_low[lane] | high & from_high[lane]
        })
    }
}

/// The weights below `threshold`, a bit each.
///
/// Each comparison first becomes a byte, in a loop that the compiler vectorises. One multiplication then gathers the
/// lowest bits of eight bytes.
#[inline(always)]
fn below<W: Copy + PartialOrd>(weights: &[W; 32], threshold: W) -> u32 {
    let mut bytes = [0u8; 32];
    for (byte, &weight) in bytes.iter_mut().zip(weights) {
        *byte = u8::from(weight < threshold);
    }
    let [a, b, c, d] = [0, 1, 2, 3].map(|eight| {
        (u64::from_le_bytes(bytes.as_chunks::<8>().0[eight]).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
    });
    a | b << 8 | c << 16 | d << 24
}
