//! Exact predicates of triangles in space: whether they have an area, and whether they cross.
//!
//! All signs come from the crate `robust`, after Jonathan Richard Shewchuk, "Adaptive Precision Floating-Point
//! Arithmetic and Fast Robust Geometric Predicates" (1997). They are exact as long as nothing overflows or underflows:
//! with coordinates that were `f32`, differences are at most 2¹²⁹ and multiples of 2⁻¹⁴⁹, their products of three at
//! most 2³⁹⁰ and multiples of 2⁻⁴⁴⁷, which `f64` can represent.

use robust::{Coord, Coord3D, orient2d, orient3d};

/// A triangle's corners; finite.
pub(super) type Corners = [[f32; 3]; 3];

/// Whether the corners lie on one line, or at one point.
pub(super) fn has_no_area(corners: &Corners) -> bool {
    (0..3).all(|axis| clear_turn(axis, *corners) == 0.0) && (0..3).all(|axis| turn(axis, *corners) == 0.0)
}

/// Which way three points turn, seen along an axis: a number of that sign, and 0 if rounding may have changed the sign.
#[inline(always)]
pub(super) fn clear_turn(axis: usize, points: [[f32; 3]; 3]) -> f64 {
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let [a, b, c] = points.map(|point| [f64::from(point[x]), f64::from(point[y])]);
    let (left, right) = ((a[0] - c[0]) * (b[1] - c[1]), (a[1] - c[1]) * (b[0] - c[0]));
    let turn = left - right;
    // Shewchuk's bound is (3 + 16 × 2⁻⁵³) × 2⁻⁵³ times this sum.
    const ERROR: f64 = 4.0 / (1u64 << 53) as f64;
    if turn.abs() > ERROR * (left.abs() + right.abs()) { turn } else { 0.0 }
}

/// Whether two triangles have a point in common that is neither a common vertex nor on a common edge. `common`: how
/// many of the first corners of both are equal, in the same order; all others differ.
///
/// Both have an area.
pub(super) fn cross(a: &Corners, b: &Corners, common: usize) -> bool {
    match common {
        0 => cross_apart(a, b),
        1 => cross_at_corner(a, b),
        // In one plane, and on one side of the common edge.
        2 => {
            let axis = flat_axis(a);
            side(a, b[2]) == 0.0 && (turn(axis, *a) > 0.0) == (turn(axis, *b) > 0.0)
        }
        _ => true,
    }
}

/// Whether triangles without a common corner have a point in common.
fn cross_apart(a: &Corners, b: &Corners) -> bool {
    let on_one_side = |a: &Corners, b: &Corners| {
        let sides = b.map(|corner| side(a, corner));
        sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0)
    };
    let edges = |corners: &Corners| [[corners[0], corners[1]], [corners[1], corners[2]], [corners[2], corners[0]]];
    !on_one_side(a, b)
        && !on_one_side(b, a)
        && (edges(b).into_iter().any(|edge| meets(a, edge)) || edges(a).into_iter().any(|edge| meets(b, edge)))
}

/// Whether triangles with a common first corner extend in a common direction from there.
fn cross_at_corner(a: &Corners, b: &Corners) -> bool {
    let in_a = [side(a, b[1]), side(a, b[2])];
    if in_a == [0.0; 2] {
        // In one plane, where a side of one of them leads into the other.
        let axis = flat_axis(a);
        let turns = [1, 2].map(|i| [1, 2].map(|j| turn(axis, [a[0], a[i], b[j]])));
        let [a_turn, b_turn] = [turn(axis, *a), turn(axis, *b)];
        let within = |from: f64, to: f64, turn: f64| from * turn.signum() >= 0.0 && to * turn.signum() <= 0.0;
        return (0..2).any(|j| within(turns[0][j], turns[1][j], a_turn))
            || (0..2).any(|i| within(-turns[i][0], -turns[i][1], b_turn));
    }
    let in_b = [side(b, a[1]), side(b, a[2])];
    if is_one_sided(in_a) || is_one_sided(in_b) {
        return false;
    }
    // The planes meet in a line through the corner. Let p and q lead from there to the others of `a`, P and Q to those
    // of
    // `b`, with n = p × q and N = P × Q. Then the line is along n × N = (p·N) q − (q·N) p = (n·Q) P − (n·P) Q: into `a`
    // where p·N ≥ 0 ≥ q·N, and into `b` where n·P ≤ 0 ≤ n·Q.
    leads_down(in_b) != leads_down(in_a)
}

