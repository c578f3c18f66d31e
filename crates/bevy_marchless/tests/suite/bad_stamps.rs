//! Stamps with bad numbers, or on entities without a terrain, are dropped and change nothing.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use std::time::Duration;

#[test]
fn bad_stamps_are_dropped_and_the_others_are_not() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let before = geometry(&mut app, terrain);
    let nobody = app.world_mut().spawn_empty().id();
    let sphere = BrushShape::sphere(Vec3::splat(16.0), 3.0);
    let backwards = Stroke { id: 0, rate: 1.0, falloff: 1.0, start: Duration::from_secs(2), end: Duration::ZERO };
    let bad = [
        Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), f32::NAN)),
        Stamp::dig(terrain, BrushShape::sphere(Vec3::new(f32::INFINITY, 0.0, 0.0), 3.0)),
        Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), -1.0)),
        Stamp::dig(terrain, BrushShape::cuboid(Vec3::splat(16.0), Vec3::ZERO)),
        Stamp::add(terrain, BrushShape::capsule(Vec3::ZERO, Vec3::splat(1e30), 1.0), 1),
        Stamp::dig(terrain, sphere).with_stroke(backwards),
        Stamp::dig(terrain, sphere).with_stroke(Stroke { rate: f32::NAN, end: Duration::from_secs(3), ..backwards }),
        Stamp::dig(nobody, sphere),
    ];
    for stamp in bad {
        app.world_mut().write_message(stamp);
    }
    app.update();
    assert_eq!(geometry(&mut app, terrain), before);
    app.world_mut().write_message(bad[0]);
    app.world_mut().write_message(Stamp::dig(terrain, sphere));
    app.update();
    assert_ne!(geometry(&mut app, terrain), before);
}
