//! Views that fill.

use bevy_marchless::prelude::*;
use bevy_math::{DVec3, Vec3};
use marchless_benches::split_mix;
use marchless_plugin_benches::{Game, PACE, World};

use crate::situation::{Bench, Row, above, updates_until};

/// The number of updates until an endless view is full, without edits and with a dig in every update.
pub(crate) fn filling(bench: &Bench) -> Vec<Row> {
    World::ALL.into_iter().flat_map(|world| fill(bench, world)).collect()
}

fn fill(bench: &Bench, world: World) -> [Row; 2] {
    let viewer = TerrainViewer::new(256.0);
    let most = bench.count(20 * PACE);

    let mut game = bench.game(world.terrain());
    game.spawn_viewer(viewer, above(0.0, 0.0));
    let (times, full) = updates_until(&mut game, most, |_| {}, is_full);
    let alone = Row::new(format!("a view of {} fills", world.name()), times).with_updates_until("full", full);
    let ground: Vec<DVec3> = (0..u64::from(most)).filter_map(|number| game.ground_below(nearby(number))).collect();

    let mut game = bench.game(world.terrain());
    game.spawn_viewer(viewer, above(0.0, 0.0));
    let mut ground = ground.into_iter().cycle();
    let dig_next = |game: &mut Game| {
        if let Some(ground) = ground.next() {
            game.dig(ground, 5.0);
        }
    };
    let (times, full) = updates_until(&mut game, most, dig_next, is_full);
    let name = format!("a view of {} fills, with a dig in every update", world.name());
    [alone, Row::new(name, times).with_updates_until("full", full)]
}

fn is_full(game: &mut Game) -> bool {
    let coverage = game.volume().coverage();
    coverage.waiting == 0 && coverage.drawn > 0
}

/// A place above the ground, within 64 voxels of the viewer on both axes.
fn nearby(number: u64) -> Vec3 {
    let random = |axis| (split_mix(2 * number + axis) >> 40) as f32 / (1 << 23) as f32 - 1.0;
    Vec3::new(64.0 * random(0), 100.0, 64.0 * random(1))
}

/// A viewer that jumps in every update between two places whose views share no chunk, and then stays.
pub(crate) fn jumping(bench: &Bench) -> Vec<Row> {
    let mut game = bench.game(World::Hills.terrain());
    let viewer = game.spawn_viewer(TerrainViewer::new(256.0), above(0.0, 0.0));
    let times = game.updates(bench.count(600), |game, update| {
        game.place(viewer, above(if update % 2 == 0 { 10_000.0 } else { 0.0 }, 0.0));
    });
    let jumps = Row::new("a viewer jumps to and fro", times);
    let (times, settled) = game.settle(bench.count(20 * PACE));
    vec![jumps, Row::new("a viewer stays after its jumps", times).with_updates_until("full", settled)]
}
