//! [`FinerNeighbours`]: which neighbours of a leaf are finer, and where its lattice points move to make room.

use crate::cell::Face;

/// The set of a leaf's neighbours that are one level finer, among the 26 places of its own size around it.
///
/// A place is named by its direction: −1, 0 or 1 along each axis. Six directions lead across a face, twelve across an
/// edge, eight across a corner.
///
/// ```
/// use marchless::FinerNeighbours;
///
/// // All that lies beyond the leaf's high face along x is finer.
/// let finer = FinerNeighbours::from_fn(|[x, _, _]| x == 1);
/// assert!(finer.contains([1, 0, -1]) && !finer.contains([0, 1, 0]));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FinerNeighbours(u32);

impl FinerNeighbours {
    /// No neighbour is finer.
    pub const NONE: Self = Self(0);

    /// The set of those of the 26 directions for which `is_finer` returns true.
    pub fn from_fn(mut is_finer: impl FnMut([i32; 3]) -> bool) -> Self {
        let mut finer = 0;
        for place in (0..27).filter(|&place| place != CENTRE) {
            finer |= u32::from(is_finer(direction(place))) << place;
        }
        Self(finer)
    }

    /// True if the neighbour in this direction is finer. Of each coordinate only the sign matters; the leaf itself, at
    /// `[0, 0, 0]`, is not finer.
    pub const fn contains(self, direction: [i32; 3]) -> bool {
        let [x, y, z] = direction;
        self.0 >> (CENTRE as i32 + x.signum() + 3 * y.signum() + 9 * z.signum()) & 1 == 1
    }

    /// True if the neighbour across this face is finer.
    pub const fn contains_face(self, face: Face) -> bool {
        self.contains(across(face))
    }

    /// True if no neighbour is finer.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The direction across the first edge of the leaf at which finer and coarser leaves alternate, if there is one:
    /// those across both faces at the edge are finer, and the one across the edge is not.
    pub(crate) fn alternating_edge(self) -> Option<[i32; 3]> {
        (0..27).map(direction).find(|&[x, y, z]| {
            let faces = [[x, 0, 0], [0, y, 0], [0, 0, z]].map(|face| self.contains(face));
            let is_edge = [x, y, z].iter().filter(|v| **v != 0).count() == 2;
            is_edge && faces.iter().filter(|finer| **finer).count() == 2 && !self.contains([x, y, z])
        })
    }

    /// How far the leaf's lattice points move.
    pub(super) fn displacements(self) -> Displacements {
        Displacements(core::array::from_fn(|class| {
            // −1 at the leaf's low end along an axis, 1 at its high end, 0 between.
            let at = direction(class);
            let mut sum = [0i32; 3];
            for octant in 0..8 {
                let towards = [0, 1, 2].map(|axis| 2 * (octant >> axis & 1) - 1);
                let leaf = [0, 1, 2].map(|axis| if towards[axis] == at[axis] { at[axis] } else { 0 });
                if self.contains(leaf) {
                    sum = [0, 1, 2].map(|axis| sum[axis] + towards[axis]);
                }
            }
            sum.map(|sum| match sum.signum() {
                1 => -ROOM,
                -1 => ROOM,
                _ => 0.0,
            })
        }))
    }
}

/// The room for transition cells, in cells of the coarser leaf.
const ROOM: f32 = 0.125;

/// The place of the leaf itself.
const CENTRE: usize = 13;

/// The direction of a place.
fn direction(place: usize) -> [i32; 3] {
    [place % 3, place / 3 % 3, place / 9].map(|v| v as i32 - 1)
}

/// The direction across a face.
const fn across(face: Face) -> [i32; 3] {
    let mut direction = [0; 3];
    direction[face.axis()] = if face.is_high() { 1 } else { -1 };
    direction
}

/// How far lattice points on the border of a leaf move, to make room for transition cells.
///
/// A point belongs to up to eight leaves, one for each octant around it. Along each axis, it moves by an eighth of a
/// cell away from the finer ones among them, or not at all if they lie evenly on both sides. All coarser leaves at a
/// point see the same eight, so all of them move it alike.
pub(super) struct Displacements([[f32; 3]; 27]);

impl Displacements {
    /// The displacement of a lattice point of a leaf of `cells` cells per axis.
    pub(super) fn of(&self, point: [u32; 3], cells: [u32; 3]) -> [f32; 3] {
        let class = |axis: usize| {
            if point[axis] == 0 {
                0
            } else if point[axis] == cells[axis] {
                2
            } else {
                1
            }
        };
        self.0[class(0) + 3 * class(1) + 9 * class(2)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_move_away_from_finer_leaves() {
        let cells = [4, 4, 4];
        let face = FinerNeighbours::from_fn(|[x, ..]| x == 1).displacements();
        assert_eq!(face.of([4, 2, 2], cells), [-0.125, 0.0, 0.0]);
        assert_eq!(face.of([4, 4, 0], cells), [-0.125, 0.0, 0.0]);
        assert_eq!(face.of([3, 2, 2], cells), [0.0; 3]);
        let edge = FinerNeighbours::from_fn(|direction| direction == [1, 1, 0]).displacements();
        assert_eq!(edge.of([4, 4, 2], cells), [-0.125, -0.125, 0.0]);
        assert_eq!(edge.of([4, 4, 4], cells), [-0.125, -0.125, 0.125]);
        assert_eq!(edge.of([4, 3, 2], cells), [0.0; 3]);
        // One of the two beyond the face is finer only: the other's corner moves outward.
        let beside = FinerNeighbours::from_fn(|[x, y, _]| x == 1 && y == -1).displacements();
        assert_eq!(beside.of([4, 0, 2], cells), [-0.125, 0.125, 0.0]);
        let below = FinerNeighbours::from_fn(|[x, y, _]| x == 0 && y == -1).displacements();
        assert_eq!(below.of([4, 0, 2], cells), [0.125, 0.125, 0.0]);
    }

    #[test]
    fn alternating_edges_are_found() {
        let faces = |direction| direction == [1, 0, 0] || direction == [0, 0, -1];
        assert_eq!(FinerNeighbours::from_fn(faces).alternating_edge(), Some([1, 0, -1]));
        let with_edge = |direction| faces(direction) || direction == [1, 0, -1];
        assert_eq!(FinerNeighbours::from_fn(with_edge).alternating_edge(), None);
        assert!(FinerNeighbours::from_fn(|_| true).contains([-7, 3, 0]));
        assert!(!FinerNeighbours::from_fn(|_| true).contains([0; 3]));
    }
}
