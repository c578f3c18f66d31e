//! Gives new terrains a volume and chunks, and follows changes of their settings.

use std::collections::BTreeSet;
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_transform::components::Transform;
use marchless::{Grid, Region};

use super::fill::{FillResults, fill_chunk};
use super::volume::ChunkState;
use super::{Terrain, TerrainError, TerrainVolume};
use crate::chunk::{Chunk, chunk_transform, new_chunk};
use crate::work::{WorkQueue, new_number};

/// Checks terrains that are new or whose settings changed, and does what the change asks for.
pub(crate) fn prepare_terrains(
    mut terrains: Query<(Entity, &Terrain, &mut TerrainVolume, Has<TerrainError>), Changed<Terrain>>,
    mut transforms: Query<&mut Transform, With<Chunk>>,
    mut commands: Commands,
    queue: Res<WorkQueue>,
    results: Res<FillResults>,
) {
    for (entity, terrain, mut volume, was_refused) in &mut terrains {
        if let Err(error) = terrain.check() {
            bevy_log::error!("terrain {entity}: {error}; its settings are not applied");
            commands.entity(entity).try_insert(error);
            continue;
        }
        if was_refused {
            commands.entity(entity).try_remove::<TerrainError>();
        }
        let before = volume.settings.replace(terrain.clone());
        volume.colors = Arc::new(terrain.palette.to_vertex_colors());
        let same_chunks = |old: &Terrain| (old.extent, old.chunk_cells) == (terrain.extent, terrain.chunk_cells);
        if !before.as_ref().is_some_and(same_chunks) {
            lay_out(entity, terrain, &mut volume, &mut commands);
        }
        match &before {
            Some(old) if same_samples(old, terrain) => {
                if !same_meshes(old, terrain) {
                    let all: BTreeSet<_> = volume.chunks.keys().copied().collect();
                    volume.add_pending(all, None);
                }
            }
            _ => {
                for (position, state) in &volume.chunks {
                    if let Some(mut transform) = state.entity.and_then(|entity| transforms.get_mut(entity).ok()) {
                        *transform = chunk_transform(*position, terrain.chunk_cells, terrain.voxel_size);
                    }
                }
                refill(entity, terrain, &mut volume, &queue, &results);
            }
        }
    }
}

/// Replaces all chunk entities.
fn lay_out(entity: Entity, terrain: &Terrain, volume: &mut TerrainVolume, commands: &mut Commands) {
    let extent = extent_of(terrain);
    volume.forget_work();
    for old in core::mem::take(&mut volume.chunks).into_values().filter_map(|state| state.entity) {
        commands.entity(old).try_despawn();
    }
    for position in extent.points() {
        let chunk = commands
            .spawn(new_chunk(entity, crate::chunk::ChunkKey::finest(position), terrain.chunk_cells, terrain.voxel_size))
            .id();
        volume.chunks.insert(position, ChunkState::new(position, extent, Some(chunk)));
    }
    volume.shown = empty_grid(terrain);
    volume.shown_isovalue = terrain.isovalue;
}

/// Asks for new samples of all chunks. What is drawn stays until each chunk's new mesh is there.
fn refill(entity: Entity, terrain: &Terrain, volume: &mut TerrainVolume, queue: &WorkQueue, results: &FillResults) {
    let extent = extent_of(terrain);
    volume.forget_work();
    volume.grid = empty_grid(terrain);
    volume.bits.clear();
    volume.filling = new_number();
    volume.unfilled = volume.chunks.len();
    for (&position, state) in &mut volume.chunks {
        let ticket = fill_chunk(entity, terrain, volume.filling, position, queue, results);
        let new = ChunkState::new(position, extent, state.entity);
        *state = ChunkState { fill: Some(ticket), drawn: state.drawn, empty: state.empty, ..new };
    }
}

/// A despawned chunk is meshed no more. Its samples stay: its neighbours' meshes need them.
pub(crate) fn forget_despawned_chunk(
    removed: On<Remove, Chunk>,
    chunks: Query<&Chunk>,
    mut volumes: Query<&mut TerrainVolume>,
) {
    let Ok(chunk) = chunks.get(removed.entity) else { return };
    let Ok(mut volume) = volumes.get_mut(chunk.terrain) else { return };
    if let Some(state) = volume.chunks.get_mut(&chunk.position.to_array()).filter(|s| s.entity == Some(removed.entity))
    {
        state.entity = None;
    }
}

/// Without its `Terrain` an entity is no terrain: its chunks and samples go.
pub(crate) fn forget_removed_terrain(
    removed: On<Remove, Terrain>,
    mut volumes: Query<&mut TerrainVolume>,
    mut commands: Commands,
) {
    let Ok(mut volume) = volumes.get_mut(removed.entity) else { return };
    let former = core::mem::take(&mut *volume);
    for chunk in former.chunks.into_values().filter_map(|state| state.entity) {
        commands.entity(chunk).try_despawn();
    }
}

/// Whether both are the same before any edit.
fn same_samples(a: &Terrain, b: &Terrain) -> bool {
    a.source == b.source && a.extent == b.extent && a.chunk_cells == b.chunk_cells && a.voxel_size == b.voxel_size
}

/// Whether the same samples look the same.
fn same_meshes(a: &Terrain, b: &Terrain) -> bool {
    a.isovalue == b.isovalue && a.normals == b.normals && a.palette == b.palette
}

fn extent_of(terrain: &Terrain) -> Region {
    terrain.kept_region()
}

fn empty_grid(terrain: &Terrain) -> Grid<i16> {
    Grid::bounded(terrain.chunk_cells, terrain.chunk_region()).expect("the settings have been checked")
}
