//! The 512 cases of a transition cell, derived at compile time. A transition cell joins cells of one size to a cell
//! twice as large.
//!
//! It has nine samples, all of them on its finer face. The corners of its coarser face are the finer face's corners
//! once more: the same lattice points, the same samples.
//!
//! ```text
//!    finer face, w = 1              coarser face, w = 0
//!
//!    6───e4───7───e5───8            6───────e13───────8
//!    │        │        │            │                 │
//!   e9       e10      e11           │                 │
//!    │        │        │            │                 │
//!    3───e2───4───e3───5           e14               e15         v
//!    │        │        │            │                 │          │
//!   e6       e7       e8            │                 │          │
//!    │        │        │            │                 │          │
//!    0───e0───1───e1───2            0───────e12───────2          └────u   w points to the reader
//!
//!    sample = 3·v + u, in steps of the finer face
//!    edges 0–5 run along u and 6–11 along v on the finer face, 12 and 13 along u and 14 and 15 along v on the coarser
//! ```
//!
//! The axes u, v and w are right-handed. Nine faces bound the cell: four squares of the finer face, the coarser face,
//! and four lateral faces. A lateral face has three samples in a row and the coarser edge between the outer two; the
//! lines from a corner to itself on the coarser face carry no crossing.
//!
//! The faces follow the rule of the [regular cells](super): **inside corners are separated**. So a transition cell fits
//! the four cells at its finer face, the cell at its coarser face, and its neighbours at the lateral faces. The
//! segments close into at most 4 loops of 3 to 11 crossings. They become triangles as follows:
//!
//! - A loop that reaches the coarser face becomes a fan around one of its crossings there. No triangle then has three
//!   corners on the finer face, where they could lie on one line: on flat ground they do.
//! - A loop that passes the coarser face twice leaves two crossings out of that fan, because diagonals to them would
//!   lie in the coarser face. They form a quadrilateral with their neighbours on the loop.
//! - A *flat* loop never leaves the finer face. It becomes the first fan that has no diagonal in one of the nine faces
//!   and whose triangles turn the same way, wherever on their edges the crossings lie.
//! - *Pinched* squares of the finer face are cut off first, as a quadrilateral each. There, a flat loop touches itself
//!   or another one between two outside samples; 13 cases have such squares. Without the cut, no fan would do, and
//!   where all four squares are pinched (case 341, the checkerboard), the discs of two loops would cover each other.
//!   With it, that case is a ring of 12 triangles.
//!
//! The tests show that triangles never cross and have an area, wherever on their edges the crossings lie, for cells an
//! eighth as thick as they are wide, and for coarser faces whose sides are moved by as much. A diagonal lies in a face
//! of the cell only where squares are pinched. This does no harm, because the cells at the finer face never have one.
//! There are 2,640 triangles in all, at most 12 per case, and in each case as many as in Lengyel's table.
//!
//! Refused: the first fan or the shortest diagonals for all loops. Dozens of cases have triangles that cross.
//!
//! Transition cells are those of Eric Lengyel, "Voxel-Based Terrain for Real-Time Virtual Simulations" (2010),
//! chapter 4. He numbers cases differently: bits go around the finer face, the centre last.

mod loops;

use loops::{Loop, next_crossings};

/// An edge of a transition cell, 0–15: twelve on the finer face, four on the coarser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct TransitionEdge(u8);

impl TransitionEdge {
    /// All sixteen edges.
    pub const ALL: [Self; 16] = {
        let mut all = [Self(0); 16];
        let mut index = 0;
        while index < 16 {
            all[index] = Self(index as u8);
            index += 1;
        }
        all
    };

    /// The edge number `index`.
    ///
    /// # Panics
    /// If `index` is not below 16.
    pub const fn new(index: u8) -> Self {
        assert!(index < 16, "a transition cell has sixteen edges");
        Self(index)
    }

    /// The edge between two samples: of the finer face if they are neighbours there, of the coarser face if they are
    /// neighbouring corners.
    ///
    /// # Panics
    /// If there is no such edge.
    pub const fn between(a: usize, b: usize) -> Self {
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        assert!(high < 9, "a transition cell has nine samples");
        let index = match (low, high - low) {
            (_, 1) if low % 3 < 2 => low / 3 * 2 + low % 3,
            (_, 3) => 6 + low,
            (0 | 6, 2) => 12 + low / 6,
            (0 | 2, 6) => 14 + low / 2,
            _ => panic!("no edge joins these samples"),
        };
        Self(index as u8)
    }

