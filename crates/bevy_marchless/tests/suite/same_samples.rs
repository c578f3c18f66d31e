//! The same stamps give the same samples, in whatever order threads work.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

/// Twelve stamps, one per update from the first on, while the terrain is still being filled.
fn play(mut app: App, updates_before: usize) -> (App, Entity) {
    let terrain = app.world_mut().spawn(ground()).id();
    for _ in 0..updates_before {
        app.update();
    }
    for step in 0..12u8 {
        let center = Vec3::new(6.0 + 2.0 * f32::from(step), 15.0, 12.3);
        let shape = BrushShape::sphere(center, 2.0 + 0.3 * f32::from(step));
        let stamp = match step % 3 {
            0 => Stamp::dig(terrain, shape),
            1 => Stamp::add(terrain, shape, step),
            _ => Stamp::paint(terrain, shape, step),
        };
        app.world_mut().write_message(stamp);
        app.update();
    }
    settle(&mut app, terrain);
    (app, terrain)
}

#[test]
fn the_same_stamps_give_the_same_samples_in_any_order_of_work() {
    let (mut one, first) = play(app_with_budget(1), 0);
    for (other, updates_before) in [(app_with_budget(3), 0), (app(), 0), (app(), 30), (bare_app(), 2)] {
        let (mut other, second) = play(other, updates_before);
        let (a, b) = (volume(&one, first).grid(), volume(&other, second).grid());
        for point in a.planes().unwrap().grown(1, 1).points() {
            assert_eq!(a.get(point), b.get(point), "at {point:?}");
        }
        assert_eq!(geometry(&mut one, first), geometry(&mut other, second));
    }
}
