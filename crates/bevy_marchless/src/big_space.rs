//! Terrain in a big space (the crate `big_space`), which does not jitter at any distance from the origin.
//!
//! If a terrain's entity is a `Grid`, its chunks lie in the grid's cells. In the update that spawns it, each chunk's
//! entity gets a `CellCoord` and a `Transform` relative to the middle of that cell, both computed in double precision
//! from the chunk's position. [`TerrainQuery`](crate::query::TerrainQuery) and viewers use the grid's exact position
//! relative to the floating origin. World space is relative to the floating origin's cell, as everywhere in a big
//! space.
//!
//! # How to set it up
//! ```
//! use bevy_app::prelude::*;
//! use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//! use bevy_transform::components::Transform;
//! use big_space::prelude::*;
//!
//! fn main() {
//!     let mut app = App::new();
//!     // In a game: DefaultPlugins.build().disable::<TransformPlugin>(), since the big space takes its place.
//!     app.add_plugins((TaskPoolPlugin::default(), bevy_time::TimePlugin));
//!     app.add_plugins((BigSpaceDefaultPlugins, MarchlessPlugins)).add_systems(Startup, setup);
//!     app.update();
//! }
//!
//! fn setup(mut commands: Commands) {
//!     commands.spawn_big_space_default(|space| {
//!         let source = |[x, y, z]: [f64; 3]| y - 40.0 - 8.0 * (x * 0.05).sin() * (z * 0.04).cos();
//!         let mut terrain = space.spawn_grid(Grid::default(), Terrain::endless(source));
//!         // Ten million units along x; a camera goes here.
//!         let (cell, place) = (CellCoord::new(5_000, 0, 0), Transform::from_xyz(0.0, 60.0, 0.0));
//!         terrain.spawn_spatial((FloatingOrigin, TerrainViewer::new(256.0), cell, place));
//!     });
//! }
//! ```
//!
//! - The terrain's entity is a grid *in* a big space, not its root, which must not have a `Transform`. A grid's
//!   translation and rotation count; its scale is ignored, as in `big_space`.
//! - Put the floating origin (usually the camera) into the terrain's own grid, or into one that is neither rotated
//!   against it nor offset by fractions of a cell. In other grids, `big_space` rounds the distance between both to an
//!   `f32` of at most half a cell.
//! - The terrain's source, stamps and hits are in the terrain's own space, in double precision, from the origin of its
//!   lattice.
//!
//! # Order of systems
//! Observers place chunks when they are spawned, in [`MarchlessSystems::Work`]. All of [`MarchlessSystems`] runs before
//! `TransformSystems::Propagate`, in which `big_space` propagates transforms. So a chunk is at its place in the update
//! that spawns it. Queries in `Update` use the floating origin's position of the last propagation, as with every
//! `GlobalTransform`.
//!
//! # Performance
//! Each chunk has two more components, and moves between archetypes once or twice when it is spawned. If the terrain's
//! grid takes part in `BigSpaceStationaryPlugin` (one of `BigSpaceDefaultPlugins`), chunks are marked `Stationary`.
//! They then cost nothing while the floating origin stays in its cell. Without this plugin, or after a change of
//! settings has moved the chunks, `big_space` checks each chunk in every update. When the floating origin changes its
//! cell, all chunks get a new `GlobalTransform`.

use ::big_space::precision::GridPrecision;
use ::big_space::prelude::{CellCoord, Grid, GridDirtyTick, Stationary};
use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;
use bevy_math::{DVec3, Vec3};
use bevy_transform::components::Transform;

use crate::chunk::{Chunk, chunk_place, chunk_transform};
use crate::schedule::MarchlessSystems;
use crate::terrain::{Terrain, TerrainVolume};

/// Places the chunks of terrains that are grids.
#[derive(Default)]
pub struct BigSpacePlugin;

impl Plugin for BigSpacePlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(place_new_chunk)
            .add_observer(place_in_new_grid)
            .add_observer(leave_removed_grid)
            .add_systems(PostUpdate, follow_settings.in_set(MarchlessSystems::Decorate));
    }
}

