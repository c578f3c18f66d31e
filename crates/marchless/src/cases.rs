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

impl CaseIndex {
    /// The triangles of this case, each corner named by the edge that it lies on.
    pub const fn triangles(self) -> &'static [[Edge; 3]] {
        let (used, _) = TRIANGLES[self.0 as usize].split_at(TRIANGLE_COUNTS[self.0 as usize] as usize);
        used
    }
}

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
    const fn derive(&mut self, case: CaseIndex) {
        let Some((count, triangles)) = triangulate(&Loops::new(case, 0)) else {
            panic!("where inside corners are separated, every loop has a fan");
        };
        self.counts[case.0 as usize] = count;
        self.triangles[case.0 as usize] = triangles;
    }
}

/// The triangles of these loops as fans around crossings: at most 5, of which the first so many count. `None` where
/// there are more, or where some loop has no fan.
pub(crate) const fn triangulate(loops: &Loops) -> Option<(u8, [[Edge; 3]; 5])> {
    let (mut count, mut triangles, mut number) = (0, [[Edge::ALL[0]; 3]; 5], 0);
    while number < loops.count {
        let crossings = loops.get(number);
        let Some(apex) = fan_apex(crossings) else { return None };
        let (len, mut corner) = (crossings.len(), 1);
        while corner + 1 < len {
            if count == 5 {
                return None;
            }
            triangles[count] =
                [crossings[apex], crossings[(apex + corner) % len], crossings[(apex + corner + 1) % len]];
            count += 1;
            corner += 1;
        }
        number += 1;
    }
    Some((count as u8, triangles))
}

/// The loops that the surface's segments on the faces of a cell close into.
#[derive(Clone, Copy)]
pub(crate) struct Loops {
    /// One loop behind the other, each with the inside to its left as seen from outside the cell.
    crossings: [Edge; 12],
    /// Where each loop ends.
    ends: [usize; 4],
    pub(crate) count: usize,
}

impl Loops {
    /// Joins the crossings face by face and follows them. `joined`: a bit for each face on which inside corners that
    /// stand diagonally are joined instead of separated; of faces that are not ambiguous, it means nothing.
    pub(crate) const fn new(case: CaseIndex, joined: u8) -> Self {
        let next = next_crossings(case, joined);
        let mut loops = Self { crossings: [Edge::ALL[0]; 12], ends: [0; 4], count: 0 };
        let (mut seen, mut len, mut start) = ([false; 12], 0, 0);
        while start < 12 {
            if next[start].is_some() && !seen[start] {
                let mut at = start;
                while !seen[at] {
                    seen[at] = true;
                    loops.crossings[len] = Edge::ALL[at];
                    len += 1;
                    at = match next[at] {
                        Some(edge) => edge.index(),
                        None => panic!("a loop is closed"),
                    };
                }
                loops.ends[loops.count] = len;
                loops.count += 1;
            }
            start += 1;
        }
        loops
    }

    /// The crossings of loop `number`, in order.
    pub(crate) const fn get(&self, number: usize) -> &[Edge] {
        let start = if number == 0 { 0 } else { self.ends[number - 1] };
        let (until_end, _) = self.crossings.split_at(self.ends[number]);
        let (_, crossings) = until_end.split_at(start);
        crossings
    }
}

/// For each crossed edge, the one that follows it on a loop.
const fn next_crossings(case: CaseIndex, joined: u8) -> [Option<Edge>; 12] {
    let (mut next, mut face) = ([None; 12], 0);
    while face < 6 {
        let corners = Face::ALL[face].corners();
        let outside_is_cut_off = case.is_ambiguous(Face::ALL[face]) && joined >> face & 1 == 1;
        let mut start = 0;
        while start < 4 {
            // A run of inside corners begins behind an outside one, and ends before the next.
            if !case.is_inside(corners[start]) && case.is_inside(corners[(start + 1) % 4]) {
                let entry = Edge::between(corners[start], corners[(start + 1) % 4]);
                let mut end = if outside_is_cut_off { (start + 3) % 4 } else { (start + 1) % 4 };
                while case.is_inside(corners[(end + 1) % 4]) {
                    end = (end + 1) % 4;
                }
                next[entry.index()] = Some(Edge::between(corners[end], corners[(end + 1) % 4]));
            }
            start += 1;
        }
        face += 1;
    }
    next
}

/// The first crossing of the loop whose fan has no diagonal in a face of the cell, if there is one.
pub(crate) const fn fan_apex(crossings: &[Edge]) -> Option<usize> {
    let (len, mut apex) = (crossings.len(), 0);
    while apex < len {
        let (mut clear, mut step) = (true, 2);
        while step + 1 < len {
            clear &= !crossings[apex].shares_face(crossings[(apex + step) % len]);
            step += 1;
        }
        if clear {
            return Some(apex);
        }
        apex += 1;
    }
    None
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
