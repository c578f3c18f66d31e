//! The 512 cases of a transition cell, derived once more by another route, and checked beside all cells they meet.
//!
//! As in `cases`, no loop is ever followed: segments come from groups of inside corners on each face. Here a cell has
//! 13 corners, the nine samples and the four corners of the coarser face.

use std::{
    array,
    collections::{BTreeMap, BTreeSet},
};

use fastrand::Rng;
use marchless::{
    MeshReport,
    cases::transition::{TRIANGLE_STARTS, TRIANGLES, TransitionCase, TransitionEdge},
    cell::{CaseIndex, Corner},
};
use transvoxel_data::transition_cell_data::{TRANSITION_CELL_CLASS, TRANSITION_CELL_DATA, TRANSITION_VERTEX_DATA};

use crate::support::exact::{Vector, boundary, cross, dot, minus, triangles_cross};

/// A directed line between the crossings of two edges.
type Segment = [usize; 2];

/// The sample of each of the 13 corners.
const SAMPLES: [usize; 13] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 2, 6, 8];

/// The cases with a diagonal in a face: there, two outside samples meet in a square between the inside centre and an
/// inside corner, and nothing of their loops is on the coarser face.
const PINCHED: [usize; 13] = [245, CHECKERBOARD, 343, 349, 350, 351, 371, 373, 375, 413, 469, 477, 501];

/// All but the middles of the finer face's sides are inside.
const CHECKERBOARD: usize = 0b101_010_101;

/// The ends of edge `edge`, as its number says: along u and along v on the finer face, then on the coarser.
fn ends(edge: usize) -> [usize; 2] {
    match edge {
        0..6 => [edge / 2 * 3 + edge % 2, edge / 2 * 3 + edge % 2 + 1],
        6..12 => [edge - 6, edge - 3],
        _ => [[9, 10], [11, 12], [9, 11], [10, 12]][edge - 12],
    }
}

/// Corner `corner`, in half steps of the finer face.
fn corner_position(corner: usize) -> Vector {
    let sample = SAMPLES[corner] as i64;
    [2 * (sample % 3), 2 * (sample / 3), if corner < 9 { 2 } else { 0 }]
}

fn middle(edge: usize) -> Vector {
    let [a, b] = ends(edge).map(corner_position);
    [0, 1, 2].map(|axis| (a[axis] + b[axis]) / 2)
}

/// The nine faces: the direction outward, and the corners.
fn faces() -> Vec<(Vector, Vec<usize>)> {
    let within = |low: Vector, high: Vector| {
        let lies = |corner: &usize| {
            let position = corner_position(*corner);
            (0..3).all(|axis| (low[axis]..=high[axis]).contains(&position[axis]))
        };
        (0..13).filter(lies).collect()
    };
    let squares = [[0, 0], [2, 0], [0, 2], [2, 2]].map(|[u, v]| ([0, 0, 1], within([u, v, 2], [u + 2, v + 2, 2])));
    let others = [
        ([0, 0, -1], within([0, 0, 0], [4, 4, 0])),
        ([-1, 0, 0], within([0, 0, 0], [0, 4, 2])),
        ([1, 0, 0], within([4, 0, 0], [4, 4, 2])),
        ([0, -1, 0], within([0, 0, 0], [4, 0, 2])),
        ([0, 1, 0], within([0, 4, 0], [4, 4, 2])),
    ];
    squares.into_iter().chain(others).collect()
}

fn is_inside(case: usize, corner: usize) -> bool {
    case >> SAMPLES[corner] & 1 == 1
}

fn crossed_edges(case: usize) -> Vec<usize> {
    (0..16).filter(|&edge| is_inside(case, ends(edge)[0]) != is_inside(case, ends(edge)[1])).collect()
}

