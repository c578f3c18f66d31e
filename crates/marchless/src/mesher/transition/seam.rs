//! [`FineVertices`]: the vertices on the finer side of a leaf's faces, and the triangles of the transition cells.

use alloc::vec::Vec;
use core::ops::Range;

use super::{
    border::BorderVertices,
    leaf::{FacePlane, LeafSamples},
};
use crate::{
    buffer::MeshBuffer,
    cases::transition::{TransitionCase, TransitionEdge},
    cell::Face,
    lattice::{MAX_CHUNK_CELLS, Samples},
    mesher::{
        crossing::crossing_fraction,
        normal::{EndNeighbours, vertex_normal},
        settings::MeshSettings,
    },
    sample::Weight,
};

/// The numbers of the vertices on the finer side of a leaf's faces.
#[derive(Clone, Debug)]
pub(super) struct FineVertices {
    /// The signs of the present face's samples, a row each.
    rows: Vec<u128>,
    /// By edge of the present face. Only the entries of crossed edges hold anything.
    face: Vec<u32>,
    /// By finer edge along the twelve edges of the leaf; for those of finer faces that are done.
    rims: Vec<u32>,
}

/// The finer edges along an edge of a leaf.
const RIM: usize = 2 * MAX_CHUNK_CELLS as usize;

impl FineVertices {
    pub(super) const fn new() -> Self {
        Self { rows: Vec::new(), face: Vec::new(), rims: Vec::new() }
    }

    /// Adds the transition cells of one face to the leaf's mesh. Faces come in order.
    pub(super) fn add<W: Weight>(
        &mut self,
        leaf: &LeafSamples<'_, W>,
        face: Face,
        samples: &Samples<'_, W>,
        settings: &MeshSettings,
        border: &BorderVertices,
        out: &mut MeshBuffer,
    ) {
        let Some(plane) = &leaf.planes()[face.index()] else { return };
        let threshold = W::threshold(settings.isovalue);
        let [u, v] = plane.cells;
        let full = u128::MAX >> (127 - 2 * u);
        self.rows.clear();
        self.rows.extend((0..=2 * v).map(|k| sign_row(plane, samples, k, threshold)));
        let first = self.rows[0];
        if (first == 0 || first == full) && self.rows.iter().all(|&row| row == first) {
            return;
        }
        self.rims.resize(12 * RIM, 0);
        self.face.resize(2 * u * (2 * v + 1) + (2 * u + 1) * 2 * v, 0);
        let pass = FacePass { leaf, plane, samples, settings, threshold };
        for k in 0..=2 * v {
            let row = self.rows[k];
            for i in bits((row ^ row >> 1) & full >> 1) {
                self.add_vertex(&pass, 0, [i, k], out);
            }
            if k < 2 * v {
                for i in bits(row ^ self.rows[k + 1]) {
                    self.add_vertex(&pass, 1, [i, k], out);
                }
            }
        }
        self.add_triangles(plane, border, &mut out.indices);
    }

    /// Adds the vertex on an edge of the present face: along axis `along` of its plane, from point `at` on.
    fn add_vertex<W: Weight>(&mut self, pass: &FacePass<'_, W>, along: usize, at: [usize; 2], out: &mut MeshBuffer) {
        let plane = pass.plane;
        let across = at[1 - along];
        let rim = (across == 0 || across == 2 * plane.cells[1 - along]).then(|| {
            let other = Face::new((2 * plane.axes[1 - along] + usize::from(across > 0)) as u8);
            (other, rim_index(plane.face, other, plane.axes[along]) * RIM + at[along])
        });
        let vertex = match rim {
            Some((other, index)) if pass.leaf.finer.contains_face(other) && other < plane.face => self.rims[index],
            _ => pass.vertex(along, at, out),
        };
        if let Some((_, index)) = rim {
            self.rims[index] = vertex;
        }
        self.face[edge_index(plane, along, at)] = vertex;
    }

