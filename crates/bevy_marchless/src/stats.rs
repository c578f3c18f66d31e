//! [`Stats`]: what an update did, for the diagnostics.

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use core::time::Duration;

use crate::stream::StreamStats;

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
        let left = all.saturating_sub(self.0);
        start.checked_add(left).unwrap_or_else(|| start + Duration::from_secs(3_600))
    }

    /// The update's time so far.
    pub(crate) const fn so_far(&self) -> Duration {
        self.0
    }
}

/// Ends the update's time.
pub(crate) fn sum_up(mut main_thread: ResMut<MainThread>, mut stream: ResMut<StreamStats>) {
    let time = core::mem::take(&mut main_thread.0);
    (stream.main_thread, stream.main_thread_last) = (stream.main_thread + time, time);
}

pub(crate) fn count_update(mut stats: ResMut<Stats>) {
    stats.update += 1;
}
