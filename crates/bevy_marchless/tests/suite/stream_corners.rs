//! Corner cases of streaming: dropped samples, late jobs, and chunks that come back while their edit is meshed.

use std::time::Duration;

use crate::common::*;
use bevy_app::prelude::*;
use bevy_ecs::prelude::*;
use bevy_marchless::marchless::Region;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use bevy_transform::components::Transform;

fn dropped(app: &mut App, terrain: Entity) {
    settle(app, terrain);
    for _ in 0..20 {
        app.update();
        settle(app, terrain);
    }
}

/// The chunks that are not drawn as a fresh mesh of their neighbourhood, as far as the grid holds it.
fn wrong(app: &mut App, terrain: Entity, around: IVec3, reach: i32) -> Vec<IVec3> {
    let drawn = geometry(app, terrain);
    let volume = volume(app, terrain);
    let settings = volume.settings().unwrap();
    let mesh_settings = marchless::MeshSettings { isovalue: settings.isovalue, ..Default::default() };
    let mut mesher = marchless::Mesher::new();
    let mut wrong = vec![];
    let r = Region::new((around - reach).to_array(), (around + reach + 1).to_array());
    for position in r.points() {
        let Some(_leaf) = volume.leaf_at(position.into()) else { continue };
        let whole = Region::new(position, position.map(|v| v + 1)).grown(1, 1);
        if !whole.points().all(|p| volume.grid().chunk(p).is_some()) {
            continue;
        }
        let mut mesh = marchless::MeshBuffer::new();
        volume.grid().mesh_chunk(position, &mut mesher, mesh_settings, &mut mesh).unwrap();
        let found = drawn.iter().find(|(at, _)| at.to_array() == position);
        if *found.map(|(_, m)| m.clone()).unwrap_or_default() != mesh {
            wrong.push(IVec3::from(position));
        }
    }
    wrong
}

#[test]
fn a_chunk_whose_samples_were_dropped_is_drawn_when_it_comes_back() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = TerrainViewer::new(48.0).with_margin(0.0).with_sample_radius(8.0);
    let viewer = app.world_mut().spawn((viewer, Transform::default())).id();
    dropped(&mut app, terrain);
    assert_eq!(volume(&app, terrain).coverage().waiting, 0);
    // Moves away, so that dropped chunks are hidden, and back in steps: the chunks come into range at its rim.
    move_to(&mut app, viewer, Vec3::new(16.0, 0.0, 0.0));
    dropped(&mut app, terrain);
    for x in (0..16).rev() {
        move_to(&mut app, viewer, Vec3::new(x as f32, 0.0, 0.0));
        settle(&mut app, terrain);
        settle(&mut app, terrain);
        assert_eq!(volume(&app, terrain).coverage().waiting, 0, "back at {x}");
    }
}

#[test]
fn edits_show_after_samples_are_no_longer_dropped() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = TerrainViewer::new(48.0).with_margin(4.0).with_sample_radius(16.0);
    let viewer = app.world_mut().spawn((viewer, Transform::default())).id();
    dropped(&mut app, terrain);
    let at = [33, -2, 5];
    let chunk = volume(&app, terrain).grid().chunk_of(at);
    assert!(volume(&app, terrain).grid().chunk(chunk).is_none(), "far away, and drawn");
    app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().sample_radius = f32::INFINITY;
    dropped(&mut app, terrain);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::from(at.map(|v| v as f32)), 6.0)));
    dropped(&mut app, terrain);
    assert!(volume(&app, terrain).grid().chunk(chunk).is_some(), "all samples stay now");
    assert!(volume(&app, terrain).grid().get(at).weight > 0, "dug");
}

#[test]
fn the_isovalue_may_change_while_jobs_sample() {
    let mut app = app_with_budget(100_000);
    let ground = |[_, y, _]: [f64; 3]| y - 14.0;
    let terrain = app.world_mut().spawn(Terrain::new(ground).with_extent(UVec3::splat(4)).with_chunk_cells(16)).id();
    for updates in 1..6 {
        app.world_mut().get_mut::<Terrain>(terrain).unwrap().set_source(ground);
        app.world_mut().get_mut::<Terrain>(terrain).unwrap().isovalue = 0.0;
        for _ in 0..updates {
            app.update();
        }
        app.world_mut().get_mut::<Terrain>(terrain).unwrap().isovalue = 3.0;
        settle(&mut app, terrain);
        assert_eq!(wrong(&mut app, terrain, IVec3::splat(1), 0).len(), 0, "changed after {updates} updates");
    }
}

