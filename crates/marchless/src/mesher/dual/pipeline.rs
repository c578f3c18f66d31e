//! [`DualJob`]: slab by slab from samples to vertices and quads.

use alloc::vec::Vec;

use super::{
    Extent, Offset, STEPS,
    cells::{CellRows, CellSearch, CellVertices, EdgeList, VertexList},
    crease::Creases,
    place::{BATCH, Batch, CellSlabs},
    quadric::Quadric,
    quads::{Quad, QuadBatch, QuadEdges},
    settings::DualSettings,
    sharp::Planes,
    smooth::{Smoothing, smooth},
};
use crate::{
    buffer::MeshBuffer,
    cell::Edge,
    lattice::Samples,
    mesher::MeshError,
    sample::{
        Weight,
        private::{PerWeight, Sealed},
    },
    signs::{SignSweep, SlabLayout, Window, uniform_prefix},
    simd::{Backend, Job, Simd, dispatch},
};

/// Scratch memory of [`Mesher::mesh_dual`](crate::Mesher::mesh_dual).
#[derive(Clone, Debug)]
pub(in crate::mesher) struct DualPipeline {
    signs: SignSweep<4>,
    search: CellSearch,
    /// The edges with quads that begin on the present slab, by axis.
    edges: [EdgeList; 3],
    quad_batch: QuadBatch,
    /// The vertices of the cells below the present slab of cells, and of that slab.
    cells: [CellVertices; 2],
    /// The vertices of the present slab of cells; if vertices are finished together, those of all slabs.
    list: VertexList,
    /// The places of all vertices in their cells.
    offsets: Vec<Offset>,
    planes: Planes,
    /// The quadrics of all vertices, if any material is sharp.
    quadrics: Vec<Quadric>,
    /// If vertices are finished together: each slab of cells with vertices, and the number of its first one.
    slabs: Vec<(usize, usize)>,
    /// If vertices are finished together: all quads, and the materials of all vertices.
    quads: Vec<Quad>,
    materials: Vec<u8>,
    smoothing: Smoothing,
    /// If vertices are finished together: the number of each vertex among those of the mesh.
    numbers: Vec<u32>,
    creases: Creases,
}

impl DualPipeline {
    pub(in crate::mesher) const fn new() -> Self {
        Self {
            signs: SignSweep::new(),
            search: CellSearch::new(),
            edges: [const { EdgeList::new() }; 3],
            quad_batch: QuadBatch::new(),
            cells: [CellVertices::new(), CellVertices::new()],
            list: VertexList::new(),
            offsets: Vec::new(),
            planes: Planes::new(),
            quadrics: Vec::new(),
            slabs: Vec::new(),
            quads: Vec::new(),
            materials: Vec::new(),
            smoothing: Smoothing::new(),
            numbers: Vec::new(),
            creases: Creases::new(),
        }
    }

    fn clear(&mut self) {
        self.list.len = 0;
        self.offsets.clear();
        self.quadrics.clear();
        self.slabs.clear();
        self.quads.clear();
        self.materials.clear();
    }
}

/// A volume to be meshed.
pub(super) struct DualJob<'a, W> {
    /// All samples, without a mark for padding.
    pub(super) samples: Samples<'a, W>,
    pub(super) layout: SlabLayout,
    pub(super) extent: Extent,
    pub(super) settings: &'a DualSettings,
    pub(super) backend: Backend,
    pub(super) pipeline: &'a mut DualPipeline,
    pub(super) out: &'a mut MeshBuffer,
}

impl<W: Weight> DualJob<'_, W> {
    /// Meshes the volume with its backend.
    pub(super) fn mesh(self) -> Result<(), MeshError> {
        W::call::<Mesh>(self)
    }
}

/// [`DualJob::mesh`], by type of weight.
struct Mesh;

impl PerWeight for Mesh {
    type Arguments<'a, W: Sealed> = DualJob<'a, W>;
    type Output = Result<(), MeshError>;

    fn of_i8(job: DualJob<'_, i8>) -> Self::Output {
        dispatch(job.backend, job)
    }

    fn of_i16(job: DualJob<'_, i16>) -> Self::Output {
        dispatch(job.backend, job)
    }

    fn of_f32(job: DualJob<'_, f32>) -> Self::Output {
        dispatch(job.backend, job)
    }
}

