//! Many viewers, and many terrains.

use std::f32::consts::TAU;

use bevy_ecs::prelude::Entity;
use bevy_marchless::prelude::*;
use bevy_math::{Quat, UVec3, Vec3};
use bevy_transform::components::Transform;
use marchless_plugin_benches::{Game, PACE, World};

use crate::situation::{Bench, Row, above, updates_until};

const VIEWERS: u32 = 32;

/// The distance between viewers, so large that no two views share a chunk.
const APART: f32 = 4_000.0;

/// The place of a viewer, moved by `shift` voxels.
fn place(viewer: u32, shift: f32) -> Transform {
    above((viewer % 8) as f32 * APART + shift, (viewer / 8) as f32 * APART)
}

/// 32 viewers in one world: they arrive, rest, one leaves, one looks round.
pub(crate) fn coming_and_going(bench: &Bench) -> Vec<Row> {
    let (mut game, viewers) = crowd(bench);
    let (times, settled) = game.settle(bench.count(20 * PACE));
    let arrive = Row::new("32 viewers arrive", times).with_updates_until("full", settled);
    bench.settle(&mut game);
    let rest = row("32 viewers rest", bench, &mut game, 300, |_, _| {});
    let leaving = spawn(&mut game, VIEWERS);
    bench.settle(&mut game);
    game.app.world_mut().entity_mut(leaving).despawn();
    let leave = row("32 viewers, a 33rd leaves", bench, &mut game, 60, |_, _| {});

    // All but the first see something new, which takes their jobs longer than what is measured.
    let leaving = spawn(&mut game, VIEWERS);
    move_all(&mut game, &viewers[1..], 2_000.0);
    game.updates(bench.count(120), |_, _| {});
    let look = row("32 viewers, one looks round while jobs wait", bench, &mut game, 300, |game, update| {
        let turn = Quat::from_rotation_y(update as f32 * TAU / 120.0);
        game.place(viewers[0].1, place(0, 0.0).with_rotation(turn));
    });
    game.app.world_mut().entity_mut(leaving).despawn();
    let leave_early = row("32 viewers, a 33rd leaves while jobs wait", bench, &mut game, 60, |_, _| {});
    vec![arrive, rest, leave, look, leave_early]
}

/// 32 viewers in one world: they step to and fro, then they walk.
pub(crate) fn walking(bench: &Bench) -> Vec<Row> {
    let (mut game, viewers) = crowd(bench);
    game.settle(bench.count(120 * PACE));
    let step = row("32 viewers, all step 4 voxels to and fro", bench, &mut game, 300, |game, update| {
        move_all(game, &viewers, if update % 2 == 0 { 4.0 } else { 0.0 });
    });
    let walk = row("32 viewers, all walk 4 voxels an update", bench, &mut game, 300, |game, update| {
        move_all(game, &viewers, 4.0 * (update + 1) as f32);
    });
    vec![step, walk]
}

/// A world with 32 viewers that appear in its first update.
fn crowd(bench: &Bench) -> (Game, Vec<(u32, Entity)>) {
    let mut game = bench.game(World::Hills.terrain());
    let viewers = (0..VIEWERS).map(|number| (number, spawn(&mut game, number))).collect();
    (game, viewers)
}

/// Adds the viewer with a number at its start.
fn spawn(game: &mut Game, number: u32) -> Entity {
    game.spawn_viewer(TerrainViewer::new(256.0), place(number, 0.0))
}

/// Runs updates, each after a change. The row also shows how many chunks are pending in the end.
fn row(name: &str, bench: &Bench, game: &mut Game, updates: u32, change: impl FnMut(&mut Game, u32)) -> Row {
    let times = game.updates(bench.count(updates), change);
    let waiting = game.volume().coverage().waiting;
    Row::new(name, times).with_figure(format!("{waiting} chunks waited in the end"))
}

/// Moves viewers to `shift` voxels from their starts.
fn move_all(game: &mut Game, viewers: &[(u32, Entity)], shift: f32) {
    for (number, viewer) in viewers {
        game.place(*viewer, place(*number, shift));
    }
}

/// 400 small terrains with an extent, in a square, and 32 viewers among them; nothing changes.
pub(crate) fn idle_terrains(bench: &Bench) -> Vec<Row> {
    let terrain = || {
        let ground = |[_, y, _]: [f64; 3]| y - 4.3;
        Terrain::new(ground).with_extent(UVec3::ONE).with_chunk_cells(8)
    };
    let mut game = bench.game(terrain());
    for number in 1..400 {
        let corner = Vec3::new((number % 20) as f32, 0.0, (number / 20) as f32) * 16.0;
        game.app.world_mut().spawn((terrain(), Transform::from_translation(corner)));
    }
    for viewer in 0..VIEWERS {
        game.spawn_viewer(TerrainViewer::new(64.0), above((viewer % 8) as f32 * 40.0, (viewer / 8) as f32 * 80.0));
    }
    let (_, settled) = updates_until(&mut game, bench.count(20 * PACE), |_| {}, all_settled);
    let times = game.updates(bench.count(300), |_, _| {});
    let figure = if settled { "all settled" } else { "not all settled" };
    vec![Row::new("400 idle terrains, 32 idle viewers", times).with_figure(figure)]
}

/// True if all terrains have settled.
fn all_settled(game: &mut Game) -> bool {
    let mut volumes = game.app.world_mut().query::<&TerrainVolume>();
    volumes.iter(game.app.world()).all(TerrainVolume::is_settled)
}
