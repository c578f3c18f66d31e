//! A paused game keeps its stamps.

use crate::common::*;
use bevy_app::PostUpdate;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

#[derive(Resource, Default)]
struct Paused(bool);

#[test]
fn pausing_keeps_stamps() {
    let mut app = app();
    app.init_resource::<Paused>();
    app.configure_sets(PostUpdate, MarchlessSystems::Work.run_if(|paused: Res<Paused>| !paused.0));
    let terrain = settled(&mut app, ground());
    let before = geometry(&mut app, terrain);

    app.world_mut().resource_mut::<Paused>().0 = true;
    app.world_mut().write_message(Stamp::add(terrain, BrushShape::sphere(Vec3::new(16.0, 16.0, 16.0), 5.0), 1));
    app.update();
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(16.0, 16.0, 16.0), 3.0)));
    for _ in 0..10 {
        app.update();
    }
    assert_eq!(geometry(&mut app, terrain), before, "nothing happens while paused");

    app.world_mut().resource_mut::<Paused>().0 = false;
    app.update();
    let grid = volume(&app, terrain).grid();
    assert!(grid.get([16, 16, 16]).weight > 0, "the second stamp came last");
    assert!(grid.get([16, 20, 16]).weight < 0, "the first stamp was kept");
    assert_drawn(&mut app, terrain);
}
