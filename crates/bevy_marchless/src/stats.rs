//! [`Stats`]: what an update did, for the diagnostics.

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use core::time::Duration;

/// The work of one update; the diagnostics read it and start it over.
#[derive(Resource, Debug, Default)]
pub(crate) struct Stats {
    /// Counts updates, paused ones included.
    pub(crate) update: u64,
    /// How many chunks were meshed, and how long that took in all.
    pub(crate) meshed: u32,
    pub(crate) mesh_time: Duration,
    /// How long the latest edit that became visible was on its way.
    pub(crate) edit_to_visible: Option<(u64, Duration)>,
}

impl Stats {
    /// This moment.
    pub(crate) fn now(&self) -> Since {
        Since { update: self.update, time: Instant::now() }
    }

    /// Notes that a chunk has been meshed.
    pub(crate) fn count_mesh(&mut self, time: Duration) {
        self.meshed += 1;
        self.mesh_time += time;
    }

    /// Notes that an edit asked for at `since` is visible.
    pub(crate) fn edit_is_visible(&mut self, since: Since) {
        self.edit_to_visible = Some((self.update - since.update, since.time.elapsed()));
    }
}

/// When something was asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Since {
    pub(crate) update: u64,
    pub(crate) time: Instant,
}

impl Since {
    pub(crate) fn earlier(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(if b.time < a.time { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

/// How long the plugin's systems have taken in this update.
#[derive(Resource, Debug, Default)]
pub(crate) struct MainThread(Duration);

impl MainThread {
    /// A system begins.
    pub(crate) fn start(&self) -> Instant {
        Instant::now()
    }

    /// It ends.
    pub(crate) fn stop(&mut self, start: Instant) {
        self.0 += start.elapsed();
    }

    /// Until when a system that has begun at `start` may go on, if all of the update's systems so far are to take this
    /// long.
    pub(crate) fn until(&self, start: Instant, all: Duration) -> Instant {
        start + all.saturating_sub(self.0)
    }

    /// The update's time; from now on, the next update's.
    pub(crate) fn take(&mut self) -> Duration {
        core::mem::take(&mut self.0)
    }
}

pub(crate) fn count_update(mut stats: ResMut<Stats>) {
    stats.update += 1;
}
