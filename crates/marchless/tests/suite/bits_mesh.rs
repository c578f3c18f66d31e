//! Meshes of bits: with vertices in the middle of edges, with vertices placed by functions, and of many materials.

use std::{cell::Cell, collections::BTreeSet};

use marchless::{
    MeshBuffer, MeshError, MeshReport, MeshSettings, Mesher, Samples, Shape,
    bits::{BitGrid, BitMesher, BitsError, MaterialGrid},
};
use proptest::{collection::vec, prelude::*, sample::select};

use crate::support::{points, random};

/// Small boxes, and rows of about one word or two along any axis.
fn shapes() -> impl Strategy<Value = Shape> {
    let long = (select(&[2, 31, 32, 33, 63, 64, 65, 127, 130][..]), 2..5u32, 2..5u32, 0..3usize);
    let long = long.prop_map(|(long, a, b, turn)| {
        let mut size = [long, a, b];
        size.rotate_right(turn);
        size
    });
    prop_oneof![long, [2..7u32, 2..7u32, 2..7u32]].prop_map(|size| Shape::new(size).expect("no size is 0"))
}

fn is_on_border(shape: Shape, point: [u32; 3]) -> bool {
    (0..3).any(|axis| point[axis] == 0 || point[axis] + 1 == shape.size()[axis])
}

/// White noise of some density; with no set point on the border if `enclosed`.
#[derive(Clone, Copy, Debug)]
struct Noise {
    shape: Shape,
    seed: u64,
    /// How many of 8 points are set.
    density: u64,
    enclosed: bool,
}

impl Noise {
    fn any() -> impl Strategy<Value = Self> {
        (shapes(), any::<u64>(), 1..8u64, any::<bool>()).prop_map(|(shape, seed, density, enclosed)| Self {
            shape,
            seed,
            density,
            enclosed,
        })
    }

    fn is_set(&self, point: [u32; 3]) -> bool {
        random(self.seed, point) % 8 < self.density && !(self.enclosed && is_on_border(self.shape, point))
    }

    fn grid(&self) -> BitGrid {
        BitGrid::from_fn(self.shape, |point| self.is_set(point)).expect("it is small")
    }
}

/// The two ends of each edge of the lattice.
fn edges(shape: Shape) -> impl Iterator<Item = [[u32; 3]; 2]> {
    points(shape.size()).flat_map(move |low| {
        (0..3).filter_map(move |axis| {
            let mut high = low;
            high[axis] += 1;
            (high[axis] < shape.size()[axis]).then_some([low, high])
        })
    })
}

fn middle([low, high]: [[u32; 3]; 2]) -> [f32; 3] {
    [0, 1, 2].map(|axis| (low[axis] + high[axis]) as f32 / 2.0)
}

/// The positions as bits, in order. No position is negative, so the bits have the order of the numbers.
fn places(positions: impl IntoIterator<Item = [f32; 3]>) -> BTreeSet<[u32; 3]> {
    positions.into_iter().map(|position| position.map(f32::to_bits)).collect()
}

fn report(mesh: &MeshBuffer, shape: Shape) -> MeshReport {
    MeshReport::in_box(&mesh.positions, &mesh.indices, [[0.0; 3], shape.size().map(|size| (size - 1) as f32)])
}

fn check_normals(mesh: &MeshBuffer) -> Result<(), TestCaseError> {
    prop_assert_eq!(mesh.normals.len(), mesh.positions.len());
    for normal in &mesh.normals {
        let length = normal.iter().map(|v| v * v).sum::<f32>().sqrt();
        prop_assert!((length - 1.0).abs() < 1e-5, "{:?} is no unit vector", normal);
    }
    Ok(())
}

