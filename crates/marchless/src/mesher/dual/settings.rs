//! [`DualSettings`]: the isovalue, normals, smoothing, sharp materials and creases of a dual mesh.

use core::f32::consts::PI;

use super::crease::cosine;
use crate::{material::MaterialSet, mesher::MeshError};

/// The most steps of smoothing.
const MAX_SMOOTHING: u32 = 8;

/// The settings of a dual mesh ([`Mesher::mesh_dual`](crate::Mesher::mesh_dual)): isovalue, normals, smoothing, sharp
/// materials, creases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualSettings {
    /// The weight of the surface, in voxels. Samples below it are inside. Finite; default 0.
    pub isovalue: f32,
    /// Whether meshes get normals; default true.
    pub normals: bool,
    /// Steps of smoothing, 0 to 8; default 0.
    ///
    /// A vertex starts at the mean of its crossings. In each step it moves half the way to the mean of its neighbours,
    /// and stays in its cell. Sharp vertices do not move. Each step needs one more layer of padding on each side.
    pub smoothing: u32,
    /// The materials whose creases, edges and tips are kept; default none.
    ///
    /// A vertex belongs to the nearest of the inside samples at its crossings, as seen from their mean. If the material
    /// of that sample is in the set, the vertex lies where the sum of the squared distances to the planes at its
    /// crossings is least, within its cell; in directions in which the planes say little, it stays at the mean. All
    /// samples without materials have material 0. With [`MaterialSet::EMPTY`], no vertex is sharp; with
    /// [`MaterialSet::ALL`], all are.
    ///
    /// The planes come from the samples up to one beyond the cell. So creases are sharp if the weights are about
    /// distances there: a field that is only right in sign makes sharp vertices as rough as the field.
    pub sharp: MaterialSet,
    /// The angle from which on creases show in the normals, in radians, 0 to π; default `None`: nowhere.
    ///
    /// Where the triangles around a sharp vertex turn by more than this from one to the next, the vertex gets a copy
    /// for each smooth run of them: with the same position and material, and with the mean of the run's triangles'
    /// normals by area. Sharp vertices without a crease have such a mean, too. The copies follow all other vertices.
    ///
    /// Copies open the mesh for [`MeshReport`](crate::MeshReport): merge vertices of equal positions before, or judge
    /// the mesh without creases, which has the same triangles. Creases need one more layer of padding on each side.
    /// Without [`normals`](Self::normals), or without sharp vertices, no vertex is copied.
    pub crease: Option<f32>,
}

impl DualSettings {
    /// The layers of padding on each side of a [padded](crate::Samples::padded) block: `2 + smoothing`, and one more
    /// with creases.
    pub const fn padding(&self) -> u32 {
        self.smoothing.saturating_add(if self.crease.is_some() { 3 } else { 2 })
    }

    /// The cosine of the crease angle, if vertices may be copied.
    pub(super) fn crease_cosine(&self) -> Option<f64> {
        self.crease.filter(|_| self.normals && !self.sharp.is_empty()).map(cosine)
    }

    pub(in crate::mesher) fn check(&self) -> Result<(), MeshError> {
        if !self.isovalue.is_finite() {
            return Err(MeshError::Isovalue { found: self.isovalue });
        }
        if self.smoothing > MAX_SMOOTHING {
            return Err(MeshError::Smoothing { found: self.smoothing, most: MAX_SMOOTHING });
        }
        match self.crease {
            Some(angle) if !(0.0..=PI).contains(&angle) => Err(MeshError::Crease { found: angle }),
            _ => Ok(()),
        }
    }
}

impl Default for DualSettings {
    fn default() -> Self {
        Self { isovalue: 0.0, normals: true, smoothing: 0, sharp: MaterialSet::EMPTY, crease: None }
    }
}
