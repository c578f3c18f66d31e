//! Every pattern of signs in one cell, in two neighbours and in 2 × 2 × 1 cells, and ten million patterns of 2 × 2 × 2.
//!
//! In both topologies, and with any values of these signs, the surface is closed except for its rim in the faces of the
//! box, 2-manifold, consistently oriented, and without degenerate triangles.

mod small;

use std::thread;

use fastrand::Rng;
use marchless::{MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Topology};
use small::{Defect, SmallBox, SmallJudge};

const TOPOLOGIES: [Topology; 2] = [Topology::Separated, Topology::Trilinear];

/// Kinds of values with given signs.
#[derive(Clone, Copy, Debug)]
enum Values {
    /// −1 and 1: every saddle equals the isovalue.
    Ones,
    /// Whole numbers up to 3: many saddles equal the isovalue.
    Few,
    /// −1, 0 and 1: samples equal the isovalue, too.
    Zeros,
    /// Uniformly distributed.
    Even,
    /// Magnitudes from 1e-38 to 1e38.
    Wide,
    /// Not finite, the largest, or almost zero.
    Extreme,
}

const VALUES: [Values; 6] = [Values::Ones, Values::Few, Values::Zeros, Values::Even, Values::Wide, Values::Extreme];

impl Values {
    fn value(self, inside: bool, random: &mut Rng) -> f32 {
        let magnitude = match self {
            Self::Ones => 1.0,
            Self::Few => f32::from(random.u8(1..=3)),
            Self::Zeros if inside => 1.0,
            Self::Zeros => f32::from(random.u8(..2)),
            Self::Even => (1.0 - random.f64()) as f32,
            Self::Wide => f32::from_bits((random.u32(..) >> 1).clamp(0x006c_e3ee, 0x7e96_7699)),
            Self::Extreme => {
                let outside = [f32::NAN, f32::INFINITY, f32::MAX, 0.0, 1e-45, 1.0, -0.0];
                let inside_or_outside = [f32::INFINITY, f32::MAX, 1e-45, 1.0, 1e-40, 3e38];
                if inside || random.bool() {
                    inside_or_outside[random.usize(..inside_or_outside.len())]
                } else {
                    outside[random.usize(..outside.len())]
                }
            }
        };
        if inside { -magnitude } else { magnitude }
    }
}

/// A mesher, its mesh, the judge of the mesh, and a source of random values.
struct Bench {
    mesher: Mesher,
    mesh: MeshBuffer,
    judge: SmallJudge,
    random: Rng,
    weights: [f32; 27],
    /// The number of meshes made.
    meshes: usize,
    triangles: usize,
}

impl Bench {
    fn new(seed: u64) -> Self {
        Self {
            mesher: Mesher::new(),
            mesh: MeshBuffer::new(),
            judge: SmallJudge::new(),
            random: Rng::with_seed(seed),
            weights: [0.0; 27],
            meshes: 0,
            triangles: 0,
        }
    }

    /// Fills the samples with random values.
    fn fill(&mut self, small: SmallBox, values: Values) {
        for index in 0..small.len() {
            self.weights[index as usize] = values.value(small.inside >> index & 1 == 1, &mut self.random);
        }
    }

    fn mesh(&mut self, small: SmallBox, topology: Topology) {
        let settings = MeshSettings { topology, normals: false, ..MeshSettings::default() };
        let shape = Shape::new(small.size).expect("a small shape");
        let samples = Samples::new(shape, &self.weights[..shape.len()]).expect("one weight a sample");
        self.mesher.mesh(samples, &settings, &mut self.mesh).expect("there are cells");
        self.meshes += 1;
        self.triangles += self.mesh.triangle_count();
    }

    fn report(&self, small: SmallBox) -> MeshReport {
        MeshReport::in_box(&self.mesh.positions, &self.mesh.indices, small.bounds())
    }

    /// Checks both topologies of one set of values.
    fn check(&mut self, small: SmallBox, values: Values) {
        self.fill(small, values);
        for topology in TOPOLOGIES {
            self.mesh(small, topology);
            let defect = match self.judge.judge(&self.mesh, small, topology == Topology::Trilinear) {
                Ok(_) => continue,
                Err(Defect::TooManyVertices(_)) if self.report(small).is_clean() => continue,
                Err(defect) => defect,
            };
            let weights = &self.weights[..small.len() as usize];
            panic!("{topology:?}, {small:?}, {weights:?}: {defect:?} in {:?}", self.mesh);
        }
    }
}

/// Checks each of `patterns` with values of each of these kinds, `repeats` times, in two threads.
fn check_all(size: [u32; 3], patterns: u32, values: &[Values], repeats: usize) {
    let checked: [usize; 2] = in_two_threads(|half| {
        let mut bench = Bench::new(u64::from(size[0] + 7 * size[1] + 49 * size[2] + half));
        for inside in (half..patterns).step_by(2) {
            for _ in 0..repeats {
                for &values in values {
                    bench.check(SmallBox { size, inside }, values);
                }
            }
        }
        bench.meshes
    });
    assert_eq!(checked.iter().sum::<usize>(), patterns as usize * values.len() * repeats * 2);
}