proptest! {
    #[test]
    fn vertices_are_in_the_middle_of_crossed_edges(noise in Noise::any()) {
        let mut mesh = MeshBuffer::new();
        noise.grid().mesh(&mut mesh).unwrap();
        let crossed = edges(noise.shape).filter(|&[low, high]| noise.is_set(low) != noise.is_set(high));
        let expected = places(crossed.map(middle));
        prop_assert_eq!(mesh.positions.len(), expected.len());
        prop_assert!(places(mesh.positions.iter().copied()) == expected);
        let report = report(&mesh, noise.shape);
        prop_assert!(report.is_clean() && (!noise.enclosed || report.is_closed()), "{}", report);
        check_normals(&mesh)?;
        prop_assert!(mesh.materials.is_empty());
    }

    #[test]
    fn meshes_are_those_of_weights_of_one(noises in vec(Noise::any(), 2..4)) {
        let (mut bit_mesher, mut mesher) = (BitMesher::new(), Mesher::new());
        let (mut plain, settings) = (BitMesher::without_normals(), MeshSettings::default());
        let (mut mesh, mut expected) = (MeshBuffer::new(), MeshBuffer::new());
        for noise in noises {
            let weights: Vec<_> = points(noise.shape.size()).map(|p| if noise.is_set(p) { -1.0f32 } else { 1.0 }).collect();
            let samples = Samples::new(noise.shape, &weights).unwrap();
            mesher.mesh(samples, &settings, &mut expected).unwrap();
            bit_mesher.mesh(&noise.grid(), &mut mesh).unwrap();
            prop_assert!(mesh == expected, "{:?}", noise);
            plain.mesh(&noise.grid(), &mut mesh).unwrap();
            expected.normals.clear();
            prop_assert!(mesh == expected, "{:?}", noise);
        }
    }
}

/// Functions that place vertices.
#[derive(Clone, Copy, Debug)]
enum Function {
    /// Waves of a few cells' length.
    Waves,
    /// Waves times a factor: far too steep, or almost flat.
    Scaled(f32),
    /// The signs of the waves, −1 or 1.
    Steps,
    /// An unrelated random number at each position.
    Wild,
    /// Waves with some values that are not finite.
    Broken,
    /// One value everywhere.
    Constant(f32),
}

impl Function {
    fn any() -> impl Strategy<Value = Self> {
        let constant = select(&[0.0, -0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY][..]);
        prop_oneof![
            3 => Just(Self::Waves),
            1 => select(&[1e38, -1e38, 1e-30, 1e-43, f32::INFINITY][..]).prop_map(Self::Scaled),
            1 => Just(Self::Steps),
            1 => Just(Self::Wild),
            2 => Just(Self::Broken),
            1 => constant.prop_map(Self::Constant),
        ]
    }

    fn at(self, seed: u64, position: [f32; 3]) -> f32 {
        let [x, y, z] = position;
        let phase = (seed % 64) as f32 / 10.0;
        let waves =
            (x * 0.7 + phase).sin() + (y * 0.9 - phase).sin() * (z * 0.6).cos() + 0.3 * (z - x * 0.5 + y * 0.2).sin();
        let wild = random(seed, position.map(f32::to_bits));
        match self {
            Self::Waves => waves,
            Self::Scaled(scale) => waves * scale,
            Self::Steps => waves.signum(),
            Self::Wild => wild as i32 as f32,
            Self::Broken => {
                let broken = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN];
                broken.get((wild % 16) as usize).copied().unwrap_or(waves)
            }
            Self::Constant(value) => value,
        }
    }
}

/// The ends of the edge with this middle.
fn edge_of(middle: [f32; 3]) -> [[u32; 3]; 2] {
    [middle.map(|v| v.floor() as u32), middle.map(|v| v.ceil() as u32)]
}

