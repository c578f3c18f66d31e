//! Without assets, chunks still have geometry.

use crate::common::*;
use bevy_app::{App, TaskPoolPlugin};
use bevy_camera::primitives::Aabb;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_mesh::Mesh3d;

#[test]
fn a_server_has_geometry_without_assets() {
    let mut app = bare_app();
    let terrain = settled(&mut app, ball());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(10.0), 6.0)));
    app.update();
    assert_drawn(&mut app, terrain);
    assert!(report(&mut app, terrain).is_closed());
    assert_eq!(app.world_mut().query::<&Mesh3d>().iter(app.world()).count(), 0);
    assert_eq!(app.world_mut().query::<(&Chunk, &Aabb)>().iter(app.world()).count(), 8);
}

#[test]
fn the_plugins_need_no_more_than_task_pools() {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), MarchlessPlugins));
    let terrain = settled(&mut app, ball());
    let before = geometry(&mut app, terrain);
    assert!(before.iter().any(|(_, mesh)| !mesh.is_empty()));
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(10.0), 6.0)));
    app.update();
    assert!(geometry(&mut app, terrain) != before, "the stamp shows");
    assert_drawn(&mut app, terrain);
}
