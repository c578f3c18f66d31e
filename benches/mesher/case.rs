//! [`Case`]: one field of one size, with our mesher and `MeshReport` on it.

use core::{cell::OnceCell, hint::black_box};

use marchless::{DualSettings, MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape, Weight};
use marchless_benches::Field;

/// A field to mesh; sampled at first use.
pub(crate) struct Case {
    pub(crate) field: Field,
    /// Samples per axis, padding included.
    pub(crate) size: u32,
    /// The size as the table shows it.
    pub(crate) extent: String,
    /// The paper's milliseconds for this number of cells.
    pub(crate) paper: Option<&'static str>,
    distances: OnceCell<Vec<f32>>,
}

impl Case {
    pub(crate) fn new(field: Field, size: u32) -> Self {
        Self { field, size, extent: format!("{size}³"), paper: None, distances: OnceCell::new() }
    }

    /// A terrain of `cells` per axis, padding not included.
    pub(crate) fn whole_terrain(cells: u32, paper: &'static str) -> Self {
        let case = Self::new(Field::Terrain, cells + 3);
        Self { extent: format!("{cells}³ cells"), paper: Some(paper), ..case }
    }

    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.field.name(), self.extent)
    }

    /// The number of criterion's samples. A round of white noise at 256³ takes seconds.
    pub(crate) const fn sample_size(&self) -> usize {
        if self.size < 128 { 20 } else { 10 }
    }

    /// The distances, `[size³]`, x fastest, in voxels.
    pub(crate) fn distances(&self) -> &[f32] {
        self.distances.get_or_init(|| self.field.distances(self.size))
    }

    /// The distances as weights.
    pub(crate) fn weights<W: Weight>(&self) -> Vec<W> {
        self.distances().iter().map(|&distance| W::from_voxels(distance)).collect()
    }

    /// Our mesher on weights of type `W`: each call meshes them once, into warm buffers, and counts the triangles.
    pub(crate) fn ours<W: Weight>(&self, settings: MeshSettings) -> impl FnMut() -> usize + use<W> {
        let shape = Shape::cube(self.size).expect("the sizes are small");
        let (weights, mut mesher, mut mesh) = (self.weights::<W>(), Mesher::new(), MeshBuffer::new());
        move || {
            let samples = Samples::new(shape, &weights).expect("one weight a sample").padded();
            mesher.mesh(black_box(samples), &settings, &mut mesh).expect("there are cells to mesh");
            black_box(&mesh).triangle_count()
        }
    }

    /// Our dual mesher on weights of type `W`: each call meshes them once, into warm buffers, and counts the triangles.
    ///
    /// It takes the outermost two layers as padding, and so meshes one cell less per axis than the others.
    pub(crate) fn dual<W: Weight>(&self, settings: DualSettings) -> impl FnMut() -> usize + use<W> {
        let shape = Shape::cube(self.size).expect("the sizes are small");
        let (weights, mut mesher, mut mesh) = (self.weights::<W>(), Mesher::new(), MeshBuffer::new());
        move || {
            let samples = Samples::new(shape, &weights).expect("one weight a sample").padded();
            mesher.mesh_dual(black_box(samples), &settings, &mut mesh).expect("there are cells to mesh");
            black_box(&mesh).triangle_count()
        }
    }

    /// `MeshReport` on our mesh of the `f32` samples: each call checks it once, and counts the triangles.
    pub(crate) fn report(&self) -> impl FnMut() -> usize + use<> {
        let (shape, mut mesh) = (Shape::cube(self.size).expect("the sizes are small"), MeshBuffer::new());
        let samples = Samples::new(shape, self.distances()).expect("one weight a sample").padded();
        Mesher::new().mesh(samples, &MeshSettings::default(), &mut mesh).expect("there are cells to mesh");
        move || MeshReport::new(black_box(&mesh.positions), &mesh.indices).triangles
    }
}
