//! [`MeshBuffer`]: the caller's own mesh, filled again and again without allocating.

use alloc::vec::Vec;

/// An indexed triangle mesh, kept by the caller and reused from mesh to mesh.
///
/// Vertices are shared between triangles. A triangle's corners run counter-clockwise when seen from outside (from
/// the side of larger weights). Clearing keeps the memory, so that nothing is allocated once it is warm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshBuffer {
    /// One position a vertex, in cells from the first meshed sample.
    pub positions: Vec<[f32; 3]>,
    /// One unit normal a vertex, pointing outside; empty where normals were switched off.
    pub normals: Vec<[f32; 3]>,
    /// One material a vertex, that of the inside end of its edge (in the interior of a cell: of the nearest inside
    /// corner); empty where the samples had none.
    pub materials: Vec<u8>,
    /// Three a triangle.
    pub indices: Vec<u32>,
    /// The smallest box that holds all positions: `[min, max]`; `None` where there are none.
    pub bounds: Option<[[f32; 3]; 2]>,
}

impl MeshBuffer {
    /// An empty buffer; allocates nothing.
    pub const fn new() -> Self {
        Self { positions: Vec::new(), normals: Vec::new(), materials: Vec::new(), indices: Vec::new(), bounds: None }
    }

    /// Empties the buffer and keeps its memory.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.materials.clear();
        self.indices.clear();
        self.bounds = None;
    }

    /// Whether there is no triangle.
    pub const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The number of triangles.
    pub const fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// The triangles' vertex indices.
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = [u32; 3]> + '_ {
        self.indices.chunks_exact(3).map(|triangle| [triangle[0], triangle[1], triangle[2]])
    }
}