/// The segments of a case on one face.
fn face_segments(case: usize, outward: Vector, corners: &[usize]) -> Vec<Segment> {
    let is_on_face = |ends: &[usize; 2]| ends.iter().all(|end| corners.contains(end));
    // What joins corners of the face: edges, and the lines between the finer and the coarser face.
    let lines: Vec<[usize; 2]> =
        (0..16).map(ends).chain([[0, 9], [2, 10], [6, 11], [8, 12]]).filter(is_on_face).collect();
    let mut left: BTreeSet<usize> = corners.iter().copied().filter(|&corner| is_inside(case, corner)).collect();
    let mut segments = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut group = vec![first];
        let touches = |group: &[usize], c| {
            lines.iter().any(|line| line.contains(&c) && line.iter().any(|end| group.contains(end)))
        };
        while let Some(&next) = left.iter().find(|&&corner| touches(&group, corner)) {
            left.remove(&next);
            group.push(next);
        }
        let leaves = |edge: &usize| ends(*edge).iter().filter(|end| group.contains(end)).count() == 1;
        let leaving: Vec<usize> = (0..16).filter(|&edge| is_on_face(&ends(edge))).filter(leaves).collect();
        let &[a, b] = &leaving[..] else {
            assert_eq!(group.len(), corners.len(), "a group on a face is left by two edges, or is all of it");
            continue;
        };
        // The surface faces away from the group, and the rest of the cell is to the left of its rim. Corners may lie on
        // the segment's line, but then others do not.
        let along = minus(middle(b), middle(a));
        let to_group: i64 = corners
            .iter()
            .map(|corner| {
                let to_corner = dot(cross(along, minus(corner_position(*corner), middle(a))), outward);
                if group.contains(corner) { to_corner } else { -to_corner }
            })
            .sum();
        segments.push(if to_group < 0 { [a, b] } else { [b, a] });
    }
    segments
}

fn segments(case: usize) -> Vec<Segment> {
    faces().into_iter().flat_map(|(outward, corners)| face_segments(case, outward, &corners)).collect()
}

/// The crossings of each loop: pieces that share no crossing.
fn loops(case: usize) -> Vec<BTreeSet<usize>> {
    let mut loops: Vec<BTreeSet<usize>> = Vec::new();
    for segment in segments(case) {
        let (touched, others): (Vec<_>, Vec<_>) =
            loops.into_iter().partition(|crossings| segment.iter().any(|crossing| crossings.contains(crossing)));
        loops = others;
        loops.push(touched.into_iter().flatten().chain(segment).collect());
    }
    loops
}

fn is_flat(crossings: &BTreeSet<usize>) -> bool {
    crossings.iter().all(|&edge| edge < 12)
}

fn triangles(case: usize) -> Vec<[usize; 3]> {
    let [start, end] = [case, case + 1].map(|case| usize::from(TRIANGLE_STARTS[case]));
    TRIANGLES[start..end].iter().map(|triangle| triangle.map(TransitionEdge::index)).collect()
}

/// Judges how triangles hang together, whatever their vertices are.
fn report<V: Copy + Ord>(triangles: &[[V; 3]], position: impl Fn(V) -> Vector) -> MeshReport {
    let vertices: Vec<V> = triangles.as_flattened().iter().copied().collect::<BTreeSet<V>>().into_iter().collect();
    let positions: Vec<[f32; 3]> = vertices.iter().map(|&vertex| position(vertex).map(|v| v as f32)).collect();
    let index = |vertex: &V| vertices.binary_search(vertex).expect("all vertices are listed") as u32;
    MeshReport::new(&positions, &triangles.as_flattened().iter().map(index).collect::<Vec<u32>>())
}

fn assert_manifold(report: &MeshReport, of: &str) {
    let defects = (report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges);
    assert_eq!((defects, report.duplicate_triangles), ((0, 0, 0), 0), "{of}: {report}");
}

#[test]
fn edges_are_numbered_as_documented() {
    for (index, edge) in TransitionEdge::ALL.into_iter().enumerate() {
        assert_eq!((edge.index(), edge), (index, TransitionEdge::new(index as u8)));
        assert_eq!(edge.samples(), ends(index).map(|corner| SAMPLES[corner]));
        assert_eq!(edge.is_fine(), ends(index).iter().all(|&corner| corner < 9));
    }
    for case in 0..512 {
        let this = TransitionCase::new(case as u16);
        let crossed: Vec<usize> =
            TransitionEdge::ALL.into_iter().filter(|&edge| this.crosses(edge)).map(TransitionEdge::index).collect();
        assert_eq!(crossed, crossed_edges(case), "case {case}");
        assert_eq!((0..9).filter(|&sample| this.is_inside(sample)).map(|sample| 1 << sample).sum::<usize>(), case);
    }
}

