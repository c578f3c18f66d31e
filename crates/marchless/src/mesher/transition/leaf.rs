//! [`LeafSamples`]: the samples of a leaf and of its finer neighbours, checked.

use thiserror::Error;

use super::FinerNeighbours;
use crate::{
    cell::Face,
    lattice::{MAX_CHUNK_CELLS, Samples, Shape},
    sample::Weight,
};

/// The samples of a leaf, a chunk in an octree of levels of detail, and those of its finer neighbours' faces.
///
/// [`Mesher::mesh_leaf`](crate::Mesher::mesh_leaf) makes its mesh.
#[derive(Clone, Copy, Debug)]
pub struct LeafSamples<'a, W> {
    pub(super) samples: Samples<'a, W>,
    pub(super) finer: FinerNeighbours,
    /// By [`Face`]; `Some` exactly where the neighbour across it is finer.
    pub(super) faces: [Option<Samples<'a, W>>; 6],
    /// Cells per axis.
    pub(super) cells: [u32; 3],
}

impl<'a, W: Weight> LeafSamples<'a, W> {
    /// The samples of a leaf.
    ///
    /// `samples`: the leaf's own, [padded](Samples::padded), 1 to 62 cells per axis. `finer`: its finer neighbours.
    ///
    /// `faces`: by [`Face`], the finer samples around each face across which a neighbour is finer; `None` for the other
    /// faces. Three layers, half a cell of the leaf apart: one inside the leaf, one on the face, and one beyond it, in
    /// the order of their positions. Along the other two axes, `2·n + 3` samples for `n` cells: from half a cell below
    /// the leaf to half a cell above. So the shape for a face across x is `[3, 2·ny + 3, 2·nz + 3]`. Normals on the
    /// face are computed from all of them; the layer inside the leaf has the values that the finer leaves' padding
    /// has there.
    ///
    /// # Errors
    /// [`LeafError`] if samples are missing or of the wrong size, if two of them differ for one lattice point (weight or
    /// material), or if finer and coarser leaves alternate at an edge.
    pub fn new(
        samples: Samples<'a, W>,
        finer: FinerNeighbours,
        faces: [Option<Samples<'a, W>>; 6],
    ) -> Result<Self, LeafError> {
        let shape = samples.shape();
        if !samples.is_padded() || shape.size().iter().any(|size| !(4..=MAX_CHUNK_CELLS + 3).contains(size)) {
            return Err(LeafError::Samples { shape, padded: samples.is_padded() });
        }
        if let Some(direction) = finer.alternating_edge() {
            return Err(LeafError::AlternatingEdge { direction });
        }
        let leaf = Self { samples, finer, faces, cells: shape.size().map(|size| size - 3) };
        for face in Face::ALL {
            leaf.check_face(face)?;
        }
        Ok(leaf)
    }

    fn check_face(&self, face: Face) -> Result<(), LeafError> {
        let is_finer = self.finer.contains_face(face);
        let samples = match &self.faces[face.index()] {
            None if is_finer => return Err(LeafError::MissingFace { face }),
            None => return Ok(()),
            Some(_) if !is_finer => return Err(LeafError::UnneededFace { face }),
            Some(samples) => samples,
        };
        let plane = FacePlane::new(face, self.cells);
        let expected = plane.shape();
        if samples.shape() != expected {
            return Err(LeafError::FaceShape { face, expected, found: samples.shape() });
        }
        if samples.materials().is_some() != self.samples.materials().is_some() {
            return Err(LeafError::FaceMaterials { face });
        }
        self.check_points(&plane, samples)
    }

    /// Checks that lattice points which the face shares with the leaf, or with an earlier face, have one sample.
    fn check_points(&self, plane: &FacePlane, samples: &Samples<'a, W>) -> Result<(), LeafError> {
        let [u, v] = plane.cells;
        let strides = self.samples.shape().strides();
        let first = strides.iter().sum::<usize>() + plane.across / 2 * strides[plane.axis];
        for j in 0..=v {
            for i in 0..=u {
                let own = first + i * strides[plane.axes[0]] + j * strides[plane.axes[1]];
                if differ(&self.samples, own, samples, plane.index([2 * i, 2 * j])) {
                    return Err(LeafError::PointsDiffer { face: plane.face, point: plane.point([2 * i, 2 * j]) });
                }
            }
        }
        for other in self.planes().iter().flatten().filter(|other| other.face.index() < plane.face.index()) {
            let (Some(other_samples), true) = (&self.faces[other.face.index()], other.axis != plane.axis) else {
                continue;
            };
            let across = usize::from(plane.axes[1] == other.axis);
            let along = 1 - across;
            for k in 0..=2 * plane.cells[along] {
                let mut at = [0; 2];
                (at[across], at[along]) = (other.across, k);
                let point = plane.point(at);
                if differ(samples, plane.index(at), other_samples, other.index(other.within(point))) {
                    return Err(LeafError::PointsDiffer { face: plane.face, point });
                }
            }
        }
        Ok(())
    }

    /// The planes of the faces across which a neighbour is finer.
    pub(super) fn planes(&self) -> [Option<FacePlane>; 6] {
        Face::ALL.map(|face| self.finer.contains_face(face).then(|| FacePlane::new(face, self.cells)))
    }
}

/// Whether two samples for one lattice point differ; NaN equals NaN.
#[inline(always)]
fn differ<W: Weight>(a: &Samples<'_, W>, a_index: usize, b: &Samples<'_, W>, b_index: usize) -> bool {
    let [a_weight, b_weight] = [a.weights()[a_index], b.weights()[b_index]];
    let is_nan = |weight: W| weight.to_voxels().is_nan();
    let same = a_weight == b_weight || is_nan(a_weight) && is_nan(b_weight);
    !same || a.materials().map(|materials| materials[a_index]) != b.materials().map(|materials| materials[b_index])
}

/// A face of a leaf as a plane of finer samples.
///
/// Its two axes are in order, so that rows along the first one are as close in memory as can be.
#[derive(Clone, Copy)]
pub(super) struct FacePlane {
    pub(super) face: Face,
    /// The axis that the face is perpendicular to.
    pub(super) axis: usize,
    /// The axes of the plane.
    pub(super) axes: [usize; 2],
    /// The leaf's cells along these axes.
    pub(super) cells: [usize; 2],
    /// The coordinate of its points across the plane, in finer steps from the leaf's corner.
    across: usize,
    /// The distances in memory of the face's samples along x, y and z.
    pub(super) strides: [usize; 3],
}

impl FacePlane {
    fn new(face: Face, cells: [u32; 3]) -> Self {
        let axis = face.axis();
        let axes = [[1, 2], [0, 2], [0, 1]][axis];
        let across = if face.is_high() { 2 * cells[axis] as usize } else { 0 };
        let mut plane =
            Self { face, axis, axes, cells: axes.map(|axis| cells[axis] as usize), across, strides: [0; 3] };
        plane.strides = plane.shape().strides();
        plane
    }

