//! [`Placement`]: the transforms of terrains in world space, in double precision.

use bevy_ecs::query::QueryData;
use bevy_math::DAffine3;
use bevy_transform::components::GlobalTransform;

/// A terrain's transform in world space, as of the last propagation of transforms.
#[derive(QueryData)]
pub(crate) struct Placement {
    transform: &'static GlobalTransform,
    #[cfg(feature = "big_space")]
    grid: Option<&'static ::big_space::grid::Grid>,
}

impl PlacementItem<'_, '_> {
    /// Whether the terrain is in a `big_space` grid. World space is then relative to a floating origin and exact at any
    /// distance; only propagated transforms are comparable with it.
    pub(crate) fn is_floating(&self) -> bool {
        #[cfg(feature = "big_space")]
        return self.grid.is_some();
        #[cfg(not(feature = "big_space"))]
        false
    }

    /// Transforms from the terrain's own space to world space. The own space is in world units from the lattice's
    /// origin: voxels times the voxel size.
    pub(crate) fn to_world(&self) -> DAffine3 {
        #[cfg(feature = "big_space")]
        if let Some(grid) = self.grid {
            return grid_to_world(grid);
        }
        in_double_precision(self.transform)
    }

    /// Transforms from world space to the terrain's own; not finite if the terrain's scale is 0.
    pub(crate) fn to_terrain(&self) -> DAffine3 {
        self.to_world().inverse()
    }
}

/// A transform in double precision.
pub(crate) fn in_double_precision(transform: &GlobalTransform) -> DAffine3 {
    let affine = transform.affine();
    DAffine3 { matrix3: affine.matrix3.as_dmat3(), translation: affine.translation.as_dvec3() }
}

/// Transforms from a grid's space to world space, which is relative to the floating origin's cell.
#[cfg(feature = "big_space")]
fn grid_to_world(grid: &::big_space::grid::Grid) -> DAffine3 {
    let origin = grid.local_floating_origin();
    origin.grid_transform() * DAffine3::from_translation(-grid.cell_to_float(&origin.cell()))
}
