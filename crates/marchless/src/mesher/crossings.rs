//! Pass 2: which edges the surface crosses, counted a word at a time.

use alloc::vec::Vec;

use super::{Layout, shifted};

/// The vertices of one row of samples: those on its edges along x, then y, then z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// The index of the row's first vertex on an edge along x, y and z.
    pub(super) first: [u32; 3],
    empty: bool,
}

impl Row {
    /// Whether no edge that starts in the row is crossed.
    pub(super) const fn is_empty(&self) -> bool {
        self.empty
    }
}

/// The crossing words of one row: bit x is set where the edge from sample x to its +x, +y or +z neighbour is crossed.
pub(super) struct RowCrossings<'a> {
    layout: &'a Layout,
    row: &'a [u64],
    /// The next rows along y and z; the row itself (no crossings) at the border.
    next: [&'a [u64]; 2],
}

impl<'a> RowCrossings<'a> {
    #[inline(always)]
    pub(super) fn new(layout: &'a Layout, signs: &'a [u64], y: usize, z: usize) -> Self {
        let index = y + z * layout.size[1];
        let next_y = if y + 1 < layout.size[1] { index + 1 } else { index };
        let next_z = if z + 1 < layout.size[2] { index + layout.size[1] } else { index };
        Self { layout, row: layout.row(signs, index), next: [layout.row(signs, next_y), layout.row(signs, next_z)] }
    }

    /// The signs of word `word`.
    #[inline(always)]
    pub(super) fn signs(&self, word: usize) -> u64 {
        self.row[word]
    }

    /// The crossings of word `word` on edges along x, y and z.
    #[inline(always)]
    pub(super) fn word(&self, word: usize) -> [u64; 3] {
        let signs = self.row[word];
        [
            (signs ^ shifted(self.row, word)) & self.layout.x_edges(word),
            signs ^ self.next[0][word],
            signs ^ self.next[1][word],
        ]
    }
}

/// Fills `rows` with the first vertex of each and returns how many vertices there are.
pub(super) fn count(layout: &Layout, signs: &[u64], rows: &mut Vec<Row>) -> u64 {
    rows.clear();
    rows.reserve(layout.rows());
    let mut total = 0u64;
    for z in 0..layout.size[2] {
        for y in 0..layout.size[1] {
            let crossings = RowCrossings::new(layout, signs, y, z);
            let mut counts = [0; 3];
            for word in 0..layout.words {
                for (count, crossed) in counts.iter_mut().zip(crossings.word(word)) {
                    *count += u64::from(crossed.count_ones());
                }
            }
            // Truncation does no harm: a total beyond `u32` is refused before the rows are read.
            let [x, y, z] = counts;
            let first = [total as u32, (total + x) as u32, (total + x + y) as u32];
            rows.push(Row { first, empty: x + y + z == 0 });
            total += x + y + z;
        }
    }
    total
}
