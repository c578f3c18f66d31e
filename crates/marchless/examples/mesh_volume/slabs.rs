//! A stand-in for the core's slab mesher: it keeps all slabs.

use marchless::{MeshBuffer, MeshError, MeshSettings, Mesher, Samples, Shape, Weight};

pub(crate) struct SlabMesher<W> {
    size: [u32; 2],
    settings: MeshSettings,
    weights: Vec<W>,
    slabs: u32,
}

impl<W: Weight> SlabMesher<W> {
    pub(crate) fn new(size: [u32; 2], settings: MeshSettings) -> Result<Self, MeshError> {
        Ok(Self { size, settings, weights: Vec::new(), slabs: 0 })
    }

    pub(crate) fn push(&mut self, slab: &[W], _out: &mut MeshBuffer) -> Result<(), MeshError> {
        self.weights.extend_from_slice(slab);
        self.slabs += 1;
        Ok(())
    }

    pub(crate) fn finish(&mut self, out: &mut MeshBuffer) -> Result<(), MeshError> {
        let shape = Shape::new([self.size[0], self.size[1], self.slabs]).expect("a shape");
        let samples = Samples::new(shape, &self.weights).expect("samples");
        Mesher::new().mesh(samples, &self.settings, out)
    }
}