    fn shape(&self) -> Shape {
        let mut size = [3; 3];
        for (axis, cells) in self.axes.into_iter().zip(self.cells) {
            size[axis] = 2 * cells as u32 + 3;
        }
        Shape::new(size).expect("a leaf's cells are few")
    }

    /// The index of the finer sample on the face at `at`, in finer steps from the leaf's corner.
    pub(super) fn index(&self, at: [usize; 2]) -> usize {
        let [u, v] = self.axes;
        self.strides[self.axis] + (at[0] + 1) * self.strides[u] + (at[1] + 1) * self.strides[v]
    }

    /// The finer lattice point of the leaf at `at`.
    pub(super) fn point(&self, at: [usize; 2]) -> [u32; 3] {
        let mut point = [0; 3];
        point[self.axis] = self.across as u32;
        point[self.axes[0]] = at[0] as u32;
        point[self.axes[1]] = at[1] as u32;
        point
    }

    /// The position on the face of a finer lattice point of the leaf.
    fn within(&self, point: [u32; 3]) -> [usize; 2] {
        self.axes.map(|axis| point[axis] as usize)
    }
}

/// The reason why samples are not those of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LeafError {
    /// The leaf's own samples are not padded, or of a size that leaves do not have.
    #[error(
        "a leaf needs padded samples, 4 to {} per axis, but there are {shape}{}",
        MAX_CHUNK_CELLS + 3,
        if *padded { "" } else { " without padding" }
    )]
    Samples {
        /// The shape that was given.
        shape: Shape,
        /// Whether the samples are padded.
        padded: bool,
    },
    /// Finer and coarser leaves alternate around an edge: four triangles would meet there. Split the leaf, or the one
    /// across the edge.
    #[error("at the edge in direction {direction:?}, finer and coarser leaves alternate")]
    AlternatingEdge {
        /// The direction from the leaf across the edge.
        direction: [i32; 3],
    },
    /// A neighbour is finer, but its samples are missing.
    #[error("the neighbour across {face:?} is finer, but there are no samples for that face")]
    MissingFace {
        /// The face.
        face: Face,
    },
    /// There are samples for a face whose neighbour is not finer.
    #[error("there are samples for {face:?}, but the neighbour across it is not finer")]
    UnneededFace {
        /// The face.
        face: Face,
    },
    /// The samples for a face have the wrong shape.
    #[error("{face:?} needs {expected} finer samples, but there are {found}")]
    FaceShape {
        /// The face.
        face: Face,
        /// The shape that the face needs.
        expected: Shape,
        /// The shape that was given.
        found: Shape,
    },
    /// The leaf has materials and the samples for a face have none, or the other way round.
    #[error("the leaf and {face:?} must both have materials, or both have none")]
    FaceMaterials {
        /// The face.
        face: Face,
    },
    /// A lattice point has two samples: one for the face, and another one in the leaf or for an earlier face.
    #[error("the sample for {face:?} at {point:?} differs from another one for the same lattice point")]
    PointsDiffer {
        /// The face.
        face: Face,
        /// The lattice point, in finer steps from the leaf's corner.
        point: [u32; 3],
    },
}
