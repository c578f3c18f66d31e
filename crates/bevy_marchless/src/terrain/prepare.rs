//! Gives new terrains a volume and chunks, and follows changes of their settings.

use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_transform::components::Transform;

use super::{Fill, Signs, Terrain, TerrainError, TerrainVolume};
use crate::chunk::{Chunk, ChunkKey, chunk_transform};
use crate::stats::MainThread;
use crate::work::new_number;

/// Checks terrains that are new or whose settings changed, and does what the change asks for.
pub(crate) fn prepare_terrains(
    mut terrains: Query<(Entity, &Terrain, &mut TerrainVolume, Has<TerrainError>), Changed<Terrain>>,
    mut transforms: Query<&mut Transform, With<Chunk>>,
    mut commands: Commands,
    mut main_thread: ResMut<MainThread>,
) {
    let start = main_thread.start();
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
        match &before {
            Some(old) if same_samples(old, terrain) => {
                if old.isovalue != terrain.isovalue {
                    volume.chunks.values_mut().for_each(|state| state.signs = Signs::UNKNOWN);
                }
                if !same_meshes(old, terrain) {
                    let all = volume.chunks.keys().map(|key| key.position).collect();
                    volume.add_changed(all, None);
                }
            }
            Some(old) if same_chunks(old, terrain) => {
                for (key, state) in &volume.chunks {
                    if let Some(mut transform) = state.entity.and_then(|entity| transforms.get_mut(entity).ok()) {
                        *transform = chunk_transform(key.position, terrain.chunk_cells, terrain.voxel_size);
                    }
                }
                refill(terrain, &mut volume);
            }
            _ => start_over(terrain, &mut volume, &mut commands),
        }
    }
    main_thread.stop(start);
}

/// Forgets all chunks; those in range come back by themselves.
fn start_over(terrain: &Terrain, volume: &mut TerrainVolume, commands: &mut Commands) {
    let former = core::mem::take(volume);
    despawn_chunks(&former, commands);
    volume.settings = former.settings;
    volume.colors = former.colors;
    volume.grid = terrain.empty_grid();
    volume.shown = terrain.empty_grid();
    volume.shown_isovalue = terrain.isovalue;
    volume.filling = new_number();
}

/// Asks for new samples of all chunks. What is drawn stays until each chunk's new mesh is there.
fn refill(terrain: &Terrain, volume: &mut TerrainVolume) {
    let extent = terrain.chunk_region();
    volume.forget_work();
    volume.grid = terrain.empty_grid();
    volume.edited.clear();
    volume.stamps.clear();
    volume.bits.clear();
    volume.filling = new_number();
    volume.unfilled = volume.chunks.len();
    for (key, state) in &mut volume.chunks {
        state.fill = Fill::Unasked;
        state.signs = Signs::UNKNOWN;
        state.missing = key.around().filter(|near| extent.contains(near.position)).count() as u8;
        state.stale = state.drawn && !state.hidden;
    }
    let all: Vec<ChunkKey> = volume.chunks.keys().copied().collect();
    volume.streaming.refill(all.into_iter());
}

/// A despawned chunk is drawn no more. Its samples stay: its neighbours' meshes need them.
pub(crate) fn forget_despawned_chunk(
    removed: On<Remove, Chunk>,
    chunks: Query<&Chunk>,
    mut volumes: Query<&mut TerrainVolume>,
) {
    let Ok(chunk) = chunks.get(removed.entity) else { return };
    let Ok(mut volume) = volumes.get_mut(chunk.terrain) else { return };
    let key = ChunkKey { level: chunk.level, position: chunk.position.to_array() };
    if let Some(state) = volume.chunks.get_mut(&key).filter(|state| state.entity == Some(removed.entity)) {
        (state.entity, state.hidden) = (None, true);
        (state.drawn, state.empty, state.stale) = (true, true, false);
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
    despawn_chunks(&former, &mut commands);
}

fn despawn_chunks(volume: &TerrainVolume, commands: &mut Commands) {
    for chunk in volume.chunks.values().filter_map(|state| state.entity) {
        commands.entity(chunk).try_despawn();
    }
}

/// Whether chunks have the same places.
fn same_chunks(a: &Terrain, b: &Terrain) -> bool {
    a.extent == b.extent && a.chunk_cells == b.chunk_cells
}

/// Whether both are the same before any edit.
fn same_samples(a: &Terrain, b: &Terrain) -> bool {
    a.source == b.source && same_chunks(a, b) && a.voxel_size == b.voxel_size
}

/// Whether the same samples look the same.
fn same_meshes(a: &Terrain, b: &Terrain) -> bool {
    a.isovalue == b.isovalue && a.normals == b.normals && a.palette == b.palette
}
