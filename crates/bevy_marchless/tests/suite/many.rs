//! Two terrains do not mix.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

#[test]
fn two_terrains_do_not_mix() {
    let mut app = app();
    let first = app.world_mut().spawn(ground()).id();
    let second = app.world_mut().spawn(ball()).id();
    settle(&mut app, first);
    settle(&mut app, second);
    assert_drawn(&mut app, first);
    assert_drawn(&mut app, second);

    let untouched = geometry(&mut app, second);
    app.world_mut().write_message(Stamp::dig(first, BrushShape::sphere(Vec3::splat(16.0), 5.0)));
    app.update();
    assert_eq!(geometry(&mut app, second), untouched);
    assert_drawn(&mut app, first);

    app.world_mut().despawn(first);
    app.world_mut().write_message(Stamp::dig(second, BrushShape::sphere(Vec3::splat(16.0), 5.0)));
    app.world_mut().write_message(Stamp::dig(first, BrushShape::sphere(Vec3::splat(16.0), 9.0)));
    settle(&mut app, second);
    assert_ne!(geometry(&mut app, second), untouched);
    assert_drawn(&mut app, second);
}
