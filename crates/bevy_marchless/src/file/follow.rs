//! Lets terrains follow the worlds that they are to be.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use bevy_asset::{AssetEvent, AssetId, AssetLoadError, AssetServer, Assets, LoadState};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;

use super::{DescriptionError, TerrainDescription, TerrainFile};
use crate::terrain::{Terrain, TerrainVolume};

/// What is known of a terrain's world.
#[derive(Component, Default)]
pub(super) struct FollowedFile {
    /// The world that the terrain was made last.
    world: Option<TerrainDescription>,
    /// Whether the terrain is to be another one, whose file has not been read yet.
    is_loading: bool,
}

/// Gives terrains, disabled ones too, what has changed in their worlds. Stamps on a terrain wait while its file is being read.
pub(super) fn follow_worlds(
    mut terrains: Query<
        (Entity, Ref<TerrainFile>, &mut Terrain, &mut TerrainVolume, &mut FollowedFile),
        Allow<Disabled>,
    >,
    worlds: Res<Assets<TerrainDescription>>,
    server: Res<AssetServer>,
    mut events: MessageReader<AssetEvent<TerrainDescription>>,
) {
    let changed: HashSet<_> = events
        .read()
        .filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    for (entity, handle, mut terrain, mut volume, mut followed) in &mut terrains {
        let may_be_another = handle.is_changed() || followed.is_loading;
        if !may_be_another && !changed.contains(&handle.0.id()) {
            continue;
        }
        let world = worlds.get(&handle.0);
        followed.is_loading = world.is_none() && matches!(server.load_state(&handle.0), LoadState::Loading);
        volume.set_loading(followed.is_loading);
        let Some(world) = world.filter(|world| followed.world.as_ref() != Some(*world)) else { continue };
        // Only what is applied counts as a change of the terrain.
        let mut next = terrain.clone();
        match world.apply(followed.world.as_ref(), &mut next) {
            Ok(()) => {
                *terrain = next;
                followed.world = Some(world.clone());
            }
            Err(error) => bevy_log::warn!("terrain {entity}: its world is not applied, and it stays as it is: {error}"),
        }
    }
}

/// Without its world a terrain waits for nothing.
pub(super) fn forget_removed_world(
    removed: On<Remove, TerrainFile>,
    mut terrains: Query<(&mut TerrainVolume, &mut FollowedFile), Allow<Disabled>>,
) {
    if let Ok((mut volume, mut followed)) = terrains.get_mut(removed.entity) {
        volume.set_loading(false);
        *followed = FollowedFile::default();
    }
}

/// Tells once of each world file that could not be loaded.
pub(super) fn report_failures(
    terrains: Query<&TerrainFile>,
    server: Res<AssetServer>,
    mut reported: Local<HashMap<AssetId<TerrainDescription>, (Arc<AssetLoadError>, String)>>,
) {
    let used: HashSet<_> = terrains.iter().map(|world| world.0.id()).collect();
    reported.retain(|id, _| used.contains(id));
    for id in used {
        match server.load_state(id) {
            LoadState::Failed(error) => {
                let before = reported.get(&id);
                if before.is_some_and(|(before, _)| Arc::ptr_eq(before, &error)) {
                    continue;
                }
                // A reload may try twice, and fail twice in the same way.
                let text = describe(&error);
                if before.is_none_or(|(_, before)| *before != text) {
                    bevy_log::warn!("terrains stay as they are, since their {text}");
                }
                reported.insert(id, (error, text));
            }
            LoadState::Loaded => {
                reported.remove(&id);
            }
            LoadState::NotLoaded | LoadState::Loading => {}
        }
    }
}

/// The file and what is wrong with it, in one line, without a backtrace.
fn describe(error: &AssetLoadError) -> String {
    if let AssetLoadError::AssetLoaderError(loading) = error
        && let Some(error) = loading.error().downcast_ref::<DescriptionError>()
    {
        return format!("world '{}' cannot be loaded: {error}", loading.path());
    }
    let text = error.to_string();
    format!("world cannot be loaded: {}", text.lines().next().unwrap_or(""))
}
