//! Gives new terrains a volume and applies changes of settings.

use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;
use bevy_platform::time::Instant;
use bevy_transform::components::Transform;
use std::sync::Arc;

use super::{Terrain, TerrainError, TerrainSources, TerrainVolume};
use crate::budget::FrameBudget;
use crate::chunk::{Chunk, chunk_transform};
use crate::schedule::MakesMeshes;
use crate::volume::Heart;

/// Checks new and changed terrains and applies their settings.
///
/// Compares the change tick with that of the settings last checked, so that changes made while a terrain was disabled
/// are not missed.
pub(crate) fn prepare_terrains(
    mut terrains: Query<(Entity, Ref<Terrain>, &mut TerrainVolume, Has<TerrainError>)>,
    mut transforms: Query<&mut Transform, With<Chunk>>,
    meshes: Option<Res<MakesMeshes>>,
    sources: Res<TerrainSources>,
    mut commands: Commands,
    mut budget: ResMut<FrameBudget>,
) {
    let start = Instant::now();
    for (entity, terrain, mut volume, was_refused) in &mut terrains {
        if volume.is_loading() && volume.settings().is_none() {
            continue; // Nobody wants to see the default settings first.
        }
        let may_be_another = volume.has_other_sources(sources.last_changed()) && terrain.source.name().is_some();
        if may_be_another || volume.is_new(terrain.last_changed()) {
            let volume = &mut *volume;
            match terrain.check().and_then(|()| terrain.resolved(&sources)) {
                Ok(resolved) => {
                    if was_refused {
                        commands.entity(entity).try_remove::<TerrainError>();
                    }
                    volume.accept(&resolved, terrain.last_changed());
                    follow_settings(volume);
                }
                Err(error) => {
                    bevy_log::error!("terrain {entity}: {error}; its settings are not applied");
                    commands.entity(entity).try_insert(error);
                    volume.refuse(terrain.last_changed());
                }
            }
        }
        if volume.has_next()
            && let Some((terrain, before)) = volume.take_next()
        {
            match before {
                Some(before) if before.chunk_cells == terrain.chunk_cells && !volume.heart().has_levels() => {
                    if before.voxel_size != terrain.voxel_size {
                        place_chunks(&terrain, volume.heart(), &mut transforms);
                    }
                    volume.heart_mut().refill(terrain.sampling_settings(), terrain.mesh_method());
                    follow_settings(&mut volume);
                }
                _ => {
                    start_over(&terrain, &mut volume, meshes.is_some(), &mut commands);
                    volume.heart_mut().set_levels(terrain.levels.detail());
                }
            }
        }
    }
    budget.spend(start);
}

/// Applies all settings that do not change the samples.
fn follow_settings(volume: &mut TerrainVolume) {
    let Some(settings) = volume.settings() else { return };
    let (method, normals, colors) = (settings.mesh_method(), settings.normals, settings.palette.to_vertex_colors());
    let (extent, levels) = (settings.chunk_region(), settings.levels.detail());
    let heart = volume.heart_mut();
    if heart.extent() != Some(extent) {
        heart.resize(extent);
    }
    heart.set_levels(levels);
    if heart.mesh_settings().normals() != normals || **heart.colors() != colors {
        heart.set_appearance(normals, Arc::new(colors));
    }
    heart.set_mesh_method(method);
}

/// Replaces the whole heart and despawns all chunks; chunks in the load regions are loaded anew.
fn start_over(terrain: &Terrain, volume: &mut TerrainVolume, meshing: bool, commands: &mut Commands) {
    let colors = Arc::new(terrain.palette.to_vertex_colors());
    let former = volume.start_over(Heart::new(
        terrain.sampling_settings(),
        terrain.mesh_method(),
        terrain.normals,
        colors,
        meshing,
    ));
    despawn_chunks(former, commands);
}

/// Moves a terrain's drawn chunks after its voxel size changed.
fn place_chunks(terrain: &Terrain, heart: &Heart, transforms: &mut Query<&mut Transform, With<Chunk>>) {
    for (key, entity) in heart.table().entities() {
        if let Ok(mut transform) = transforms.get_mut(entity) {
            *transform = chunk_transform(key, terrain.chunk_cells, terrain.voxel_size);
        }
    }
}

/// Chunk entities that the plugin did not create: copies made by cloning a terrain, chunks read from a scene, and those
/// that a game spawned.
#[derive(Resource, Default)]
pub(crate) struct CopiedChunks(Vec<Entity>);

/// Notes a chunk that its terrain does not know, to despawn it. It is not despawned at once, since the caller may be
/// about to add more components to it.
pub(crate) fn note_copied_chunk(
    added: On<Add, Chunk>,
    chunks: Query<&Chunk, Allow<Disabled>>,
    volumes: Query<&TerrainVolume, Allow<Disabled>>,
    mut copied: ResMut<CopiedChunks>,
) {
    let Ok(chunk) = chunks.get(added.entity) else { return };
    let drawn = volumes.get(chunk.terrain).ok().and_then(|volume| volume.heart().entity(chunk.key()));
    if drawn != Some(added.entity) {
        copied.0.push(added.entity);
    }
}

/// Despawns the noted entities that are still chunks.
pub(crate) fn despawn_copied_chunks(
    mut copied: ResMut<CopiedChunks>,
    chunks: Query<(), (With<Chunk>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    for chunk in copied.bypass_change_detection().0.drain(..).filter(|chunk| chunks.contains(*chunk)) {
        commands.entity(chunk).try_despawn();
    }
}

/// Removes a despawned chunk from the terrain's shown chunks. Its samples stay, because its neighbours' meshes need
/// them.
pub(crate) fn forget_despawned_chunk(
    removed: On<Remove, Chunk>,
    chunks: Query<&Chunk, Allow<Disabled>>,
    mut volumes: Query<&mut TerrainVolume, Allow<Disabled>>,
) {
    let Ok(chunk) = chunks.get(removed.entity) else { return };
    let Ok(mut volume) = volumes.get_mut(chunk.terrain) else { return };
    volume.heart_mut().despawned(chunk.key(), removed.entity);
}

/// Drops the chunks and samples of an entity whose `Terrain` was removed.
pub(crate) fn forget_removed_terrain(
    removed: On<Remove, Terrain>,
    mut volumes: Query<&mut TerrainVolume, Allow<Disabled>>,
    mut commands: Commands,
) {
    let Ok(mut volume) = volumes.get_mut(removed.entity) else { return };
    let mut former = core::mem::take(&mut *volume);
    despawn_chunks(core::mem::take(former.heart_mut()), &mut commands);
}

fn despawn_chunks(mut former: Heart, commands: &mut Commands) {
    let shown: Vec<Entity> = former.table().entities().map(|(_, entity)| entity).collect();
    for entity in shown.into_iter().chain(former.take_released()) {
        commands.entity(entity).try_despawn();
    }
}
