//! Edits of chunks that are not loaded.

use bevy_marchless::prelude::*;
use bevy_math::DVec3;
use marchless_benches::split_mix;
use marchless_plugin_benches::{Game, World};

use crate::situation::{Bench, Row, above};

/// A place that no viewer sees, at the height of the ground.
const FAR_AWAY: DVec3 = DVec3::new(20_000.0, 40.0, 0.0);

/// Digs far from the only viewer: one large ball, then many small ones at the same place.
pub(crate) fn far_away(bench: &Bench) -> Vec<Row> {
    let mut game = bench.game(World::Hills.terrain());
    game.spawn_viewer(TerrainViewer::new(256.0), above(0.0, 0.0));
    bench.settle(&mut game);

    game.dig(FAR_AWAY, 1_000.0);
    let mut rows = update_and_after(bench, &mut game, "ball of radius 1,000 where nothing is loaded");
    for number in 0..6_000 {
        game.dig(FAR_AWAY + scattered(number), 4.0);
    }
    rows.extend(update_and_after(bench, &mut game, "6,000 small digs there"));
    rows
}

/// A place within 1,000 voxels on both sides, and 30 up and down.
fn scattered(number: u64) -> DVec3 {
    let random = |axis| (split_mix(3 * number + axis) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
    DVec3::new(random(0), random(1), random(2)) * DVec3::new(1_000.0, 30.0, 1_000.0)
}

/// The update that reads the stamps, and the 100 updates after it.
fn update_and_after(bench: &Bench, game: &mut Game, what: &str) -> Vec<Row> {
    vec![
        Row::new(format!("{what}: its update"), game.updates(1, |_, _| {})),
        Row::new(format!("{what}: the 100 after"), game.updates(bench.count(100), |_, _| {})),
    ]
}
