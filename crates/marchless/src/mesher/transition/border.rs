//! [`BorderVertices`]: the vertices of a leaf's own cells at its border, moved to make room for transition cells.

use alloc::vec::Vec;

use super::{
    finer::Displacements,
    leaf::{FacePlane, LeafSamples},
};
use crate::{cell::Face, sample::Weight};

/// The numbers of the vertices on the coarse edges of each face behind which a neighbour is finer.
#[derive(Clone, Debug)]
pub(super) struct BorderVertices {
    /// By face. Only the entries of crossed edges of such faces hold anything.
    faces: [Vec<u32>; 6],
}

impl BorderVertices {
    pub(super) const fn new() -> Self {
        Self { faces: [const { Vec::new() }; 6] }
    }

    /// The number of the vertex on an edge of a face: along axis `along` of its plane, from point `at` on.
    pub(super) fn on(&self, plane: &FacePlane, along: usize, at: [usize; 2]) -> u32 {
        self.faces[plane.face.index()][edge_index(plane, along, at)]
    }

    /// Finds the border vertices of a leaf's mesh by their positions, and moves those that must make room.
    pub(super) fn collect<W: Weight>(
        &mut self,
        leaf: &LeafSamples<'_, W>,
        displacements: &Displacements,
        positions: &mut [[f32; 3]],
    ) {
        let (cells, planes) = (leaf.cells, leaf.planes());
        for plane in planes.iter().flatten() {
            self.faces[plane.face.index()].resize(edge_count(plane), 0);
        }
        let last = cells.map(|cells| cells as f32);
        for (vertex, position) in (0..).zip(positions) {
            // Edges with an end on the border have their vertex less than a cell away from it.
            if (0..3).all(|axis| (1.0..=last[axis] - 1.0).contains(&position[axis])) {
                continue;
            }
            let low = position.map(|v| v as u32);
            let Some(axis) = (0..3).find(|&axis| position[axis] != low[axis] as f32) else { continue };
            let faces = (0..3).filter(|&across| across != axis).filter_map(|across| face_at(low, across, cells));
            for plane in faces.filter_map(|face| planes[face.index()].as_ref()) {
                let along = usize::from(plane.axes[1] == axis);
                let index = edge_index(plane, along, plane.axes.map(|axis| low[axis] as usize));
                self.faces[plane.face.index()][index] = vertex;
            }
            let (mut high, fraction) = (low, position[axis] - low[axis] as f32);
            high[axis] += 1;
            let [from, to] = [low, high].map(|end| displacements.of(end, cells));
            // All of it is exact: fractions have 14 bits, displacements 3, and a leaf has at most 62 cells.
            for k in 0..3 {
                position[k] += from[k] + (to[k] - from[k]) * fraction;
            }
        }
    }
}

/// The number of edges of a face's cells.
const fn edge_count(plane: &FacePlane) -> usize {
    let [u, v] = plane.cells;
    u * (v + 1) + (u + 1) * v
}

/// The index of an edge of a face's cells: along axis `along` of its plane, from point `at` on.
const fn edge_index(plane: &FacePlane, along: usize, at: [usize; 2]) -> usize {
    let [u, v] = plane.cells;
    if along == 0 { at[0] + u * at[1] } else { u * (v + 1) + at[0] + (u + 1) * at[1] }
}

/// The face of the leaf across `axis` on which a lattice point lies.
fn face_at(point: [u32; 3], axis: usize, cells: [u32; 3]) -> Option<Face> {
    let is_high = point[axis] == cells[axis];
    (is_high || point[axis] == 0).then(|| Face::new(2 * axis as u8 + u8::from(is_high)))
}
