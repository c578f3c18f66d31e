//! All meshers of the fields, each used as its documentation says.
//!
//! - All get the same samples and mesh at 0. Samples below 0 are inside (transvoxel, for which larger is inside, gets
//!   them negated).
//! - fast-surface-nets leaves the faces on one side to the neighbour, so it gets one more outside layer there.
//! - isomesh, isosurface and transvoxel call a function for values at positions. It returns the samples at lattice
//!   points, and their trilinear interpolation between them, where isomesh computes gradients.
//! - isosurface shares only some of its vertices and mcubes none, and each cell computes its own positions. Their
//!   vertices are merged if they differ only by rounding ([`Mesh::welded`]).

use std::panic::{AssertUnwindSafe, catch_unwind};

use fast_surface_nets::{
    SurfaceNetsBuffer,
    ndshape::{RuntimeShape, Shape as _},
    surface_nets,
};
use isomesh::{
    RuntimeShape3, Sdf,
    extractor::Extractor,
    marching_cubes::{FaceAmbiguity, InteriorAmbiguity},
};
use isosurface::source::Source;
use marchless::{DualSettings, MaterialSet, MeshBuffer, MeshSettings, Mesher, Samples, Shape, Topology};
use transvoxel::prelude::{Block, FieldCaching, GenericMeshBuilder, TransitionSide, extract_from_field};

use crate::{fields::Field, mesh::Mesh};

/// A mesher.
#[derive(Clone, Copy)]
pub(crate) struct Peer {
    /// The crate, its version and its algorithm.
    pub(crate) name: &'static str,
    extract: fn(&Field) -> Option<Mesh>,
}

impl Peer {
    /// The first [`Self::OURS`] are ours.
    pub(crate) const ALL: [Self; 13] = [
        Self { name: "marchless, `Separated`", extract: |field| marchless(field, Topology::Separated) },
        Self { name: "marchless, `Trilinear`", extract: |field| marchless(field, Topology::Trilinear) },
        Self { name: "marchless, dual", extract: |field| dual(field, 0, MaterialSet::EMPTY) },
        Self { name: "marchless, dual, smoothed twice", extract: |field| dual(field, 2, MaterialSet::EMPTY) },
        Self { name: "marchless, dual, sharp", extract: |field| dual(field, 0, MaterialSet::ALL) },
        Self { name: "transvoxel 2.0.0, regular cells", extract: transvoxel },
        Self { name: "isosurface 0.0.4, marching cubes", extract: isosurface },
        Self { name: "mcubes 0.1.7", extract: mcubes },
        Self {
            name: "isomesh 0.0.14, marching cubes",
            extract: |field| isomesh(field, isomesh::marching_cubes::MarchingCubes::new()),
        },
        Self { name: "isomesh 0.0.14, the same, trilinear", extract: isomesh_trilinear },
        Self {
            name: "isomesh 0.0.14, marching tetrahedra",
            extract: |field| isomesh(field, isomesh::marching_tetrahedra::MarchingTetrahedra::new()),
        },
        Self {
            name: "isomesh 0.0.14, manifold dual contouring",
            extract: |field| isomesh(field, isomesh::manifold_dual_contouring::ManifoldDualContouring::new()),
        },
        Self { name: "fast-surface-nets 0.2.1", extract: nets },
    ];
    pub(crate) const OURS: usize = 5;
    /// Of ours, the first are free of any flaw. Dual meshes may have triangles that cross, and vertices that meet.
    pub(crate) const FLAWLESS: usize = 2;

    /// Its mesh of a field; `None` if it refuses or panics.
    pub(crate) fn mesh(self, field: &Field) -> Option<Mesh> {
        catch_unwind(AssertUnwindSafe(|| (self.extract)(field))).ok().flatten()
    }
}

fn marchless(field: &Field, topology: Topology) -> Option<Mesh> {
    let samples = Samples::new(Shape::cube(field.size as u32).ok()?, &field.samples).ok()?;
    let mut mesh = MeshBuffer::new();
    Mesher::new().mesh(samples, &MeshSettings { topology, ..MeshSettings::default() }, &mut mesh).ok()?;
    Some(Mesh { positions: mesh.positions, indices: mesh.indices })
}

