//! Draws the bounds of chunks.

use bevy_app::{App, PostUpdate};
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_gizmos::AppGizmoBuilder as _;
use bevy_gizmos::GizmoPlugin;
use bevy_gizmos::config::GizmoConfigGroup;
use bevy_gizmos::gizmos::Gizmos;
use bevy_math::{IVec3, Vec3, bounding::Aabb3d};
use bevy_reflect::prelude::*;
use bevy_transform::TransformSystems;
use bevy_transform::components::GlobalTransform;

use crate::chunk::{Chunk, ChunkGeometry};
use crate::terrain::TerrainVolume;

/// Whether the bounds of chunks are drawn. Default: no.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct ShowChunkBounds(pub bool);

/// The gizmos' group, so that their line width and more can be set in the `GizmoConfigStore`.
#[derive(Reflect, GizmoConfigGroup, Clone, Debug)]
#[reflect(Default, Debug, Clone)]
pub struct ChunkBoundsGizmos {
    /// The colour of chunks that have something to draw.
    pub drawn: Color,
    /// The colour of the whole terrain's bounds.
    pub terrain: Color,
}

impl Default for ChunkBoundsGizmos {
    fn default() -> Self {
        Self { drawn: Color::srgb(0.35, 0.55, 0.75), terrain: Color::srgb(0.9, 0.75, 0.3) }
    }
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<ShowChunkBounds>().register_type::<ShowChunkBounds>().register_type::<ChunkBoundsGizmos>();
}

/// Without Bevy's `GizmoPlugin` there is nothing to draw with.
pub(super) fn finish(app: &mut App) {
    if app.is_plugin_added::<GizmoPlugin>() {
        app.init_gizmo_group::<ChunkBoundsGizmos>().add_systems(
            PostUpdate,
            draw_bounds.after(TransformSystems::Propagate).run_if(|show: Res<ShowChunkBounds>| show.0),
        );
    }
}

fn draw_bounds(
    chunks: Query<(&Chunk, &ChunkGeometry, &GlobalTransform)>,
    terrains: Query<(&TerrainVolume, &GlobalTransform)>,
    mut gizmos: Gizmos<ChunkBoundsGizmos>,
) {
    let (drawn, whole) = (gizmos.config_ext.drawn, gizmos.config_ext.terrain);
    let cuboid = |size: Vec3| Aabb3d::from_min_max(Vec3::ZERO, size);
    for (chunk, geometry, transform) in &chunks {
        if let Ok((volume, _)) = terrains.get(chunk.terrain)
            && !geometry.mesh.is_empty()
        {
            gizmos.aabb_3d(cuboid(Vec3::splat(volume.grid().chunk_cells() as f32)), *transform, drawn);
        }
    }
    for (volume, transform) in &terrains {
        if let Some(settings) = volume.settings() {
            let corner = |chunk: IVec3| chunk.as_vec3() * settings.chunk_cells as f32 * settings.voxel_size;
            let bounds = Aabb3d::from_min_max(corner(settings.extent.min), corner(settings.extent.max));
            gizmos.aabb_3d(bounds, *transform, whole);
        }
    }
}
