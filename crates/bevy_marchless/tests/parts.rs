//! The plugin's parts can be left out.

mod common;

use bevy_app::{App, PluginGroup as _, TaskPoolPlugin};
use bevy_marchless::brush::BrushPlugin;
use bevy_marchless::mesh::MeshingPlugin;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_transform::TransformPlugin;
use common::*;

#[test]
fn samples_alone_need_no_meshing() {
    let mut app = App::new();
    let parts = MarchlessPlugins.build().disable::<MeshingPlugin>().disable::<DebugPlugin>();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, parts));
    let terrain = app.world_mut().spawn(ball()).id();
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), 4.0)));
    update_until(&mut app, |app| volume(app, terrain).is_filled());
    assert!(volume(&app, terrain).grid().get([16; 3]).weight > 0);
    assert!(volume(&app, terrain).grid().get([22, 16, 16]).weight < 0);
    assert!(geometry(&mut app, terrain).iter().all(|(_, mesh)| mesh.is_empty()));
}

#[test]
fn terrain_without_brushes_is_drawn() {
    let mut app = App::new();
    let parts = MarchlessPlugins.build().disable::<BrushPlugin>();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, parts));
    let terrain = settled(&mut app, ball());
    assert_drawn(&mut app, terrain);
}