impl<W: Weight> Job for DualJob<'_, W> {
    type Output = Result<(), MeshError>;

    #[inline(always)]
    fn run<S: Simd>(mut self) -> Self::Output {
        self.pipeline.clear();
        let (layout, threshold) = (self.layout, W::threshold(self.settings.isovalue));
        // Uniform slabs at the start have no surface: only the last of them is needed.
        let uniform = uniform_prefix::<S, W>(self.samples.weights(), threshold) / layout.len;
        if uniform == layout.size[2] {
            return Ok(());
        }
        let mut batch = Batch::new();
        let start = uniform.saturating_sub(1);
        for z in start..layout.size[2] {
            let slab = |z: usize| &self.samples.weights()[z * layout.len..][..layout.len];
            let (first, next) = ((z == start).then(|| slab(z)), (z + 1 < layout.size[2]).then(|| slab(z + 1)));
            let signs = &mut self.pipeline.signs;
            signs.advance::<S, W>(&layout, first, next, threshold);
            if z > start && (self.extent.cells[2][0]..self.extent.cells[2][1]).contains(&(z - 1)) {
                // The slab of cells from `z − 1` to `z`.
                if signs.write_out_pair(&layout) {
                    self.add_slab::<S>(z - 1, &mut batch)?;
                }
            }
        }
        if self.is_deferred() {
            self.finish(&mut batch)?;
        }
        batch.widen(self.extent.origin, self.out);
        Ok(())
    }
}

impl<'a, W: Weight> DualJob<'a, W> {
    /// Adds the vertices between slab `z` and the next one, the quads around edges within slab `z`, and those around
    /// edges between both slabs.
    #[inline(always)]
    fn add_slab<S: Simd>(&mut self, z: usize, batch: &mut Batch<W>) -> Result<(), MeshError> {
        let is_deferred = self.is_deferred();
        let slabs = self.cell_slabs(z);
        let Self { extent, pipeline, out, layout, .. } = self;
        let DualPipeline {
            signs,
            search,
            edges,
            quad_batch,
            cells,
            list,
            offsets,
            planes,
            quadrics,
            slabs: starts,
            quads,
            materials,
            ..
        } = &mut **pipeline;
        cells.swap(0, 1);
        if is_deferred {
            starts.push((z, list.len));
        } else {
            list.len = 0;
        }
        let first = offsets.len();
        let listed = list.len;
        let rows = CellRows { layout, extent, z, signs: signs.all() };
        search.find::<S>(rows, first as u32, &mut cells[1], list, edges);
        if (first + list.len - listed) as u64 > u64::from(u32::MAX) {
            return Err(MeshError::TooManyVertices { found: (first + list.len - listed) as u64 });
        }
        for start in (listed..list.len).step_by(BATCH) {
            let range = start..list.len.min(start + BATCH);
            batch.gather(&slabs, list, range.clone());
            batch.place(&slabs, list, range.clone());
            batch.append_offsets(range.len(), offsets);
            let placed = &mut offsets[first + start - listed..];
            let materials = if is_deferred { &mut *materials } else { &mut out.materials };
            if slabs.edges.materials.is_some() {
                let at_means = range.clone().zip(&*placed);
                materials.extend(at_means.map(|(vertex, &offset)| material(&slabs, list, vertex, offset)));
            }
            let sharp = &self.settings.sharp;
            if !sharp.is_empty() {
                let own = &materials[materials.len().saturating_sub(range.len())..];
                let is_sharp = |i: usize| sharp.contains(own.get(i).copied().unwrap_or_default());
                if (0..range.len()).any(is_sharp) {
                    let range = range.clone();
                    batch.copy_samples(planes, range.len().next_multiple_of(16));
                    batch.sharpen(self.backend, &slabs, list, range, planes, is_sharp, quadrics, placed);
                } else {
                    quadrics.resize(quadrics.len() + range.len(), Quadric::default());
                }
            }
            if !is_deferred {
                batch.append(&slabs, list, range, self.settings.normals, out);
            }
        }

        let quad_edges = QuadEdges { layout, extent, z, cells };
        let [x_edges, y_edges, z_edges] = edges;
        if is_deferred {
            quad_edges.list::<0>(x_edges, quads);
            quad_edges.list::<1>(y_edges, quads);
            quad_edges.list::<2>(z_edges, quads);
        } else {
            let indices = &mut out.indices;
            quad_batch.append::<0>(&quad_edges, x_edges, offsets, quadrics, indices);
            quad_batch.append::<1>(&quad_edges, y_edges, offsets, quadrics, indices);
            quad_batch.append::<2>(&quad_edges, z_edges, offsets, quadrics, indices);
        }
        Ok(())
    }

    /// Whether vertices are finished together, when all are known: with smoothing and with creases.
    const fn is_deferred(&self) -> bool {
        self.settings.smoothing > 0 || self.settings.crease.is_some()
    }