fn check_placement(noise: Noise, fits: bool, function: Function) -> Result<(), TestCaseError> {
    let at = |position| function.at(noise.seed, position);
    let at_point = |point: [u32; 3]| at(point.map(|v| v as f32));
    let is_set = |point| if fits { at_point(point) < 0.0 } else { noise.is_set(point) };
    let grid = BitGrid::from_fn(noise.shape, is_set).unwrap();
    let (mut even, mut mesh, asked) = (MeshBuffer::new(), MeshBuffer::new(), Cell::new(0));
    grid.mesh(&mut even).unwrap();
    let counted = |position| {
        asked.set(asked.get() + 1);
        at(position)
    };
    grid.mesh_placed(counted, &mut mesh).unwrap();

    prop_assert!(asked.get() <= 14 * mesh.positions.len());
    prop_assert!(mesh.indices == even.indices);
    prop_assert_eq!(mesh.positions.len(), even.positions.len());
    let report = report(&mesh, noise.shape);
    prop_assert!(report.is_clean(), "{}", report);
    check_normals(&mesh)?;
    let corner = |pick: fn(f32, f32) -> f32| {
        mesh.positions.iter().copied().reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis])))
    };
    prop_assert_eq!(mesh.bounds, corner(f32::min).zip(corner(f32::max)).map(|(min, max)| [min, max]));
    let mut zeros = [0; 2];
    for (vertex, &middle) in even.positions.iter().enumerate() {
        let (ends, position) = (edge_of(middle), mesh.positions[vertex]);
        let [low, high] = ends.map(at_point);
        let fits = low.is_finite() && high.is_finite() && ends.iter().all(|&end| is_set(end) == (at_point(end) < 0.0));
        if !fits {
            prop_assert_eq!((position, mesh.normals[vertex]), (middle, even.normals[vertex]));
        }
        for axis in 0..3 {
            let along = position[axis] - ends[0][axis] as f32;
            let on_edge = ends[0][axis] == ends[1][axis] && along == 0.0
                || ends[0][axis] != ends[1][axis] && (1.0 / 1024.0..=1023.0 / 1024.0).contains(&along);
            prop_assert!(on_edge, "{:?} is not on the edge of {:?}", position, middle);
            if fits && matches!(function, Function::Waves) && (0.002..0.998).contains(&along) {
                // Some edges have three zeros.
                prop_assert!(at(position).abs() < 0.03, "{} at {:?}", at(position), position);
                zeros[usize::from(at(position).abs() < 1e-4)] += 1;
            }
        }
    }
    prop_assert!(zeros[0] <= 2 + zeros[1] / 20, "{:?}", zeros);
    Ok(())
}

proptest! {
    #[test]
    fn placed_vertices_are_sound_whatever_the_function(noise in Noise::any(), function in Function::any()) {
        check_placement(noise, false, function)?;
        check_placement(noise, true, function)?;
    }

    /// Placed meshes equal the meshes of samples of the function, except for the places of vertices on their edges. On
    /// a plane, the places are equal, too.
    #[test]
    fn placed_meshes_lie_on_spheres_and_planes(
        center in proptest::array::uniform3(4.0f32..9.0),
        radius in 1.5f32..6.0,
        slope in proptest::array::uniform3(-1.0f32..1.0),
    ) {
        let shape = Shape::new([14, 13, 15]).unwrap();
        let length = slope.iter().map(|v| v * v).sum::<f32>().sqrt();
        prop_assume!(length > 0.1);
        let from_center = |position: [f32; 3]| [0, 1, 2].map(|axis| position[axis] - center[axis]);
        let sphere = |p| from_center(p).iter().map(|v| v * v).sum::<f32>().sqrt() - radius;
        let plane = |p| (0..3).map(|axis| from_center(p)[axis] * slope[axis] / length).sum::<f32>();
        for (function, is_plane) in [(&sphere as &dyn Fn([f32; 3]) -> f32, false), (&plane, true)] {
            let weights: Vec<f32> = points(shape.size()).map(|point| function(point.map(|v| v as f32))).collect();
            let samples = Samples::new(shape, &weights).unwrap();
            let (mut mesh, mut expected_mesh) = (MeshBuffer::new(), MeshBuffer::new());
            Mesher::new().mesh(samples, &MeshSettings::default(), &mut expected_mesh).unwrap();
            BitGrid::from_samples(samples, 0.0).unwrap().mesh_placed(function, &mut mesh).unwrap();
            prop_assert!(mesh.indices == expected_mesh.indices);
            let (mut exact, mut clamped) = (0, 0);
            let [normal_limit, apart_limit] = if is_plane { [1e-4, 1e-4] } else { [3e-3, 1.0] };
            for (vertex, &position) in mesh.positions.iter().enumerate() {
                let along = position.iter().map(|v| v.fract()).fold(0.0, f32::max);
                let off = function(position).abs();
                // Crossings are rounded to 2⁻¹⁴ of their edges.
                exact += usize::from(off < 0.5 / 16_384.0 + 4e-6);
                clamped += usize::from(!(0.001..0.999).contains(&along));
                // The zero is hard to find on an edge that almost touches the sphere.
                prop_assert!(off < if is_plane { 2e-3 } else { 1e-3 }, "{} at {:?}", function(position), position);
                let outward = if is_plane { slope.map(|v| v / length) } else { from_center(position).map(|v| v / radius) };
                for axis in 0..3 {
                    let [normal, expected] = [mesh.normals[vertex][axis], outward[axis]];
                    prop_assert!((normal - expected).abs() < normal_limit, "{} for {}", normal, expected);
                    let [at, expected] = [position[axis], expected_mesh.positions[vertex][axis]];
                    prop_assert!((at - expected).abs() < apart_limit, "{} for {}", at, expected);
                }
            }
            let hard = if is_plane { 0 } else { 4 + mesh.positions.len() / 25 };
            prop_assert!(exact + clamped + hard >= mesh.positions.len(), "{} of {}", exact, mesh.positions.len());
        }
    }
}

