//! How close meshes come to shapes with creases: a turned cube, a cone, and a cube with a ball cut out and one added.
//!
//! All meshers get the same `f32` samples. isomesh's dual contouring also calls for gradients, and gets its own central
//! differences of the trilinear interpolation. Distances are those of the shape's function, at the corners, the middles
//! of sides and the middle of each triangle. Angles are between the normal at each corner and the function's gradient a
//! little inside the triangle, apart for places with and without a crease within a voxel.
//!
//! `cargo bench -p marchless_benches --bench quality` prints the table. `cargo test` runs it on small shapes, and fails
//! if sharp placement is no better than means.

mod shapes;

use std::{env, process::ExitCode};

use isomesh::{RuntimeShape3, Sdf, extractor::Extractor, manifold_dual_contouring::ManifoldDualContouring};
use marchless::{DualSettings, MaterialSet, MeshBuffer, Mesher, Samples, Shape};
use marchless_benches::aligned;

use shapes::{Point, Scene, dot, unit};

/// A mesher of the samples.
#[derive(Clone, Copy, PartialEq)]
enum Subject {
    Mean,
    Sharp,
    Crease,
    Isomesh,
}

impl Subject {
    const ALL: [Self; 4] = [Self::Mean, Self::Sharp, Self::Crease, Self::Isomesh];

    const fn name(self) -> &'static str {
        match self {
            Self::Mean => "marchless, dual",
            Self::Sharp => "marchless, dual, sharp",
            Self::Crease => "marchless, dual, sharp, creases at 0.5",
            Self::Isomesh => "isomesh 0.0.14, manifold dual contouring",
        }
    }

    fn mesh(self, grid: &Grid) -> Mesh {
        if self == Self::Isomesh {
            let shape = RuntimeShape3::new([grid.size as u32; 3]).expect("the sizes are small");
            let mut mesh = isomesh::MeshBuffer::<f32>::new();
            let mut extractor = ManifoldDualContouring::new();
            extractor.extract_into(grid, &shape, [0.0; 3], 1.0, &mut mesh).expect("there are cells");
            return Mesh { positions: mesh.positions, normals: mesh.normals, indices: mesh.indices };
        }
        let sharp = if self == Self::Mean { MaterialSet::EMPTY } else { MaterialSet::ALL };
        let crease = (self == Self::Crease).then_some(0.5);
        let settings = DualSettings { sharp, crease, ..DualSettings::default() };
        let samples = Samples::new(Shape::cube(grid.size as u32).expect("the sizes are small"), &grid.samples);
        let mut mesh = MeshBuffer::new();
        Mesher::new().mesh_dual(samples.expect("one weight a sample"), &settings, &mut mesh).expect("there are cells");
        Mesh { positions: mesh.positions, normals: mesh.normals, indices: mesh.indices }
    }
}

struct Mesh {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    indices: Vec<u32>,
}

/// The samples of a scene, `[size³]`, x fastest.
struct Grid {
    size: usize,
    samples: Vec<f32>,
}

impl Grid {
    fn new(scene: &Scene, size: usize) -> Self {
        let points = (0..size * size * size).map(|i| [i % size, i / size % size, i / (size * size)]);
        Self { size, samples: points.map(|point| scene.distance(point.map(|v| v as f64)) as f32).collect() }
    }
}

impl Sdf for Grid {
    type Scalar = f32;

    fn sample(&self, position: [f32; 3]) -> f32 {
        let most = self.size as f32 - 1.0;
        let position = position.map(|v| v.clamp(0.0, most));
        let low = position.map(|v| (v as usize).min(self.size - 2));
        let t = [0, 1, 2].map(|axis| position[axis] - low[axis] as f32);
        let at = |x, y, z| self.samples[low[0] + x + self.size * (low[1] + y + self.size * (low[2] + z))];
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |y, z| mix(at(0, y, z), at(1, y, z), t[0]);
        mix(mix(row(0, 0), row(1, 0), t[1]), mix(row(0, 1), row(1, 1), t[1]), t[2])
    }
}

/// The largest and the sum of some errors.
#[derive(Default)]
struct Errors {
    largest: f64,
    sum: f64,
    count: usize,
}

impl Errors {
    fn add(&mut self, error: f64) {
        self.largest = self.largest.max(error);
        self.sum += error;
        self.count += 1;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }
}

struct Verdict {
    /// At vertices alone, and at all points of triangles.
    vertices: Errors,
    far_vertices: usize,
    points: Errors,
    angles: [Errors; 2],
}

/// Compares a mesh with its scene.
fn judge(scene: &Scene, mesh: &Mesh) -> Verdict {
    let mut verdict = Verdict {
        vertices: Errors::default(),
        far_vertices: 0,
        points: Errors::default(),
        angles: [Errors::default(), Errors::default()],
    };
    for position in &mesh.positions {
        let distance = scene.distance(position.map(f64::from)).abs();
        verdict.vertices.add(distance);
        verdict.far_vertices += usize::from(distance > 0.05);
    }
    for triangle in mesh.indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].map(f64::from));
        let mean = |weights: [f64; 3]| -> Point {
            [0, 1, 2].map(|k| weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k])
        };
        let third = 1.0 / 3.0;
        let points = [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [third; 3]];
        for point in [a, b, c].into_iter().chain(points.map(mean)) {
            verdict.points.add(scene.distance(point).abs());
        }
        for (corner, &vertex) in triangle.iter().enumerate() {
            let mut weights = [0.15; 3];
            weights[corner] = 0.7;
            let point = mean(weights);
            let normal = unit(mesh.normals[vertex as usize].map(f64::from));
            let angle = dot(normal, scene.normal(point)).clamp(-1.0, 1.0).acos().to_degrees();
            verdict.angles[usize::from(scene.has_crease(point))].add(angle);
        }
    }
    verdict
}

fn main() -> ExitCode {
    // Criterion's own rule: without `--bench`, the caller is `cargo test`.
    let testing = !env::args().any(|argument| argument == "--bench");
    let size = if testing { 20 } else { 64 };
    let heads = [
        "shape",
        "mesher",
        "vertices",
        "far off",
        "largest, vertices",
        "mean",
        "largest, triangles",
        "mean",
        "largest angle, smooth",
        "mean",
        "largest angle, crease",
        "mean",
    ];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    let mut is_better = true;
    for scene in Scene::all(size as f64) {
        let grid = Grid::new(&scene, size);
        let mut far_means = 0;
        for subject in Subject::ALL {
            let mesh = subject.mesh(&grid);
            let verdict = judge(&scene, &mesh);
            match subject {
                Subject::Mean => far_means = verdict.far_vertices,
                Subject::Sharp => is_better &= verdict.far_vertices < far_means,
                Subject::Crease | Subject::Isomesh => (),
            }
            let Verdict { vertices, points, angles: [smooth, crease], far_vertices } = verdict;
            let names = [scene.name(), subject.name()].map(str::to_owned);
            let counts = [mesh.positions.len(), far_vertices].map(|count| count.to_string());
            let distances = [vertices, points].map(|errors| [errors.largest, errors.mean()].map(|v| format!("{v:.4}")));
            let angles = [smooth, crease].map(|errors| [errors.largest, errors.mean()].map(|v| format!("{v:.2}°")));
            let numbers = [distances, angles].into_iter().flatten().flatten();
            rows.push(names.into_iter().chain(counts).chain(numbers).collect());
        }
    }
    println!("{}", aligned(&rows));
    println!("{size}³ samples; distances in voxels; far off: vertices more than 0.05 voxels from the shape");
    if is_better { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
