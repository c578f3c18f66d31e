//! [`MeshSettings`]: the isovalue, normals and topology of a mesh.

use super::error::MeshError;

/// The settings of a mesh: isovalue, normals, topology.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshSettings {
    /// The weight of the surface, in voxels. Samples below it are inside. Finite; default 0.
    ///
    /// A chunk that a [`Source`](crate::Source)'s bound settled without sampling holds no true distances. It suits
    /// isovalues within ±3 voxels.
    pub isovalue: f32,
    /// Whether meshes get normals; default true.
    pub normals: bool,
    /// The rule that decides ambiguous cells; default [`Topology::Separated`].
    pub topology: Topology,
}

/// The rule that decides ambiguous cells, where the signs of the corners allow several surfaces.
///
/// A cell is ambiguous if it has a face whose corners alternate, or if two corners at the ends of a diagonal differ
/// from all others. Both topologies give closed, 2-manifold surfaces without zero-area triangles on every input, and
/// the same vertices on the lattice's edges. A plugin's terrain, its ray casts
/// ([`Grid::ray_cast`](crate::Grid::ray_cast)) and levels of detail use the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Separates inside corners that are diagonal to each other on a face or in a cell. This is the rule of the
    /// [`cases`](crate::cases), and the faster option.
    #[default]
    Separated,
    /// Follows the trilinear interpolant of the cell's corners, computed in `f64`.
    ///
    /// Ambiguous cells may get other triangles, and some of them one or six vertices in their interior. Of the cells
    /// that the surface crosses, none to 3 % are ambiguous in terrain and caves, and half in white noise. Ties and
    /// weights that are not finite are decided as by default, and tunnels with a waist within 2⁻⁴⁰ of a face of their
    /// cell are left out.
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