    /// The edge's number, 0–15.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// True if the edge belongs to the finer face.
    pub const fn is_fine(self) -> bool {
        self.0 < 12
    }

    /// The two ends of the edge, the lower first.
    pub const fn samples(self) -> [usize; 2] {
        let index = self.0 as usize;
        let (low, step) = match index {
            0..6 => (index / 2 * 3 + index % 2, 1),
            6..12 => (index - 6, 3),
            12 | 13 => ((index - 12) * 6, 2),
            _ => ((index - 14) * 2, 6),
        };
        [low, low + step]
    }

    /// True if both edges lie on one of the nine faces.
    const fn shares_face(self, other: Self) -> bool {
        EDGE_FACES[self.0 as usize] & EDGE_FACES[other.0 as usize] != 0
    }
}

/// The samples of each face, counter-clockwise as seen from outside the cell. Neighbours in a list share an edge, and
/// so do the last and the first.
const FACES: [&[usize]; 9] = [
    // The squares of the finer face.
    &[0, 1, 4, 3],
    &[1, 2, 5, 4],
    &[3, 4, 7, 6],
    &[4, 5, 8, 7],
    // The coarser face.
    &[0, 6, 8, 2],
    // The lateral faces: −u, +u, −v, +v. Their last edge is one of the coarser face.
    &[0, 3, 6],
    &[8, 5, 2],
    &[2, 1, 0],
    &[6, 7, 8],
];

/// The number of squares of the finer face: the first entries of [`FACES`].
const SQUARES: usize = 4;

/// The edges of each face: entry `i` joins samples `i` and `i + 1` of its list. The last entry of a lateral face is
/// unused.
const FACE_EDGES: [[TransitionEdge; 4]; 9] = {
    let (mut edges, mut face) = ([[TransitionEdge(0); 4]; 9], 0);
    while face < FACES.len() {
        let (samples, mut start) = (FACES[face], 0);
        while start < samples.len() {
            edges[face][start] = TransitionEdge::between(samples[start], samples[(start + 1) % samples.len()]);
            start += 1;
        }
        face += 1;
    }
    edges
};

/// The two faces that each edge lies on, a bit each.
const EDGE_FACES: [u16; 16] = {
    let (mut faces, mut face) = ([0; 16], 0);
    while face < FACES.len() {
        let mut start = 0;
        while start < FACES[face].len() {
            faces[FACE_EDGES[face][start].index()] |= 1 << face;
            start += 1;
        }
        face += 1;
    }
    faces
};

/// The set of a transition cell's samples that are inside. Bit `i` is sample `i`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TransitionCase(u16);

impl TransitionCase {
    /// The case whose inside samples are the bits of `inside`.
    ///
    /// # Panics
    /// If `inside` is not below 512.
    pub const fn new(inside: u16) -> Self {
        assert!(inside < 512, "a transition cell has nine samples");
        Self(inside)
    }

    /// The case's number, 0–511.
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// True if sample number `sample`, 0–8, is inside.
    pub const fn is_inside(self, sample: usize) -> bool {
        debug_assert!(sample < 9, "a transition cell has nine samples");
        self.0 >> sample & 1 == 1
    }

    /// True if the surface crosses `edge`.
    pub const fn crosses(self, edge: TransitionEdge) -> bool {
        let [low, high] = edge.samples();
        self.is_inside(low) != self.is_inside(high)
    }

    /// The triangles of this case. Corners are named by the edges that they lie on.
    pub const fn triangles(self) -> &'static [[TransitionEdge; 3]] {
        let (until_end, _) = TRIANGLES.split_at(TRIANGLE_STARTS[self.0 as usize + 1] as usize);
        let (_, triangles) = until_end.split_at(TRIANGLE_STARTS[self.0 as usize] as usize);
        triangles
    }

    /// The pinched squares of the finer face, a bit each: the centre is inside, and only flat loops pass the square's
    /// four edges.
    const fn pinched(self) -> u8 {
        if !self.is_inside(4) {
            return 0;
        }
        let (next, mut pinched, mut square) = (next_crossings(self, 0), 0, 0);
        while square < SQUARES {
            let (mut all_flat, mut start) = (true, 0);
            while start < 4 && all_flat {
                let edge = FACE_EDGES[square][start];
                all_flat = self.crosses(edge) && Loop::new(&next, edge).is_flat();
                start += 1;
            }
            pinched |= (all_flat as u8) << square;
            square += 1;
        }
        pinched
    }
}