    fn add_triangles(&self, plane: &FacePlane, border: &BorderVertices, indices: &mut Vec<u32>) {
        let [u, v] = plane.cells;
        // Bit 2·i stands for cell i.
        let cells = 0x5555_5555_5555_5555_5555_5555_5555_5555 & u128::MAX >> (128 - 2 * u);
        // The second and third axis of y's plane are x and z: a left-handed order.
        let turned = plane.face.is_high() == (plane.axis == 1);
        for j in 0..v {
            let [below, middle, above] = [0, 1, 2].map(|k| self.rows[2 * j + k]);
            let (any, all) = (below | middle | above, below & middle & above);
            let active = (any | any >> 1 | any >> 2) & !(all & all >> 1 & all >> 2) & cells;
            for at in bits(active) {
                let signs = |row: u128| (row >> at) as u16 & 7;
                let case = TransitionCase::new(signs(below) | signs(middle) << 3 | signs(above) << 6);
                let vertex = |edge: TransitionEdge| {
                    let [low, high] = edge.samples();
                    let along = usize::from(high - low >= 3);
                    let step = [low % 3, low / 3];
                    if edge.is_fine() {
                        self.face[edge_index(plane, along, [at + step[0], 2 * j + step[1]])]
                    } else {
                        border.on(plane, along, [at / 2 + step[0] / 2, j + step[1] / 2])
                    }
                };
                for triangle in case.triangles() {
                    let [a, b, c] = triangle.map(vertex);
                    indices.extend(if turned { [a, c, b] } else { [a, b, c] });
                }
            }
        }
    }
}

/// What the vertices of one face are made from.
struct FacePass<'a, W: Weight> {
    leaf: &'a LeafSamples<'a, W>,
    plane: &'a FacePlane,
    samples: &'a Samples<'a, W>,
    settings: &'a MeshSettings,
    threshold: W::Threshold,
}

impl<W: Weight> FacePass<'_, W> {
    /// Appends the vertex on an edge: along axis `along` of the plane, from point `at` on. It is the vertex that the
    /// finer leaf has there.
    fn vertex(&self, along: usize, at: [usize; 2], out: &mut MeshBuffer) -> u32 {
        let (plane, weights) = (self.plane, self.samples.weights());
        let axis = plane.axes[along];
        let low = plane.index(at);
        let high = low + plane.strides[axis];
        let fraction = crossing_fraction(weights[low], weights[high], self.settings.isovalue * W::SCALE);
        let mut position = plane.point(at).map(|v| v as f32 * 0.5);
        position[axis] += fraction * 0.5;
        let vertex = out.positions.len() as u32;
        out.positions.push(position);
        let low_inside = weights[low].inside(self.threshold);
        if self.settings.normals {
            // `map` over the strides or the ends would move arrays about for longer than everything else takes.
            let [x, y, z] = plane.strides;
            let neighbours = |end: usize| EndNeighbours {
                low: [weights[end - x], weights[end - y], weights[end - z]],
                high: [weights[end + x], weights[end + y], weights[end + z]],
                one_sided: [false; 3],
            };
            let ends = [neighbours(low), neighbours(high)];
            out.normals.push(vertex_normal(&ends, axis, fraction, low_inside));
        }
        if let Some(materials) = self.samples.materials() {
            out.materials.push(materials[if low_inside { low } else { high }]);
        }
        vertex
    }
}

/// The signs of a row of a face's samples.
fn sign_row<W: Weight>(plane: &FacePlane, samples: &Samples<'_, W>, row: usize, threshold: W::Threshold) -> u128 {
    let (weights, stride) = (&samples.weights()[plane.index([0, row])..], plane.strides[plane.axes[0]]);
    let count = 2 * plane.cells[0] + 1;
    // Half a row fits a word, whose shifts are much faster.
    let half = |points: Range<usize>| {
        points.rev().fold(0u64, |signs, i| signs << 1 | u64::from(weights[i * stride].inside(threshold)))
    };
    u128::from(half(0..count.min(64))) | u128::from(half(64..count.max(64))) << 64
}

/// The index of a finer edge of a face: along axis `along` of its plane, from point `at` on.
const fn edge_index(plane: &FacePlane, along: usize, at: [usize; 2]) -> usize {
    let [u, v] = [2 * plane.cells[0], 2 * plane.cells[1]];
    if along == 0 { at[0] + u * at[1] } else { u * (v + 1) + at[0] + (u + 1) * at[1] }
}

/// The number, 0–11, of the edge of a leaf between two faces. `along`: the axis that it runs along.
fn rim_index(a: Face, b: Face, along: usize) -> usize {
    let high = |face: Face| usize::from(face.is_high());
    let [first, second] = if a.axis() < b.axis() { [a, b] } else { [b, a] };
    4 * along + high(first) + 2 * high(second)
}

/// The positions of the bits of a word, from the lowest on.
fn bits(mut word: u128) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        (word != 0).then(|| {
            word &= word - 1;
            bit as usize
        })
    })
}