#[test]
fn every_case_is_bounded_by_its_face_segments() {
    for case in 0..512 {
        let segments = segments(case);
        let expected: BTreeMap<Segment, i32> = segments.iter().map(|&segment| (segment, 1)).collect();
        assert_eq!(expected.len(), segments.len(), "case {case}");
        for crossing in crossed_edges(case) {
            assert_eq!(segments.iter().filter(|segment| segment.contains(&crossing)).count(), 2, "case {case}");
        }
        assert_eq!(boundary(&triangles(case)), expected, "case {case}");
        let listed = TransitionCase::new(case as u16).triangles();
        assert_eq!(
            listed.iter().map(|triangle| triangle.map(TransitionEdge::index)).collect::<Vec<_>>(),
            triangles(case)
        );
    }
}

#[test]
fn loops_become_discs_and_the_checkerboard_a_ring() {
    let mut total = 0;
    for case in 0..512 {
        let (loops, triangles) = (loops(case), triangles(case));
        assert!(loops.len() <= 4 && loops.iter().all(|crossings| (3..=11).contains(&crossings.len())), "case {case}");
        let report = report(&triangles, middle);
        assert_manifold(&report, &format!("case {case}"));
        assert_eq!(report.boundary_edges, crossed_edges(case).len(), "case {case}");
        if case == CHECKERBOARD {
            let sizes: BTreeSet<usize> = loops.iter().map(BTreeSet::len).collect();
            assert_eq!((sizes, triangles.len()), (BTreeSet::from([4, 8]), 12));
            assert_eq!((report.components, report.euler), (1, 0));
        } else {
            for crossings in &loops {
                let own = triangles.iter().filter(|triangle| triangle.iter().all(|edge| crossings.contains(edge)));
                assert_eq!(own.count(), crossings.len() - 2, "case {case}");
            }
            assert_eq!((report.components, report.euler), (loops.len(), loops.len() as i64), "case {case}");
        }
        total += triangles.len();
    }
    assert_eq!(total, 2640);
}

#[test]
fn only_flat_loops_have_triangles_on_the_finer_face() {
    for case in 0..512 {
        for crossings in loops(case).iter().filter(|crossings| !is_flat(crossings)) {
            let is_fine = |triangle: &[usize; 3]| triangle.iter().all(|edge| *edge < 12 && crossings.contains(edge));
            assert!(!triangles(case).iter().any(is_fine), "case {case}");
        }
    }
}

#[test]
fn diagonals_lie_in_faces_only_where_squares_are_pinched() {
    let faces = faces();
    let has_diagonal_in_face = |case: &usize| {
        let triangles = triangles(*case);
        let rim = boundary(&triangles);
        let sides = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        sides.filter(|side| !rim.contains_key(side)).any(|[a, b]| {
            let ends = [ends(a), ends(b)];
            faces.iter().any(|(_, corners)| ends.as_flattened().iter().all(|end| corners.contains(end)))
        })
    };
    assert_eq!((0..512).filter(has_diagonal_in_face).collect::<Vec<_>>(), PINCHED);
}

