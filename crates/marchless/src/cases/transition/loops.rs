//! The loops that the surface's segments on the faces of a transition cell form.

use super::{FACE_EDGES, FACES, SQUARES, TransitionCase, TransitionEdge};

/// The crossed edge that follows each crossed edge on its loop.
///
/// `pinched`: squares of the finer face whose quadrilateral is cut off, a bit each. What remains of their segments cuts
/// off outside samples instead of inside ones.
pub(super) const fn next_crossings(case: TransitionCase, pinched: u8) -> [Option<TransitionEdge>; 16] {
    let (mut next, mut face) = ([None; 16], 0);
    while face < FACES.len() {
        let (samples, len) = (FACES[face], FACES[face].len());
        let outside_is_cut_off = face < SQUARES && pinched >> face & 1 == 1;
        let mut start = 0;
        while start < len {
            // A run of inside samples begins behind an outside sample and ends before the next one.
            if !case.is_inside(samples[start]) && case.is_inside(samples[(start + 1) % len]) {
                let mut end = if outside_is_cut_off { start + len - 1 } else { start + 1 };
                while case.is_inside(samples[(end + 1) % len]) {
                    end += 1;
                }
                next[FACE_EDGES[face][start].index()] = Some(FACE_EDGES[face][end % len]);
            }
            start += 1;
        }
        face += 1;
    }
    next
}

/// A loop of the surface's segments on the faces. As seen from outside the cell, the inside is to its left.
pub(super) struct Loop {
    /// The first `len` are in use.
    crossings: [TransitionEdge; 11],
    pub(super) len: usize,
}

impl Loop {
    /// The loop through `start`, which is crossed.
    pub(super) const fn new(next: &[Option<TransitionEdge>; 16], start: TransitionEdge) -> Self {
        let (mut crossings, mut len, mut at) = ([start; 11], 0, start);
        loop {
            crossings[len] = at;
            len += 1;
            at = match next[at.index()] {
                Some(edge) => edge,
                None => panic!("a loop is closed"),
            };
            if at.0 == start.0 {
                return Self { crossings, len };
            }
        }
    }

    /// Crossing number `index`, counted on around the loop.
    pub(super) const fn get(&self, index: usize) -> TransitionEdge {
        self.crossings[index % self.len]
    }

    /// The edges that the loop passes, a bit each.
    pub(super) const fn edges(&self) -> u16 {
        let (mut edges, mut index) = (0, 0);
        while index < self.len {
            edges |= 1 << self.crossings[index].0;
            index += 1;
        }
        edges
    }

    /// True if the loop never leaves the finer face.
    pub(super) const fn is_flat(&self) -> bool {
        self.edges() >> 12 == 0
    }

    /// The index of the crossing that the loop's fan is built around.
    pub(super) const fn apex(&self) -> usize {
        let mut apex = 0;
        if self.is_flat() {
            while !self.has_flat_fan(apex) {
                apex += 1;
                assert!(apex < self.len, "every flat loop has a fan");
            }
            return apex;
        }
        // The first of the coarser edges by their v. If there are two such loops, one fan is then built around a
        // crossing along u and the other around one along v. Fans around two along the same axis can cross.
        let (by_v, mut rank) = ([12, 14, 15, 13], 0);
        while self.edges() >> by_v[rank] & 1 == 0 {
            rank += 1;
        }
        while self.crossings[apex].0 != by_v[rank] {
            apex += 1;
        }
        apex
    }

    /// True if no diagonal of a flat loop's fan lies in a face, and its triangles turn the same way wherever the
    /// crossings lie. The turn is linear in each crossing's position, so the ends of the edges decide.
    const fn has_flat_fan(&self, apex: usize) -> bool {
        let (mut left, mut right, mut corner) = (false, false, 1);
        while corner + 1 < self.len {
            let [a, b, c] = [self.get(apex), self.get(apex + corner), self.get(apex + corner + 1)];
            if corner > 1 && a.shares_face(b) {
                return false;
            }
            let mut ends = 0;
            while ends < 8 {
                let turn = turn([a.samples()[ends & 1], b.samples()[ends >> 1 & 1], c.samples()[ends >> 2]]);
                (left, right) = (left || turn > 0, right || turn < 0);
                ends += 1;
            }
            corner += 1;
        }
        !(left && right)
    }
}

/// Twice the area of a triangle of samples on the finer face: above 0 if they turn counter-clockwise as seen from
/// outside the cell.
const fn turn([a, b, c]: [usize; 3]) -> i32 {
    let (u, v) = ([a as i32 % 3, b as i32 % 3, c as i32 % 3], [a as i32 / 3, b as i32 / 3, c as i32 / 3]);
    (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
}
