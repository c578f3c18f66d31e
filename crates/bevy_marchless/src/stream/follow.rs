//! Computes what viewers see of each terrain, and loads and unloads chunks accordingly.

use core::time::Duration;

use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;
use bevy_math::DAffine3;
use bevy_platform::collections::HashSet;
use bevy_platform::time::Instant;
use bevy_transform::components::GlobalTransform;
use bevy_transform::helper::TransformHelper;

use super::TerrainViewer;
use super::view::ViewFinder;
use crate::budget::{FrameBudget, Share};
use crate::cover::{LoadRegion, View};
use crate::placement::{Placement, in_double_precision};
use crate::stats::TerrainStats;
use crate::terrain::{Terrain, TerrainVolume};

/// The number of updates after which a terrain that loads nothing by itself and has had no viewer is reported.
const PATIENCE: u32 = 120;

/// The views of all viewers on one terrain.
#[derive(Component, Default)]
pub(super) struct TerrainViews {
    /// The latest valid view of each viewer, and the settings it was made from.
    views: EntityHashMap<(TerrainViewer, View)>,
    /// The terrain's state from which the views were made.
    at: Option<TerrainState>,
    /// Whether the terrain had several levels of detail then.
    has_levels: bool,
    /// The latest run of the system that visited the terrain.
    run: u64,
    /// The number of updates without a viewer; stays at [`PATIENCE`] once reached or once there was a viewer.
    waited: u32,
}

impl TerrainViews {
    /// Counts updates without a viewer. Returns true once: when a terrain that loads nothing by itself has waited
    /// [`PATIENCE`] updates.
    fn has_waited_too_long(&mut self, there_are_viewers: bool, settings: &Terrain) -> bool {
        if there_are_viewers {
            self.waited = PATIENCE;
        }
        if self.waited == PATIENCE || !settings.kept_region().is_empty() {
            return false;
        }
        self.waited += 1;
        self.waited == PATIENCE
    }
}

/// A terrain's transform, its generation, and how often its settings have changed.
#[derive(Clone, Copy, PartialEq)]
struct TerrainState {
    to_world: DAffine3,
    generation: u64,
    changes: u64,
}

/// The state of all viewers in the latest update.
#[derive(Default)]
pub(super) struct Viewers {
    /// The number of runs of the system.
    run: u64,
    seen: EntityHashMap<ViewerState>,
    /// The viewers that have changed since the update before; sorted.
    changed: Vec<Entity>,
    gone: Vec<Entity>,
}

#[derive(Clone, Copy, PartialEq)]
struct ViewerState {
    settings: TerrainViewer,
    /// The transform in this update.
    now: Option<GlobalTransform>,
    /// The transform at the last propagation; `None` if none has happened since the viewer was added.
    propagated: Option<GlobalTransform>,
}

impl Viewers {
    fn update(
        &mut self,
        viewers: &Query<(Entity, &TerrainViewer, Ref<GlobalTransform>)>,
        transforms: &TransformHelper,
    ) {
        self.run += 1;
        self.changed.clear();
        self.gone.clear();
        for (viewer, settings, propagated) in viewers {
            let now = transforms.compute_global_transform(viewer).ok();
            let propagated = (!propagated.is_added()).then_some(*propagated);
            let seen = ViewerState { settings: *settings, now, propagated };
            if self.seen.insert(viewer, seen) != Some(seen) {
                self.changed.push(viewer);
            }
        }
        if self.seen.len() > viewers.iter().len() {
            self.gone.extend(self.seen.keys().filter(|viewer| !viewers.contains(**viewer)));
            self.gone.iter().for_each(|viewer| _ = self.seen.remove(viewer));
        }
        self.changed.sort_unstable();
    }
}

