//! Terrain loads and edits show while the game's time stands still.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_time::{Time, TimePlugin, Virtual};

#[test]
fn a_paused_time_pauses_no_terrain() {
    let mut app = app();
    app.add_plugins(TimePlugin);
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    let terrain = settled(&mut app, ball());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(8.0), 5.0)));
    app.update();
    assert!(volume(&app, terrain).is_settled());
    assert_drawn(&mut app, terrain);
    assert!(app.world().resource::<Time<Virtual>>().elapsed().is_zero());
}
