//! Ray casts against all the triangles of all the meshes.

use alloc::{sync::Arc, vec::Vec};

use proptest::prelude::*;

use super::*;
use crate::{
    brush::{Operation, QuantisedShape, QuantisedStamp},
    buffer::MeshBuffer,
    lattice::Region,
    mesher::{MeshSettings, Mesher},
};

const CELLS: u32 = 8;
const BOUNDS: Region = Region::new([-1, -1, 0], [2, 1, 2]);

/// A grid with balls added and dug out, and some noise.
fn grid(seed: u64, bounded: bool) -> Grid<i16> {
    let mut grid = if bounded { Grid::bounded(CELLS, BOUNDS) } else { Grid::new(CELLS) }.unwrap();
    let mut rng = fastrand::Rng::with_seed(seed);
    for number in 0..9 {
        let center = [0, 1, 2].map(|_| rng.f64() * 24.0 - 8.0);
        let shape = QuantisedShape::sphere(center, rng.f64() * 6.0 + 1.0).unwrap();
        let operation = if number % 3 == 2 { Operation::Dig } else { Operation::Add };
        grid.apply(&QuantisedStamp::new(shape, operation, number));
    }
    for _ in 0..60 {
        let point = [0, 1, 2].map(|_| rng.i32(0..8));
        grid.set(point, Voxel::new(rng.i16(-300..300), rng.u8(0..5))).unwrap();
    }
    grid
}

struct Triangle {
    chunk: [i32; 3],
    /// In lattice units.
    corners: [[f64; 3]; 3],
    materials: [u8; 3],
}