/// The triangles of all cases, case after case. Corners are named by their edges, counter-clockwise as seen from
/// outside. [`TRIANGLE_STARTS`] says where each case begins.
pub static TRIANGLES: [[TransitionEdge; 3]; 2640] = CASES.triangles;

/// The index in [`TRIANGLES`] of the first triangle of each case; the last entry is the number of all triangles.
pub const TRIANGLE_STARTS: [u16; 513] = CASES.starts;

const CASES: Cases = {
    let mut cases = Cases { starts: [0; 513], triangles: [[TransitionEdge(0); 3]; 2640], count: 0 };
    let mut case = 0;
    while case < 512 {
        cases.derive(TransitionCase(case));
        cases.starts[case as usize + 1] = cases.count as u16;
        case += 1;
    }
    assert!(cases.count == cases.triangles.len());
    cases
};

struct Cases {
    starts: [u16; 513],
    triangles: [[TransitionEdge; 3]; 2640],
    count: usize,
}

impl Cases {
    const fn derive(&mut self, case: TransitionCase) {
        let (pinched, mut square) = (case.pinched(), 0);
        while square < SQUARES {
            if pinched >> square & 1 == 1 {
                let [a, b, c, d] = FACE_EDGES[square];
                self.push([a, b, c]);
                self.push([a, c, d]);
            }
            square += 1;
        }
        let (next, mut seen, mut start) = (next_crossings(case, pinched), 0, 0);
        while start < 16 {
            if next[start].is_some() && seen >> start & 1 == 0 {
                let crossings = Loop::new(&next, TransitionEdge(start as u8));
                seen |= crossings.edges();
                self.push_fan(&crossings);
            }
            start += 1;
        }
    }

    const fn push_fan(&mut self, crossings: &Loop) {
        let (apex, mut corner) = (crossings.apex(), 1);
        while corner + 1 < crossings.len {
            let mut next = corner + 1;
            while next + 1 < crossings.len && crossings.get(apex).shares_face(crossings.get(apex + next)) {
                next += 1;
            }
            let (before, after) = (crossings.get(apex + corner), crossings.get(apex + next));
            self.push([crossings.get(apex), before, after]);
            if next == corner + 3 {
                // The fan left out the two crossings of another segment on the coarser face. They are the ends of two
                // coarser edges; the diagonal starts at the one whose edge meets that of the apex.
                let (first, second) = (crossings.get(apex + corner + 1), crossings.get(apex + corner + 2));
                if crossings.get(apex + 1).is_fine() {
                    self.push([before, first, after]);
                    self.push([first, second, after]);
                } else {
                    self.push([before, first, second]);
                    self.push([before, second, after]);
                }
            }
            corner = next;
        }
    }

    const fn push(&mut self, triangle: [TransitionEdge; 3]) {
        self.triangles[self.count] = triangle;
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn every_edge_lies_between_its_samples() {
        for edge in TransitionEdge::ALL {
            let [low, high] = edge.samples();
            assert!(low < high);
            assert_eq!((TransitionEdge::between(low, high), TransitionEdge::between(high, low)), (edge, edge));
            assert_eq!(EDGE_FACES[edge.index()].count_ones(), 2);
        }
    }

    #[test]
    fn a_lone_inside_sample_faces_outside() {
        let [low_u, high_u, v] = [(0, 1), (1, 2), (1, 4)].map(|(a, b)| TransitionEdge::between(a, b));
        assert_eq!(TransitionCase::new(1 << 1).triangles(), [[low_u, v, high_u]]);
    }

    #[test]
    fn thirteen_cases_are_pinched() {
        let pinched: Vec<u16> = (0..512).filter(|&case| TransitionCase(case).pinched() != 0).collect();
        assert_eq!(pinched, [245, 341, 343, 349, 350, 351, 371, 373, 375, 413, 469, 477, 501]);
    }
}