fn dual(field: &Field, smoothing: u32, sharp: MaterialSet) -> Option<Mesh> {
    let samples = Samples::new(Shape::cube(field.size as u32).ok()?, &field.samples).ok()?;
    let mut mesh = MeshBuffer::new();
    let settings = DualSettings { smoothing, sharp, ..DualSettings::default() };
    Mesher::new().mesh_dual(samples, &settings, &mut mesh).ok()?;
    Some(Mesh { positions: mesh.positions, indices: mesh.indices })
}

fn nets(field: &Field) -> Option<Mesh> {
    let size = field.size as u32 + 1;
    let shape = RuntimeShape::<u32, 3>::new([size; 3]);
    let samples: Vec<f32> = (0..shape.size()).map(|i| field.at(shape.delinearize(i).map(|v| v as usize))).collect();
    let mut mesh = SurfaceNetsBuffer::default();
    surface_nets(&samples, &shape, [0; 3], [size - 1; 3], &mut mesh);
    Some(Mesh { positions: mesh.positions, indices: mesh.indices })
}

fn isomesh(field: &Field, mut extractor: impl Extractor<f32>) -> Option<Mesh> {
    let shape = RuntimeShape3::new([field.size as u32; 3]).ok()?;
    let mut mesh = isomesh::MeshBuffer::<f32>::new();
    extractor.extract_into(field, &shape, [0.0; 3], 1.0, &mut mesh).ok()?;
    Some(Mesh { positions: mesh.positions, indices: mesh.indices })
}

fn isomesh_trilinear(field: &Field) -> Option<Mesh> {
    let mut extractor = isomesh::marching_cubes::MarchingCubes::new();
    extractor.set_face_ambiguity(FaceAmbiguity::AsymptoticDecider);
    extractor.set_interior_ambiguity(InteriorAmbiguity::Trilinear);
    isomesh(field, extractor)
}

fn isosurface(field: &Field) -> Option<Mesh> {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    isosurface::marching_cubes::MarchingCubes::new(field.size).extract(field, &mut positions, &mut indices);
    let cells = field.size as f32 - 1.0;
    let positions = positions.as_chunks().0.iter().map(|&position: &[f32; 3]| position.map(|v| v * cells)).collect();
    Some(Mesh { positions, indices }.welded())
}

fn transvoxel(field: &Field) -> Option<Mesh> {
    let density = |x: f32, y: f32, z: f32| -field.at([x, y, z].map(|v| v.round() as usize));
    let cells = field.size - 1;
    let (block, sides) = (Block::new([0.0f32; 3], cells as f32, cells), TransitionSide::none());
    let builder = GenericMeshBuilder::new();
    let mesh = extract_from_field(&density, FieldCaching::CacheNothing, block, sides, 0.0, builder).build();
    let indices = mesh.triangle_indices.iter().map(|&index| index as u32).collect();
    Some(Mesh { positions: mesh.positions.as_chunks().0.to_vec(), indices })
}

fn mcubes(field: &Field) -> Option<Mesh> {
    let (size, spacing) = (field.size, (1.0, 1.0, 1.0));
    let samples = field.samples.clone();
    let cubes = mcubes::MarchingCubes::new((size, size, size), spacing, spacing, [0.0; 3].into(), samples, 0.0).ok()?;
    let mesh = cubes.generate(mcubes::MeshSide::OutsideOnly);
    let positions = mesh.vertices.iter().map(|vertex| [vertex.posit.x, vertex.posit.y, vertex.posit.z]).collect();
    let indices = mesh.indices.iter().map(|&index| index as u32).collect();
    Some(Mesh { positions, indices }.welded())
}

impl Sdf for Field {
    type Scalar = f32;

    fn sample(&self, position: [f32; 3]) -> f32 {
        let low = position.map(|v| v.max(0.0) as usize);
        let [tx, ty, tz] = [0, 1, 2].map(|axis| (position[axis] - low[axis] as f32).max(0.0));
        let corner = |x, y, z| self.at([low[0] + x, low[1] + y, low[2] + z]);
        let row = |y, z| mix(corner(0, y, z), corner(1, y, z), tx);
        mix(mix(row(0, 0), row(1, 0), ty), mix(row(0, 1), row(1, 1), ty), tz)
    }
}

impl Source for Field {
    fn sample(&self, x: f32, y: f32, z: f32) -> f32 {
        self.at([x, y, z].map(|v| (v * (self.size - 1) as f32).round() as usize))
    }
}

/// Between `a` and `b`; just `a` at 0, even if `b` is infinite.
fn mix(a: f32, b: f32, t: f32) -> f32 {
    if t == 0.0 { a } else { a * (1.0 - t) + b * t }
}