/// Noise of a few materials. The first ones are more frequent if the seed is even.
#[derive(Clone, Debug)]
struct Mixture {
    shape: Shape,
    seed: u64,
    planes: u32,
    /// All materials that may occur.
    materials: Vec<u8>,
}

impl Mixture {
    fn any() -> impl Strategy<Value = Self> {
        (shapes(), any::<u64>(), 2..=8u32, vec(any::<u8>(), 2..6)).prop_map(|(shape, seed, planes, mut materials)| {
            materials.iter_mut().for_each(|material| *material &= (255u32 >> (8 - planes)) as u8);
            Self { shape, seed, planes, materials }
        })
    }

    fn at(&self, point: [u32; 3]) -> u8 {
        let bits = random(self.seed, point);
        let count = self.materials.len() as u64;
        let index = if self.seed.is_multiple_of(2) { (bits >> 8) % (1 + bits % count) } else { bits % count };
        self.materials[index as usize]
    }

    fn grid(&self) -> MaterialGrid {
        let materials: Vec<u8> = points(self.shape.size()).map(|point| self.at(point)).collect();
        MaterialGrid::from_materials(self.shape, &materials, self.planes).expect("all of them fit")
    }

    fn distinct(&self) -> BTreeSet<u8> {
        self.materials.iter().copied().collect()
    }

    /// The middles of the edges between points of `a` and of `b`.
    fn between(&self, a: u8, b: u8) -> BTreeSet<[u32; 3]> {
        let joins = |ends: &[[u32; 3]; 2]| {
            let [low, high] = ends.map(|end| self.at(end));
            (low, high) == (a, b) || (low, high) == (b, a)
        };
        places(edges(self.shape).filter(joins).map(middle))
    }
}

proptest! {
    #[test]
    fn set_materials_are_found_again(mixture in Mixture::any()) {
        let grid = mixture.grid();
        let mut built = MaterialGrid::new(mixture.shape, mixture.planes).unwrap();
        prop_assert_eq!((grid.shape(), grid.planes().len()), (mixture.shape, mixture.planes as usize));
        for point in points(mixture.shape.size()) {
            prop_assert_eq!(grid.get(point), Some(mixture.at(point)));
            prop_assert_eq!(built.get(point), Some(0));
            built.set(point, mixture.materials[0]).unwrap();
            built.set(point, mixture.at(point)).unwrap();
        }
        prop_assert!(built == grid);
    }

    #[test]
    fn selections_are_those_of_a_plain_loop(
        shape in shapes(),
        planes in 2..=8u32,
        seed: u64,
        set in prop_oneof![vec(any::<u8>(), 0..6), vec(any::<u8>(), 0..400), (any::<u8>(), any::<u8>()).prop_map(|(a, b)| (a..b).collect())],
    ) {
        let at = |point| (random(seed, point) % (1 << planes)) as u8;
        let materials: Vec<u8> = points(shape.size()).map(at).collect();
        let grid = MaterialGrid::from_materials(shape, &materials, planes).unwrap();
        let expected = BitGrid::from_fn(shape, |point| set.contains(&at(point))).unwrap();
        prop_assert!(grid.select(set.iter().copied()) == expected);
        let mut out = BitGrid::filled(shape, true).unwrap();
        grid.select_into(set, &mut out).unwrap();
        prop_assert!(out == expected);
        prop_assert_eq!(grid.select(0..=255).count(), shape.len());
    }

    #[test]
    fn boundaries_of_two_materials_coincide(mixture in Mixture::any()) {
        let (grid, materials) = (mixture.grid(), mixture.distinct());
        let mut mesh = MeshBuffer::new();
        let mut boundary = |set: &[u8]| {
            grid.mesh(set.iter().copied(), &mut mesh).unwrap();
            let report = report(&mesh, mixture.shape);
            prop_assert!(report.is_clean(), "{}", report);
            check_normals(&mesh)?;
            prop_assert_eq!(mesh.materials.len(), mesh.positions.len());
            for (&position, &material) in mesh.positions.iter().zip(&mesh.materials) {
                let ends = edge_of(position).map(|end| mixture.at(end));
                prop_assert!(ends.contains(&material) && set.contains(&material), "{} at {:?}", material, position);
            }
            let found = places(mesh.positions.iter().copied());
            prop_assert_eq!(found.len(), mesh.positions.len());
            Ok(found)
        };
        for &a in &materials {
            let of_a = boundary(&[a])?;
            let mut others = 0;
            for &b in materials.iter().filter(|&&b| b != a) {
                let (of_b, of_both) = (boundary(&[b])?, boundary(&[a, b])?);
                let between = mixture.between(a, b);
                prop_assert!(of_a.is_superset(&between) && of_b.is_superset(&between));
                prop_assert!(of_both.is_disjoint(&between));
                prop_assert!(of_a.intersection(&of_b).eq(&between));
                others += between.len();
            }
            prop_assert_eq!(of_a.len(), others);
        }
    }
}