fn in_two_threads<T: Send>(work: impl Fn(u32) -> T + Sync) -> [T; 2] {
    thread::scope(|scope| {
        let other = scope.spawn(|| work(1));
        let own = work(0);
        match other.join() {
            Ok(other) => [own, other],
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

#[test]
fn all_256_cases_are_sound() {
    check_all([2; 3], 1 << 8, &VALUES, 200);
}

#[test]
fn all_pairs_of_face_neighbours_are_sound() {
    for size in [[3, 2, 2], [2, 3, 2], [2, 2, 3]] {
        check_all(size, 1 << 12, &VALUES, 4);
    }
}

#[test]
fn all_patterns_of_2_by_2_by_1_cells_are_sound() {
    for size in [[3, 3, 2], [3, 2, 3], [2, 3, 3]] {
        check_all(size, 1 << 18, &[Values::Ones, Values::Few], 1);
    }
}

#[test]
fn ten_million_patterns_of_2_by_2_by_2_cells_are_sound() {
    let seed = 0x6d61_7263_686c_6573;
    println!("seed {seed:#x}");
    let checked = in_two_threads(|half| {
        let mut bench = Bench::new(seed + u64::from(half));
        for pattern in 0..5_000_000 {
            let inside = bench.random.u32(..) & ((1 << 27) - 1);
            // Mostly those that make decisions; the last kinds take longest.
            let values = VALUES[if pattern % 8 == 0 { pattern / 8 % VALUES.len() } else { pattern % 4 }];
            bench.check(SmallBox { size: [3; 3], inside }, values);
        }
        [bench.meshes, bench.triangles]
    });
    let [meshes, triangles] = [0, 1].map(|i| checked[0][i] + checked[1][i]);
    println!("{meshes} meshes, {triangles} triangles");
    assert_eq!(meshes, 20_000_000);
}

/// Checks with the full report, which also finds triangles that cross each other.
#[test]
fn the_triangles_of_a_cell_never_cross() {
    let mut bench = Bench::new(24);
    for inside in 0..256 {
        for number in 0..500 {
            let small = SmallBox { size: [2; 3], inside };
            bench.fill(small, VALUES[number % VALUES.len()]);
            for topology in TOPOLOGIES {
                bench.mesh(small, topology);
                let report = bench.report(small);
                let (weights, mesh) = (&bench.weights[..8], &bench.mesh);
                assert!(report.is_clean(), "{topology:?}, {weights:?}: {report} in {mesh:?}");
            }
        }
    }
}

/// Damages a mesh in a random way.
fn spoil(mesh: &mut MeshBuffer, random: &mut Rng) {
    let mut any = |len: usize| random.usize(..len);
    let (vertices, corners) = (mesh.positions.len(), mesh.indices.len());
    let (vertex, corner) = (any(vertices), any(corners));
    let first = corner / 3 * 3;
    match any(8) {
        0 => drop(mesh.indices.drain(first..first + 3)),
        1 => mesh.indices.swap(first, first + 1),
        2 => mesh.indices.extend_from_within(first..first + 3),
        3 => mesh.indices[corner] = vertex as u32,
        4 => mesh.positions[vertex] = mesh.positions[any(vertices)],
        5 => mesh.positions.push([0.5, 1.0, 1.0]),
        6 => mesh.indices[corner] = vertices as u32,
        // A strip of two triangles is cut along its other diagonal.
        _ => {
            let [a, b, c] = [0, 1, 2].map(|i| mesh.indices[first + i]);
            let side =
                |other: usize| (0..3).find(|&i| (mesh.indices[other + (i + 1) % 3], mesh.indices[other + i]) == (a, b));
            if let Some((other, i)) = (0..corners).step_by(3).find_map(|other| Some((other, side(other)?))) {
                let d = mesh.indices[other + (i + 2) % 3];
                mesh.indices[first..first + 3].copy_from_slice(&[a, d, c]);
                mesh.indices[other..other + 3].copy_from_slice(&[d, b, c]);
            }
        }
    }
}

/// Meshes that the judge accepts, intact or damaged, are clean in the full report, too, except for triangles that cross
/// each other: the judge does not look for those.
#[test]
fn the_judge_is_no_milder_than_the_report() {
    let mut bench = Bench::new(42);
    let (mut sound, mut spoilt) = (0, 0);
    for pattern in 0..6000 {
        let size = [[3, 3, 3], [2, 3, 3], [3, 2, 2], [2, 2, 2]][pattern % 4];
        let inside = bench.random.u32(..) & ((1 << (size[0] * size[1] * size[2])) - 1);
        let (small, values) = (SmallBox { size, inside }, VALUES[pattern % VALUES.len()]);
        bench.fill(small, values);
        bench.mesh(small, TOPOLOGIES[pattern / 4 % 2]);
        if bench.mesh.is_empty() {
            continue;
        }
        let is_spoilt = pattern % 3 > 0;
        if is_spoilt {
            spoil(&mut bench.mesh, &mut bench.random);
        }
        let mut report = bench.report(small);
        if is_spoilt {
            // Another diagonal may make triangles cross each other, which the judge leaves to the report.
            report.crossing_triangles = 0;
        }
        match bench.judge.judge(&bench.mesh, small, true) {
            Ok(found) => {
                assert!(report.is_clean(), "{report}: {:?}", bench.mesh);
                assert_eq!(found.rim, report.boundary_edges, "{report}: {:?}", bench.mesh);
                sound += 1;
            }
            Err(Defect::TooManyVertices(_)) => {}
            Err(defect) => {
                assert!(is_spoilt, "{defect:?}: {:?}", bench.mesh);
                spoilt += 1;
            }
        }
    }
    println!("{sound} sound, {spoilt} spoilt");
    assert!(sound > 1900 && spoilt > 3000);
}
