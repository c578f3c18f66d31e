//! The peers behind one interface: each takes the samples once, and then meshes them repeatedly into warm buffers and
//! counts triangles.
//!
//! isomesh and isosurface accept no arrays: they call a function for the value at a position. Both request the lattice
//! points in order, x fastest, each once. So the function returns the next sample of a copy without padding, and no
//! position is turned into an index. For the normal at a vertex they call at its position, and get central differences
//! at the nearest sample: the cheapest that a table of samples can give (ours interpolate between the edge's two ends).
//! isomesh normalises them. isosurface does not, so the function does.
//!
//! isosurface meshes one layer of cells more than requested (it gets the padding there), and shares only about half of
//! the vertices that could be shared. Its version 0.1.0-alpha.0 shares all, and takes 4 to 50 times as long.

use core::cell::Cell;

use fast_surface_nets::{
    SignedDistance, SurfaceNetsBuffer,
    ndshape::{ConstShape3u32, RuntimeShape, Shape},
    surface_nets,
};
use isomesh::{RuntimeShape3, Sdf};
use isosurface::{
    marching_cubes::MarchingCubes,
    math::Vec3,
    source::{HermiteSource, Source},
};

use crate::case::Case;

/// An `i8` weight in steps, as fast-surface-nets expects it.
#[derive(Clone, Copy)]
pub(crate) struct Steps(pub(crate) i8);

impl From<Steps> for f32 {
    fn from(steps: Steps) -> Self {
        Self::from(steps.0)
    }
}

impl SignedDistance for Steps {
    fn is_negative(self) -> bool {
        self.0 < 0
    }
}

/// fast-surface-nets on `samples`; `normalise` adds a pass over its normals.
pub(crate) fn nets<T: SignedDistance>(size: u32, samples: Vec<T>, normalise: bool) -> impl FnMut() -> usize {
    assert_eq!(samples.len(), (size as usize).pow(3));
    let mut mesh = SurfaceNetsBuffer::default();
    move || {
        match size {
            35 => nets_of_shape(&ConstShape3u32::<35, 35, 35>, size, &samples, &mut mesh),
            64 => nets_of_shape(&ConstShape3u32::<64, 64, 64>, size, &samples, &mut mesh),
            128 => nets_of_shape(&ConstShape3u32::<128, 128, 128>, size, &samples, &mut mesh),
            256 => nets_of_shape(&ConstShape3u32::<256, 256, 256>, size, &samples, &mut mesh),
            // Whole terrains; up to 7 % slower than with a constant shape.
            _ => nets_of_shape(&RuntimeShape::<u32, 3>::new([size; 3]), size, &samples, &mut mesh),
        }
        if normalise {
            for normal in &mut mesh.normals {
                *normal = unit(*normal);
            }
        }
        core::hint::black_box(&mesh).indices.len() / 3
    }
}

/// The samples 1 to size − 2 on each axis, as in a padded block.
fn nets_of_shape<T: SignedDistance>(
    shape: &impl Shape<3, Coord = u32>,
    size: u32,
    samples: &[T],
    mesh: &mut SurfaceNetsBuffer,
) {
    surface_nets(core::hint::black_box(samples), shape, [1; 3], [size - 2; 3], mesh);
}

/// isomesh's marching cubes, unchanged.
pub(crate) fn isomesh(case: &Case) -> impl FnMut() -> usize + use<> {
    let samples = InOrder::new(case);
    let shape = RuntimeShape3::new([case.size - 2; 3]).expect("the sizes are small");
    let mut mesher = isomesh::marching_cubes::MarchingCubes::<f32>::new();
    let mut mesh = isomesh::MeshBuffer::<f32>::new();
    move || {
        samples.rewind();
        mesh.reset();
        mesher.extract(&samples, &shape, [0.0; 3], 1.0, &mut mesh).expect("there are cells to mesh");
        core::hint::black_box(&mesh).triangle_count()
    }
}

