//! [`TerrainStats`]: what the plugin has done, in all. Each figure is counted in one place.

use core::time::Duration;

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use bevy_reflect::prelude::*;

use crate::budget::FrameBudget;

/// What the plugin has done for all terrains since the start.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct TerrainStats {
    /// Updates, paused ones included.
    pub updates: u64,
    /// Chunks that came into range, their surroundings included.
    pub loaded: u64,
    /// Chunks that went out of range.
    pub unloaded: u64,
    /// Chunks that the source's bound settled, so that they needed no job.
    pub bounded: u64,
    /// Chunks that took sampling.
    pub filled: u64,
    /// Those of them that proved empty: all of their own samples lie on one side of the surface.
    pub filled_empty: u64,
    /// Chunks that were meshed, again after edits included; not those that are known to have no surface.
    pub meshed: u64,
    /// How long jobs have sampled and bounded, in all.
    pub fill_time: Duration,
    /// How long chunks were meshed, in all.
    pub mesh_time: Duration,
    /// Edits that have been shown; those that were shown together count once.
    pub edits_shown: u64,
    /// How many updates after the one that read its stamp the latest edit was shown; 0 is the same one.
    pub edit_updates_last: u64,
    /// How long after its stamp was read the latest edit was shown.
    pub edit_time_last: Duration,
    /// How long the plugin's systems have taken, in all; waiting for edits' meshes included.
    pub main_thread: Duration,
    /// How long they took in the latest update.
    pub main_thread_last: Duration,
}

impl TerrainStats {
    /// This moment.
    pub(crate) fn now(&self) -> RequestTime {
        RequestTime { update: self.updates, time: Instant::now() }
    }

    /// Notes that a chunk has been meshed.
    pub(crate) fn count_mesh(&mut self, time: Duration) {
        self.meshed += 1;
        self.mesh_time += time;
    }

    /// Notes that an edit asked for at `since` is visible.
    pub(crate) fn count_edit_shown(&mut self, since: RequestTime) {
        self.edits_shown += 1;
        self.edit_updates_last = self.updates - since.update;
        self.edit_time_last = since.time.elapsed();
    }
}

/// When something was asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RequestTime {
    update: u64,
    time: Instant,
}

impl RequestTime {
    pub(crate) fn earlier(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(if b.time < a.time { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

pub(crate) fn count_update(mut stats: ResMut<TerrainStats>) {
    stats.updates += 1;
}

/// Adds up what the update's systems have taken.
pub(crate) fn count_main_thread(budget: Res<FrameBudget>, mut stats: ResMut<TerrainStats>) {
    stats.main_thread += budget.spent();
    stats.main_thread_last = budget.spent();
}
