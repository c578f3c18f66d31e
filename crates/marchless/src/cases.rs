//! The 256 cases of a cell, derived at compile time from one rule for its faces.
//!
//! The rule: **inside corners are separated** if they are diagonal to each other on a face. A segment of its own cuts
//! off every run of inside corners around the face. Both cells at a face see the same corners and draw the same
//! segments, so they fit. The segments of six faces close into loops of 3 to 7 crossings. Each loop becomes a fan
//! around the first crossing from which no diagonal lies in a face of the cell: such a diagonal could coincide with an
//! edge in the neighbouring cell, which four triangles would then share. Every loop has such a fan, and its triangles
//! never cross each other or those of another loop, wherever on their edges the crossings lie: the tests show both.
//! There are 820 triangles in all, at most 5 per case.
//!
//! Refused: any other triangulation that avoids face diagonals. A loop of seven crossings has 16 such triangulations;
//! the triangles of 4 cross each other, those of the 3 fans do not.
//!
//! The face rule is that of the regular cells in Eric Lengyel, "Voxel-Based Terrain for Real-Time Virtual Simulations"
//! (2010); the cases themselves go back to William E. Lorensen and Harvey E. Cline, "Marching Cubes: A High Resolution
//! 3D Surface Construction Algorithm" (1987).

pub mod transition;

use crate::cell::{CaseIndex, Corner, Edge, Face};

/// The number of triangles of each case, 0–5.
pub const TRIANGLE_COUNTS: [u8; 256] = CASES.counts;

/// The triangles of each case. Corners are named by their edges, counter-clockwise as seen from outside.
///
/// The first [`TRIANGLE_COUNTS`] entries of a case are in use; the others are edge 0 three times.
pub static TRIANGLES: [[[Edge; 3]; 5]; 256] = CASES.triangles;

impl CaseIndex {
    /// The triangles of this case. Corners are named by the edges that they lie on.
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

/// The edges that the surface crosses in each case. Bit `i` is edge `i`.
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

/// The number of triangles of these loops, and the triangles themselves, as fans around crossings. `None` if there are
/// more than 5, or if a loop has no fan.
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

/// The loops that the surface's segments on the faces of a cell form.
#[derive(Clone, Copy)]
pub(crate) struct Loops {
    /// The crossings of all loops, loop after loop. As seen from outside the cell, the inside is to the left of a loop.
    crossings: [Edge; 12],
    /// The end of each loop in `crossings`.
    ends: [usize; 4],
    pub(crate) count: usize,
}

impl Loops {
    /// Joins the crossings face by face and follows them around. `joined`: the ambiguous faces on which inside corners
    /// are joined instead of separated, a bit each; bits of other faces are ignored.
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

/// The crossed edge that follows each crossed edge on its loop.
pub(crate) const fn next_crossings(case: CaseIndex, joined: u8) -> [Option<Edge>; 12] {
    let (mut next, mut face) = ([None; 12], 0);
    while face < 6 {
        let corners = Face::ALL[face].corners();
        let outside_is_cut_off = case.is_ambiguous(Face::ALL[face]) && joined >> face & 1 == 1;
        let mut start = 0;
        while start < 4 {
            // A run of inside corners begins behind an outside corner and ends before the next one.
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

/// The index of the first crossing of a loop whose fan has no diagonal in a face of the cell, if there is one.
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