#[test]
fn a_chunk_may_come_back_while_its_edit_is_meshed() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = app.world_mut().spawn((TerrainViewer::new(24.0).with_margin(0.0), Transform::default())).id();
    settle(&mut app, terrain);
    *app.world_mut().resource_mut::<MarchlessSettings>() =
        MarchlessSettings { max_inline_chunks: 0, max_jobs_per_update: Some(0), ..Default::default() };
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(4.0, 0.0, 4.0), 3.0)));
    app.update();
    let key = IVec3::ZERO;
    move_to(&mut app, viewer, Vec3::new(0.0, 0.0, -3_000.0));
    update_until(&mut app, |app| volume(app, terrain).leaf_at(key).is_none());
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(4.0, -4.0, 4.0), 3.0)));
    app.update();
    move_to(&mut app, viewer, Vec3::ZERO);
    update_until(&mut app, |app| {
        volume(app, terrain).grid().chunk([1, 0, 1]).is_some() || volume(app, terrain).leaf_at(key).is_some()
    });
    for _ in 0..50 {
        app.update();
    }
    *app.world_mut().resource_mut::<MarchlessSettings>() = MarchlessSettings::default();
    settle(&mut app, terrain);
    assert_eq!(wrong(&mut app, terrain, key, 1), [] as [IVec3; 0]);
}

#[test]
fn edits_in_a_bounded_chunk_survive_the_job_that_was_asked_for_their_sake() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = app.world_mut().spawn((TerrainViewer::new(8.0).with_margin(0.0), Transform::default())).id();
    settle(&mut app, terrain);
    app.world_mut().resource_mut::<MarchlessSettings>().max_jobs_per_update = Some(0);
    let at = Vec3::new(1_004.0, -200.0, 4.0);
    for i in 0..70 {
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(at, 1.0 + 0.02 * i as f32)));
    }
    app.update();
    app.update();
    let point = [1_004, -200, 4];
    move_to(&mut app, viewer, at);
    app.update();
    app.world_mut().resource_mut::<MarchlessSettings>().max_jobs_per_update = None;
    update_until(&mut app, |app| {
        volume(app, terrain).grid().get(point).weight > 0
            && volume(app, terrain).grid().chunk(volume(app, terrain).grid().chunk_of(point)).is_some()
    });
    let chunk = volume(&app, terrain).grid().chunk_of(point);
    move_to(&mut app, viewer, Vec3::ZERO);
    update_until(&mut app, |app| volume(app, terrain).leaf_at(chunk.into()).is_none());
    for _ in 0..20 {
        app.update();
    }
    assert!(volume(&app, terrain).grid().get(point).weight > 0, "kept");
    settle(&mut app, terrain);
    assert!(volume(&app, terrain).grid().get(point).weight > 0, "still dug");
}

#[test]
fn the_main_thread_may_take_all_the_time_there_is() {
    let mut app = app();
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::MAX;
    let terrain = app.world_mut().spawn(world()).id();
    app.world_mut().spawn((TerrainViewer::new(24.0), Transform::default()));
    settle(&mut app, terrain);
}

#[test]
fn flat_worlds_drop_samples_too() {
    let mut app = app();
    let terrain = app.world_mut().spawn(world().with_extent(Extent::ENDLESS.with_y(-1..1))).id();
    let viewer = TerrainViewer::new(48.0).with_margin(0.0).with_sample_radius(8.0);
    app.world_mut().spawn((viewer, Transform::default()));
    dropped(&mut app, terrain);
    let far = (-6..6)
        .flat_map(|x| (-6..6).map(move |z| IVec3::new(x, 0, z)))
        .filter(|c| {
            volume(&app, terrain).leaf_at(*c).is_some() && volume(&app, terrain).grid().chunk(c.to_array()).is_none()
        })
        .count();
    assert!(far > 0);
}

/// Some neighbours of a drawn chunk are unloaded when its viewer comes back, but not near enough to be requested.
#[test]
fn edits_show_beside_neighbours_that_went() {
    for away in 1..24 {
        let mut app = app();
        app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::ZERO;
        let terrain = app.world_mut().spawn(world()).id();
        let viewer = TerrainViewer::new(32.0).with_margin(16.0);
        let viewer = app.world_mut().spawn((viewer, Transform::default())).id();
        settle(&mut app, terrain);
        move_to(&mut app, viewer, Vec3::new(-10_000.0, 0.0, 0.0));
        (0..away).for_each(|_| app.update());
        move_to(&mut app, viewer, Vec3::new(-12.0, 0.0, 0.0));
        app.update();
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(26.0, 0.0, 0.0), 14.0)));
        settle(&mut app, terrain);
    }
}