/// Updates the views of all terrains, then loads and unloads chunks as far as the time budget allows.
///
/// Viewers and terrains that have not changed since the update before are skipped.
pub(super) fn follow_viewers(
    mut terrains: Query<(Entity, &mut TerrainVolume, &mut TerrainViews, Placement)>,
    viewers: Query<(Entity, &TerrainViewer, Ref<GlobalTransform>)>,
    transforms: TransformHelper,
    mut seen: Local<Viewers>,
    mut stats: ResMut<TerrainStats>,
    mut budget: ResMut<FrameBudget>,
    mut commands: Commands,
    mut reported: Local<HashSet<(Entity, Entity)>>,
) {
    let start = Instant::now();
    seen.update(&viewers, &transforms);
    if !reported.is_empty() {
        reported.retain(|(terrain, about)| {
            terrains.contains(*terrain) && (terrain == about || seen.seen.contains_key(about))
        });
    }
    let until = budget.until(start, Share::Follow);
    let share = until.saturating_duration_since(start);
    let mut seeing = Duration::ZERO;
    for (terrain, mut volume, mut followed, place) in &mut terrains {
        let Some(settings) = volume.settings() else { continue };
        if followed.has_waited_too_long(!seen.seen.is_empty(), settings) {
            bevy_log::warn!(
                "terrain {terrain} keeps no chunks loaded and there is no terrain viewer, so nothing of it appears; \
                 add a `TerrainViewer` to the camera, or set `keep`"
            );
        }
        // Transforms of this update; in a floating space, those of the last propagation.
        let to_world = if place.is_floating() {
            Some(place.to_world())
        } else {
            transforms.compute_global_transform(terrain).ok().map(|transform| in_double_precision(&transform))
        };
        let (generation, changes) = (volume.heart().samples().generation(), volume.changes());
        let at = to_world.map(|to_world| TerrainState { to_world, generation, changes });
        // Viewers may have moved while the terrain was disabled.
        let was_away = core::mem::replace(&mut followed.run, seen.run) + 1 != seen.run;
        let all = was_away || at.is_none() || followed.at != at;
        if all || !seen.changed.is_empty() || !seen.gone.is_empty() {
            let start = Instant::now();
            let is_floating = place.is_floating();
            let mut view_of = ViewOf { terrain, to_world, is_floating, seen: &seen, reported: &mut reported };
            view_of.follow(&mut volume, &mut followed, all);
            followed.at = at;
            seeing += start.elapsed();
        }
        if volume.heart().has_to_follow() {
            let heart = volume.heart_mut();
            // Computing the views of many moving viewers must not use up the time for loading.
            heart.follow(until + seeing.saturating_sub(share / 4), &mut stats);
            for entity in heart.take_released() {
                commands.entity(entity).try_despawn();
            }
        }
    }
    budget.spend(start);
}

/// Updates the views of one terrain.
struct ViewOf<'a> {
    terrain: Entity,
    to_world: Option<DAffine3>,
    is_floating: bool,
    seen: &'a Viewers,
    reported: &'a mut HashSet<(Entity, Entity)>,
}

impl ViewOf<'_> {
    /// Updates the views of changed viewers, or of all viewers if `all`.
    fn follow(&mut self, volume: &mut TerrainVolume, followed: &mut TerrainViews, all: bool) {
        for viewer in self.seen.gone.iter().filter(|viewer| followed.views.remove(*viewer).is_some()) {
            volume.heart_mut().set_view(Some(*viewer), None);
        }
        let mut viewers = self.seen.changed.clone();
        let has_levels = volume.heart().has_levels();
        if core::mem::replace(&mut followed.has_levels, has_levels) != has_levels {
            // Views with levels have other limits.
            followed.views.clear();
        }
        if all {
            viewers = self.seen.seen.keys().copied().collect();
            viewers.sort_unstable();
            self.follow_kept(volume);
            // Viewers that disappeared while the terrain was not visited.
            let gone: Vec<Entity> =
                followed.views.keys().copied().filter(|viewer| !self.seen.seen.contains_key(viewer)).collect();
            for viewer in gone {
                followed.views.remove(&viewer);
                volume.heart_mut().set_view(Some(viewer), None);
            }
        }
        for viewer in viewers {
            let Some(seen) = self.seen.seen.get(&viewer) else { continue };
            let known = followed.views.get(&viewer).copied();
            if let Some(view) = self.view(volume, viewer, seen, known) {
                followed.views.insert(viewer, view);
                volume.heart_mut().set_view(Some(viewer), Some(view.1));
            }
        }
    }

    /// Sets the view of the chunks that the terrain keeps loaded without a viewer.
    fn follow_kept(&self, volume: &mut TerrainVolume) {
        let Some(settings) = volume.settings() else { return };
        let (kept, extent) = (settings.kept_region(), settings.chunk_region());
        let view = (!kept.is_empty()).then(|| View::new(LoadRegion::of_box(kept, extent), 0.0, None, [0.0; 3]));
        volume.heart_mut().set_view(None, view);
    }

    /// The current view of a viewer, or its last valid one if the current one is invalid.
    fn view(
        &mut self,
        volume: &TerrainVolume,
        viewer: Entity,
        seen: &ViewerState,
        known: Option<(TerrainViewer, View)>,
    ) -> Option<(TerrainViewer, View)> {
        let settings = volume.settings()?;
        let to_terrain = self.to_world.map(|to_world| to_world.inverse());
        let mut finder = ViewFinder { terrain: settings, to_terrain, reported: self.reported };
        let place = if self.is_floating { seen.propagated } else { seen.now };
        let view = place.and_then(|place| finder.view(self.terrain, viewer, &seen.settings, &place, known));
        let as_before = || known.map(|(before, view)| (before, view.with_extent(settings.chunk_region())));
        view.map(|view| (seen.settings, view)).or_else(as_before)
    }
}
