//! Levels of detail without a seam: the mesh of a leaf, some of whose neighbours are one level finer.
//!
//! The leaf itself is meshed like any other samples. Where a neighbour is finer, its outermost lattice points then make
//! room, and a layer of transition cells fills it: each joins four cells of the finer side to one cell of the leaf. All
//! of it becomes part of the leaf's own mesh, so levels need no special shader, no attribute and no second mesh.
//!
//! ```text
//! leaf ──Mesher──▶ mesh ──border──▶ border vertices moved, and known by their edges ──┐
//! finer samples of a face ──seam──▶ vertices on the face ──▶ triangles of its transition cells
//! ```
//!
//! Transition cells are those of Eric Lengyel, "Voxel-Based Terrain for Real-Time Virtual Simulations" (2010), with
//! one difference: it is points that make room, not vertices, and each by what the eight leaves around it are. So
//! leaves that only meet a finer one at an edge or a corner fit as well.

mod border;
mod finer;
mod leaf;
mod seam;

use border::BorderVertices;
pub use finer::FinerNeighbours;
pub use leaf::{LeafError, LeafSamples};
use seam::FineVertices;

use super::{MeshError, MeshSettings, Mesher, Topology};
use crate::{buffer::MeshBuffer, cell::Face, sample::Weight};

/// Scratch memory of [`Mesher::mesh_leaf`].
#[derive(Clone, Debug)]
pub(super) struct Transitions {
    border: BorderVertices,
    fine: FineVertices,
}

impl Transitions {
    pub(super) const fn new() -> Self {
        Self { border: BorderVertices::new(), fine: FineVertices::new() }
    }
}

impl Mesher {
    /// Meshes a leaf, some of whose neighbours may be one level finer, into `out`, and drops its former content.
    ///
    /// Positions are in the leaf's own cells, from its first meshed sample. The mesh fits those of all neighbours
    /// without a seam: vertices on a common border have equal positions in the world and equal normals, bit for bit. This
    /// holds if
    /// - neighbours differ by one level at most, and at no edge do finer and coarser leaves alternate
    ///   ([`LeafSamples::new`] checks this for one leaf);
    /// - a lattice point has one sample: all leaves that touch it use that of the finest of them;
    /// - all leaves are meshed with the same settings.
    ///
    /// Border vertices may lie up to 1/8 cell outside the leaf's box. Without finer neighbours, the mesh is that of
    /// [`Mesher::mesh`].
    ///
    /// Not guaranteed: that no two triangles cross at a border of levels. In white noise around every pattern of levels,
    /// some did in 0.6 % of all unions, mostly where finer leaves wind around a point; on planes, none did.
    ///
    /// ```
    /// use marchless::{FinerNeighbours, LeafSamples, MeshBuffer, MeshSettings, MeshUnion, Mesher, Samples, Shape};
    ///
    /// // A ball of radius 7 around the lattice point [16, 8, 8], in voxels of level 0.
    /// let ball = |p: [i32; 3]| ((p[0] - 16).pow(2) + (p[1] - 8).pow(2) + (p[2] - 8).pow(2)) as f32;
    /// let weight = |p: [i32; 3]| ball(p).sqrt() - 7.0;
    /// // `size` samples that are `step` voxels apart, from the point `min` on, x fastest.
    /// let sampled = |min: [i32; 3], size: [u32; 3], step: i32| -> Vec<f32> {
    ///     let [nx, ny, nz] = size.map(|v| v as i32);
    ///     let points = (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / (nx * ny)]);
    ///     points.map(|p| weight([0, 1, 2].map(|axis| min[axis] + step * p[axis]))).collect()
    /// };
    /// let (mut mesher, settings, mut mesh) = (Mesher::new(), MeshSettings::default(), MeshBuffer::new());
    /// let mut union = MeshUnion::new();
    ///
    /// // On the left, one leaf of 8³ cells of level 1, which are 2 voxels wide. Its padding begins at −2.
    /// let shape = Shape::cube(11)?;
    /// let coarse = sampled([-2; 3], [11; 3], 2);
    /// // All that lies to its right is finer. The samples of that face: three layers of level 0 around x = 16.
    /// let finer = FinerNeighbours::from_fn(|[x, _, _]| x == 1);
    /// let face_shape = Shape::new([3, 19, 19])?;
    /// let face = sampled([15, -1, -1], [3, 19, 19], 1);
    /// let faces = [None, Some(Samples::new(face_shape, &face)?), None, None, None, None];
    /// let leaf = LeafSamples::new(Samples::new(shape, &coarse)?.padded(), finer, faces)?;
    /// mesher.mesh_leaf(&leaf, &settings, &mut mesh)?;
    /// union.add(&mesh, [0; 3], 1);
    ///
    /// // On the right, four leaves of 8³ cells of level 0.
    /// for [y, z] in [[0, 0], [8, 0], [0, 8], [8, 8]] {
    ///     let fine = sampled([15, y - 1, z - 1], [11; 3], 1);
    ///     let leaf = LeafSamples::new(Samples::new(shape, &fine)?.padded(), FinerNeighbours::NONE, [None; 6])?;
    ///     mesher.mesh_leaf(&leaf, &settings, &mut mesh)?;
    ///     union.add(&mesh, [16, y.into(), z.into()], 0);
    /// }
    /// // All five meshes together are a whole ball.
    /// let report = union.report();
    /// assert!(report.is_closed() && report.is_clean(), "{report}");
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Mesher::mesh`], and [`MeshError::LeafTopology`]; `out` is then empty.
    pub fn mesh_leaf<W: Weight>(
        &mut self,
        leaf: &LeafSamples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        if !leaf.finer.is_empty() && settings.topology != Topology::Separated {
            out.clear();
            return Err(MeshError::LeafTopology);
        }
        self.mesh(leaf.samples, settings, out)?;
        if leaf.finer.is_empty() {
            return Ok(());
        }
        let Transitions { border, fine } = &mut self.transitions;
        border.collect(leaf, &leaf.finer.displacements(), &mut out.positions);
        for face in Face::ALL {
            if let Some(samples) = &leaf.faces[face.index()] {
                fine.add(leaf, face, samples, settings, border, out);
            }
        }
        out.bounds = bounds(&out.positions);
        Ok(())
    }
}

/// The smallest box around all positions.
fn bounds(positions: &[[f32; 3]]) -> Option<[[f32; 3]; 2]> {
    // Without NaN, this needs one instruction; `f32::min` needs several.
    let least = |a: f32, b: f32| if a < b { a } else { b };
    let most = |a: f32, b: f32| if a > b { a } else { b };
    let first = *positions.first()?;
    // Four positions fill three vectors.
    let (fours, rest) = positions.as_chunks::<4>();
    let [mut min, mut max] = [[first; 4]; 2];
    for four in fours {
        for ((min, max), &v) in min.as_flattened_mut().iter_mut().zip(max.as_flattened_mut()).zip(four.as_flattened()) {
            (*min, *max) = (least(v, *min), most(v, *max));
        }
    }
    let all = min.iter().chain(&max).chain(rest);
    Some(all.fold([first; 2], |[min, max], position| {
        [[0, 1, 2].map(|axis| least(position[axis], min[axis])), [0, 1, 2].map(|axis| most(position[axis], max[axis]))]
    }))
}
