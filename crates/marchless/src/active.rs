//! The active cells between two slabs: the second layer that all meshers share.
//!
//! A cell is active if the signs of its corners differ. Word operations find the active cells of 64 cells at once. Each
//! active cell gets a code. Behind a row whose last samples' signs differ comes a code that stands for no cell, so that
//! counters of crossings can run on from row to row.

use alloc::vec::Vec;

use crate::{
    signs::{SlabLayout, SlabSigns},
    simd::{Simd, nonzero_words},
};

/// Codes below this one are the cases of active cells; codes from it on end a row.
///
/// A row's end stands for the crossings on its last samples, those in both slabs and in the next row. Its code is
/// `ROW_END` plus the case of a cell whose high side along x repeats these samples.
pub(crate) const ROW_END: u16 = 256;

/// The first code that [`ActiveCells::fill`] never writes. Meshers may give it and those behind it meanings of their
/// own.
pub(crate) const FIRST_FREE_CODE: u16 = 512;

/// Words of cells that are searched together.
const WORDS: usize = 64;

/// The codes of the active cells between two slabs, in order, x fastest.
#[derive(Clone, Debug)]
pub(crate) struct ActiveCells {
    /// The first `count` are in use.
    codes: Vec<u16>,
    count: usize,
    /// Scratch memory for some words of cells: the active cells, the listed cells, and the index of each word's first
    /// code. It is kept here because zeroing it on every call would take time.
    active: [u64; WORDS],
    listed: [u64; WORDS],
    first_codes: [usize; WORDS],
}

/// A list of some active cells, such as those whose weights a mesher has to look at.
pub(crate) trait CellList {
    /// The bits of the cells that belong on the list; all of them are active. Bit `x` of `corners[k]` is corner `k` of
    /// cell `x`.
    fn select(corners: [u64; 8]) -> u64;

    /// Appends a cell. `lowest_corner`: the index of its lowest corner in its slab. `code`: the index of its code.
    fn push(&mut self, lowest_corner: usize, code: u32);
}

impl ActiveCells {
    pub(crate) const fn new() -> Self {
        Self { codes: Vec::new(), count: 0, active: [0; WORDS], listed: [0; WORDS], first_codes: [0; WORDS] }
    }

    pub(crate) fn codes_mut(&mut self) -> &mut [u16] {
        &mut self.codes[..self.count]
    }

    /// Finds the active cells between the slabs `low` and `high`, row by row, and those of them that belong on `list`.
    #[inline(always)]
    pub(crate) fn fill<S: Simd, L: CellList>(
        &mut self,
        layout: &SlabLayout,
        low: &SlabSigns,
        high: &SlabSigns,
        mut list: Option<&mut L>,
    ) {
        let words = layout.words;
        let last_bit = layout.last_sample();
        let Self { active, listed, first_codes, .. } = self;
        let cells = words * (layout.size[1] - 1);
        let mut found = 0;
        for start in (0..cells).step_by(WORDS) {
            let count = (cells - start).min(WORDS);
            let [a, b, c, d, e, f, g, h] = corner_words(low, high, start, count, words);
            if list.is_some() {
                // One loop for both, so that the corners are loaded once.
                for i in 0..count {
                    let corners = [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]];
                    (active[i], listed[i]) = (active_cells(corners), L::select(corners));
                }
            } else {
                for i in 0..count {
                    active[i] = active_cells([a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]]);
                }
            }
            let ends_row = |i: usize| words == 1 || (start + i + 1).is_multiple_of(words);
            if self.codes.len() < found + 64 * count {
                self.codes.resize(found + 64 * count, 0);
            }
            let codes = &mut self.codes[..];
            let mut nonzero = nonzero_words::<S>(active, count);
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                first_codes[i % WORDS] = found;
                let corners = [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]];
                let codes = codes[found..].first_chunk_mut().expect("another word's codes fit");
                let added = S::cases(corners, active[i % WORDS], codes);
                codes[(added - 1) % 64] += if ends_row(i) && active[i % WORDS] & last_bit != 0 { ROW_END } else { 0 };
                found += added;
            }
            let Some(list) = &mut list else { continue };
            let mut nonzero = nonzero_words::<S>(listed, count);
            while nonzero != 0 {
                let i = nonzero.trailing_zeros() as usize;
                nonzero &= nonzero - 1;
                // The bit of a row's last sample is no cell.
                let mut bits = listed[i % WORDS] & if ends_row(i) { !last_bit } else { u64::MAX };
                let (y, x) = layout.word_position(start + i);
                let index = layout.index(x, y);
                while bits != 0 {
                    let below = bits ^ (bits - 1);
                    let code = first_codes[i % WORDS] + (active[i % WORDS] & below >> 1).count_ones() as usize;
                    list.push(index + bits.trailing_zeros() as usize, code as u32);
                    bits &= bits - 1;
                }
            }
        }
        self.count = found;
    }
}

/// The bits of the active cells. Bit `x` of `corners[k]` is corner `k` of cell `x`.
#[inline(always)]
pub(crate) const fn active_cells([a, b, c, d, e, f, g, h]: [u64; 8]) -> u64 {
    (a | b | c | d | e | f | g | h) & !(a & b & c & d & e & f & g & h)
}

/// The signs of the eight corners of `count` words of cells from word `start` on.
#[inline(always)]
pub(crate) fn corner_words<'a>(
    low: &'a SlabSigns,
    high: &'a SlabSigns,
    start: usize,
    count: usize,
    words: usize,
) -> [&'a [u64]; 8] {
    let [a, c] = row_words(low.signs(), start, count, words);
    let [b, d] = row_words(low.next(), start, count, words);
    let [e, g] = row_words(high.signs(), start, count, words);
    let [f, h] = row_words(high.next(), start, count, words);
    [a, b, c, d, e, f, g, h]
}

/// `count` words from word `start` on, and the words above them in the next row.
#[inline(always)]
fn row_words(signs: &[u64], start: usize, count: usize, words: usize) -> [&[u64]; 2] {
    [&signs[start..][..count], &signs[start + words..][..count]]
}
