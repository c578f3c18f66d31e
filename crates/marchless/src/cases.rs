//! The 256 cases of a cell, derived at compile time from one rule for its faces.
//!
//! On each face the crossings are joined so that **inside corners are separated** where they stand diagonally: every
//! run of inside corners around the face is cut off by a segment of its own. Both cells at a face see the same
//! corners, draw the same segments, and so fit. The segments of six faces close into loops of 3 to 7
//! crossings, and each loop becomes a fan around the first crossing from which no diagonal lies in a face of
//! the cell: such a diagonal could coincide with an edge of the neighbour's and be shared by four triangles. Every
//! loop has such a fan, and its triangles never cross one another or those of another loop, wherever on their edges
//! the crossings lie: the tests show both. 820 triangles in all, at most 5 a case.
//!
//! Refused: any triangulation that avoids face diagonals. Of the 16 that a loop of seven crossings has, 4 have
//! triangles that cross; the 3 that are fans do not.
//!
//! The face rule is that of the regular cells in Eric Lengyel, "Voxel-Based Terrain for Real-Time Virtual Simulations"
//! (2010); the cases themselves go back to William E. Lorensen and Harvey E. Cline, "Marching Cubes: A High Resolution
//! 3D Surface Construction Algorithm" (1987).

use crate::cell::{CaseIndex, Corner, Edge, Face};

/// Triangles of each case, 0–5.
pub const TRIANGLE_COUNTS: [u8; 256] = CASES.counts;

/// The edges that hold the corners of each case's triangles, counter-clockwise as seen from outside; the first
/// [`TRIANGLE_COUNTS`] entries count, the others are edge 0 three times.
pub static TRIANGLES: [[[Edge; 3]; 5]; 256] = CASES.triangles;

/// The two corners of each edge, the lower first.
pub const EDGE_CORNERS: [[Corner; 2]; 12] = {
    let (mut corners, mut edge) = ([Edge::ALL[0].corners(); 12], 0);
    while edge < 12 {
        corners[edge] = Edge::ALL[edge].corners();
        edge += 1;
    }
    corners
};

/// The edges that the surface crosses in each case: bit `i` is edge `i`.
pub const CROSSED_EDGES: [u16; 256] = {
    let (mut crossed, mut case) = ([0; 256], 0);
    while case < 256 {
        let mut edge = 0;
        while edge < 12 {
            if CaseIndex(case as u8).crosses(Edge::ALL[edge]) {
                crossed[case] |= 1 << edge;
            }
            edge += 1;
        }
        case += 1;
    }
    crossed
};

const CASES: Cases = {
    let mut cases = Cases { counts: [0; 256], triangles: [[[Edge::ALL[0]; 3]; 5]; 256] };
    let mut case = 0;
    while case < 256 {
        cases.derive(CaseIndex(case as u8));
        case += 1;
    }
    cases
};

struct Cases {
    counts: [u8; 256],
    triangles: [[[Edge; 3]; 5]; 256],
}

impl Cases {
    /// Joins the crossings face by face, follows them into loops, and cuts each loop into a fan.
    const fn derive(&mut self, case: CaseIndex) {
        let next = joined_crossings(case);
        let (mut seen, mut start) = ([false; 12], 0);
        while start < 12 {
            if next[start].is_some() && !seen[start] {
                let (mut crossings, mut len, mut at) = ([Edge::ALL[0]; 12], 0, start);
                while !seen[at] {
                    seen[at] = true;
                    crossings[len] = Edge::ALL[at];
                    len += 1;
                    at = match next[at] {
                        Some(edge) => edge.index(),
                        None => panic!("a loop is closed"),
                    };
                }
                self.add_fan(case, &crossings, len);
            }
            start += 1;
        }
    }

    const fn add_fan(&mut self, case: CaseIndex, crossings: &[Edge; 12], len: usize) {
        let apex = fan_apex(crossings, len);
        let mut corner = 1;
        while corner + 1 < len {
            let count = &mut self.counts[case.0 as usize];
            self.triangles[case.0 as usize][*count as usize] =
                [crossings[apex], crossings[(apex + corner) % len], crossings[(apex + corner + 1) % len]];
            *count += 1;
            corner += 1;
        }
    }
}

/// For each crossed edge, the one that follows it on a loop that keeps the inside to its left as seen from outside.
const fn joined_crossings(case: CaseIndex) -> [Option<Edge>; 12] {
    let (mut next, mut face) = ([None; 12], 0);
    while face < 6 {
        let corners = Face::ALL[face].corners();
        let mut start = 0;
        while start < 4 {
            // A run of inside corners begins behind an outside one, and ends before the next.
            if !case.is_inside(corners[start]) && case.is_inside(corners[(start + 1) % 4]) {
                let mut end = (start + 1) % 4;
                while case.is_inside(corners[(end + 1) % 4]) {
                    end = (end + 1) % 4;
                }
                let entry = Edge::between(corners[start], corners[(start + 1) % 4]);
                next[entry.index()] = Some(Edge::between(corners[end], corners[(end + 1) % 4]));
            }
            start += 1;
        }
        face += 1;
    }
    next
}

/// The first crossing of the loop whose fan has no diagonal in a face of the cell.
const fn fan_apex(crossings: &[Edge; 12], len: usize) -> usize {
    let mut apex = 0;
    while apex < len {
        let (mut clear, mut step) = (true, 2);
        while step + 1 < len {
            clear &= !crossings[apex].shares_face(crossings[(apex + step) % len]);
            step += 1;
        }
        if clear {
            return apex;
        }
        apex += 1;
    }
    panic!("every loop has such a fan")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_820_triangles() {
        assert_eq!(TRIANGLE_COUNTS.iter().map(|&count| u32::from(count)).sum::<u32>(), 820);
    }

    #[test]
    fn a_lone_inside_corner_faces_outside() {
        assert_eq!(CaseIndex(1).triangles(), [[Edge::new(0), Edge::new(4), Edge::new(8)]]);
    }

    #[test]
    fn triangles_use_exactly_the_crossed_edges() {
        for case in 0..=255 {
            let used = CaseIndex(case).triangles().iter().flatten().fold(0, |used, edge| used | 1u16 << edge.index());
            assert_eq!(used, CROSSED_EDGES[usize::from(case)], "case {case:08b}");
        }
    }
}
