//! [`PerSecond`]: what loading did in the latest second.

use core::time::Duration;

use bevy::prelude::*;
use bevy_marchless::stats::TerrainStats;

/// What happened in the latest whole second.
#[derive(Resource, Default)]
pub(crate) struct PerSecond {
    /// Chunks that came into range.
    pub(crate) loaded: u64,
    /// Chunks that went out of range.
    pub(crate) unloaded: u64,
    /// Chunks that were meshed.
    pub(crate) meshed: u64,
    /// The longest that the plugin's systems took in an update.
    pub(crate) slowest: Duration,
    /// Of the second that goes on: its slowest update, when it began, and what had been done by then.
    slowest_so_far: Duration,
    since: Duration,
    before: TerrainStats,
}

pub(crate) fn plugin(app: &mut App) {
    app.init_resource::<PerSecond>().add_systems(Update, count);
}

fn count(time: Res<Time<Real>>, stats: Res<TerrainStats>, mut figures: ResMut<PerSecond>) {
    figures.slowest_so_far = figures.slowest_so_far.max(stats.main_thread_last);
    if time.elapsed() < figures.since + Duration::from_secs(1) {
        return;
    }
    let before = figures.before;
    *figures = PerSecond {
        loaded: stats.loaded - before.loaded,
        unloaded: stats.unloaded - before.unloaded,
        meshed: stats.meshed - before.meshed,
        slowest: figures.slowest_so_far,
        slowest_so_far: Duration::ZERO,
        since: time.elapsed(),
        before: *stats,
    };
}
