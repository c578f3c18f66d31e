//! Triangles that cross each other: a tree of boxes finds pairs, planes rule most of them out, exact predicates judge
//! the rest.

use alloc::vec::Vec;
use core::ops::ControlFlow;

use super::{
    MeshReport,
    boxes::{Bounds, BoxTree},
    is_finite,
    places::Places,
    predicates::{Corners, cross, has_no_area},
};

/// How many of the triangles have no area, and how many pairs of the others cross.
///
/// `duplicates`: whether there are any.
pub(super) fn count(
    positions: &[[f32; 3]],
    mut triangles: Vec<[u32; 3]>,
    places: &Places,
    duplicates: bool,
) -> (usize, usize) {
    let corners = |triangle: &[u32; 3]| triangle.map(|vertex| positions[vertex as usize]);
    let mut flat = 0;
    triangles.retain(|triangle| {
        let corners = corners(triangle);
        let finite = corners.iter().all(|&corner| is_finite(corner));
        let no_area = finite && has_no_area(&corners);
        flat += usize::from(no_area);
        finite && !no_area
    });
    if duplicates {
        triangles.iter_mut().for_each(|triangle| triangle.sort_unstable());
        triangles.sort_unstable();
        triangles.dedup();
    }
    triangles.truncate(i32::MAX as usize);

    let boxes: Vec<Bounds> = triangles.iter().map(|triangle| Bounds::of(&corners(triangle))).collect();
    let (tree, order) = BoxTree::of(&boxes);
    let triangles: Vec<Triangle> = order
        .map(|index| {
            let vertices = triangles[index];
            Triangle::new(corners(&vertices), vertices.map(|vertex| places.first(vertex)), &boxes[index])
        })
        .collect();
    drop(boxes);
    let mut found = 0;
    let _ = tree.visit_pairs(&mut |a, b| {
        found += usize::from(triangles[a].crosses(&triangles[b]));
        if found < MeshReport::MOST_CROSSINGS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    (flat, found)
}

/// A triangle with an area, and what rules out most crossings with others.
struct Triangle {
    corners: Corners,
    /// The same numbers for the same places.
    vertices: [u32; 3],
    /// Across the plane, about as long as twice the area.
    normal: [f64; 3],
    /// Times the size of a box around a point and the triangle: what the product of the normal and the point's
    /// distance from the first corner must exceed, so that rounding cannot have changed its sign.
    doubt: f64,
    /// Of the box around it.
    size: f64,
}

impl Triangle {
    fn new(corners: Corners, vertices: [u32; 3], bounds: &Bounds) -> Self {
        let [u, v] = [corners[1], corners[2]].map(|corner| from(corners[0], corner));
        let normal = [0, 1, 2].map(|axis| {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            u[i] * v[j] - u[j] * v[i]
        });
        // Shewchuk's bound for the product is 7.1 times 2⁻⁵³ times six products of three lengths, none of which is longer
        // than the box that they are in.
        let [u, v] = [u, v].map(|side| side.iter().fold(0.0, |longest: f64, length| longest.max(length.abs())));
        const DOUBT: f64 = 64.0 / (1u64 << 53) as f64;
        Self { corners, vertices, normal, doubt: DOUBT * u * v, size: bounds.size() }
    }

    /// Whether two triangles whose boxes meet have a point in common other than common corners and sides.
    #[inline(always)]
    fn crosses(&self, other: &Self) -> bool {
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
        let (other_above, other_below) = self.sides(other);
        if (other_above | of_other == 7) | (other_below | of_other == 7) {
            return false;
        }
        let (self_above, self_below) = other.sides(self);
        if (self_above | of_self == 7) | (self_below | of_self == 7) {
            return false;
        }
        let all_clear = (other_above | other_below | of_other == 7) & (self_above | self_below | of_self == 7);
        if all_clear && of_self.is_power_of_two() {
            // As in `predicates`: where each parts the other, both go on in a common direction or they do not.
            return is_next_set(of_self, self_above) != is_next_set(of_other, other_above);
        }
        self.crosses_exactly(other)
    }

    /// Which corners of the other one are clearly above the plane, and which below; a bit each.
    #[inline(always)]
    fn sides(&self, other: &Self) -> (u32, u32) {
        let doubt = self.doubt * (self.size + other.size);
        let (mut above, mut below) = (0, 0);
        for (i, &corner) in other.corners.iter().enumerate() {
            let [x, y, z] = from(self.corners[0], corner);
            let height = x * self.normal[0] + y * self.normal[1] + z * self.normal[2];
            above |= u32::from(height > doubt) << i;
            below |= u32::from(height < -doubt) << i;
        }
        (above, below)
    }

    #[cold]
    #[inline(never)]
    fn crosses_exactly(&self, other: &Self) -> bool {
        // What they have in common comes first in both.
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
fn from(start: [f32; 3], end: [f32; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from(end[axis]) - f64::from(start[axis]))
}
