//! Settings that change how a large terrain is drawn.

use bevy_ecs::system::SystemState;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{Dir3, Ray3d, UVec3, Vec3};
use marchless_plugin_benches::{Game, PACE};

use crate::situation::{Bench, Row, updates_until};

/// High above the middle of the terrain.
const MIDDLE: Vec3 = Vec3::new(520.0, 120.0, 520.0);

/// A terrain of 4,096 chunks: a colour changes in every update, the isovalue changes, and a dig follows a new palette.
pub(crate) fn changes(bench: &Bench) -> Vec<Row> {
    let mut game = bench.game(Terrain::new(NoiseHeights::default()).with_extent(UVec3::new(32, 4, 32)));
    bench.settle(&mut game);
    let most = bench.count(20 * PACE);

    let dragged = game.updates(bench.count(300), |game, _| change_palette(game));
    let dragged = Row::new("4,096 chunks, another palette in every update", dragged);
    let (times, settled) = game.settle(most);
    let released = Row::new("4,096 chunks, after the last palette", times).with_updates_until("shown", settled);
    bench.settle(&mut game);

    game.change_terrain(|terrain| terrain.isovalue = 0.5);
    let (times, settled) = game.settle(most);
    let isovalue = Row::new("4,096 chunks, another isovalue", times).with_updates_until("shown", settled);
    bench.settle(&mut game);

    let before = shown_depth(&mut game).unwrap_or(0.0);
    change_palette(&mut game);
    game.update();
    game.dig(MIDDLE - Vec3::Y * before, 6.0);
    let is_deeper = |game: &mut Game| shown_depth(game).is_some_and(|depth| depth > before + 3.0);
    let (times, shown) = updates_until(&mut game, most, |_| {}, is_deeper);
    let dig = Row::new("4,096 chunks, a dig right after another palette", times).with_updates_until("shown", shown);
    vec![dragged, released, isovalue, dig]
}

/// Every material gets the colour of the next.
fn change_palette(game: &mut Game) {
    game.change_terrain(|terrain| terrain.palette.colors.rotate_left(1));
}

/// The depth of the drawn surface below the middle.
fn shown_depth(game: &mut Game) -> Option<f32> {
    let mut state = SystemState::<TerrainQuery>::new(game.app.world_mut());
    let terrains = state.get(game.app.world()).expect("a query is always valid");
    terrains.ray_cast(Ray3d::new(MIDDLE, Dir3::NEG_Y), 500.0).map(|hit| hit.distance)
}