/// All the triangles of all the chunks' meshes.
fn triangles(grid: &Grid<i16>, isovalue: f32) -> Vec<Triangle> {
    let (mut mesher, mut mesh, mut triangles) = (Mesher::new(), MeshBuffer::new(), Vec::new());
    let settings = MeshSettings { isovalue, ..MeshSettings::default() };
    for chunk in grid.bounds().unwrap_or(Region::new([-5; 3], [6; 3])).points() {
        grid.mesh_chunk(chunk, &mut mesher, settings, &mut mesh).unwrap();
        let base = grid.chunk_region(chunk).min;
        triangles.extend(mesh.triangles().map(|indices| Triangle {
            chunk,
            corners: indices.map(|i| [0, 1, 2].map(|k| f64::from(mesh.positions[i as usize][k]) + f64::from(base[k]))),
            materials: indices.map(|i| mesh.materials[i as usize]),
        }));
    }
    triangles
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The distance of the nearest hit, its triangle and the barycentric weights of the corners. A hit must be at least
/// `margin` inside the triangle's edges.
fn brute_force(
    triangles: &[Triangle],
    origin: [f64; 3],
    direction: [f64; 3],
    max_distance: f64,
    margin: f64,
) -> Option<(f64, &Triangle, [f64; 3])> {
    let direction = direction.map(|v| v / dot(direction, direction).sqrt());
    let hits = triangles.iter().filter_map(|triangle| {
        let [a, b, c] = triangle.corners;
        let (u, v) = (minus(b, a), minus(c, a));
        let p = cross(direction, v);
        let determinant = dot(u, p);
        let from_a = minus(origin, a);
        let q = cross(from_a, u);
        let shares = [dot(from_a, p) / determinant, dot(direction, q) / determinant];
        let shares = [1.0 - shares[0] - shares[1], shares[0], shares[1]];
        let distance = dot(v, q) / determinant;
        let is_hit =
            shares.iter().all(|&share| share >= margin) && (margin..=max_distance - margin).contains(&distance);
        is_hit.then_some((distance, triangle, shares))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn direction() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![
        prop::array::uniform3(-1.0f64..1.0),
        (0usize..3, -5.0f64..5.0).prop_map(|(axis, length)| [0, 1, 2].map(|i| if i == axis { length } else { 0.0 })),
        (0usize..3, prop::array::uniform3(-1.0f64..1.0)).prop_map(|(axis, d)| [0, 1, 2].map(|i| if i == axis {
            0.0
        } else {
            d[i]
        })),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn rays_hit_what_the_meshes_show(
        seed: u64,
        bounded: bool,
        isovalue in prop_oneof![Just(0.0f32), -0.9f32..3.0],
        rays in prop::collection::vec((prop::array::uniform3(-30.0f64..40.0), direction(), 0.0f64..120.0), 60),
        targets in prop::collection::vec(any::<prop::sample::Index>(), 60),
    ) {
        let grid = grid(seed, bounded);
        let triangles = triangles(&grid, isovalue);
        prop_assume!(!triangles.is_empty());
        let mut hits = 0;
        for (number, (&(origin, mut direction, max_distance), target)) in rays.iter().zip(&targets).enumerate() {
            if number % 3 == 0 {
                // Every third ray points into a triangle, so that enough rays hit something.
                let [a, b, c] = triangles[target.index(triangles.len())].corners;
                direction = minus([0, 1, 2].map(|i| a[i] * 0.5 + b[i] * 0.3 + c[i] * 0.2), origin);
            }
            if direction == [0.0; 3] {
                continue;
            }
            let found = grid.ray_cast(isovalue, origin, direction, max_distance);
            let strict = brute_force(&triangles, origin, direction, max_distance, 1e-7);
            let loose = brute_force(&triangles, origin, direction, max_distance, -1e-7);
            if strict.map(|hit| hit.0) != loose.map(|hit| hit.0) {
                continue; // grazing
            }
            hits += usize::from(found.is_some());
            match (found, strict) {
                (None, None) => {}
                (Some(found), Some((distance, triangle, shares))) => {
                    prop_assert!((found.distance - distance).abs() < 1e-6, "{found:?} instead of {distance}");
                    let length = dot(direction, direction).sqrt();
                    for axis in 0..3 {
                        let exact = origin[axis] + direction[axis] / length * distance;
                        prop_assert!((found.position[axis] - exact).abs() < 1e-6, "{found:?}");
                        let at = (exact - f64::from(found.cell[axis])).clamp(0.0, 1.0) + f64::from(found.cell[axis]);
                        prop_assert!((at - exact).abs() < 1e-6, "{found:?} lies outside of its cell");
                    }
                    prop_assert_eq!(found.chunk, triangle.chunk);
                    prop_assert_eq!(found.chunk, grid.chunk_of(found.cell));
                    let [a, b, c] = triangle.corners;
                    let normal = cross(minus(b, a), minus(c, a));
                    let cosine = dot(found.normal.map(f64::from), normal) / dot(normal, normal).sqrt();
                    prop_assert!((cosine - 1.0).abs() < 1e-4, "{found:?}: cosine {cosine}");
                    let best = shares.iter().fold(0.0f64, |best, &share| best.max(share));
                    let nearest = (0..3).filter(|&i| shares[i] > best - 1e-6).map(|i| triangle.materials[i]);
                    prop_assert!(nearest.clone().any(|material| material == found.material));
                }
                _ => prop_assert!(false, "{found:?}, but brute force finds {:?}", strict.map(|hit| hit.0)),
            }
        }
        prop_assert!(hits >= 5, "only {hits} rays hit anything");
    }

    #[test]
    fn the_estimate_of_steps_bounds_every_walk(
        origin in prop::array::uniform3(-300.0f64..300.0), direction in direction(), length in 0.0f64..500.0,
    ) {
        if let Some(ray) = Ray::new(origin, direction, length) {
            let region = Region::new([-4, -30, -5], [20, 30, 7]);
            let (steps, walked) = (ray.steps(region, Cubes::of(8)), ray.walk(region, Cubes::of(8)).count());
            prop_assert!(walked as f64 <= steps && steps <= 2.0 * walked as f64 + 5.0, "{walked}, not {steps}");
        }
    }

    #[test]
    fn hits_of_extreme_rays_are_valid(
        seed: u64,
        bounded: bool,
        origin in prop::array::uniform3(prop_oneof![any::<f64>(), -10.0f64..10.0, Just(-8.0), Just(f64::MAX)]),
        direction in prop::array::uniform3(prop_oneof![any::<f64>(), Just(0.0), Just(5e-324), Just(-1.0)]),
        max_distance in prop_oneof![any::<f64>(), Just(f64::INFINITY), Just(f64::NAN), Just(50.0)],
        isovalue in prop_oneof![any::<f32>(), Just(0.0)],
    ) {
        if let Some(hit) = grid(seed, bounded).ray_cast(isovalue, origin, direction, max_distance) {
            prop_assert!((0.0..=max_distance).contains(&hit.distance), "{hit:?}");
            prop_assert!(hit.position.iter().all(|v| v.is_finite()), "{hit:?}");
            prop_assert!((dot(hit.normal.map(f64::from), hit.normal.map(f64::from)) - 1.0).abs() < 1e-5, "{hit:?}");
        }
    }

    #[test]
    fn weights_between_the_points_are_trilinear(
        slope in prop::array::uniform3(-20i32..20), position in prop::array::uniform3(-7.0f64..6.9),
    ) {
        let mut grid = Grid::<i16>::new(CELLS).unwrap();
        for point in Region::new([-8; 3], [8; 3]).points() {
            let weight = (0..3).map(|i| slope[i] * point[i]).sum::<i32>() as i16;
            grid.set(point, Voxel::new(weight, 0)).unwrap();
        }
        let exact = (0..3).map(|i| f64::from(slope[i]) * position[i]).sum::<f64>() / 256.0;
        for isovalue in [0.0, 1.5] {
            let found = f64::from(grid.weight_at(isovalue, position).unwrap() + isovalue);
            prop_assert!((found - exact).abs() < 1e-5, "{found}, not {exact}");
        }
    }
}

/// So far away, rounding gives all planes of chunks the same distance. A walk that does not advance would never end.
#[test]
fn rays_from_beyond_f64_precision_end() {
    for far in [1e18, 1e40, 1e300] {
        let origin = [far, 0.5, 0.5];
        assert!(
            grid(1, false).ray_cast(0.0, origin, [-1.0, 0.0, 0.0], f64::INFINITY).is_none_or(|hit| hit.distance > 0.0)
        );
        let ray = Ray::new(origin, [-1.0, 0.0, 0.0], f64::INFINITY).unwrap();
        let region = Region::new([-100, 0, 0], [100, 1, 1]);
        assert!(ray.walk(region, Cubes::of(8)).count() as f64 <= ray.steps(region, Cubes::of(8)));
    }
}

#[test]
fn both_sides_are_hit_and_the_normal_points_out() {
    let mut grid = Grid::<i16>::new(16).unwrap();
    grid.apply(&QuantisedStamp::new(QuantisedShape::sphere([0.0; 3], 6.0).unwrap(), Operation::Add, 4));
    let outside = grid.ray_cast(0.0, [0.1, 0.2, 90.0], [0.0, 0.0, -2.0], f64::INFINITY).unwrap();
    assert!((outside.distance - 84.0).abs() < 0.05 && outside.normal[2] > 0.9);
    assert_eq!((outside.material, outside.chunk), (4, [0, 0, 0]));
    let inside = grid.ray_cast(0.0, [0.1, 0.2, 0.3], [0.0, 0.0, -1e-300], 20.0).unwrap();
    assert!((inside.distance - 6.3).abs() < 0.05 && inside.normal[2] < -0.9);
    assert_eq!(inside.chunk, [0, 0, -1]);
    assert_eq!(grid.ray_cast(0.0, [0.1, 0.2, 90.0], [0.0, 0.0, -2.0], 83.9), None);
    assert_eq!(grid.ray_cast(0.0, [0.1, 0.2, 90.0], [0.0, 0.0, 2.0], f64::INFINITY), None);
}

#[test]
fn invalid_rays_hit_nothing() {
    let grid = grid(1, true);
    let cast = |origin, direction, length| grid.ray_cast(0.0, origin, direction, length);
    assert!(cast([4.0, 4.0, 40.0], [0.0, 0.0, -1.0], 100.0).is_some());
    assert_eq!(cast([4.0, 4.0, 40.0], [0.0; 3], 100.0), None);
    assert_eq!(cast([4.0, f64::NAN, 40.0], [0.0, 0.0, -1.0], 100.0), None);
    assert_eq!(cast([4.0, 4.0, 40.0], [0.0, f64::INFINITY, -1.0], 100.0), None);
    assert_eq!(cast([4.0, 4.0, 40.0], [0.0, 0.0, -1.0], f64::NAN), None);
    assert_eq!(grid.ray_cast(f32::NAN, [4.0, 4.0, 40.0], [0.0, 0.0, -1.0], 100.0), None);
    assert_eq!(Grid::<i16>::new(8).unwrap().ray_cast(0.0, [0.0; 3], [1.0; 3], f64::INFINITY), None);
    assert_eq!(grid.weight_at(0.0, [0.0, f64::INFINITY, 0.0]), None);
    assert_eq!(grid.weight_at(0.0, [f64::MAX; 3]), Some(i16::OUTSIDE.to_voxels()));
}

#[test]
fn rays_skip_the_space_between_distant_chunks() {
    let mut grid = Grid::<i16>::new(8).unwrap();
    let far = [(1 << 27) - 100, -1000, 7];
    let ball = |center: [i32; 3], material| {
        let center = center.map(|v| f64::from(v) * 8.0);
        QuantisedStamp::new(QuantisedShape::sphere(center, 6.0).unwrap(), Operation::Add, material)
    };
    grid.apply(&ball([0, 0, 0], 1));
    grid.apply(&ball(far, 2));
    let [x, y, z] = far.map(|v| f64::from(v) * 8.0);
    let cast = |origin, direction| grid.ray_cast(0.0, origin, direction, f64::INFINITY);
    let hit = cast([0.4, 0.3, 50.0], [0.0, 0.0, -1.0]).expect("the ball at the origin is in the way");
    assert_eq!((hit.material, hit.chunk), (1, [0, 0, 0]));
    let hit = cast([x + 0.4, y + 0.3, z - 50.0], [0.0, 0.0, 1.0]).expect("the far ball is in the way");
    assert!(hit.material == 2 && (hit.distance - 44.0).abs() < 0.2, "{hit:?}");
    // A ray along the line through both balls hits the one in front of it.
    assert_eq!(cast([50.0, 0.0, 0.0], [-x, -y, -z]).map(|hit| hit.material), Some(1));
    assert_eq!(cast([100.0, 0.0, 0.0], [x - 100.0, y, z]).map(|hit| hit.material), Some(2));
    assert_eq!(cast([-50.0, 0.0, 0.0], [x + 50.0, y, z]).map(|hit| hit.material), Some(1));
}

#[test]
fn weights_are_finite_whatever_the_samples_are() {
    let mut grid = Grid::<f32>::new(8).unwrap();
    grid.set([0, 0, 0], Voxel::new(f32::NEG_INFINITY, 1)).unwrap();
    grid.set([1, 0, 0], Voxel::new(f32::NAN, 1)).unwrap();
    grid.set([0, 1, 0], Voxel::new(-2.0, 1)).unwrap();
    assert_eq!(grid.weight_at(0.0, [0.0, 1.0, 0.0]), Some(-2.0));
    for position in [[0.0; 3], [0.5; 3], [1.0, 0.0, 0.0], [0.25, 0.0, 0.0]] {
        assert!(grid.weight_at(0.0, position).is_some_and(f32::is_finite), "at {position:?}");
    }
    assert!(grid.weight_at(0.0, [0.0; 3]).is_some_and(|weight| weight < 0.0));
}

/// The nearest hit by brute force: all chunks that have a mesh are tried.
fn nearest_of_all(
    grid: &Grid<i16>,
    isovalue: f32,
    origin: [f64; 3],
    direction: [f64; 3],
    max_distance: f64,
) -> Option<RayHit> {
    let ray = Ray::new(origin, direction, max_distance)?;
    let drawn = grid.chunks().flat_map(|(position, _)| Region::new(position, position).grown(1, 1).points());
    let hits = drawn.filter(|&position| grid.check(position).is_ok()).filter_map(|position| {
        let surface = Surface::new(grid, position, isovalue);
        ray.walk(grid.chunk_region(position), Cubes::of(1)).find_map(|cell| surface.hit(&ray, cell))
    });
    hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// A grid of a few chunks: some side by side, some at both ends of the lattice.
fn sparse_grid() -> impl Strategy<Value = Grid<i16>> {
    let end = Grid::<i16>::largest(CELLS).max[0];
    let coordinate = move || prop_oneof![6 => -3..3i32, 2 => -70..70i32, 1 => -100_000..100_000i32, 1 => Just(end - 2), 1 => Just(-end)];
    let chunk = prop_oneof![
        1 => Just(GridChunk::AIR),
        1 => any::<u8>().prop_map(|material| GridChunk::Uniform(Voxel::new(-300, material))),
        3 => (any::<u64>(), any::<u8>()).prop_map(|(seed, material)| {
            // Slopes, so that the chunk has a surface somewhere, of one side or more.
            let slope = [0, 10, 20].map(|shift| (seed >> shift) as i32 % 256 - 128);
            let start = (seed >> 30) as i32 % 1000 - 500;
            let weight = |p: [i32; 3]| (start + (0..3).map(|axis| slope[axis] * p[axis]).sum::<i32>()) as i16;
            let weights: Vec<_> = Region::new([0; 3], [CELLS as i32; 3]).points().map(weight).collect();
            let materials = alloc::vec![material; weights.len()];
            GridChunk::Samples(Arc::new(GridSamples { weights, materials }))
        }),
    ];
    let chunks = prop::collection::vec(([coordinate(), coordinate(), coordinate()], chunk), 1..40);
    (chunks, 0..3).prop_map(move |(chunks, bounds)| {
        let mut grid = match bounds {
            0 => Grid::new(CELLS),
            1 => Grid::bounded(CELLS, Region::new([-2; 3], [3, 2, 70])),
            _ => Grid::bounded(CELLS, Grid::<i16>::largest(CELLS)),
        }
        .unwrap();
        for (position, chunk) in chunks {
            grid.insert_clean(position, chunk).unwrap();
        }
        grid
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn boxes_hide_nothing_from_rays(
        grid in sparse_grid(),
        isovalue in prop_oneof![Just(0.0f32), -0.9f32..3.0],
        rays in prop::collection::vec((
            any::<prop::sample::Index>(),
            any::<prop::sample::Index>(),
            prop::array::uniform3(-12.0f64..12.0),
            prop_oneof![0.0f64..30.0, 0.0f64..1e4, Just(1e7)],
            direction(),
            prop_oneof![Just(f64::INFINITY), 0.0f64..3e4],
        ), 40),
    ) {
        let positions: Vec<_> = grid.chunks().map(|(position, _)| position).collect();
        prop_assume!(!positions.is_empty());
        for (number, (from, to, shift, away, way, max_distance)) in rays.into_iter().enumerate() {
            let place = |index: prop::sample::Index| positions[index.index(positions.len())].map(|v| f64::from(v) * 8.0);
            let target: [f64; 3] = core::array::from_fn(|axis| place(to)[axis] + 4.0 + shift[axis] / 3.0);
            let origin = match number % 2 {
                0 => core::array::from_fn(|axis| place(from)[axis] + shift[(axis + 1) % 3]),
                _ => core::array::from_fn(|axis| target[axis] - way[axis] * away),
            };
            let direction = minus(target, origin);
            let found = grid.ray_cast(isovalue, origin, direction, max_distance);
            let expected = nearest_of_all(&grid, isovalue, origin, direction, max_distance);
            prop_assert_eq!(found.map(|hit| hit.distance), expected.map(|hit| hit.distance), "{:?}, {:?}", found, expected);
        }
    }
}

/// How many boxes and chunk positions a ray passes that hits nothing.
fn passed(grid: &Grid<i16>, origin: [f64; 3], direction: [f64; 3]) -> (u32, Vec<[i32; 3]>) {
    let ray = Ray::new(origin, direction, f64::INFINITY).unwrap();
    let mut walk = BoxWalk::new(grid.occupancy(), &ray, CELLS);
    let mut chunks = Vec::new();
    assert_eq!(
        walk.find_map(|chunk| -> Option<()> {
            chunks.push(chunk);
            None
        }),
        None
    );
    (walk.passed, chunks)
}

#[test]
fn walks_are_short_whatever_the_grid_holds() {
    let mut grid = Grid::<i16>::new(CELLS).unwrap();
    let ends = [grid.limits().min, grid.limits().max.map(|v| v - 1)];
    let mut load = |region: Region| {
        for position in region.points() {
            grid.insert_clean(position, GridChunk::AIR).unwrap();
        }
        // Rays down, along a slope, past all chunks, and from one end of the lattice to the other.
        let middle = ends[1].map(|v| f64::from(v) * 8.0);
        let rays = [
            ([3.3, 400.0, 5.7], [0.0, -1.0, 0.0]),
            ([200.3, 100.0, 5.7], [-1.0, -0.5, 0.3]),
            ([200.3, 16.1, 5.7], [-1.0, 0.0, 0.3]),
            ([1e12, 1e12, 1e12], [-1.0, -1.0, -1.0]),
            (middle, middle.map(|v| -v)),
            ([4.0, 5.0, -1e300], [0.0, 0.0, 1.0]),
        ];
        rays.map(|(origin, direction)| {
            let (count, chunks) = passed(&grid, origin, direction);
            (count, chunks.len())
        })
    };
    let one = load(Region::new([0; 3], [1; 3]));
    assert!(one.iter().all(|&(passed, chunks)| passed <= 24 && chunks <= 4), "{one:?}");
    let few = load(Region::new([-32, 0, -32], [32, 1, 32]));
    assert!(few.iter().all(|&(passed, chunks)| passed <= 120 && chunks <= 32), "{few:?}");
    // With twelve times as many chunks, only rays along them pass more boxes.
    let many = load(Region::new([-64, -2, -64], [64, 1, 64]));
    assert!(many.iter().all(|&(passed, chunks)| passed <= 160 && chunks <= 64), "{many:?}");
    assert_eq!(many[..2].iter().map(|ray| ray.0).max(), few[..2].iter().map(|ray| ray.0).max());
    // Some boxes on each level, at either end and in the middle.
    for end in ends {
        let far = load(Region::new(end, end.map(|v| v + 1)));
        assert!(far.iter().all(|&(passed, chunks)| passed <= 700 && chunks <= 64), "{far:?}");
    }
}