/// isomesh's manifold dual contouring, which asks for samples and gradients at points in any order.
pub(crate) fn isomesh_dual(case: &Case) -> impl FnMut() -> usize + use<> {
    let samples = AnyOrder(InOrder::new(case));
    let shape = RuntimeShape3::new([case.size - 2; 3]).expect("the sizes are small");
    let mut mesher = isomesh::manifold_dual_contouring::ManifoldDualContouring::<f32>::new();
    let mut mesh = isomesh::MeshBuffer::<f32>::new();
    move || {
        mesh.reset();
        isomesh::extractor::Extractor::extract_into(&mut mesher, &samples, &shape, [0.0; 3], 1.0, &mut mesh)
            .expect("there are cells to mesh");
        core::hint::black_box(&mesh).triangle_count()
    }
}

/// The samples at the nearest lattice points.
struct AnyOrder(InOrder);

impl Sdf for AnyOrder {
    type Scalar = f32;

    #[inline]
    fn sample(&self, position: [f32; 3]) -> f32 {
        let [x, y, z] = position.map(|v| (v + 1.5) as usize);
        self.0.padded[x + self.0.size * (y + self.0.size * z)]
    }

    #[inline]
    fn gradient(&self, position: [f32; 3]) -> [f32; 3] {
        self.0.gradient_near(position)
    }
}

/// isosurface's marching cubes with normals.
pub(crate) fn isosurface(case: &Case) -> impl FnMut() -> usize + use<> {
    let samples = InOrder::new(case);
    let mut mesher = MarchingCubes::new(case.size as usize - 2);
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    move || {
        samples.rewind();
        vertices.clear();
        indices.clear();
        mesher.extract_with_normals(&samples, &mut vertices, &mut indices);
        core::hint::black_box((&vertices, &indices)).1.len() / 3
    }
}

/// A source that returns its samples one after another, for callers that request them in order.
struct InOrder {
    /// Samples per axis, padding included.
    size: usize,
    padded: Vec<f32>,
    /// The inner samples of the layers 1 to size − 1: the last is the padding that isosurface asks for.
    inner: Vec<f32>,
    next: Cell<usize>,
}

impl InOrder {
    fn new(case: &Case) -> Self {
        let (size, padded) = (case.size as usize, case.distances().to_vec());
        let row = |z: usize, y: usize| &padded[(z * size + y) * size..][1..size - 1];
        let inner = (1..size).flat_map(|z| (1..size - 1).flat_map(move |y| row(z, y))).copied().collect();
        Self { size, padded, inner, next: Cell::new(0) }
    }

    fn rewind(&self) {
        self.next.set(0);
    }

    #[inline]
    fn take(&self) -> f32 {
        let index = self.next.get();
        self.next.set(index + 1);
        self.inner[index]
    }

    /// Central differences at the sample nearest to `position`, which counts from the first inner sample.
    #[inline]
    fn gradient_near(&self, position: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = position.map(|v| (v + 1.5) as usize);
        let (row, layer) = (self.size, self.size * self.size);
        let (at, samples) = (x + y * row + z.min(self.size - 2) * layer, &self.padded);
        [1, row, layer].map(|step| samples[at + step] - samples[at - step])
    }
}

impl Sdf for InOrder {
    type Scalar = f32;

    #[inline]
    fn sample(&self, _: [f32; 3]) -> f32 {
        self.take()
    }

    #[inline]
    fn gradient(&self, position: [f32; 3]) -> [f32; 3] {
        self.gradient_near(position)
    }
}

impl Source for InOrder {
    #[inline]
    fn sample(&self, _: f32, _: f32, _: f32) -> f32 {
        self.take()
    }
}

impl HermiteSource for InOrder {
    /// Positions run from 0 to 1 over the inner samples.
    #[inline]
    fn sample_normal(&self, x: f32, y: f32, z: f32) -> Vec3 {
        let cells = (self.size - 3) as f32;
        let [x, y, z] = unit(self.gradient_near([x * cells, y * cells, z * cells]));
        Vec3::new(x, y, z)
    }
}

/// The vector scaled to length 1.
#[inline]
fn unit([x, y, z]: [f32; 3]) -> [f32; 3] {
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}
