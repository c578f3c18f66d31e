//! [`TerrainMesher`]: how a terrain's samples become triangles.

use bevy_reflect::prelude::*;
use marchless::{DualSettings, MeshError, MeshMethod, MeshSettings};

use super::TerrainError;

/// How a terrain's samples become triangles; see [`choosing_a_mesher`](crate::choosing_a_mesher).
///
/// Samples, stamps and their reports are the same with each mesher.
///
/// ```
/// use bevy_marchless::prelude::*;
///
/// let ground = Terrain::new(|[_, y, _]: [f64; 3]| y - 20.0).with_mesher(DualMesher { smoothing: 2 });
/// ```
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TerrainMesher {
    /// Marching cubes: vertices on the edges between samples. The default.
    #[default]
    Primal,
    /// The dual mesher: vertices in the cells between samples. With one level of detail only.
    Dual(DualMesher),
}

/// The settings of the dual mesher.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct DualMesher {
    /// Steps of smoothing, 0 to 8; at most two fewer than [`Terrain::chunk_cells`](super::Terrain::chunk_cells). Default
    /// 0.
    ///
    /// In each step, a vertex moves half the way to the mean of its neighbours, and stays in its cell. Each step makes
    /// meshes read one more layer of samples around their chunks, so edits mesh more chunks again.
    pub smoothing: u32,
}

impl TerrainMesher {
    /// The core's method for meshes at an isovalue, with normals. A [`Grid`](marchless::Grid) that is meshed with it gives
    /// the meshes that the plugin draws.
    pub fn method(self, isovalue: f32) -> MeshMethod {
        match self {
            Self::Primal => MeshSettings { isovalue, ..MeshSettings::default() }.into(),
            Self::Dual(DualMesher { smoothing }) => {
                DualSettings { isovalue, smoothing, ..DualSettings::default() }.into()
            }
        }
    }

    /// Checks the settings for chunks of this many cells per axis.
    ///
    /// # Errors
    /// [`TerrainError::Smoothing`].
    pub(super) fn check(self, chunk_cells: u32) -> Result<(), TerrainError> {
        match self.method(0.0).check(chunk_cells) {
            Err(MeshError::Smoothing { found, most }) => Err(TerrainError::Smoothing { found, most }),
            _ => Ok(()),
        }
    }
}

impl From<DualMesher> for TerrainMesher {
    fn from(settings: DualMesher) -> Self {
        Self::Dual(settings)
    }
}
