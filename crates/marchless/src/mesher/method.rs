//! [`MeshMethod`]: which mesher makes a mesh, and its settings.

use super::{DualSettings, MeshError, MeshSettings};

/// A mesher and its settings: how the meshes of a [`Grid`](crate::Grid)'s chunks are made.
///
/// Functions that take a method also take the settings of one, [`MeshSettings`] or [`DualSettings`], by value or by
/// reference. Only meshes of one method fit together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeshMethod {
    /// Marching cubes, with vertices on the edges of the lattice ([`Mesher::mesh`](crate::Mesher::mesh)). The default.
    Primal(MeshSettings),
    /// The dual mesher, with vertices in cells ([`Mesher::mesh_dual`](crate::Mesher::mesh_dual)).
    Dual(DualSettings),
}

impl MeshMethod {
    /// The weight of the surface, in voxels.
    pub const fn isovalue(&self) -> f32 {
        match self {
            Self::Primal(settings) => settings.isovalue,
            Self::Dual(settings) => settings.isovalue,
        }
    }

    /// Whether meshes get normals.
    pub const fn normals(&self) -> bool {
        match self {
            Self::Primal(settings) => settings.normals,
            Self::Dual(settings) => settings.normals,
        }
    }

    /// The same method with other `normals`.
    #[must_use]
    pub const fn with_normals(self, normals: bool) -> Self {
        match self {
            Self::Primal(settings) => Self::Primal(MeshSettings { normals, ..settings }),
            Self::Dual(settings) => Self::Dual(DualSettings { normals, ..settings }),
        }
    }

    /// The layers of samples that the mesh of a chunk reads below its own samples, and those that it reads above, on
    /// each axis: 1 and 2 with the primal mesher, [`DualSettings::padding`] each with the dual one.
    pub const fn margins(&self) -> [u32; 2] {
        match self {
            Self::Primal(_) => [1, 2],
            Self::Dual(settings) => [settings.padding(); 2],
        }
    }

    /// Checks that chunks of `cells` cells per axis can be meshed: the margins may reach no farther than the chunks
    /// around one.
    ///
    /// # Errors
    /// [`MeshError::Smoothing`] if there are more steps of smoothing than 8 or than `cells − 2`, with creases `cells − 3`;
    /// [`MeshError::Isovalue`] if the isovalue is not finite; [`MeshError::Crease`] if the crease angle is out of range.
    pub fn check(&self, cells: u32) -> Result<(), MeshError> {
        let settings = match self {
            Self::Primal(MeshSettings { isovalue, .. }) if isovalue.is_finite() => return Ok(()),
            Self::Primal(settings) => return Err(MeshError::Isovalue { found: settings.isovalue }),
            Self::Dual(settings) => settings,
        };
        settings.check()?;
        if settings.padding() > cells {
            let most = cells.saturating_sub(settings.padding() - settings.smoothing);
            return Err(MeshError::Smoothing { found: settings.smoothing, most });
        }
        Ok(())
    }
}

impl Default for MeshMethod {
    fn default() -> Self {
        Self::Primal(MeshSettings::default())
    }
}

impl From<MeshSettings> for MeshMethod {
    fn from(settings: MeshSettings) -> Self {
        Self::Primal(settings)
    }
}

impl From<&MeshSettings> for MeshMethod {
    fn from(settings: &MeshSettings) -> Self {
        Self::Primal(*settings)
    }
}

impl From<DualSettings> for MeshMethod {
    fn from(settings: DualSettings) -> Self {
        Self::Dual(settings)
    }
}

impl From<&DualSettings> for MeshMethod {
    fn from(settings: &DualSettings) -> Self {
        Self::Dual(*settings)
    }
}

impl From<&Self> for MeshMethod {
    fn from(method: &Self) -> Self {
        *method
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshBuffer, Mesher, Samples, Shape};

    #[test]
    fn chunks_are_refused_as_the_mesher_refuses_their_blocks() {
        for cells in 8..=12 {
            for (smoothing, crease) in (0..=10).flat_map(|steps| [None, Some(0.5)].map(|crease| (steps, crease))) {
                let method = MeshMethod::from(DualSettings { smoothing, crease, ..DualSettings::default() });
                let [low, high] = method.margins();
                let shape = Shape::cube(low + cells + high).unwrap();
                let weights = alloc::vec![1i8; shape.len()];
                let samples = Samples::new(shape, &weights).unwrap().padded();
                let MeshMethod::Dual(settings) = method else { unreachable!() };
                let meshed = Mesher::new().mesh_dual(samples, &settings, &mut MeshBuffer::new());
                assert_eq!(method.check(cells).is_ok(), meshed.is_ok(), "{cells} cells, {smoothing} steps");
            }
        }
        let error = MeshMethod::from(DualSettings { smoothing: 7, ..DualSettings::default() }).check(8);
        assert_eq!(error, Err(MeshError::Smoothing { found: 7, most: 6 }));
        let with_creases = DualSettings { smoothing: 6, crease: Some(0.5), ..DualSettings::default() };
        assert_eq!(MeshMethod::from(with_creases).check(8), Err(MeshError::Smoothing { found: 6, most: 5 }));
        let wide = MeshMethod::from(DualSettings { crease: Some(4.0), ..DualSettings::default() });
        assert_eq!(wide.check(8), Err(MeshError::Crease { found: 4.0 }));
    }
}
