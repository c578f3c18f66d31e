//! [`MeshBuffer`]: the caller's mesh, filled again and again without allocating.

use alloc::vec::Vec;

/// An indexed triangle mesh that the caller keeps and reuses.
///
/// Triangles share vertices. A triangle's corners run counter-clockwise when seen from outside (from the side of larger
/// weights). Clearing keeps the memory, so a warm buffer allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshBuffer {
    /// One position per vertex, in cells from the first meshed sample.
    pub positions: Vec<[f32; 3]>,
    /// One unit normal per vertex, pointing outside; empty if the settings turn normals off.
    pub normals: Vec<[f32; 3]>,
    /// One material per vertex: that of the inside end of its edge, or of the nearest inside corner for a vertex in the
    /// interior of a cell (in a dual mesh, of those at its crossings, before smoothing). Empty if the samples have no
    /// materials.
    pub materials: Vec<u8>,
    /// Three vertex indices per triangle.
    pub indices: Vec<u32>,
    /// The smallest box that holds all positions, `[min, max]`; `None` if there are none.
    pub bounds: Option<[[f32; 3]; 2]>,
}

impl MeshBuffer {
    /// An empty buffer. It allocates nothing.
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

    /// True if there is no triangle.
    pub const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The number of triangles.
    pub const fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// The vertex indices of each triangle.
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = [u32; 3]> + '_ {
        self.indices.chunks_exact(3).map(|triangle| [triangle[0], triangle[1], triangle[2]])
    }
}
