//! [`Block`]: a leaf in a field, with finer neighbours across some of its faces, and our mesher on it.

use core::hint::black_box;

use marchless::{FinerNeighbours, LeafSamples, MeshBuffer, MeshSettings, Mesher, Samples, Shape, cell::Face};
use marchless_benches::Field;

/// The leaf's cells per axis.
pub(crate) const CELLS: u32 = 32;
/// The finer steps from the first sample of the field to the leaf's corner: one cell of padding.
pub(crate) const PADDING: u32 = 2;
/// The field's samples per axis, half a cell apart, from the leaf's padding to that on the other side.
pub(crate) const SIZE: u32 = 2 * CELLS + 2 * PADDING + 1;

/// The order in which faces get finer neighbours: three faces meet at a corner.
const ORDER: [u8; 6] = [1, 3, 5, 0, 2, 4];

/// A leaf to mesh.
pub(crate) struct Block<'a> {
    pub(crate) field: Field,
    /// The faces across which the neighbours are finer.
    pub(crate) faces: Vec<Face>,
    /// The field at the finer lattice points, `[SIZE³]`, x fastest.
    distances: &'a [f32],
}

impl<'a> Block<'a> {
    /// The leaf in this field, sampled at [`SIZE`]³ points, with finer neighbours across this number of faces.
    pub(crate) fn new(field: Field, distances: &'a [f32], faces: usize) -> Self {
        let faces = ORDER[..faces].iter().map(|&index| Face::new(index)).collect();
        Self { field, faces, distances }
    }

    pub(crate) fn name(&self) -> String {
        format!("{}, finer faces: {}", self.field.name(), self.faces.len())
    }

    /// Our mesher: each call checks and meshes the samples once, into warm buffers, and counts the triangles.
    pub(crate) fn ours(&self) -> impl FnMut() -> usize + use<> {
        let shape = Shape::cube(CELLS + 3).expect("it is small");
        let own = self.sampled([0; 3], shape, 2);
        let finer =
            FinerNeighbours::from_fn(|towards| self.faces.iter().any(|face| towards[face.axis()] == direction(*face)));
        let faces = Face::ALL.map(|face| {
            self.faces.contains(&face).then(|| {
                let (mut min, mut size) = ([PADDING - 1; 3], [2 * CELLS + 3; 3]);
                min[face.axis()] += if face.is_high() { 2 * CELLS } else { 0 };
                size[face.axis()] = 3;
                let shape = Shape::new(size).expect("it is small");
                (shape, self.sampled(min, shape, 1))
            })
        });
        let (mut mesher, mut mesh, settings) = (Mesher::new(), MeshBuffer::new(), MeshSettings::default());
        move || {
            let samples = |shape, weights| Samples::new(shape, weights).expect("one weight a sample");
            let faces = faces.each_ref().map(|face| face.as_ref().map(|(shape, weights)| samples(*shape, weights)));
            let own = samples(shape, &own).padded();
            let leaf = LeafSamples::new(black_box(own), finer, black_box(faces)).expect("the samples are of one field");
            mesher.mesh_leaf(&leaf, &settings, &mut mesh).expect("the settings are sound");
            black_box(&mesh).triangle_count()
        }
    }

    /// The samples of `shape` from `min` on, `step` apart, all in finer steps of the field.
    fn sampled(&self, min: [u32; 3], shape: Shape, step: u32) -> Vec<f32> {
        let [nx, ny, nz] = shape.size();
        let points = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        points.map(|point| self.at([0, 1, 2].map(|axis| min[axis] + step * point[axis]))).collect()
    }

    /// The field at a finer lattice point.
    pub(crate) fn at(&self, [x, y, z]: [u32; 3]) -> f32 {
        self.distances[((z * SIZE + y) * SIZE + x) as usize]
    }
}

/// The direction of a face along its axis.
const fn direction(face: Face) -> i32 {
    if face.is_high() { 1 } else { -1 }
}
