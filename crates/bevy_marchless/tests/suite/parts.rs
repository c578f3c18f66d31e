//! The plugin's parts can be left out.

use crate::common::*;
use bevy_app::{App, PluginGroup as _, TaskPoolPlugin};
use bevy_marchless::brush::BrushPlugin;
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::mesh::MeshingPlugin;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_transform::TransformPlugin;
use bevy_transform::components::Transform;

#[test]
fn samples_alone_need_no_meshing() {
    let mut app = App::new();
    let parts = MarchlessPlugins.build().disable::<MeshingPlugin>().disable::<TerrainDiagnosticsPlugin>();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, parts));
    let terrain = app.world_mut().spawn(ball()).id();
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), 4.0)));
    update_until(&mut app, |app| volume(app, terrain).is_filled());
    assert!(volume(&app, terrain).grid().get([16; 3]).weight > 0);
    assert!(volume(&app, terrain).grid().get([22, 16, 16]).weight < 0);
    assert!(geometry(&mut app, terrain).iter().all(|(_, mesh)| mesh.is_empty()));
}

#[test]
fn a_terrain_without_meshing_settles_behind_a_walking_viewer() {
    for brushes in [true, false] {
        let mut parts = MarchlessPlugins.build().disable::<MeshingPlugin>();
        if !brushes {
            parts = parts.disable::<BrushPlugin>();
        }
        let mut app = App::new();
        app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, parts));
        let terrain = app.world_mut().spawn(world()).id();
        let viewer = app.world_mut().spawn((TerrainViewer::new(32.0).with_margin(8.0), Transform::default())).id();
        for step in 0..200u8 {
            move_to(&mut app, viewer, Vec3::new(3.0 * f32::from(step), 0.0, 0.0));
            if brushes && step % 8 == 0 {
                let shape = BrushShape::sphere(Vec3::new(3.0 * f32::from(step), -8.0, 4.0), 3.0);
                app.world_mut().write_message(Stamp::dig(terrain, shape));
            }
            app.update();
        }
        settle(&mut app, terrain);
        assert!(volume(&app, terrain).grid().get([596, -16, 4]).weight < 0, "samples are there");
    }
}

#[test]
fn terrain_without_brushes_is_drawn() {
    let mut app = App::new();
    let parts = MarchlessPlugins.build().disable::<BrushPlugin>();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, parts));
    let terrain = settled(&mut app, ball());
    assert_drawn(&mut app, terrain);
}

#[test]
fn a_terrain_may_be_there_before_the_plugin() {
    let mut app = App::new();
    let terrain = app.world_mut().spawn(ball()).id();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, MarchlessPlugins));
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
}
