//! [`TerrainStats`]: totals of the plugin's work. Each figure is counted in one place.

use core::time::Duration;

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use bevy_reflect::prelude::*;

use crate::budget::FrameBudget;

/// Totals of the plugin's work for all terrains since the start.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct TerrainStats {
    /// Number of updates, including paused ones.
    pub updates: u64,
    /// Chunks loaded, including those that only serve as surroundings of others.
    pub loaded: u64,
    /// Chunks unloaded.
    pub unloaded: u64,
    /// Chunks whose samples followed from the source's bound, without a job.
    pub bounded: u64,
    /// Chunks sampled by jobs.
    pub filled: u64,
    /// Sampled chunks that proved empty: all of their own samples lie on one side of the surface.
    pub filled_empty: u64,
    /// Chunks meshed, including repeats after edits. Chunks known to have no surface do not count.
    pub meshed: u64,
    /// Total time that jobs spent on sampling and bounds.
    pub fill_time: Duration,
    /// Total time spent on meshing chunks.
    pub mesh_time: Duration,
    /// Edits shown; edits shown together count once.
    pub edits_shown: u64,
    /// Number of updates from reading the latest shown edit's stamp to showing it; 0 means the same update.
    pub edit_updates_last: u64,
    /// Time from reading the latest shown edit's stamp to showing it.
    pub edit_time_last: Duration,
    /// Total time of the plugin's systems, including waits for edits' meshes.
    pub main_thread: Duration,
    /// Time of the plugin's systems in the latest update.
    pub main_thread_last: Duration,
}

impl TerrainStats {
    /// The current update and time.
    pub(crate) fn now(&self) -> RequestTime {
        RequestTime { update: self.updates, time: Instant::now() }
    }

    /// Counts a meshed chunk and its time.
    pub(crate) fn count_mesh(&mut self, time: Duration) {
        self.meshed += 1;
        self.mesh_time += time;
    }

    /// Counts a shown edit whose stamp was read at `since`.
    pub(crate) fn count_edit_shown(&mut self, since: RequestTime) {
        self.edits_shown += 1;
        self.edit_updates_last = self.updates - since.update;
        self.edit_time_last = since.time.elapsed();
    }
}

/// The update and time of a request.
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

/// Adds the time of the update's systems to the statistics.
pub(crate) fn count_main_thread(budget: Res<FrameBudget>, mut stats: ResMut<TerrainStats>) {
    stats.main_thread += budget.spent();
    stats.main_thread_last = budget.spent();
}
