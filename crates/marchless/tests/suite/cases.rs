//! The 256 cases, derived independently and checked in all pairs of neighbours.
//!
//! This derivation follows no loops. On each face, neighbouring inside corners form a group. One segment between the
//! two edges that leave the group cuts it off; the direction of the segment follows from where the group lies. The
//! boundary of a case's triangles must be exactly these segments.

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use marchless::{
    MeshReport,
    cases::{CROSSED_EDGES, TRIANGLE_COUNTS, TRIANGLES},
    cell::{CaseIndex, Corner, Edge},
};

use crate::support::exact::{boundary, cross, dot, minus, triangles_cross};

/// A directed line between the crossings of two edges.
type Segment = [usize; 2];

/// The ends of an edge: edges 0–3 run along x, 4–7 along y, 8–11 along z.
fn ends(edge: usize) -> [usize; 2] {
    let others = match edge / 4 {
        0 => [2, 4],
        1 => [1, 4],
        _ => [1, 2],
    };
    let low = (edge & 1) * others[0] + (edge >> 1 & 1) * others[1];
    [low, low + (1 << (edge / 4))]
}

/// The position of a corner, in half cells.
fn corner_position(corner: usize) -> [i64; 3] {
    [0, 1, 2].map(|axis| 2 * (corner >> axis & 1) as i64)
}

fn middle(edge: usize) -> [i64; 3] {
    let [a, b] = ends(edge).map(corner_position);
    [0, 1, 2].map(|axis| (a[axis] + b[axis]) / 2)
}

/// The six faces, each with its axis, whether it is the high one, and its four corners.
fn faces() -> impl Iterator<Item = (usize, bool, Vec<usize>)> {
    (0..6).map(|face| {
        let (axis, high) = (face / 2, face % 2 == 1);
        (axis, high, (0..8).filter(|corner| (corner >> axis & 1 == 1) == high).collect())
    })
}

fn is_inside(case: usize, corner: usize) -> bool {
    case >> corner & 1 == 1
}

fn crossed_edges(case: usize) -> Vec<usize> {
    (0..12).filter(|&edge| is_inside(case, ends(edge)[0]) != is_inside(case, ends(edge)[1])).collect()
}

/// The segments of a case on one face.
fn face_segments(case: usize, axis: usize, high: bool, corners: &[usize]) -> Vec<Segment> {
    let mut outward = [0; 3];
    outward[axis] = if high { 1 } else { -1 };
    let mut left: BTreeSet<usize> = corners.iter().copied().filter(|&corner| is_inside(case, corner)).collect();
    let mut segments = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut group = vec![first];
        while let Some(&next) = left.iter().find(|&&c| group.iter().any(|&member| (member ^ c).count_ones() == 1)) {
            left.remove(&next);
            group.push(next);
        }
        let leaving: Vec<usize> = (0..12)
            .filter(|&edge| ends(edge).iter().all(|end| corners.contains(end)))
            .filter(|&edge| ends(edge).iter().filter(|end| group.contains(end)).count() == 1)
            .collect();
        let &[a, b] = &leaving[..] else {
            assert_eq!(group.len(), 4, "a group on a face is left by two edges, or is all of it");
            continue;
        };
        // The surface faces away from the group, and the rest of the cell is to the left of its rim.
        let along = minus(middle(b), middle(a));
        let to_group =
            group.iter().map(|&corner| dot(cross(along, minus(corner_position(corner), middle(a))), outward));
        segments.push(if to_group.sum::<i64>() < 0 { [a, b] } else { [b, a] });
    }
    segments
}

fn segments(case: usize) -> Vec<Segment> {
    faces().flat_map(|(axis, high, corners)| face_segments(case, axis, high, &corners)).collect()
}

fn triangles(case: usize) -> Vec<[usize; 3]> {
    let count = usize::from(TRIANGLE_COUNTS[case]);
    TRIANGLES[case][..count].iter().map(|triangle| triangle.map(Edge::index)).collect()
}

#[test]
fn edges_are_numbered_as_documented() {
    for (index, edge) in Edge::ALL.into_iter().enumerate() {
        assert_eq!(edge.corners().map(Corner::index), ends(index));
        assert_eq!((edge.index(), edge.axis()), (index, index / 4));
    }
    for (case, crossed) in CROSSED_EDGES.into_iter().enumerate() {
        let expected = crossed_edges(case).into_iter().map(|edge| 1 << edge).sum();
        assert_eq!(crossed, expected, "case {case:08b}");
    }
}

#[test]
fn every_case_is_bounded_by_its_face_segments() {
    for case in 0..256 {
        let expected: BTreeMap<Segment, i32> = segments(case).into_iter().map(|segment| (segment, 1)).collect();
        assert_eq!(boundary(&triangles(case)), expected, "case {case:08b}");
        assert_eq!(CaseIndex(case as u8).triangles().len(), triangles(case).len());
    }
}

