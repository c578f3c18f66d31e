//! [`ChunkGizmosPlugin`]: draws the bounds of chunks, in colours that show their states.

use bevy_app::{App, Plugin, PostUpdate};
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

use crate::chunk::{Chunk, ChunkGeometry, ChunkKey, chunk_transform};
use crate::cover::LeafState;
use crate::terrain::TerrainVolume;

/// Whether the bounds of chunks are drawn. Default: false.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct ShowChunkBounds(pub bool);

/// What the colours of chunk bounds tell. Default: states.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub enum ChunkColors {
    /// Whether a chunk is drawn, waits or is empty.
    #[default]
    States,
    /// The levels of detail of drawn chunks. Chunks without a mesh are not shown.
    Levels,
}

/// The gizmo group of chunk bounds: their colours. Line width and more can be set in the `GizmoConfigStore`.
#[derive(Reflect, GizmoConfigGroup, Clone, Debug)]
#[reflect(Default, Debug, Clone)]
pub struct ChunkBoundsGizmos {
    /// The colour of chunks whose mesh is not empty, with [`ChunkColors::States`].
    pub drawn: Color,
    /// The colours of drawn chunks by their level, with [`ChunkColors::Levels`].
    pub levels: [Color; 7],
    /// The colour of chunks that wait to be filled or meshed.
    pub waiting: Color,
    /// The colour of chunks without a surface, drawn as a small cube in the middle of each.
    pub empty: Color,
    /// The colour of the whole terrain's bounds, if it is not endless.
    pub terrain: Color,
}

impl Default for ChunkBoundsGizmos {
    fn default() -> Self {
        Self {
            drawn: Color::srgb(0.35, 0.55, 0.75),
            levels: [
                Color::srgb(0.95, 0.30, 0.25),
                Color::srgb(0.98, 0.65, 0.15),
                Color::srgb(0.90, 0.90, 0.20),
                Color::srgb(0.35, 0.80, 0.30),
                Color::srgb(0.20, 0.70, 0.85),
                Color::srgb(0.40, 0.45, 0.95),
                Color::srgb(0.80, 0.40, 0.90),
            ],
            waiting: Color::srgb(1.0, 0.45, 0.1),
            empty: Color::srgba(0.6, 0.6, 0.6, 0.35),
            terrain: Color::srgb(0.9, 0.75, 0.3),
        }
    }
}

/// How far inside a chunk its bounds are drawn, so that neighbours' lines do not cover each other. [Units: voxels]
const INSET: f32 = 0.25;
/// The edge of an empty chunk's cube, as a share of the chunk's edge.
const EMPTY_SHARE: f32 = 0.06;
/// The bounds of a terrain with more chunks than this along an axis are not drawn.
const ENDLESS: u32 = 1 << 16;

/// Draws the bounds of chunks while [`ShowChunkBounds`] is true.
///
/// Needs Bevy's `GizmoPlugin`, added before or after; without it, nothing is drawn.
#[derive(Default)]
pub struct ChunkGizmosPlugin;

impl Plugin for ChunkGizmosPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ShowChunkBounds>()
            .init_resource::<ChunkColors>()
            .register_type::<ShowChunkBounds>()
            .register_type::<ChunkColors>()
            .register_type::<ChunkBoundsGizmos>();
    }

    fn finish(&self, app: &mut App) {
        if app.is_plugin_added::<GizmoPlugin>() {
            app.init_gizmo_group::<ChunkBoundsGizmos>().add_systems(
                PostUpdate,
                (draw_drawn, draw_others.run_if(resource_equals(ChunkColors::States)), draw_terrains)
                    .after(TransformSystems::Propagate)
                    .run_if(|show: Res<ShowChunkBounds>| show.0),
            );
        }
    }
}

fn draw_drawn(
    chunks: Query<(&Chunk, &ChunkGeometry, &GlobalTransform)>,
    volumes: Query<&TerrainVolume>,
    colors: Res<ChunkColors>,
    mut gizmos: Gizmos<ChunkBoundsGizmos>,
) {
    let (drawn, levels) = (gizmos.config_ext.drawn, gizmos.config_ext.levels);
    for (chunk, geometry, transform) in &chunks {
        if let Ok(volume) = volumes.get(chunk.terrain)
            && !geometry.mesh.is_empty()
        {
            let color = match *colors {
                ChunkColors::States => drawn,
                ChunkColors::Levels => levels[usize::from(chunk.level).min(levels.len() - 1)],
            };
            gizmos.aabb_3d(inset(volume.grid().chunk_cells()), *transform, color);
        }
    }
}

/// Draws chunks without an entity: waiting and empty ones.
fn draw_others(volumes: Query<(&TerrainVolume, &GlobalTransform)>, mut gizmos: Gizmos<ChunkBoundsGizmos>) {
    let (waiting, empty) = (gizmos.config_ext.waiting, gizmos.config_ext.empty);
    for (volume, to_world) in &volumes {
        let Some(settings) = volume.settings() else { continue };
        let cells = settings.chunk_cells;
        let middle = Vec3::splat(0.5 * cells as f32);
        let mark = 0.5 * EMPTY_SHARE * cells as f32;
        for leaf in volume.leaves() {
            let key = ChunkKey { level: leaf.level, position: leaf.position.to_array() };
            let transform = to_world.mul_transform(chunk_transform(key, cells, settings.voxel_size));
            match leaf.state {
                LeafState::Drawn => {}
                LeafState::Waiting => gizmos.aabb_3d(inset(cells), transform, waiting),
                LeafState::Empty => gizmos.aabb_3d(Aabb3d::new(middle, Vec3::splat(mark)), transform, empty),
            }
        }
    }
}

fn draw_terrains(terrains: Query<(&TerrainVolume, &GlobalTransform)>, mut gizmos: Gizmos<ChunkBoundsGizmos>) {
    let color = gizmos.config_ext.terrain;
    for (volume, transform) in &terrains {
        if let Some(settings) = volume.settings()
            && settings.extent.size().max_element() <= ENDLESS
        {
            let corner = |chunk: IVec3| chunk.as_vec3() * settings.chunk_cells as f32 * settings.voxel_size;
            let bounds = Aabb3d::from_min_max(corner(settings.extent.min), corner(settings.extent.max));
            gizmos.aabb_3d(bounds, *transform, color);
        }
    }
}

/// The box that is drawn for a chunk of `cells` cells per axis, in voxels from its lowest corner.
fn inset(cells: u32) -> Aabb3d {
    Aabb3d::from_min_max(Vec3::splat(INSET), Vec3::splat(cells as f32 - INSET))
}