/// Gives a new chunk its cell. A chunk does not move, so propagation may skip it.
fn place_new_chunk(
    added: On<Add, Chunk>,
    chunks: Query<&Chunk>,
    terrains: Query<(&TerrainVolume, &Grid, Has<GridDirtyTick>)>,
    mut commands: Commands,
) {
    let Ok(chunk) = chunks.get(added.entity) else { return };
    let Ok((volume, grid, can_sleep)) = terrains.get(chunk.terrain) else { return };
    let Some(settings) = volume.settings() else { return };
    let mut entity = commands.entity(added.entity);
    let place = place(chunk, settings, grid);
    if can_sleep {
        entity.try_insert((place, Stationary));
    } else {
        entity.try_insert(place);
    }
}

/// Places the chunks of a terrain that becomes a grid, or whose grid is replaced.
fn place_in_new_grid(
    inserted: On<Insert, Grid>,
    terrains: Query<(&TerrainVolume, &Grid, &Children)>,
    chunks: Query<Placed>,
    mut commands: Commands,
) {
    if let Ok((volume, grid, children)) = terrains.get(inserted.entity) {
        place_again(volume, grid, children, &chunks, &mut commands);
    }
}

/// Moves chunks when the voxel size in effect changes. It is compared with the size of the last update, because
/// settings may take effect later than they change.
fn follow_settings(
    terrains: Query<(Entity, &TerrainVolume, &Grid, &Children)>,
    chunks: Query<Placed>,
    mut sizes: Local<EntityHashMap<f32>>,
    mut commands: Commands,
) {
    for (terrain, volume, grid, children) in &terrains {
        let Some(settings) = volume.settings() else { continue };
        if sizes.insert(terrain, settings.voxel_size).is_some_and(|before| before != settings.voxel_size) {
            place_again(volume, grid, children, &chunks, &mut commands);
        }
    }
    if sizes.len() > terrains.iter().len() {
        sizes.retain(|terrain, _| terrains.contains(*terrain));
    }
}

/// Removes the cells of the chunks of a terrain that stops being a grid.
fn leave_removed_grid(
    removed: On<Remove, Grid>,
    terrains: Query<(&TerrainVolume, &Children)>,
    chunks: Query<(Entity, &Chunk)>,
    mut commands: Commands,
) {
    let Ok((volume, children)) = terrains.get(removed.entity) else { return };
    let Some(settings) = volume.settings() else { return };
    for (entity, chunk) in chunks.iter_many(children) {
        let transform = chunk_transform(chunk.key(), settings.chunk_cells, settings.voxel_size);
        commands.entity(entity).try_remove::<(CellCoord, Stationary)>().try_insert(transform);
    }
}

/// A chunk, and its cell and transform.
type Placed = (Entity, &'static Chunk, Option<&'static CellCoord>, &'static Transform);

/// Places the chunks of a terrain again, as far as they are misplaced. These lose `Stationary`, since stationary
/// entities would not be propagated.
fn place_again(
    volume: &TerrainVolume,
    grid: &Grid,
    children: &Children,
    chunks: &Query<Placed>,
    commands: &mut Commands,
) {
    let Some(settings) = volume.settings() else { return };
    for (entity, chunk, cell, transform) in chunks.iter_many(children) {
        let place = place(chunk, settings, grid);
        if (cell, transform) != (Some(&place.0), &place.1) {
            commands.entity(entity).try_remove::<Stationary>().try_insert(place);
        }
    }
}

/// The cell whose middle is nearest to a chunk's lowest corner, and the chunk's transform relative to that middle.
///
/// Up to 2²⁹ voxels from the origin, the corner and the cell's middle are exact in `f64`. Only the offset is rounded,
/// to an `f32`.
fn place(chunk: &Chunk, settings: &Terrain, grid: &Grid) -> (CellCoord, Transform) {
    let (corner, size) = chunk_place(chunk.key(), settings.chunk_cells, settings.voxel_size);
    let edge = f64::from(grid.cell_edge_length());
    let [x, y, z] = (corner / edge).round().to_array().map(|v| v as GridPrecision);
    let cell = CellCoord::new(x, y, z);
    let offset: DVec3 = corner - grid.cell_to_float(&cell);
    let transform = Transform::from_translation(offset.as_vec3()).with_scale(Vec3::splat(size));
    (cell, transform)
}
