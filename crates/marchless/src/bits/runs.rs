//! Runs of set bits: finding them in rows, and the words that a run covers.

use alloc::vec::Vec;

use super::{BitGrid, set_bits};

/// The maximal runs of set bits of a grid's rows, in memory order.
#[derive(Clone, Debug)]
pub(super) struct Runs {
    /// The first x of each run and the x past its last.
    pub(super) spans: Vec<[u32; 2]>,
    /// The index of each row's first run; then the number of all runs.
    pub(super) starts: Vec<usize>,
}

impl Runs {
    /// The runs of a grid.
    pub(super) fn of(grid: &BitGrid) -> Self {
        let nx = grid.shape.size()[0];
        let mut spans = Vec::new();
        let mut starts = Vec::with_capacity(grid.words.len() / grid.row + 1);
        for row in grid.words.chunks_exact(grid.row) {
            starts.push(spans.len());
            let (mut open, mut start) = (0, 0);
            for (&word, base) in row.iter().zip((0..).step_by(64)) {
                // A run starts or ends, in turn, at each bit that differs from the one before it.
                for bit in set_bits(word ^ (word << 1 | open)) {
                    if word >> bit & 1 == 1 {
                        start = base + bit;
                    } else {
                        spans.push([start, base + bit]);
                    }
                }
                open = word >> 63;
            }
            if open == 1 {
                spans.push([start, nx]);
            }
        }
        starts.push(spans.len());
        Self { spans, starts }
    }
}

/// The words that hold the bits from `start` up to, but without, `end`: the index of each word, and a mask of the bits
/// in it. Nothing if `end` is not above `start`.
pub(super) fn span_words([start, end]: [u32; 2]) -> impl Iterator<Item = (usize, u64)> {
    let (first, behind) = if start < end { (start / 64, end.div_ceil(64)) } else { (0, 0) };
    (first..behind).map(move |index| {
        let low = if index == start / 64 { u64::MAX << (start % 64) } else { u64::MAX };
        let high = if index == end / 64 { !(u64::MAX << (end % 64)) } else { u64::MAX };
        (index as usize, low & high)
    })
}
