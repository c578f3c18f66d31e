//! Rays.

use std::f32::consts::TAU;
use std::hint::black_box;
use std::time::Duration;

use bevy_ecs::system::SystemState;
use bevy_marchless::prelude::*;
use bevy_math::{Dir3, Ray3d, Vec3};
use marchless_plugin_benches::{Times, World, thread_time};

use crate::situation::{Bench, Row, above};

/// Rays of infinite length in all directions, from the middle of a large view.
pub(crate) fn endless_rays(bench: &Bench) -> Vec<Row> {
    let mut game = bench.game(World::Hills.terrain());
    game.spawn_viewer(TerrainViewer::new(320.0), above(0.0, 0.0));
    bench.settle(&mut game);
    let coverage = game.volume().coverage();
    let shown = coverage.drawn + coverage.empty;

    let count = bench.count(1_000);
    let mut state = SystemState::<TerrainQuery>::new(game.app.world_mut());
    let terrains = state.get(game.app.world()).expect("a query is always valid");
    let mut hits = 0;
    let cast = |number| {
        let ray = Ray3d::new(Vec3::new(0.0, 80.0, 0.0), direction(number, count));
        let start = thread_time();
        let hit = black_box(terrains.ray_cast(black_box(ray), f32::INFINITY));
        let time = thread_time() - start;
        hits += u32::from(hit.is_some());
        time
    };
    let times: Times = (0..count).map(cast).collect();
    let figure = format!("{:.1} µs a ray, {hits} hit; {shown} chunks shown", microseconds(times.mean()));
    vec![Row::new("rays with an infinite reach", times).with_figure(figure)]
}

/// Directions spread evenly over the sphere, on a spiral.
fn direction(number: u32, count: u32) -> Dir3 {
    let golden_angle = TAU * 0.381_966;
    let y = 1.0 - (2 * number + 1) as f32 / count as f32;
    let (sin, cos) = (number as f32 * golden_angle).sin_cos();
    let around = (1.0 - y * y).sqrt();
    Dir3::new(Vec3::new(around * cos, y, around * sin)).unwrap_or(Dir3::NEG_Y)
}

fn microseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}