/// Eric Lengyel's own tables, as the crate `transvoxel-data` copies them. His triangulations differ from ours.
#[test]
fn segments_and_triangle_counts_are_lengyels() {
    for lengyel in 0..512 {
        // He numbers the samples around the face, the centre last.
        let around = [0, 1, 2, 5, 8, 7, 6, 3, 4];
        let case: usize = (0..9).map(|bit| (lengyel >> bit & 1) << around[bit]).sum();
        let data = TRANSITION_CELL_DATA[usize::from(TRANSITION_CELL_CLASS[lengyel] & 0x7f)];
        let vertices = TRANSITION_VERTEX_DATA[lengyel].map(|vertex| {
            let corners = [usize::from(vertex >> 4 & 15), usize::from(vertex & 15)];
            (0..16).find(|&edge| ends(edge) == corners)
        });
        let corners = &data.vertex_index[..3 * usize::from(data.get_triangle_count())];
        let theirs: Vec<usize> =
            corners.iter().map(|&vertex| vertices[usize::from(vertex)].expect("it is a vertex on an edge")).collect();
        let undirected = |triangles: &[[usize; 3]]| -> BTreeSet<Segment> {
            boundary(triangles).into_keys().map(|[a, b]| [a.min(b), a.max(b)]).collect()
        };
        assert_eq!(undirected(theirs.as_chunks().0), undirected(&triangles(case)), "case {case}");
        assert_eq!(theirs.len(), 3 * triangles(case).len(), "case {case}");
    }
}

/// A crossing in a block of cells: the two lattice points at the ends of its edge, in steps of the finer face. An edge
/// of the coarser face has other ends than the two edges of the finer face in the same place.
type Crossing = [Vector; 2];

/// The triangles of the transition cell whose sample 0 is at `origin` on the plane z = 0.
fn transition_cell([x, y]: [i64; 2], inside: impl Fn(Vector) -> bool) -> Vec<[Crossing; 3]> {
    let point = |sample: usize| [x + sample as i64 % 3, y + sample as i64 / 3, 0];
    let case: usize = (0..9).map(|sample| usize::from(inside(point(sample))) << sample).sum();
    triangles(case).into_iter().map(|t| t.map(|edge| ends(edge).map(|corner| point(SAMPLES[corner])))).collect()
}

/// The triangles of the regular cell of `size` steps whose corner 0 is at `origin`.
fn regular_cell(origin: Vector, size: i64, inside: impl Fn(Vector) -> bool) -> Vec<[Crossing; 3]> {
    let point = |corner: Corner| array::from_fn(|axis| origin[axis] + size * i64::from(corner.offset()[axis]));
    let case = Corner::ALL.iter().map(|&corner| u8::from(inside(point(corner))) << corner.index()).sum();
    CaseIndex(case).triangles().iter().map(|t| t.map(|edge| edge.corners().map(point))).collect()
}

/// Checks that cells fit: their triangles are a manifold, and it is open only where `is_outer` holds for all four ends
/// of the two edges.
fn assert_fit(triangles: &[[Crossing; 3]], is_outer: impl Fn(&[Vector]) -> bool, of: &str) {
    for side in boundary(triangles).keys() {
        assert!(is_outer(side.as_flattened()), "{of}: {side:?} is open");
    }
    let middle = |[a, b]: Crossing| array::from_fn(|axis| a[axis] + b[axis]);
    assert_manifold(&report(triangles, middle), of);
}

#[test]
fn every_case_fits_the_four_cells_at_its_finer_face_and_the_one_at_its_coarser() {
    let mut random = Rng::with_seed(512);
    for case in 0..512 {
        for _ in 0..64 {
            let (above, below) = (random.usize(..512), random.usize(..16));
            let inside = |[x, y, z]: Vector| match z {
                0 => case >> (3 * y + x) & 1 == 1,
                1 => above >> (3 * y + x) & 1 == 1,
                _ => below >> (y + x / 2) & 1 == 1,
            };
            let mut triangles = transition_cell([0, 0], inside);
            for [x, y] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                triangles.extend(regular_cell([x, y, 0], 1, inside));
            }
            triangles.extend(regular_cell([0, 0, -2], 2, inside));
            let is_outer = |ends: &[Vector]| {
                [(0, 0), (0, 2), (1, 0), (1, 2), (2, -2), (2, 1)]
                    .iter()
                    .any(|&(axis, side)| ends.iter().all(|end| end[axis] == side))
            };
            assert_fit(&triangles, is_outer, &format!("case {case}, above {above:09b}, below {below:04b}"));
        }
    }
}