/// Whether both of two sides are above, or both below.
fn is_one_sided([first, second]: [f64; 2]) -> bool {
    (first > 0.0 && second > 0.0) || (first < 0.0 && second < 0.0)
}

/// Whether the first of two sides, not both of which are 0, is above the second, where they are not one-sided.
fn leads_down([first, second]: [f64; 2]) -> bool {
    first > 0.0 || second < 0.0
}

/// Whether a triangle and a line segment have a point in common.
fn meets(triangle: &Corners, [p, q]: [[f32; 3]; 2]) -> bool {
    let &[a, b, c] = triangle;
    let (p_side, q_side) = (side(triangle, p), side(triangle, q));
    if p_side == 0.0 && q_side == 0.0 {
        return meets_in_plane(flat_axis(triangle), triangle, [p, q]);
    }
    if is_one_sided([p_side, q_side]) {
        return false;
    }
    // The line goes through the plane in one point, and passes the three sides on the same hand where that is within.
    let hands = [[a, b], [b, c], [c, a]].map(|[start, end]| side(&[p, q, start], end));
    hands.iter().all(|&hand| hand >= 0.0) || hands.iter().all(|&hand| hand <= 0.0)
}

/// Whether a triangle and a line segment in its plane have a point in common, seen along an axis that is not parallel
/// to the plane.
fn meets_in_plane(axis: usize, &[a, b, c]: &Corners, [p, q]: [[f32; 3]; 2]) -> bool {
    let sides = [[a, b], [b, c], [c, a]];
    let turns = sides.map(|[start, end]| turn(axis, [start, end, p]));
    let p_within = turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0);
    p_within || sides.iter().any(|&side| segments_meet(axis, [p, q], side))
}

/// Whether two segments, neither of length 0, have a point in common, seen along an axis.
fn segments_meet(axis: usize, [p, q]: [[f32; 3]; 2], [a, b]: [[f32; 3]; 2]) -> bool {
    let from_pq = [turn(axis, [p, q, a]), turn(axis, [p, q, b])];
    let from_ab = [turn(axis, [a, b, p]), turn(axis, [a, b, q])];
    if is_one_sided(from_pq) || is_one_sided(from_ab) {
        return false;
    }
    // On one line, they meet where their boxes do.
    from_pq != [0.0; 2]
        || (0..3).all(|k| k == axis || (p[k].min(q[k]) <= a[k].max(b[k]) && a[k].min(b[k]) <= p[k].max(q[k])))
}

/// An axis that is not parallel to a triangle's plane.
fn flat_axis(corners: &Corners) -> usize {
    (0..2).find(|&axis| turn(axis, *corners) != 0.0).unwrap_or(2)
}

/// On which side of a triangle's plane a point lies: the sign, 0 in the plane.
fn side(&[a, b, c]: &Corners, point: [f32; 3]) -> f64 {
    let at = |[x, y, z]: [f32; 3]| Coord3D { x, y, z };
    orient3d(at(a), at(b), at(c), at(point))
}

/// Which way three points turn, seen along an axis: the sign, 0 on one line.
fn turn(axis: usize, points: [[f32; 3]; 3]) -> f64 {
    let [a, b, c] = points.map(|point| Coord { x: point[(axis + 1) % 3], y: point[(axis + 2) % 3] });
    orient2d(a, b, c)
}
