//! [`MeshUnion`]: the meshes of many chunks as one surface.

use alloc::vec::Vec;

use super::MeshReport;
use crate::buffer::MeshBuffer;

/// The union of meshes of chunks, at one level of detail or several, to be judged as one surface.
///
/// Vertices of different meshes are one vertex of the union if they are at the same point of the world, to the last bit.
/// So a seam that is open by the smallest number of `f32` shows as boundary edges.
///
/// ```
/// use marchless::{MeshBuffer, MeshUnion};
///
/// // Two triangles of two chunks of 8 cells, with an edge of each on the common border.
/// let triangle = |positions: [[f32; 3]; 3]| MeshBuffer {
///     positions: positions.into(),
///     indices: [0, 1, 2].into(),
///     ..MeshBuffer::new()
/// };
/// let mut union = MeshUnion::new();
/// union.add(&triangle([[8.0, 0.0, 0.5], [8.0, 1.0, 0.5], [7.0, 0.0, 0.5]]), [0; 3], 0);
/// // This chunk's cells are two voxels wide.
/// union.add(&triangle([[0.0, 0.5, 0.25], [0.0, 0.0, 0.25], [0.5, 0.0, 0.25]]), [8, 0, 0], 1);
/// assert_eq!(union.report().boundary_edges, 4);
/// ```
#[derive(Clone, Debug, Default)]
pub struct MeshUnion {
    /// In voxels of level 0.
    positions: Vec<[f64; 3]>,
    indices: Vec<u32>,
}

impl MeshUnion {
    /// A union of no meshes.
    pub const fn new() -> Self {
        Self { positions: Vec::new(), indices: Vec::new() }
    }

    /// Adds a mesh. Its positions are in cells, which are 2^`level` voxels wide, from the lattice point `origin` of
    /// level 0.
    pub fn add(&mut self, mesh: &MeshBuffer, origin: [i64; 3], level: u8) {
        let (first, cell) = (self.positions.len() as u32, (1u64 << level.min(63)) as f64);
        // Exact: crossings have 17 bits behind the point at most, and 36 before it are enough for any lattice.
        let place = |position: &[f32; 3]| [0, 1, 2].map(|k| origin[k] as f64 + f64::from(position[k]) * cell);
        self.positions.extend(mesh.positions.iter().map(place));
        self.indices.extend(mesh.indices.iter().map(|&index| first.wrapping_add(index)));
    }

    /// All vertices, in voxels of level 0 from the first one's lattice point, and the three vertex indices of each
    /// triangle. Vertices at the same point are one.
    ///
    /// Points are compared exactly, and only then rounded to `f32`.
    pub fn weld(&self) -> (Vec<[f32; 3]>, Vec<u32>) {
        let key = |vertex: u32| self.positions[vertex as usize];
        let mut order: Vec<u32> = (0..self.positions.len() as u32).collect();
        let compare = |a: [f64; 3], b: [f64; 3]| {
            // −0 and 0 are one point.
            let [a, b] = [a, b].map(|position| position.map(|v| v + 0.0));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
        };
        order.sort_unstable_by(|&a, &b| compare(key(a), key(b)));
        let origin = self.positions.first().map_or([0.0; 3], |first| first.map(libm::floor));
        let (mut positions, mut welded) = (Vec::new(), alloc::vec![0; self.positions.len()]);
        let mut last = None;
        for vertex in order {
            if last.is_none_or(|last| compare(key(last), key(vertex)).is_ne()) {
                positions.push(core::array::from_fn(|k| (key(vertex)[k] - origin[k]) as f32));
            }
            welded[vertex as usize] = positions.len() as u32 - 1;
            last = Some(vertex);
        }
        let index = |index: &u32| welded.get(*index as usize).copied().unwrap_or(u32::MAX);
        (positions, self.indices.iter().map(index).collect())
    }

    /// What is wrong with the union as one surface.
    ///
    /// Edges and fans are judged exactly, areas and crossings at positions that are rounded to `f32`. They are exact too
    /// as long as the union spans no more than about a hundred voxels of its finest level.
    pub fn report(&self) -> MeshReport {
        let (positions, indices) = self.weld();
        MeshReport::new(&positions, &indices)
    }
}
