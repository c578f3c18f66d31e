//! [`DualSettings`]: the isovalue, normals and smoothing of a dual mesh.

use crate::mesher::MeshError;

/// The most steps of smoothing.
const MAX_SMOOTHING: u32 = 8;

/// The settings of a dual mesh ([`Mesher::mesh_dual`](crate::Mesher::mesh_dual)): isovalue, normals, smoothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualSettings {
    /// The weight of the surface, in voxels. Samples below it are inside. Finite; default 0.
    pub isovalue: f32,
    /// Whether meshes get normals; default true.
    pub normals: bool,
    /// Steps of smoothing, 0 to 8; default 0.
    ///
    /// A vertex starts at the mean of its crossings. In each step it moves half the way to the mean of its neighbours,
    /// and stays in its cell. Each step needs one more layer of padding on each side.
    pub smoothing: u32,
}

impl DualSettings {
    pub(super) fn check(&self) -> Result<(), MeshError> {
        if !self.isovalue.is_finite() {
            return Err(MeshError::Isovalue { found: self.isovalue });
        }
        if self.smoothing > MAX_SMOOTHING {
            return Err(MeshError::Smoothing { found: self.smoothing, most: MAX_SMOOTHING });
        }
        Ok(())
    }
}

impl Default for DualSettings {
    fn default() -> Self {
        Self { isovalue: 0.0, normals: true, smoothing: 0 }
    }
}
