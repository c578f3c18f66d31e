//! [`MeshSettings`]: the isovalue, normals and topology of a mesh.

use super::error::MeshError;

/// How to mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshSettings {
    /// The surface lies where the weight equals this many voxels; samples below it are inside. Finite; default 0.
    ///
    /// Chunks that a [`Source`](crate::Source)'s bound spared from sampling hold no true distances: they suit isovalues
    /// within ±3 voxels.
    pub isovalue: f32,
    /// Whether to compute normals; default true.
    pub normals: bool,
    /// Which way the surface goes where the signs of a cell's corners leave it open; default [`Topology::Separated`].
    pub topology: Topology,
}

/// Which way the surface goes where the signs of a cell's corners leave it open: on faces whose corners alternate, and
/// between two corners at the ends of a cell's diagonal that are unlike all others.
///
/// Both give closed, 2-manifold surfaces without zero-area triangles on every input, and the same vertices on the lattice's
/// edges. A plugin's terrain, its ray casts ([`ray_cast`](crate::ray_cast)) and levels of detail use the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Inside corners that stand diagonally on a face or in a cell are separated; the rule of the cases
    /// ([`cases`](crate::cases)), and the fastest.
    #[default]
    Separated,
    /// As the trilinear interpolant of the cell's corners has it, computed in `f64`. The few cells that need it (none to
    /// 3 % of those that the surface crosses in terrain and caves, half of them in white noise) get other triangles, and
    /// some of them one or six vertices in their interior. Ties and weights that are not finite are decided as by
    /// default, and tunnels with a waist within 2⁻⁴⁰ of a face of their cell are left out.
    Trilinear,
}

impl MeshSettings {
    pub(super) fn check(&self) -> Result<(), MeshError> {
        if self.isovalue.is_finite() { Ok(()) } else { Err(MeshError::Isovalue { found: self.isovalue }) }
    }
}

impl Default for MeshSettings {
    fn default() -> Self {
        Self { isovalue: 0.0, normals: true, topology: Topology::Separated }
    }
}
