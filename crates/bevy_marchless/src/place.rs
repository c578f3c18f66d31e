//! [`Place`]: where terrains are in world space, in double precision.

use bevy_ecs::query::QueryData;
use bevy_math::DAffine3;
use bevy_transform::components::GlobalTransform;

/// Where a terrain was in world space when transforms were last propagated.
#[derive(QueryData)]
pub(crate) struct Place {
    transform: &'static GlobalTransform,
    #[cfg(feature = "big_space")]
    grid: Option<&'static ::big_space::grid::Grid>,
}

impl PlaceItem<'_, '_> {
    /// From the terrain's own space (world units from its lattice's origin, so voxels times the voxel size) to world space.
    pub(crate) fn to_world(&self) -> DAffine3 {
        #[cfg(feature = "big_space")]
        if let Some(grid) = self.grid {
            return crate::big_space::grid_to_world(grid);
        }
        let affine = self.transform.affine();
        DAffine3 { matrix3: affine.matrix3.as_dmat3(), translation: affine.translation.as_dvec3() }
    }

    /// From world space to the terrain's own; not finite where the terrain is scaled to nothing.
    pub(crate) fn to_terrain(&self) -> DAffine3 {
        self.to_world().inverse()
    }
}
