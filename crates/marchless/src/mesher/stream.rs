//! [`SlabMesher`]: meshes volumes that come slab by slab and need not fit in memory.

use alloc::vec::Vec;

use super::{
    error::MeshError,
    job::{Input, MeshJob},
    pipeline::SlabPipeline,
    settings::MeshSettings,
};
use crate::{
    buffer::MeshBuffer,
    sample::Weight,
    signs::{SlabLayout, Window},
    simd::Backend,
};

/// Meshes a volume that comes slab by slab along z, and keeps four slabs of it.
///
/// Its output, joined, is the mesh that [`Mesher::mesh`](super::Mesher::mesh) makes of the whole volume, byte for byte,
/// with the same guarantees. Slabs have no materials.
///
/// ```
/// use marchless::{MeshBuffer, MeshSettings, SlabMesher};
///
/// // A slope, 16 samples high. Only one slab of it exists at a time.
/// let mut mesher = SlabMesher::new([32, 32], MeshSettings::default())?;
/// let mut mesh = MeshBuffer::new();
/// let mut triangles = 0;
/// for z in 0..16 {
///     let slab: Vec<f32> = (0..32 * 32).map(|index| z as f32 - (index % 32) as f32 / 3.0).collect();
///     mesher.push(&slab, &mut mesh)?;
///     // Write the mesh to a file here. Indices go on counting after the mesh is cleared.
///     triangles += mesh.triangle_count();
///     mesh.clear();
/// }
/// mesher.finish(&mut mesh)?;
/// triangles += mesh.triangle_count();
/// assert!(triangles > 2000);
/// # Ok::<(), marchless::MeshError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SlabMesher<W> {
    backend: Backend,
    settings: MeshSettings,
    size: [u32; 2],
    layout: SlabLayout,
    pipeline: SlabPipeline,
    /// The newest slabs: slab `z` at `z % 4`.
    newest: [Vec<W>; 4],
    /// The number of slabs that were pushed.
    count: usize,
}

impl<W: Weight> SlabMesher<W> {
    /// A mesher for slabs of `size` samples along x and y, at least 2 each. It meshes all cells; at the volume's border
    /// the gradient is one-sided.
    ///
    /// # Errors
    /// [`MeshError::SlabSize`] if an axis has fewer than 2 samples or a slab does not fit in memory;
    /// [`MeshError::Isovalue`] if the isovalue is not finite.
    pub fn new(size: [u32; 2], settings: MeshSettings) -> Result<Self, MeshError> {
        settings.check()?;
        let layout = SlabLayout::of_slabs(size).ok_or(MeshError::SlabSize { size })?;
        let (backend, pipeline) = (Backend::fastest(), SlabPipeline::new());
        Ok(Self { backend, settings, size, layout, pipeline, newest: Default::default(), count: 0 })
    }

    /// Reads the next slab and appends the vertices and triangles that it completes to `out`. `slab`: `[nx·ny]`, x
    /// fastest.
    ///
    /// `out` may be emptied between calls: indices count all vertices since the first slab.
    ///
    /// # Errors
    /// [`MeshError::SlabLength`]; nothing has then changed. [`MeshError::TooManyVertices`], then from every further
    /// call too; `out` then ends with vertices of no triangle.
    pub fn push(&mut self, slab: &[W], out: &mut MeshBuffer) -> Result<(), MeshError> {
        if slab.len() != self.layout.len {
            let (size, expected) = (self.size, self.layout.len);
            return Err(MeshError::SlabLength { size, expected, found: slab.len() });
        }
        let fill = |newest: &mut Vec<W>| {
            newest.clear();
            newest.extend_from_slice(slab);
        };
        self.push_with(fill, out)
    }

    /// [`SlabMesher::push`] for a slab that `fill` writes to a vector, which holds an older slab or nothing.
    pub(crate) fn push_with(&mut self, fill: impl FnOnce(&mut Vec<W>), out: &mut MeshBuffer) -> Result<(), MeshError> {
        let newest = &mut self.newest[self.count % 4];
        fill(newest);
        debug_assert_eq!(newest.len(), self.layout.len);
        self.count += 1;
        // Gradients need the slab above.
        if self.count >= 2 { self.step(self.count - 2, out) } else { Ok(()) }
    }

    /// Appends the rest of the mesh to `out`, after the last slab.
    ///
    /// # Errors
    /// [`MeshError::TooFewSlabs`] if fewer than 2 slabs were pushed; [`MeshError::TooManyVertices`].
    pub fn finish(mut self, out: &mut MeshBuffer) -> Result<(), MeshError> {
        self.end(out)
    }

    /// [`SlabMesher::finish`] for a mesher that will [start over](Self::start_over).
    pub(crate) fn end(&mut self, out: &mut MeshBuffer) -> Result<(), MeshError> {
        if self.count < 2 {
            return Err(MeshError::TooFewSlabs { found: self.count });
        }
        self.step(self.count - 1, out)
    }

    /// Begins another volume and keeps the memory.
    ///
    /// # Errors
    /// [`MeshError::SlabSize`], as from [`SlabMesher::new`].
    pub(crate) fn start_over(&mut self, size: [u32; 2]) -> Result<(), MeshError> {
        self.layout = SlabLayout::of_slabs(size).ok_or(MeshError::SlabSize { size })?;
        (self.size, self.count) = (size, 0);
        Ok(())
    }

    fn step(&mut self, z: usize, out: &mut MeshBuffer) -> Result<(), MeshError> {
        let last = self.count - 1;
        let around = [z.saturating_sub(2), z.saturating_sub(1), z, last.min(z + 1)];
        let window = Window {
            slabs: around.map(|z| &self.newest[z % 4][..]),
            materials: None,
            z,
            one_sided: [z <= 1, z == 0 || z == last],
        };
        let input = Input::Stream { window, has_next: z < last };
        let (settings, pipeline) = (&self.settings, &mut self.pipeline);
        MeshJob { input, layout: self.layout, settings, pipeline, out }.run_on(self.backend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        lattice::{Samples, Shape},
        mesher::Mesher,
    };

    #[test]
    fn vertices_that_indices_cannot_name_are_refused() {
        let mut mesh = MeshBuffer::new();
        let mut mesher = SlabMesher::<i8>::new([2, 2], MeshSettings::default()).unwrap();
        mesher.push(&[1; 4], &mut mesh).unwrap();
        // Four vertices come between these two slabs.
        mesher.push(&[-1; 4], &mut mesh).unwrap();
        let mut last = mesher.clone();
        last.pipeline.vertex_count = u64::from(u32::MAX) - 4;
        last.finish(&mut mesh).unwrap();
        mesher.pipeline.vertex_count = u64::from(u32::MAX) - 3;
        mesh.clear();
        let too_many = MeshError::TooManyVertices { found: u64::from(u32::MAX) + 1 };
        assert_eq!(mesher.push(&[-1; 4], &mut mesh), Err(too_many));
        assert_eq!((mesher.push(&[-1; 4], &mut mesh), mesh.triangle_count()), (Err(too_many), 0));

        let weights = [1i8, 1, 1, 1, -1, -1, -1, -1];
        let samples = Samples::new(Shape::cube(2).unwrap(), &weights).unwrap();
        let mut next = Mesher { pipeline: mesher.pipeline, ..Mesher::new() };
        next.mesh(samples, &MeshSettings::default(), &mut mesh).unwrap();
        assert_eq!(mesh.triangle_count(), 2);
    }
}
