//! [`Triangle`]: whether two triangles cross, in `f64` as far as its error bounds allow.

use super::{
    aabb::Aabb,
    predicates::{Corners, clear_turn, cross},
};

/// A triangle with an area, and what rules out most crossings with others.
pub(super) struct Triangle {
    corners: Corners,
    /// Equal for equal positions.
    vertices: [u32; 3],
    /// At right angles to the plane, about as long as twice the area.
    normal: [f64; 3],
    /// An error bound, per length of a box around a point and the triangle: if the product of the normal and the vector
    /// from the first corner to the point exceeds it, its sign is certain.
    error: f64,
    /// The longest side of the bounding box.
    size: f64,
}

impl Triangle {
    /// `vertices`: equal for equal positions.
    #[inline(always)]
    pub(super) fn new(corners: Corners, vertices: [u32; 3], aabb: &Aabb) -> Self {
        let [u, v] = [corners[1], corners[2]].map(|corner| difference(corners[0], corner));
        let normal = [0, 1, 2].map(|axis| {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            u[i] * v[j] - u[j] * v[i]
        });
        // Shewchuk's bound for the product is 7.1 times 2⁻⁵³ times six products of three lengths, none longer than the
        // box around them.
        let [u, v] = [u, v].map(|side| side.iter().fold(0.0, |longest: f64, length| longest.max(length.abs())));
        const ERROR: f64 = 64.0 / (1u64 << 53) as f64;
        Self { corners, vertices, normal, error: ERROR * u * v, size: aabb.longest_side() }
    }

    /// Whether two triangles whose boxes overlap have a point in common other than common corners and sides.
    #[inline(always)]
    pub(super) fn crosses(&self, other: &Self) -> bool {
        // The corners that both have in common, a bit each.
        let (mut of_self, mut of_other) = (0u32, 0u32);
        for (i, a) in self.vertices.iter().enumerate() {
            for (j, b) in other.vertices.iter().enumerate() {
                let same = u32::from(a == b);
                of_self |= same << i;
                of_other |= same << j;
            }
        }
        if of_self == 7 {
            return true;
        }
        // This settles nearly all pairs, for reasons that alternate: one branch for all of them is fastest.
        let (other_above, other_below) = self.sides(other);
        let (self_above, self_below) = other.sides(self);
        let is_one_sided = (other_above | of_other == 7)
            | (other_below | of_other == 7)
            | (self_above | of_self == 7)
            | (self_below | of_self == 7);
        let all_clear = (other_above | other_below | of_other == 7) & (self_above | self_below | of_self == 7);
        // As in `predicates`: each plane parts the other triangle, and both extend in a common direction or do not.
        let at_corner = all_clear & of_self.is_power_of_two();
        let parts = is_next_set(of_self, self_above) == is_next_set(of_other, other_above);
        if is_one_sided | (at_corner & parts) {
            return false;
        }
        if at_corner {
            return true;
        }
        !self.is_clearly_beside(other, of_self, of_other)
            && !other.is_clearly_beside(self, of_other, of_self)
            && self.crosses_exactly(other)
    }

    /// Which corners of the other triangle are clearly above this one's plane, and which below; a bit each.
    #[inline(always)]
    fn sides(&self, other: &Self) -> (u32, u32) {
        let error = self.error * (self.size + other.size);
        let (mut above, mut below) = (0, 0);
        for (i, &corner) in other.corners.iter().enumerate() {
            let [x, y, z] = difference(self.corners[0], corner);
            let height = x * self.normal[0] + y * self.normal[1] + z * self.normal[2];
            above |= u32::from(height > error) << i;
            below |= u32::from(height < -error) << i;
        }
        (above, below)
    }

    /// Whether the other triangle lies clearly beyond the line through one of this triangle's sides, except for common
    /// corners on that side, as seen along the axis nearest to the normal. Then the two have nothing else in common.
    /// This settles most pairs in one plane, and most close pairs on a surface like the ground.
    ///
    /// `of_self`, `of_other`: the common corners, a bit each.
    fn is_clearly_beside(&self, other: &Self, of_self: u32, of_other: u32) -> bool {
        let [x, y, z] = self.normal.map(f64::abs);
        let axis = if x > y && x > z {
            0
        } else if y > z {
            1
        } else {
            2
        };
        let turn = self.normal[axis];
        (0..3).any(|i| {
            let (j, opposite) = ((i + 1) % 3, (i + 2) % 3);
            let side = [self.corners[i], self.corners[j]];
            let beyond = |corner: [f32; 3]| clear_turn(axis, [side[0], side[1], corner]) * turn;
            of_self >> opposite & 1 == 0
                && beyond(self.corners[opposite]) > 0.0
                && (0..3).all(|k| of_other >> k & 1 == 1 || beyond(other.corners[k]) < 0.0)
        })
    }

    #[cold]
    #[inline(never)]
    fn crosses_exactly(&self, other: &Self) -> bool {
        // Common corners come first in both.
        let (mut a, mut b) = ((self.corners, self.vertices), (other.corners, other.vertices));
        let mut common = 0;
        for i in 0..3 {
            if let Some(j) = (common..3).find(|&j| b.1[j] == a.1[i]) {
                a.0.swap(common, i);
                a.1.swap(common, i);
                b.0.swap(common, j);
                b.1.swap(common, j);
                common += 1;
            }
        }
        cross(&a.0, &b.0, common)
    }
}

/// Whether a bit is set for the corner after the one whose bit is `corner`.
#[inline(always)]
const fn is_next_set(corner: u32, bits: u32) -> bool {
    (bits | bits << 3) & corner << 1 != 0
}

/// From one point to another, in `f64`, where it does not overflow.
#[inline(always)]
fn difference(start: [f32; 3], end: [f32; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from(end[axis]) - f64::from(start[axis]))
}