#[test]
fn every_loop_of_n_crossings_has_n_minus_2_triangles() {
    let mut total = 0;
    for case in 0..256 {
        let segments = segments(case);
        // Each crossing is a piece of its own until a segment joins two; a loop has as many segments as crossings.
        let mut loops: Vec<BTreeSet<usize>> = segments.iter().map(|&[a, b]| [a, b].into()).collect();
        let mut merged = 0;
        while merged < loops.len() {
            match (merged + 1..loops.len()).find(|&other| !loops[merged].is_disjoint(&loops[other])) {
                Some(other) => {
                    let other = loops.swap_remove(other);
                    loops[merged].extend(other);
                }
                None => merged += 1,
            }
        }
        let expected: usize = loops.iter().map(|crossings| crossings.len() - 2).sum();
        assert_eq!(triangles(case).len(), expected, "case {case:08b}");
        total += expected;
    }
    assert_eq!(total, 820);
}

#[test]
fn every_case_is_a_manifold_with_no_diagonal_in_a_face() {
    for case in 0..256 {
        let triangles = triangles(case);
        let positions: Vec<_> = (0..12).map(|edge| middle(edge).map(|v| v as f32)).collect();
        let indices: Vec<u32> = triangles.iter().flatten().map(|&edge| edge as u32).collect();
        let report = MeshReport::new(&positions, &indices);
        let crossed = crossed_edges(case).len();
        assert_eq!((report.unused_vertices, report.boundary_edges), (12 - crossed, crossed), "case {case:08b}");
        assert_eq!(
            (report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges),
            (0, 0, 0),
            "case {case:08b}: {report}"
        );
        let rim = boundary(&triangles);
        for triangle in &triangles {
            for corner in 0..3 {
                let side = [triangle[corner], triangle[(corner + 1) % 3]];
                let ends: Vec<usize> = side.iter().flat_map(|&edge| ends(edge)).collect();
                let in_a_face = faces().any(|(_, _, corners)| ends.iter().all(|end| corners.contains(end)));
                assert_eq!(in_a_face, rim.contains_key(&side), "case {case:08b}, side {side:?}");
            }
        }
    }
}

#[test]
fn all_pairs_of_neighbours_fit() {
    for axis in 0..3 {
        // Twelve samples: 2 × 2 across the axis, three layers along it; a cell per pair of layers.
        for samples in 0..1 << 12 {
            let sample = |corner: usize, layer: usize| {
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(|other| corner >> other & 1);
                4 * ((corner >> axis & 1) + layer) + 2 * v + u
            };
            let mut known: Vec<[usize; 2]> = Vec::new();
            let mut indices = Vec::new();
            for layer in 0..2 {
                let case = (0..8).map(|corner| (samples >> sample(corner, layer) & 1) << corner).sum();
                for edge in triangles(case).into_iter().flatten() {
                    let edge = ends(edge).map(|corner| sample(corner, layer));
                    let index = known.iter().position(|&other| other == edge).unwrap_or(known.len());
                    if index == known.len() {
                        known.push(edge);
                    }
                    indices.push(index);
                }
            }
            let triangles: Vec<[usize; 3]> = indices.as_chunks().0.to_vec();
            // The remaining boundary must not lie in the face between the two cells: samples 4 to 7.
            for side in boundary(&triangles).keys() {
                let shared = side.iter().all(|&crossing| known[crossing].iter().all(|end| (4..8).contains(end)));
                assert!(!shared, "axis {axis}, samples {samples:012b}: {side:?} is open");
            }
            let positions: Vec<_> = known.iter().map(|&[a, b]| [a as f32, b as f32, (a * b) as f32]).collect();
            let indices: Vec<u32> = indices.iter().map(|&index| index as u32).collect();
            let report = MeshReport::new(&positions, &indices);
            assert_eq!(
                (report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges),
                (0, 0, 0),
                "axis {axis}, samples {samples:012b}: {report}"
            );
        }
    }
}

/// Crossings are placed at whole 1024ths of their edges, so that everything below is exact.
const STEPS: i64 = 1024;

fn place(edge: usize, step: i64) -> [i64; 3] {
    let mut position = corner_position(ends(edge)[0]).map(|v| v / 2 * STEPS);
    position[edge / 4] = step;
    position
}

fn assert_nothing_crosses(case: usize, triangles: &[[usize; 3]], steps: &[i64; 12]) {
    let placed: Vec<_> = triangles.iter().map(|triangle| triangle.map(|edge| place(edge, steps[edge]))).collect();
    for (index, &a) in placed.iter().enumerate() {
        for &b in &placed[..index] {
            assert!(!triangles_cross(a, b), "case {case:08b}: {a:?} and {b:?} cross");
        }
    }
}

#[test]
fn triangles_never_cross_at_random_placements() {
    let mut random = Rng::with_seed(256);
    for case in 0..256 {
        let triangles = triangles(case);
        for _ in 0..500 {
            // Half of the crossings are at an end of their edge, where triangles come close.
            let steps = [(); 12].map(|()| match random.u8(..4) {
                0 => 1,
                1 => STEPS - 1,
                _ => random.i64(1..STEPS),
            });
            assert_nothing_crosses(case, &triangles, &steps);
        }
    }
}

#[test]
fn triangles_never_cross_with_all_crossings_at_ends() {
    for case in 0..256 {
        let triangles = triangles(case);
        let crossed = crossed_edges(case);
        for ends in 0..1 << crossed.len() {
            let mut steps = [1; 12];
            for (bit, &edge) in crossed.iter().enumerate() {
                steps[edge] = if ends >> bit & 1 == 1 { STEPS - 1 } else { 1 };
            }
            assert_nothing_crosses(case, &triangles, &steps);
        }
    }
}