#[test]
fn invalid_arguments_are_typed_errors() {
    let mut mesh = MeshBuffer::new();
    let cube = BitGrid::from_fn(Shape::cube(3).unwrap(), |point| point == [1; 3]).unwrap();
    for size in [[1, 2, 2], [2, 1, 2], [2, 2, 1], [1, 1, 1]] {
        let shape = Shape::new(size).unwrap();
        let flat = BitGrid::filled(shape, true).unwrap();
        let too_small = Err(MeshError::TooSmall { shape, least: 2 });
        let materials = MaterialGrid::new(shape, 2).unwrap();
        let mut refused = |mesh_flat: &dyn Fn(&mut MeshBuffer) -> Result<(), MeshError>| {
            cube.mesh(&mut mesh).unwrap();
            assert!(!mesh.is_empty());
            assert_eq!(mesh_flat(&mut mesh), too_small);
            assert_eq!(mesh, MeshBuffer::new());
        };
        refused(&|mesh| flat.mesh(mesh));
        refused(&|mesh| flat.mesh_placed(|_| 0.0, mesh));
        refused(&|mesh| materials.mesh([0], mesh));
    }

    let shape = Shape::new([3, 2, 4]).unwrap();
    for planes in [0, 1, 9, u32::MAX] {
        let error = Err(BitsError::PlanesOutOfRange { found: planes });
        assert_eq!(
            (MaterialGrid::new(shape, planes), MaterialGrid::from_materials(shape, &[0; 24], planes)),
            (error.clone(), error)
        );
    }
    for found in [0, 23, 25] {
        let error = MaterialGrid::from_materials(shape, &vec![0; found], 2);
        assert_eq!(error, Err(BitsError::MaterialsLength { shape, expected: 24, found }));
    }
    let mut materials = [3; 24];
    materials[shape.index([2, 1, 3])] = 4;
    let error = BitsError::MaterialTooLarge { material: 4, position: [2, 1, 3], planes: 2 };
    assert_eq!(error.to_string(), "2 planes hold materials below 4, but 4 was given for [2, 1, 3]");
    assert_eq!(MaterialGrid::from_materials(shape, &materials, 2), Err(error));

    let mut grid = MaterialGrid::from_materials(shape, &materials, 3).unwrap();
    let before = grid.clone();
    assert_eq!(grid.set([0; 3], 8), Err(BitsError::MaterialTooLarge { material: 8, position: [0; 3], planes: 3 }));
    let outside = [3, 0, 0];
    assert_eq!(grid.set(outside, 1), Err(BitsError::OutOfRange { position: outside, shape }));
    assert_eq!((grid.get(outside), &grid), (None, &before));
    let found = Shape::cube(3).unwrap();
    let mut other = BitGrid::new(found).unwrap();
    assert_eq!(grid.select_into([1], &mut other), Err(BitsError::ShapesDiffer { expected: shape, found }));
    // Every byte is a material of 8 planes.
    assert!(MaterialGrid::from_materials(shape, &[255; 24], 8).is_ok());
}
