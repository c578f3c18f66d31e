//! [`SlabPipeline`]: what one more slab of samples adds to the mesh.

use super::{
    error::MeshError,
    primal::{FirstVertices, VertexPass, write_triangles},
    settings::{MeshSettings, Topology},
    trilinear::TrilinearCells,
};
use crate::{
    active::ActiveCells,
    buffer::MeshBuffer,
    sample::Weight,
    signs::{SignSweep, SlabLayout, Window, crossing_count},
    simd::Simd,
};

/// The state that passes from slab to slab.
#[derive(Clone, Debug)]
pub(super) struct SlabPipeline {
    signs: SignSweep,
    /// The active cells between the slab below and the current one.
    active: ActiveCells,
    /// Those of them that [`Topology::Trilinear`] decides by their weights.
    trilinear: TrilinearCells,
    /// The numbers of the newest slab's first vertices on edges along x and along y.
    first_within: [u64; 2],
    /// All vertices so far.
    pub(super) vertex_count: u64,
}

/// The role of a slab in the volume, or in the part of it that is being meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SlabRole {
    /// The first slab: there is none below it.
    First,
    /// A slab above another one.
    Inner,
    /// The last slab of a part, which is the next part's first. The next part makes the vertices within it.
    Shared,
}

impl SlabPipeline {
    pub(super) const fn new() -> Self {
        Self {
            signs: SignSweep::new(),
            active: ActiveCells::new(),
            trilinear: TrilinearCells::new(),
            first_within: [0; 2],
            vertex_count: 0,
        }
    }

    /// Meshes one more slab: the vertices between it and the slab below, the vertices within it, and the triangles
    /// between the two slabs. `next`: the slab above, if there is one.
    ///
    /// # Errors
    /// [`MeshError::TooManyVertices`].
    #[inline(always)]
    pub(super) fn step<S: Simd, W: Weight>(
        &mut self,
        layout: &SlabLayout,
        window: &Window<'_, W>,
        role: SlabRole,
        next: Option<&[W]>,
        settings: &MeshSettings,
        vertices: &mut VertexPass<W>,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        let is_first = role == SlabRole::First;
        if is_first {
            self.vertex_count = 0;
        }
        self.signs.advance::<S, W>(layout, is_first.then_some(window.slabs[2]), next, W::threshold(settings.isovalue));
        let has_active = !is_first && self.signs.write_out_pair(layout);
        let first_between = self.vertex_count;
        if has_active {
            self.mesh_between::<S, W>(layout, window, settings, vertices, out);
        }
        let below = self.first_within;
        self.first_within = self.mesh_within::<S, W>(layout, window, role, settings, vertices, out);
        if self.vertex_count > u64::from(u32::MAX) {
            return Err(MeshError::TooManyVertices { found: self.vertex_count });
        }
        if has_active {
            let [x, y] = [0, 1].map(|axis| [below[axis] as u32, self.first_within[axis] as u32]);
            let first = FirstVertices { x, y, z: first_between as u32 };
            let codes = self.active.codes_mut();
            write_triangles::<S>(layout, self.signs.pair(), &first, codes, &self.trilinear, &mut out.indices);
        }
        Ok(())
    }

    /// Makes the vertices on edges along z from the slab below, finds the active cells, and decides those of
    /// [`Topology::Trilinear`].
    #[inline(always)]
    fn mesh_between<S: Simd, W: Weight>(
        &mut self,
        layout: &SlabLayout,
        window: &Window<'_, W>,
        settings: &MeshSettings,
        vertices: &mut VertexPass<W>,
        out: &mut MeshBuffer,
    ) {
        let ([below, current], edges) = (self.signs.pair(), window.edges_between());
        self.vertex_count += vertices.add::<S, 2>(layout, &edges, settings, below.signs(), current.signs(), out);
        self.trilinear.clear();
        let is_trilinear = settings.topology == Topology::Trilinear;
        self.active.fill::<S, _>(layout, below, current, is_trilinear.then(|| self.trilinear.ambiguous_mut()));
        if is_trilinear {
            let (codes, bounds) = (self.active.codes_mut(), &mut vertices.bounds);
            self.vertex_count +=
                self.trilinear.decide::<S, W>(layout, &edges, settings, codes, self.vertex_count, bounds, out);
        }
    }

    /// Makes the vertices on edges along x and y, unless the next part makes them. Returns the number of the first one
    /// of each axis.
    #[inline(always)]
    fn mesh_within<S: Simd, W: Weight>(
        &mut self,
        layout: &SlabLayout,
        window: &Window<'_, W>,
        role: SlabRole,
        settings: &MeshSettings,
        vertices: &mut VertexPass<W>,
        out: &mut MeshBuffer,
    ) -> [u64; 2] {
        let first_x = self.vertex_count;
        let Some(current) = self.signs.current_mixed() else { return [first_x; 2] };
        let (signs, next) = (current.signs(), current.next());
        if role == SlabRole::Shared {
            return [first_x, first_x + crossing_count(signs, next)];
        }
        let edges = window.edges_within();
        self.vertex_count += vertices.add::<S, 0>(layout, &edges, settings, signs, next, out);
        let first_y = self.vertex_count;
        let below_last_row = &signs[..signs.len() - layout.words];
        self.vertex_count +=
            vertices.add::<S, 1>(layout, &edges, settings, below_last_row, &signs[layout.words..], out);
        [first_x, first_y]
    }
}
