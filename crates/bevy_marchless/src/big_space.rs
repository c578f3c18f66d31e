//! Terrain in a big space (the crate `big_space`), where nothing shakes however far one goes from the origin.
//!
//! A terrain whose entity is a `Grid` has its chunks in the grid's cells: each chunk's entity gets a `CellCoord` and a
//! `Transform` relative to that cell's middle, both computed in double precision from the chunk's position, in the update that
//! spawns it. [`TerrainQuery`](crate::query::TerrainQuery) and viewers then go by the grid's exact
//! place relative to the floating origin. World space is relative to the floating origin's cell, as everywhere in a big space.
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
//! - The terrain's entity is a grid *in* a big space, not its root, which must not have a `Transform`. The scale of a grid's `Transform` is
//!   ignored, as `big_space` does; its place and rotation count.
//! - The floating origin (mostly the camera) belongs in the terrain's own grid, or in one that is neither turned against it nor offset by
//!   fractions of a cell. In others `big_space` rounds the way between both to an `f32` of at most half a cell.
//! - The terrain's source, stamps and hits are in the terrain's own space, in double precision, from its lattice's origin on.
//!
//! # Order of systems
//! Chunks are placed by observers, as they are spawned in [`MarchlessSystems::Work`]. All of [`MarchlessSystems`] runs before
//! `TransformSystems::Propagate`, in which `big_space` does its own propagation, so that a chunk is where it belongs in the very
//! update that spawns it. Queries in `Update` see the floating origin where it was when transforms were last propagated, like
//! every `GlobalTransform`.
//!
//! # What it costs
//! Two more components, and one or two moves between archetypes as a chunk is spawned. Where the terrain's grid takes part in
//! `BigSpaceStationaryPlugin` (among `BigSpaceDefaultPlugins`), chunks are marked `Stationary`, and cost nothing more as long as
//! the floating origin stays in its cell; without it, or after a change of settings has moved them, `big_space` looks at
//! each chunk in every update. When the floating origin changes its cell, all chunks get a new `GlobalTransform`.

use ::big_space::precision::GridPrecision;
use ::big_space::prelude::{CellCoord, Grid, GridDirtyTick, Stationary};
use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;
use bevy_math::{DVec3, IVec3, Vec3};
use bevy_transform::components::Transform;

use crate::chunk::{Chunk, chunk_transform};
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

/// A chunk gets its cell as soon as it is there. It never moves, so that propagation may pass over it.
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
    let place = place(chunk.position, settings, grid);
    if can_sleep {
        entity.try_insert((place, Stationary));
    } else {
        entity.try_insert(place);
    }
}

/// A terrain that becomes a grid, or another one, takes its chunks with it.
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

/// Chunks move where the size of a voxel changes. How large it was is remembered, since settings may take effect later.
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

/// A terrain that is no grid any more has chunks without cells.
fn leave_removed_grid(
    removed: On<Remove, Grid>,
    terrains: Query<(&TerrainVolume, &Children)>,
    chunks: Query<(Entity, &Chunk)>,
    mut commands: Commands,
) {
    let Ok((volume, children)) = terrains.get(removed.entity) else { return };
    let Some(settings) = volume.settings() else { return };
    for (entity, chunk) in chunks.iter_many(children) {
        let transform = chunk_transform(chunk.position.to_array(), settings.chunk_cells, settings.voxel_size);
        commands.entity(entity).try_remove::<(CellCoord, Stationary)>().try_insert(transform);
    }
}

/// A chunk and where it is.
type Placed = (Entity, &'static Chunk, Option<&'static CellCoord>, &'static Transform);

/// Places those chunks of a terrain that are elsewhere. They are awake from then on: what sleeps would not be propagated.
fn place_again(
    volume: &TerrainVolume,
    grid: &Grid,
    children: &Children,
    chunks: &Query<Placed>,
    commands: &mut Commands,
) {
    let Some(settings) = volume.settings() else { return };
    for (entity, chunk, cell, transform) in chunks.iter_many(children) {
        let place = place(chunk.position, settings, grid);
        if (cell, transform) != (Some(&place.0), &place.1) {
            commands.entity(entity).try_remove::<Stationary>().try_insert(place);
        }
    }
}

/// The cell whose middle is nearest to a chunk's lowest corner, and the chunk's transform relative to that.
///
/// Out to 2²⁹ voxels the corner and the cell's middle are exact in `f64`; only the offset is rounded, to an `f32`.
fn place(position: IVec3, settings: &Terrain, grid: &Grid) -> (CellCoord, Transform) {
    let corner = position.as_dvec3() * f64::from(settings.chunk_cells) * f64::from(settings.voxel_size);
    let edge = f64::from(grid.cell_edge_length());
    let [x, y, z] = (corner / edge).round().to_array().map(|v| v as GridPrecision);
    let cell = CellCoord::new(x, y, z);
    let offset: DVec3 = corner - grid.cell_to_float(&cell);
    let transform = Transform::from_translation(offset.as_vec3()).with_scale(Vec3::splat(settings.voxel_size));
    (cell, transform)
}
