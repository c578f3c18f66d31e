//! Systems that let terrains follow their files.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use bevy_asset::{AssetEvent, AssetId, AssetLoadError, AssetServer, Assets, LoadState};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;

use super::{DescriptionError, TerrainDescription, TerrainFile};
use crate::terrain::{Terrain, TerrainVolume};

/// The state of a terrain that follows a file.
#[derive(Component, Default)]
pub(super) struct FollowedFile {
    /// The description that was applied last.
    description: Option<TerrainDescription>,
    /// Whether the terrain waits for a file that has not been read yet.
    is_loading: bool,
}

/// Applies changes of descriptions to their terrains, disabled ones included. Stamps on a terrain wait while its file
/// is being read.
pub(super) fn follow_files(
    mut terrains: Query<
        (Entity, Ref<TerrainFile>, &mut Terrain, &mut TerrainVolume, &mut FollowedFile),
        Allow<Disabled>,
    >,
    descriptions: Res<Assets<TerrainDescription>>,
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
        let description = descriptions.get(&handle.0);
        followed.is_loading = description.is_none() && matches!(server.load_state(&handle.0), LoadState::Loading);
        volume.set_loading(followed.is_loading);
        let is_new = |description: &&TerrainDescription| followed.description.as_ref() != Some(*description);
        let Some(description) = description.filter(is_new) else { continue };
        // A clone, so that the terrain counts as changed only if the description could be applied.
        let mut next = terrain.clone();
        match description.apply(followed.description.as_ref(), &mut next) {
            Ok(()) => {
                *terrain = next;
                followed.description = Some(description.clone());
            }
            Err(error) => bevy_log::warn!("terrain {entity}: its file is not applied, and it stays as it is: {error}"),
        }
    }
}

/// Lets a terrain that loses its [`TerrainFile`] stop waiting, and forgets its description.
pub(super) fn forget_removed_file(
    removed: On<Remove, TerrainFile>,
    mut terrains: Query<(&mut TerrainVolume, &mut FollowedFile), Allow<Disabled>>,
) {
    if let Ok((mut volume, mut followed)) = terrains.get_mut(removed.entity) {
        volume.set_loading(false);
        *followed = FollowedFile::default();
    }
}

/// Logs each file that could not be loaded, once.
pub(super) fn report_failures(
    terrains: Query<&TerrainFile>,
    server: Res<AssetServer>,
    mut reported: Local<HashMap<AssetId<TerrainDescription>, (Arc<AssetLoadError>, String)>>,
) {
    let used: HashSet<_> = terrains.iter().map(|file| file.0.id()).collect();
    reported.retain(|id, _| used.contains(id));
    for id in used {
        match server.load_state(id) {
            LoadState::Failed(error) => {
                let before = reported.get(&id);
                if before.is_some_and(|(before, _)| Arc::ptr_eq(before, &error)) {
                    continue;
                }
                // A reload may load twice, and fail twice in the same way.
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

/// The file and its error, in one line, without a backtrace.
fn describe(error: &AssetLoadError) -> String {
    if let AssetLoadError::AssetLoaderError(loading) = error
        && let Some(error) = loading.error().downcast_ref::<DescriptionError>()
    {
        return format!("terrain file '{}' cannot be loaded: {error}", loading.path());
    }
    let text = error.to_string();
    format!("terrain file cannot be loaded: {}", text.lines().next().unwrap_or(""))
}
