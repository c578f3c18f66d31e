//! One word for each word of a row, repeated over several rows.

use alloc::{vec, vec::Vec};

/// Words that fit without an allocation: enough for loops over them to run at full speed.
const INLINE: usize = 256;

/// What the words of one row are masked with, repeated: rows of a few words are too short for a loop of their own, so
/// that loops run over several rows as one stream of words, with this beside it.
pub(super) struct Pattern {
    inline: [u64; INLINE],
    /// In place of `inline` where one row alone is longer.
    long: Vec<u64>,
    len: usize,
}

impl Pattern {
    /// `word` of each of the `row` words of a row, over as many rows as fit, at most `rows`, which is not 0. The first
    /// is that of the word `start` of a row.
    pub(super) fn new(row: usize, rows: usize, start: usize, word: impl Fn(usize) -> u64) -> Self {
        let len = row * (INLINE / row).clamp(1, rows);
        let mut pattern = Self { inline: [0; INLINE], long: if len > INLINE { vec![0; len] } else { Vec::new() }, len };
        let words = if len > INLINE { &mut pattern.long[..] } else { &mut pattern.inline[..len] };
        let mut column = start;
        for out in words {
            *out = word(column);
            column = if column + 1 == row { 0 } else { column + 1 };
        }
        pattern
    }

    /// The words, a multiple of a row's.
    #[inline(always)]
    pub(super) fn words(&self) -> &[u64] {
        if self.len > INLINE { &self.long } else { &self.inline[..self.len] }
    }
}