#[test]
fn all_pairs_of_neighbours_fit() {
    for axis in 0..2 {
        // Fifteen samples: five along the axis, three across it.
        for samples in 0..1 << 15 {
            let inside = |point: Vector| samples >> (5 * point[1 - axis] + point[axis]) & 1 == 1;
            let mut second = [0, 0];
            second[axis] = 2;
            let triangles = [transition_cell([0, 0], inside), transition_cell(second, inside)].concat();
            let is_outer = |ends: &[Vector]| ends.iter().any(|end| end[axis] != 2);
            assert_fit(&triangles, is_outer, &format!("axis {axis}, samples {samples:015b}"));
        }
    }
}

/// Crossings are placed at whole 1024ths of their edges, so that everything below is exact.
const STEPS: i64 = 1024;

/// How far the coarser face's sides −u, +u, −v and +v are moved along u and v, in eighths of the cell's width.
type Moved = [i64; 4];

/// All ways to move each side of the coarser face outward or inward by an eighth, or not at all.
fn all_moved() -> impl Iterator<Item = Moved> {
    (0..81).map(|number| [1, 3, 9, 27].map(|power| number / power % 3 - 1))
}

/// The crossing of an edge in a cell eight units wide and one unit thick; a unit is [`STEPS`].
fn place(edge: usize, step: i64, moved: Moved) -> Vector {
    let [a, b] = ends(edge).map(|corner| {
        let [u, v, w] = corner_position(corner);
        if w == 0 { [2 * u + moved[u as usize / 4], 2 * v + moved[2 + v as usize / 4], 0] } else { [2 * u, 2 * v, 1] }
    });
    array::from_fn(|axis| a[axis] * STEPS + (b[axis] - a[axis]) * step)
}

/// Calls `check` with some edges' crossings, as a function of the edge: at the ends of the edges in all combinations
/// and with all coarser faces, then at random placements.
fn for_placements(edges: &BTreeSet<usize>, random: &mut Rng, mut check: impl FnMut(&dyn Fn(usize) -> Vector)) {
    let mut placed = [[0; 3]; 16];
    for moved in all_moved() {
        for ends in 0..1 << edges.len() {
            for (bit, &edge) in edges.iter().enumerate() {
                placed[edge] = place(edge, if ends >> bit & 1 == 1 { STEPS - 1 } else { 1 }, moved);
            }
            check(&|edge| placed[edge]);
        }
        for _ in 0..20 {
            // Ends more often than chance would have it: that is where triangles come close.
            for &edge in edges {
                let step = match random.u8(..4) {
                    0 => 1,
                    1 => STEPS - 1,
                    _ => random.i64(1..STEPS),
                };
                placed[edge] = place(edge, step, moved);
            }
            check(&|edge| placed[edge]);
        }
    }
}

/// Whether two triangles cross does not depend on the rest of their case. So each pair that occurs is placed once.
#[test]
fn triangles_never_cross() {
    let mut pairs = BTreeMap::new();
    for case in 0..512 {
        let triangles = triangles(case);
        for (index, &a) in triangles.iter().enumerate() {
            for &b in &triangles[..index] {
                pairs.insert([a.min(b), a.max(b)], case);
            }
        }
    }
    let mut random = Rng::with_seed(512);
    for ([a, b], case) in pairs {
        for_placements(&a.into_iter().chain(b).collect(), &mut random, |placed| {
            let [a, b] = [a, b].map(|triangle| triangle.map(placed));
            assert!(!triangles_cross(a, b), "case {case}: {a:?} and {b:?} cross");
        });
    }
}

#[test]
fn triangles_always_have_an_area() {
    let all: BTreeSet<[usize; 3]> = (0..512).flat_map(triangles).collect();
    let mut random = Rng::with_seed(512);
    for triangle in all {
        for_placements(&triangle.into(), &mut random, |placed| {
            let [a, b, c] = triangle.map(placed);
            assert_ne!(cross(minus(b, a), minus(c, a)), [0; 3], "{triangle:?} at {:?}", [a, b, c]);
        });
    }
}
