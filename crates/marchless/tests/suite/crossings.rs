//! Crossing triangles against a plain oracle, which tries all pairs in whole numbers: it clips each side of a triangle
//! to the other triangle.

use marchless::MeshReport;
use proptest::{collection::vec, prelude::*};

type Point = [i128; 3];

fn minus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn dot(a: Point, b: Point) -> i128 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

fn across(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|axis| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

fn normal([a, b, c]: [Point; 3]) -> Point {
    across(minus(b, a), minus(c, a))
}

/// A fraction with a positive denominator.
#[derive(Clone, Copy)]
struct Fraction(i128, i128);

impl Fraction {
    fn is_below(self, other: Self) -> bool {
        self.0 * other.1 < other.0 * self.1
    }
}

/// The part of the way from `p` to `q` that lies in the triangle: the fractions where it starts and ends.
fn cut([p, q]: [Point; 2], triangle: [Point; 3]) -> Option<[Fraction; 2]> {
    let plane = normal(triangle);
    // A point is in the triangle where none of these is negative: both signs of the plane, and the three sides.
    let mut limits = vec![(triangle[0], plane), (triangle[0], plane.map(|v| -v))];
    limits.extend((0..3).map(|i| (triangle[i], across(plane, minus(triangle[(i + 1) % 3], triangle[i])))));
    let [mut first, mut last] = [Fraction(0, 1), Fraction(1, 1)];
    for (point, inward) in limits {
        let (start, slope) = (dot(minus(p, point), inward), dot(minus(q, p), inward));
        if slope == 0 {
            if start < 0 {
                return None;
            }
            continue;
        }
        let border = Fraction(-start * slope.signum(), slope.abs());
        if slope > 0 && first.is_below(border) {
            first = border;
        } else if slope < 0 && border.is_below(last) {
            last = border;
        }
    }
    (!last.is_below(first)).then_some([first, last])
}

/// True if two triangles share a point that is neither a common corner nor on a common side.
fn cross(a: [Point; 3], b: [Point; 3]) -> bool {
    let common: Vec<Point> = a.into_iter().filter(|corner| b.contains(corner)).collect();
    if common.len() == 3 {
        return true;
    }
    // Their intersection is convex, and each of its corners is on a side of one of them.
    [(a, b), (b, a)].into_iter().any(|(sides, other)| {
        (0..3).any(|i| {
            let [p, q] = [sides[i], sides[(i + 1) % 3]];
            let side_is_common = common.contains(&p) && common.contains(&q);
            let is_allowed = |part: Fraction| {
                side_is_common || (part.0 == 0 && common.contains(&p)) || (part.0 == part.1 && common.contains(&q))
            };
            cut([p, q], other).is_some_and(|parts| !parts.into_iter().all(is_allowed))
        })
    })
}

/// The number of crossing triangles by the oracle.
fn crossings(positions: &[Point], indices: &[u32]) -> usize {
    let mut seen = Vec::new();
    let mut triangles = Vec::new();
    for triangle in indices.chunks_exact(3) {
        let mut sorted = triangle.to_vec();
        sorted.sort_unstable();
        let corners = [0, 1, 2].map(|i| positions[triangle[i] as usize]);
        if normal(corners) != [0; 3] && !seen.contains(&sorted) {
            seen.push(sorted);
            triangles.push(corners);
        }
    }
    (0..triangles.len()).map(|i| triangles[..i].iter().filter(|&&other| cross(triangles[i], other)).count()).sum()
}

fn check(positions: &[Point], indices: &[u32], scale: f32) -> Result<(), TestCaseError> {
    let places: Vec<[f32; 3]> = positions.iter().map(|position| position.map(|v| v as f32 * scale)).collect();
    let found = MeshReport::new(&places, indices).crossing_triangles;
    prop_assert_eq!(found, crossings(positions, indices));
    Ok(())
}

/// Whole coordinates below a limit, and triangles between such points.
fn soup(limit: i128, vertices: u32, triangles: usize) -> impl Strategy<Value = (Vec<Point>, Vec<u32>)> {
    let position = [-limit..=limit, -limit..=limit, -limit..=limit];
    (3..=vertices).prop_flat_map(move |vertices| {
        let indices = vec(0..vertices, 3..=3 * triangles);
        (vec(position.clone(), vertices as usize), indices)
    })
}

/// Scales from where a product of three coordinates is the smallest subnormal number to where it overflows `f32`.
fn scales() -> impl Strategy<Value = f32> {
    prop_oneof![Just(1.0), Just(f32::from_bits(1)), Just(2f32.powi(-60)), Just(2f32.powi(113))]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn touching_and_coplanar_triangles((positions, indices) in soup(1, 8, 6), scale in scales()) {
        check(&positions, &indices, scale)?;
    }

    #[test]
    fn flat_soups((positions, indices) in soup(3, 9, 6), scale in scales(), slope in [-3..=3i128, -3..=3]) {
        let flat: Vec<Point> = positions.iter().map(|&[x, y, _]| [x, y, slope[0] * x + slope[1] * y]).collect();
        check(&flat, &indices, scale)?;
    }

    #[test]
    fn crowded_soups((positions, indices) in soup(4, 12, 8), scale in scales()) {
        check(&positions, &indices, scale)?;
    }

    #[test]
    fn any_triangles((positions, indices) in soup(4000, 12, 8), scale in scales()) {
        check(&positions, &indices, scale)?;
    }
}

/// The sum of the crossings in the reports of all pairs of triangles.
fn by_pairs(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> usize {
    let pairs = (0..triangles.len()).flat_map(|i| (0..i).map(move |j| [i, j]));
    pairs.map(|pair| MeshReport::new(positions, pair.map(|i| triangles[i]).as_flattened()).crossing_triangles).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Triangles of very different sizes, isolated, in clusters and far away.
    #[test]
    fn all_pairs_are_found(
        parts in vec(([-1.0f32..1.0, -1.0..1.0, -1.0..1.0], 0..9i32, vec([-1.0f32..1.0, -1.0..1.0, -1.0..1.0], 3)), 2..80),
        far in prop_oneof![Just(1.0f32), Just(1e30)],
    ) {
        let mut positions = Vec::new();
        for (middle, size, corners) in &parts {
            let size = 3f32.powi(-size);
            positions.extend(corners.iter().map(|corner| [0, 1, 2].map(|axis| middle[axis] + corner[axis] * size)));
        }
        positions[0] = positions[0].map(|v| v * far);
        let triangles: Vec<[u32; 3]> = (0..parts.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let found = MeshReport::new(&positions, triangles.as_flattened()).crossing_triangles;
        prop_assert_eq!(found, by_pairs(&positions, &triangles));
    }

    /// With any coordinates, the report does not depend on the order of triangles, corners and axes.
    #[test]
    fn order_does_not_change_the_report(
        positions in vec(
            proptest::array::uniform3(prop_oneof![
                4 => proptest::sample::select(vec![0.0f32, 1.0, -1.0, 1e-45, 1e-38, 1e20, f32::MAX, f32::MIN]),
                1 => proptest::num::f32::ANY,
            ]),
            3..10,
        ),
        corners in vec(0..30u32, 3..40),
        turn in 0..3usize,
    ) {
        let count = positions.len() as u32;
        let mut triangles: Vec<[u32; 3]> =
            corners.chunks_exact(3).map(|t| [0, 1, 2].map(|i| t[i] % count)).collect();
        let report = MeshReport::new(&positions, triangles.as_flattened());

        triangles.reverse();
        triangles.iter_mut().enumerate().for_each(|(i, triangle)| triangle.rotate_left(i % 3));
        let turned: Vec<[f32; 3]> = positions
            .iter()
            .rev()
            .map(|&position| {
                let mut position = position.map(|v| -v);
                position.rotate_left(turn);
                position
            })
            .collect();
        let indices: Vec<u32> = triangles.as_flattened().iter().map(|&index| count - 1 - index).collect();
        prop_assert_eq!(MeshReport::new(&turned, &indices), report);
    }
}

/// One example for each way in which two triangles can meet.
#[test]
fn all_ways_for_two_triangles_to_meet_are_judged() {
    let a = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let crossing = |b: [[f32; 3]; 3]| MeshReport::new([a, b].as_flattened(), &[0, 1, 2, 3, 4, 5]).crossing_triangles;
    let cases = [
        ("pierces the inside", [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [5.0, 5.0, 1.0]], 1),
        ("touches the inside with a corner", [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]], 1),
        ("touches a side with a corner", [[2.0, 0.0, 0.0], [2.0, -1.0, 1.0], [3.0, -1.0, 1.0]], 1),
        ("touches a side with a side", [[2.0, -1.0, -1.0], [2.0, 1.0, 1.0], [2.0, -3.0, 1.0]], 1),
        ("lies within, in the plane", [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 2.0, 0.0]], 1),
        ("has half a side in common", [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, -1.0, 0.0]], 1),
        ("is a copy", a, 1),
        ("is folded over", [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 4.0, 0.0]], 1),
        ("has a corner in common, and leans on a side", [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 4.0]], 1),
        ("has a corner in common, and pierces", [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]], 1),
        ("has a corner in common", [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 1.0]], 0),
        ("has a corner in common, opposite in the plane", [[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], 0),
        ("has a side in common", [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 1.0, 0.001]], 0),
        ("has a side in common, unfolded", [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, -1.0, 0.0]], 0),
        ("is beside it in the plane", [[4.0, 1.0, 0.0], [5.0, 1.0, 0.0], [4.0, 2.0, 0.0]], 0),
        ("is just above", [[1.0, 1.0, 1e-45], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]], 0),
    ];
    for (way, b, expected) in cases {
        assert_eq!(crossing(b), expected, "a triangle that {way}");
    }
}

/// Thousands of copies of one triangle: the full count would take hours.
#[test]
fn the_count_of_crossings_stops_at_its_limit() {
    let positions: Vec<[f32; 3]> =
        (0..15_000).map(|i| [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]][i % 3]).collect();
    let indices: Vec<u32> = (0..15_000).collect();
    assert_eq!(MeshReport::new(&positions, &indices).crossing_triangles, MeshReport::MOST_CROSSINGS);
    let same: Vec<u32> = (0..3_000_000).map(|i| i % 3).collect();
    let report = MeshReport::new(&positions[..3], &same);
    assert_eq!((report.duplicate_triangles, report.crossing_triangles), (999_999, 0));
}