    /// Smooths all vertices, finds creases, and writes the vertices and triangles of the mesh.
    #[inline(always)]
    fn finish(&mut self, batch: &mut Batch<W>) -> Result<(), MeshError> {
        let DualPipeline {
            list, offsets, quadrics, slabs: starts, quads, materials, smoothing, numbers, creases, ..
        } = &mut *self.pipeline;
        smooth(self.settings.smoothing, quads, offsets, smoothing);
        let cosine = self.settings.crease_cosine();
        if let Some(cosine) = cosine {
            creases.find(cosine, quads, offsets, quadrics);
        } else {
            creases.clear();
        }

        // Number the vertices of the mesh, and move them together.
        numbers.clear();
        numbers.resize(offsets.len(), u32::MAX);
        for quad in quads.iter().filter(|quad| quad.is_own) {
            for vertex in quad.vertices {
                numbers[vertex as usize] = 0;
            }
        }
        let (mut count, mut slab) = (0, 0);
        for (vertex, number) in numbers.iter_mut().enumerate() {
            while slab < starts.len() && starts[slab].1 == vertex {
                starts[slab].1 = count;
                slab += 1;
            }
            if *number == u32::MAX {
                continue;
            }
            *number = count as u32;
            (list.x[count], list.y[count]) = (list.x[vertex], list.y[vertex]);
            (list.edges[count], list.cases[count]) = (list.edges[vertex], list.cases[vertex]);
            offsets[count] = offsets[vertex];
            if let Some(&quadric) = quadrics.get(vertex) {
                quadrics[count] = quadric;
            }
            if let Some(&material) = materials.get(vertex) {
                materials[count] = material;
            }
            count += 1;
        }
        for start in &mut starts[slab..] {
            start.1 = count;
        }
        list.len = count;
        offsets.truncate(count);
        materials.truncate(count);
        self.out.materials.extend_from_slice(materials);
        if cosine.is_some() {
            let found = creases.number(numbers, count);
            if found > u64::from(u32::MAX) {
                return Err(MeshError::TooManyVertices { found });
            }
            creases.write_triangles(numbers, &mut self.out.indices);
        } else {
            for quad in quads.iter_mut().filter(|quad| quad.is_own) {
                quad.vertices = quad.vertices.map(|vertex| numbers[vertex as usize]);
                self.out.indices.extend_from_slice(&quad.triangles(offsets, quadrics));
            }
        }

        for slab in 0..self.pipeline.slabs.len() {
            let (z, start) = self.pipeline.slabs[slab];
            let end = self.pipeline.slabs.get(slab + 1).map_or(count, |&(_, start)| start);
            let slabs = self.cell_slabs(z);
            let DualPipeline { list, offsets, .. } = &mut *self.pipeline;
            list.reserve_word();
            for start in (start..end).step_by(BATCH) {
                let range = start..end.min(start + BATCH);
                if self.settings.normals {
                    batch.gather(&slabs, list, range.clone());
                }
                batch.set_offsets(&offsets[range.clone()]);
                batch.append(&slabs, list, range, self.settings.normals, self.out);
            }
        }
        self.pipeline.creases.write_normals(&self.pipeline.numbers, self.out);
        Ok(())
    }

    /// What the vertices between slab `z` and the next one are made from.
    #[inline(always)]
    fn cell_slabs(&self, z: usize) -> CellSlabs<'a, W> {
        CellSlabs {
            layout: self.layout,
            edges: Window::of(&self.samples, &self.layout, z + 1).edges_between(),
            isovalue: self.settings.isovalue,
            is_inner: !self.extent.is_open,
            origin: self.extent.origin,
        }
    }
}

/// The material of the nearest of the inside corners that a vertex's crossings have; of the lowest of several.
#[inline(always)]
fn material<W: Weight>(slabs: &CellSlabs<'_, W>, list: &VertexList, vertex: usize, offset: Offset) -> u8 {
    let (x, y, case, mut edges) = (list.x[vertex], list.y[vertex], list.cases[vertex], list.edges[vertex]);
    let mut corners = 0u32;
    while edges != 0 {
        corners |= 1 << INSIDE_ENDS[edges.trailing_zeros() as usize % 12][usize::from(case)];
        edges &= edges - 1;
    }
    let materials = slabs.edges.materials.unwrap_or_default();
    let near = slabs.layout.index(x, y);
    let at = |corner: u32| {
        let [x, y, z] = [corner & 1, corner >> 1 & 1, corner >> 2].map(|v| v as usize);
        materials[z][near + x + y * slabs.layout.stride]
    };
    let first = at(corners.trailing_zeros());
    let (mut nearest, mut least, mut are_equal) = (first, u32::MAX, true);
    let mut left = corners;
    while left != 0 {
        are_equal &= at(left.trailing_zeros()) == first;
        left &= left - 1;
    }
    if are_equal {
        return first;
    }
    while corners != 0 {
        let corner = corners.trailing_zeros();
        let mut squared = 0;
        for (axis, &steps) in offset[..3].iter().enumerate() {
            let from = i32::from(steps) - STEPS * (corner >> axis & 1) as i32;
            squared += (from * from) as u32;
        }
        if squared < least {
            (least, nearest) = (squared, at(corner));
        }
        corners &= corners - 1;
    }
    nearest
}

/// The inside end of each edge, by case; of those that are not crossed, one of both.
static INSIDE_ENDS: [[u8; 256]; 12] = {
    let (mut ends, mut edge) = ([[0; 256]; 12], 0);
    while edge < 12 {
        let mut case = 0;
        while case < 256 {
            let [low, high] = Edge::ALL[edge].corners();
            ends[edge][case] = if case >> low.index() & 1 == 1 { low.index() } else { high.index() } as u8;
            case += 1;
        }
        edge += 1;
    }
    ends
};
