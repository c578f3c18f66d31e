//! [`Placement`]: where terrains are in world space, in double precision.

use bevy_ecs::query::QueryData;
use bevy_math::DAffine3;
use bevy_transform::components::GlobalTransform;

/// Where a terrain was in world space when transforms were last propagated.
#[derive(QueryData)]
pub(crate) struct Placement {
    transform: &'static GlobalTransform,
    #[cfg(feature = "big_space")]
    grid: Option<&'static ::big_space::grid::Grid>,
}

impl PlacementItem<'_, '_> {
    /// Whether it is exact however far from the origin: then world space is relative to a floating origin, and only
    /// propagated transforms can be compared with it.
    pub(crate) fn is_floating(&self) -> bool {
        #[cfg(feature = "big_space")]
        return self.grid.is_some();
        #[cfg(not(feature = "big_space"))]
        false
    }

    /// From the terrain's own space (world units from its lattice's origin, so voxels times the voxel size) to world space.
    pub(crate) fn to_world(&self) -> DAffine3 {
        #[cfg(feature = "big_space")]
        if let Some(grid) = self.grid {
            return grid_to_world(grid);
        }
        in_double_precision(self.transform)
    }

    /// From world space to the terrain's own; not finite where the terrain is scaled to nothing.
    pub(crate) fn to_terrain(&self) -> DAffine3 {
        self.to_world().inverse()
    }
}

/// A transform in double precision.
pub(crate) fn in_double_precision(transform: &GlobalTransform) -> DAffine3 {
    let affine = transform.affine();
    DAffine3 { matrix3: affine.matrix3.as_dmat3(), translation: affine.translation.as_dvec3() }
}

/// From the space of a grid to world space, which is relative to the floating origin's cell.
#[cfg(feature = "big_space")]
fn grid_to_world(grid: &::big_space::grid::Grid) -> DAffine3 {
    let origin = grid.local_floating_origin();
    origin.grid_transform() * DAffine3::from_translation(-grid.cell_to_float(&origin.cell()))
}
