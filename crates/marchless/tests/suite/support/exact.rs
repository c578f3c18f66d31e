//! Triangles of whole numbers, and what is exact about them.

use std::collections::BTreeMap;

/// A point or a direction.
pub(crate) type Vector = [i64; 3];

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|axis| a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3])
}

pub(crate) fn dot(a: Vector, b: Vector) -> i64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// For each directed side, how often it occurs minus how often its reverse does. Sides that cancel are left out.
pub(crate) fn boundary<V: Copy + Ord>(triangles: &[[V; 3]]) -> BTreeMap<[V; 2], i32> {
    let mut sides = BTreeMap::new();
    for triangle in triangles {
        for corner in 0..3 {
            let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
            *sides.entry([a, b]).or_insert(0) += 1;
            *sides.entry([b, a]).or_insert(0) -= 1;
        }
    }
    sides.retain(|_, count| *count > 0);
    sides
}

/// True if the interiors of two triangles have a point in common.
///
/// They have none if an axis separates them. For two triangles it is enough to try the normals, the cross products of a
/// side of each, and the directions in a triangle's plane across its sides.
pub(crate) fn triangles_cross(a: [Vector; 3], b: [Vector; 3]) -> bool {
    let sides = |t: [Vector; 3]| [0, 1, 2].map(|corner| minus(t[(corner + 1) % 3], t[corner]));
    let (sides_a, sides_b) = (sides(a), sides(b));
    let normals = [sides_a, sides_b].map(|sides| cross(sides[0], sides[1]));
    let separates = |axis: Vector| {
        let [(min_a, max_a), (min_b, max_b)] = [a, b].map(|triangle| {
            let along = triangle.map(|corner| dot(corner, axis));
            (along.into_iter().min().unwrap_or(0), along.into_iter().max().unwrap_or(0))
        });
        // They may touch (at a shared corner or side), but not both lie in the plane between them.
        (max_a <= min_b && min_a < max_b) || (max_b <= min_a && min_b < max_a)
    };
    let products = sides_a.into_iter().flat_map(|side_a| sides_b.map(|side_b| cross(side_a, side_b)));
    let in_plane =
        sides_a.map(|side| cross(side, normals[0])).into_iter().chain(sides_b.map(|side| cross(side, normals[1])));
    !normals.into_iter().chain(products).chain(in_plane).any(separates)
}

#[test]
fn crossing_triangles_are_noticed() {
    let floor = [[0, 0, 0], [4, 0, 0], [0, 4, 0]];
    let standing = |x: i64| [[x, 1, -1], [x, 1, 3], [x + 9, 9, 3]];
    assert!(triangles_cross(floor, standing(1)));
    assert!(!triangles_cross(floor, standing(5)));
    // A shared corner or side is no crossing; an overlap in one plane is one.
    assert!(!triangles_cross(floor, [[0, 0, 0], [-4, 0, 1], [0, -4, 1]]));
    assert!(!triangles_cross(floor, [[4, 0, 0], [0, 4, 0], [4, 4, 0]]));
    assert!(triangles_cross(floor, [[4, 0, 0], [0, 4, 0], [1, 1, 0]]));
}
