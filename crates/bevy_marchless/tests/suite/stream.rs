//! Chunks come and go with viewers.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_marchless::stream::{Coverage, LeafState};
use bevy_math::Vec3;
use bevy_transform::components::Transform;

#[test]
fn what_a_viewer_sees_is_loaded_and_goes_when_it_leaves() {
    let mut app = app();
    let terrain = settled(&mut app, world());
    assert_eq!(geometry(&mut app, terrain).len(), 0, "nobody looks");
    let viewer = app.world_mut().spawn((TerrainViewer::new(32.0).with_margin(8.0), Transform::default())).id();
    settle(&mut app, terrain);
    let here = geometry(&mut app, terrain);
    assert!(here.len() > 40);
    let first = volume(&app, terrain).coverage();
    move_to(&mut app, viewer, Vec3::new(10_000.0, 0.0, 0.0));
    settle(&mut app, terrain);
    let there = geometry(&mut app, terrain);
    assert!(there.len() > 40 && there.iter().all(|(position, _)| position.x > 1_000));
    move_to(&mut app, viewer, Vec3::ZERO);
    settle(&mut app, terrain);
    assert!(geometry(&mut app, terrain) == here, "as before");
    assert_eq!(volume(&app, terrain).coverage(), first);
    app.update(); // Unused assets are dropped one update later.
    assert_eq!(app.world_mut().query::<&bevy_mesh::Mesh3d>().iter(app.world()).count(), mesh_assets(&app));
    app.world_mut().despawn(viewer);
    settle(&mut app, terrain);
    assert_eq!(geometry(&mut app, terrain).len(), 0);
    assert_eq!(volume(&app, terrain).coverage(), Coverage::default());
    assert_eq!(volume(&app, terrain).grid().chunks().count(), 0, "nothing was edited");
    let stats = *app.world().resource::<TerrainStats>();
    assert_eq!(stats.loaded, stats.unloaded);
    assert!(stats.bounded > stats.filled && stats.filled > 0);
}

#[test]
fn holes_are_there_when_one_comes_back() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = app.world_mut().spawn((TerrainViewer::new(24.0), Transform::default())).id();
    settle(&mut app, terrain);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(1.0, 0.0, 3.0), 5.0)));
    settle(&mut app, terrain);
    let dug = geometry(&mut app, terrain);
    move_to(&mut app, viewer, Vec3::new(0.0, 0.0, -3_000.0));
    settle(&mut app, terrain);
    // A second hole, in unloaded terrain.
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(-9.0, -3.0, 9.0), 3.0)));
    app.update();
    move_to(&mut app, viewer, Vec3::ZERO);
    settle(&mut app, terrain);
    let both = geometry(&mut app, terrain);
    assert!(both != dug, "the second hole");

    let mut fresh_app = crate::common::app();
    let fresh = fresh_app.world_mut().spawn(world()).id();
    fresh_app.world_mut().spawn((TerrainViewer::new(24.0), Transform::default()));
    settle(&mut fresh_app, fresh);
    for (at, radius) in [(Vec3::new(1.0, 0.0, 3.0), 5.0), (Vec3::new(-9.0, -3.0, 9.0), 3.0)] {
        fresh_app.world_mut().write_message(Stamp::dig(fresh, BrushShape::sphere(at, radius)));
    }
    settle(&mut fresh_app, fresh);
    assert!(both == geometry(&mut fresh_app, fresh), "a fresh world looks the same");
}

#[test]
fn samples_far_from_viewers_are_dropped_and_come_back_for_edits() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = TerrainViewer::new(48.0).with_margin(4.0).with_sample_radius(16.0);
    app.world_mut().spawn((viewer, Transform::default()));
    settle(&mut app, terrain);
    for _ in 0..20 {
        app.update();
        settle(&mut app, terrain);
    }
    let at = [33, -2, 5];
    let chunk = volume(&app, terrain).grid().chunk_of(at);
    assert!(volume(&app, terrain).grid().chunk(chunk).is_none(), "far away, and drawn");
    assert_eq!(volume(&app, terrain).leaf_at(chunk.into()).unwrap().state, LeafState::Drawn);
    let before = geometry(&mut app, terrain);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::from(at.map(|v| v as f32)), 6.0)));
    update_until(&mut app, |app| volume(app, terrain).grid().chunk(chunk).is_some());
    settle(&mut app, terrain);
    let after = geometry(&mut app, terrain);
    assert!(before != after, "the hole shows");
    assert!(volume(&app, terrain).grid().get(at).weight > 0, "dug");
}
