//! Pass 4: the triangles of each active cell, with vertex indices from running counters.

use alloc::vec::Vec;

use super::{Layout, crossings::Row, set_bits, shifted};
use crate::cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES};

/// Fills `indices`, cell by cell, x fastest.
pub(super) fn join(layout: &Layout, signs: &[u64], rows: &[Row], indices: &mut Vec<u32>) {
    for z in 0..layout.size[2] - 1 {
        for y in 0..layout.size[1] - 1 {
            let low = y + z * layout.size[1];
            let high = low + layout.size[1];
            CellRow {
                signs: [low, low + 1, high, high + 1].map(|row| layout.row(signs, row)),
                next: NextVertex::new([low, low + 1, high, high + 1].map(|row| rows[row])),
            }
            .join(layout, indices);
        }
    }
}

/// One row of cells between four rows of samples: those at `[y, z]`, `[y + 1, z]`, `[y, z + 1]` and `[y + 1, z + 1]`.
struct CellRow<'a> {
    signs: [&'a [u64]; 4],
    next: NextVertex,
}

impl CellRow<'_> {
    #[inline(always)]
    fn join(mut self, layout: &Layout, indices: &mut Vec<u32>) {
        for word in 0..layout.words {
            let low = self.signs.map(|row| row[word]);
            let high = self.signs.map(|row| shifted(row, word));
            let any = low.iter().chain(&high).fold(0, |all, word| all | word);
            let all = low.iter().chain(&high).fold(u64::MAX, |all, word| all & word);
            let active = any & !all & layout.x_edges(word);
            if active == 0 {
                continue;
            }
            // Every cell writes room for five triangles and keeps as many as it has.
            let mut end = indices.len();
            indices.resize(end + 15 * active.count_ones() as usize, 0);
            for x in set_bits(active) {
                let case = case_index(&low, &high, x);
                let vertices = self.next.advance(CROSSED_EDGES[case]);
                if let Some(room) = indices[end..].first_chunk_mut::<15>() {
                    for (corner, edge) in room.iter_mut().zip(TRIANGLES[case].as_flattened()) {
                        *corner = vertices[edge.index() & 15];
                    }
                }
                end += 3 * TRIANGLE_COUNTS[case] as usize;
            }
            indices.truncate(end);
        }
    }
}

/// The case of cell `x` of a row, from the sign words of its low and high corners.
#[inline(always)]
fn case_index(low: &[u64; 4], high: &[u64; 4], x: usize) -> usize {
    let mut case = 0;
    for row in 0..4 {
        case |= (low[row] >> x & 1) << (2 * row) | (high[row] >> x & 1) << (2 * row + 1);
    }
    case as usize
}

/// The next vertex on each edge of the cells of a row.
///
/// No map and no search: every crossing of the four rows belongs to an active cell, so that counters which each
/// active cell advances by its own crossings always stand at the next vertex. The high side needs no counter: in the
/// row's order, its vertex is the one behind the low side's.
struct NextVertex {
    /// On edges 0 to 3.
    x: [u32; 4],
    /// On edges 4 and 6.
    y: [u32; 2],
    /// On edges 8 and 10.
    z: [u32; 2],
}

impl NextVertex {
    fn new(rows: [Row; 4]) -> Self {
        Self {
            x: rows.map(|row| row.first[0]),
            y: [rows[0].first[1], rows[2].first[1]],
            z: [rows[0].first[2], rows[1].first[2]],
        }
    }

    /// The vertices on the twelve edges of the next active cell, which crosses the edges `crossed`; those of other
    /// edges mean nothing. (Sixteen, so that a masked index needs no check.)
    #[inline(always)]
    fn advance(&mut self, crossed: u16) -> [u32; 16] {
        let has = |edge: u32| u32::from(crossed >> edge & 1);
        let y = [self.y[0] + has(4), self.y[1] + has(6)];
        let z = [self.z[0] + has(8), self.z[1] + has(10)];
        let vertices = [
            self.x[0], self.x[1], self.x[2], self.x[3], //
            self.y[0], y[0], self.y[1], y[1], //
            self.z[0], z[0], self.z[1], z[1], //
            0, 0, 0, 0,
        ];
        for (edge, next) in self.x.iter_mut().enumerate() {
            *next += has(edge as u32);
        }
        (self.y, self.z) = (y, z);
        vertices
    }
}
