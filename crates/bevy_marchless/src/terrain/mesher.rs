//! [`TerrainMesher`]: how a terrain's samples become triangles.

use core::f32::consts::PI;

use bevy_reflect::prelude::*;
use marchless::{DualSettings, MaterialSet, MeshError, MeshMethod, MeshSettings};

use super::TerrainError;

/// How a terrain's samples become triangles; see [`choosing_a_mesher`](crate::choosing_a_mesher).
///
/// Samples, stamps and their reports are the same with each mesher.
///
/// ```
/// use bevy_marchless::prelude::*;
///
/// // Earth is smooth, masonry of material 3 keeps its edges.
/// let masonry = SharpMaterials::Only(vec![3]);
/// let mesher = DualMesher { smoothing: 2, sharp: masonry, crease: Some(30.0) };
/// let ground = Terrain::new(|[_, y, _]: [f64; 3]| y - 20.0).with_mesher(mesher);
/// ```
#[derive(Reflect, Clone, Debug, Default, PartialEq)]
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
#[derive(Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct DualMesher {
    /// Steps of smoothing, 0 to 8; at most two fewer than [`Terrain::chunk_cells`](super::Terrain::chunk_cells). Default
    /// 0.
    ///
    /// In each step, a vertex moves half the way to the mean of its neighbours, and stays in its cell. Each step makes
    /// meshes read one more layer of samples around their chunks, so edits mesh more chunks again.
    pub smoothing: u32,
    /// The materials whose creases, edges and tips are kept. Default none.
    ///
    /// A vertex has the material of the nearest of the inside samples around it, and is sharp if that material is. Sharp
    /// vertices are not smoothed.
    pub sharp: SharpMaterials,
    /// The angle from which on creases of sharp materials show in the normals: where triangles turn by more than this
    /// from one to the next, a vertex gets a copy for each side. `None`, the default: nowhere. [Units: degrees]
    /// [Range: 0 to 180]
    pub crease: Option<f32>,
}

/// The materials whose creases the dual mesher keeps.
#[derive(Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SharpMaterials {
    /// No material; the default.
    #[default]
    None,
    /// All materials.
    All,
    /// These materials.
    Only(Vec<u8>),
}

impl TerrainMesher {
    /// The core's method for meshes at an isovalue, with normals. A [`Grid`](marchless::Grid) that is meshed with it gives
    /// the meshes that the plugin draws.
    pub fn method(&self, isovalue: f32) -> MeshMethod {
        let Self::Dual(DualMesher { smoothing, sharp, crease }) = self else {
            return MeshSettings { isovalue, ..MeshSettings::default() }.into();
        };
        let sharp = match sharp {
            SharpMaterials::None => MaterialSet::EMPTY,
            SharpMaterials::All => MaterialSet::ALL,
            SharpMaterials::Only(materials) => materials.iter().copied().collect(),
        };
        // Half a turn in degrees may be a little more than π in `f32`.
        let radians = |degrees: f32| if degrees == 180.0 { PI } else { degrees.to_radians() };
        let (smoothing, crease) = (*smoothing, crease.map(radians));
        DualSettings { isovalue, smoothing, sharp, crease, ..DualSettings::default() }.into()
    }

    /// Checks the settings for chunks of this many cells per axis.
    ///
    /// # Errors
    /// [`TerrainError::Smoothing`], [`TerrainError::Crease`].
    pub(super) fn check(&self, chunk_cells: u32) -> Result<(), TerrainError> {
        if let Self::Dual(DualMesher { crease: Some(crease), .. }) = self
            && !(0.0..=180.0).contains(crease)
        {
            return Err(TerrainError::Crease { found: *crease });
        }
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
