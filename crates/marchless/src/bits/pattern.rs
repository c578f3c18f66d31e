//! [`Pattern`]: the masks of one row's words, repeated over several rows.

use alloc::{vec, vec::Vec};

/// The number of words that fit without an allocation: enough for loops over them to run at full speed.
const INLINE: usize = 256;

/// The masks of one row's words, repeated over several rows.
///
/// A row of a few words is too short for a loop of its own. Loops go over several rows as one stream of words instead,
/// and over these masks beside it.
pub(super) struct Pattern {
    inline: [u64; INLINE],
    /// Used instead of `inline` if one row alone is longer.
    long: Vec<u64>,
    len: usize,
}

impl Pattern {
    /// The pattern of rows of `row` words. `word` returns the mask of each word of a row, and the first mask is that of
    /// word `start`. Repeats the row as often as it fits, at most `rows` times, which is not 0.
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

    /// The masks: those of one or more whole rows.
    #[inline(always)]
    pub(super) fn words(&self) -> &[u64] {
        if self.len > INLINE { &self.long } else { &self.inline[..self.len] }
    }
}
