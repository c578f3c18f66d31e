//! Pass 4: the triangles of each active cell, with vertex indices from running counters.

use alloc::vec::Vec;

use super::{Layout, crossings::Row, set_bits};
use crate::cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES};

/// Room for the indices of any cell's triangles.
const MOST: usize = 15;

/// Fills `indices`, cell by cell, x fastest.
pub(super) fn join(layout: &Layout, signs: &[u64], rows: &[Row], indices: &mut Vec<u32>) {
    let mut end = 0;
    for z in 0..layout.size[2] - 1 {
        for y in 0..layout.size[1] - 1 {
            let low = y + z * layout.size[1];
            let high = low + layout.size[1];
            // Then all four rows are alike, and all of one sign.
            if rows[low].is_empty() && rows[low + 1].is_empty() {
                continue;
            }
            let signs = [low, low + 1, high, high + 1].map(|row| layout.row(signs, row));
            let next = NextVertex::new([&rows[low], &rows[low + 1], &rows[high], &rows[high + 1]]);
            end = join_row(layout, signs, next, indices, end);
        }
    }
    indices.truncate(end);
}

/// Writes the triangles of one row of cells from `indices[end]` on and returns where they end. `signs`: the rows of samples at
/// `[y, z]`, `[y + 1, z]`, `[y, z + 1]` and `[y + 1, z + 1]`.
#[inline(always)]
fn join_row(
    layout: &Layout,
    signs: [&[u64]; 4],
    mut next: NextVertex,
    indices: &mut Vec<u32>,
    mut end: usize,
) -> usize {
    let cells = layout.size[0] - 1;
    // In groups of 32 cells, whose 33 signs fit a word.
    for group in 0..cells.div_ceil(32) {
        let signs = signs.map(|row| group_signs(row, group));
        let [any, all] = signs.iter().fold([0, u64::MAX], |[any, all], word| [any | word, all & word]);
        let valid = (1u64 << (cells - 32 * group).min(32)) - 1;
        let active = (any | any >> 1) & !(all & all >> 1) & valid;
        if active == 0 {
            continue;
        }
        // Every cell is given room for the most triangles, and keeps what it needs.
        let room = end + MOST * active.count_ones() as usize;
        if indices.len() < room {
            indices.resize(room, 0);
        }
        for x in set_bits(active) {
            let case =
                (signs[0] >> x & 3 | (signs[1] >> x & 3) << 2 | (signs[2] >> x & 3) << 4 | (signs[3] >> x & 3) << 6)
                    as usize;
            let vertices = next.advance(case);
            if let Some(corners) = indices[end..].first_chunk_mut::<MOST>() {
                for (corner, edge) in corners.iter_mut().zip(TRIANGLES[case].as_flattened()) {
                    *corner = vertices[edge.index() & 15];
                }
            }
            end += 3 * TRIANGLE_COUNTS[case] as usize;
        }
    }
    end
}

/// The 33 signs of the cells of group `group`; higher bits mean nothing.
#[inline(always)]
fn group_signs(row: &[u64], group: usize) -> u64 {
    let word = row[group / 2];
    if group.is_multiple_of(2) { word } else { word >> 32 | row.get(group / 2 + 1).map_or(0, |next| next << 32) }
}

/// The next vertex on each edge of the cells of a row.
///
/// No map and no search: every crossing of the four rows belongs to an active cell, so that counters which each
/// active cell advances by its own crossings always stand at the next vertex. The high side needs no counter: in the
/// row's order, its vertex is the one behind the low side's.
struct NextVertex {
    /// On edges 0 to 3.
    x: [u32; 4],
    /// On edges 4, 6, 8 and 10.
    low: [u32; 4],
}

impl NextVertex {
    fn new(rows: [&Row; 4]) -> Self {
        Self {
            x: rows.map(|row| row.first[0]),
            low: [rows[0].first[1], rows[2].first[1], rows[0].first[2], rows[1].first[2]],
        }
    }

    /// The vertices on the twelve edges of the next active cell, a cell of `case`; those of edges that it does not
    /// cross mean nothing. (Sixteen, so that a masked index needs no check.)
    #[inline(always)]
    fn advance(&mut self, case: usize) -> [u32; 16] {
        let (step_x, step_low) = &STEPS[case];
        let (x, low) = (self.x, self.low);
        for edge in 0..4 {
            self.x[edge] += step_x[edge];
            self.low[edge] += step_low[edge];
        }
        let high = self.low;
        [
            x[0], x[1], x[2], x[3], //
            low[0], high[0], low[1], high[1], //
            low[2], high[2], low[3], high[3], //
            0, 0, 0, 0,
        ]
    }
}

/// How far a cell of each case advances the counters.
static STEPS: [([u32; 4], [u32; 4]); 256] = {
    let (mut steps, mut case) = ([([0; 4], [0; 4]); 256], 0);
    while case < 256 {
        let mut edge = 0;
        while edge < 4 {
            steps[case].0[edge] = (CROSSED_EDGES[case] >> edge & 1) as u32;
            steps[case].1[edge] = (CROSSED_EDGES[case] >> (4 + 2 * edge) & 1) as u32;
            edge += 1;
        }
        case += 1;
    }
    steps
};
