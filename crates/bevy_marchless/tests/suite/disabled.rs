//! A terrain that was disabled for a while continues where it was: nothing is lost, and stamps wait.

use crate::common::*;
use bevy_app::App;
use bevy_color::Color;
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_marchless::mesh::ChunkSamples;
use bevy_marchless::prelude::*;
use bevy_marchless::terrain::{SourceHandle, TerrainError, TerrainSources};
use bevy_math::{UVec3, Vec3};
use bevy_transform::components::Transform;

fn disable(app: &mut App, entity: Entity) {
    app.world_mut().entity_mut(entity).insert(Disabled);
}

fn enable(app: &mut App, entity: Entity) {
    app.world_mut().entity_mut(entity).remove::<Disabled>();
}

fn updates(app: &mut App, count: u32) {
    (0..count).for_each(|_| app.update());
}

fn dig(terrain: Entity, at: Vec3, radius: f32) -> Stamp {
    Stamp::dig(terrain, BrushShape::sphere(at, radius))
}

fn write(app: &mut App, stamp: Stamp) -> Stamp {
    app.world_mut().write_message(stamp);
    stamp
}

#[test]
fn while_it_loads() {
    for before in [0, 1, 3, 9, 12] {
        let mut app = app_with_budget(1);
        let terrain = app.world_mut().spawn(ground()).id();
        updates(&mut app, before);
        disable(&mut app, terrain);
        updates(&mut app, 50);
        enable(&mut app, terrain);
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

#[test]
fn while_threads_load_it() {
    let mut app = app();
    let terrain = app.world_mut().spawn(ground().with_extent(UVec3::splat(4))).id();
    app.update();
    disable(&mut app, terrain);
    for _ in 0..50 {
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    enable(&mut app, terrain);
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &[]);
}

#[test]
fn while_a_dig_is_meshed() {
    for before in [1, 2, 5] {
        let mut app = app_with_budget(1);
        app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
        let terrain = settled(&mut app, ground());
        let first = write(&mut app, dig(terrain, Vec3::splat(16.0), 6.0));
        updates(&mut app, before);
        disable(&mut app, terrain);
        updates(&mut app, 50);
        enable(&mut app, terrain);
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[first]);
        let second = write(&mut app, dig(terrain, Vec3::splat(14.0), 6.0));
        app.update();
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[first, second]);
    }
}

#[test]
fn its_chunks_may_be_disabled_with_it() {
    let mut app = app_with_budget(1);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let terrain = settled(&mut app, ground());
    let first = write(&mut app, dig(terrain, Vec3::splat(16.0), 6.0));
    updates(&mut app, 3);
    app.world_mut().entity_mut(terrain).insert_recursive::<Children>(Disabled);
    updates(&mut app, 20);
    let second = write(&mut app, dig(terrain, Vec3::splat(14.0), 6.0));
    updates(&mut app, 30);
    app.world_mut().entity_mut(terrain).remove_recursive::<Children, Disabled>();
    app.update();
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &[first, second]);
}

#[test]
fn stamps_wait_in_order() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let other = settled(&mut app, ground());
    disable(&mut app, terrain);
    let place = Vec3::new(16.0, 16.0, 16.0);
    let add = Stamp::add(terrain, BrushShape::sphere(place, 5.0), 1);
    let stamps = [write(&mut app, add), write(&mut app, dig(terrain, place, 3.0))];
    let beside = write(&mut app, dig(other, place, 4.0));
    app.update();
    assert_as_new(&mut app, other, &[beside]);
    updates(&mut app, 50);
    assert!(volume(&app, terrain).grid().get([16, 14, 16]).weight < 0, "nothing happens while it is disabled");
    enable(&mut app, terrain);
    app.update();
    assert!(volume(&app, terrain).is_settled());
    assert_as_new(&mut app, terrain, &stamps);
}

#[test]
fn stamps_on_a_terrain_that_is_despawned_while_disabled_are_dropped() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    disable(&mut app, terrain);
    write(&mut app, dig(terrain, Vec3::splat(16.0), 6.0));
    updates(&mut app, 3);
    app.world_mut().despawn(terrain);
    updates(&mut app, 3);
    assert_eq!(geometry(&mut app, terrain).len(), 0);
    let other = settled(&mut app, ground());
    assert_as_new(&mut app, other, &[]);
}

#[test]
fn settings_changed_meanwhile_take_effect() {
    let changes: [fn(&mut Terrain); 5] = [
        |terrain| terrain.palette = Palette::new([Color::BLACK]),
        |terrain| terrain.isovalue = 1.25,
        |terrain| terrain.extent = UVec3::new(1, 3, 2).into(),
        |terrain| terrain.voxel_size = 0.5,
        |terrain| terrain.set_source(|[_, y, _]: [f64; 3]| y - 9.25),
    ];
    for change in changes {
        let mut app = app();
        let terrain = settled(&mut app, ground());
        disable(&mut app, terrain);
        app.update();
        change(&mut app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain"));
        updates(&mut app, 50);
        enable(&mut app, terrain);
        app.update();
        settle(&mut app, terrain);
        assert_as_new(&mut app, terrain, &[]);
    }
}

#[test]
fn from_the_first() {
    let mut app = app();
    let terrain = app.world_mut().spawn((ground(), Disabled)).id();
    let stamp = write(&mut app, dig(terrain, Vec3::splat(16.0), 6.0));
    updates(&mut app, 50);
    enable(&mut app, terrain);
    app.update();
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &[stamp]);
}

#[test]
fn a_disabled_entity_that_is_no_terrain_any_more_has_no_chunks() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    disable(&mut app, terrain);
    updates(&mut app, 3);
    app.world_mut().entity_mut(terrain).remove::<Terrain>();
    updates(&mut app, 3);
    assert_eq!(geometry(&mut app, terrain).len(), 0);
    app.world_mut().entity_mut(terrain).insert(ball());
    enable(&mut app, terrain);
    app.update();
    settle(&mut app, terrain);
    assert_as_new(&mut app, terrain, &[]);
}

#[test]
fn a_viewer_may_walk_meanwhile() {
    let mut app = app_with_budget(16);
    let terrain = app.world_mut().spawn(world()).id();
    let viewer = app.world_mut().spawn((TerrainViewer::new(24.0).with_margin(0.0), Transform::default())).id();
    settle(&mut app, terrain);
    for x in [1.0, 16.0, 500.0] {
        move_to(&mut app, viewer, Vec3::new(x / 2.0, 0.0, 0.0));
        app.update();
        disable(&mut app, terrain);
        move_to(&mut app, viewer, Vec3::new(x, 0.0, 0.0));
        updates(&mut app, 50);
        enable(&mut app, terrain);
        app.update();
        settle(&mut app, terrain);
        updates(&mut app, 4);
        let mut other = crate::common::app();
        let fresh = other.world_mut().spawn(world()).id();
        let place = Transform::from_xyz(x, 0.0, 0.0);
        other.world_mut().spawn((TerrainViewer::new(24.0).with_margin(0.0), place));
        settle(&mut other, fresh);
        assert!(geometry(&mut app, terrain) == geometry(&mut other, fresh), "moved to {x}");
    }
}

/// A plane at `height` in 9³ samples.
fn plane(height: f32) -> ChunkSamples {
    let distances: Vec<f32> = (0..729).map(|index| (index / 9 % 9) as f32 - height).collect();
    ChunkSamples::from_distances(UVec3::splat(9), &distances).expect("as many distances as samples")
}

fn height(app: &App, entity: Entity) -> Option<f32> {
    let mesh = &app.world().get::<ChunkGeometry>(entity).expect("samples have geometry").mesh;
    mesh.positions.first().map(|[_, y, _]| *y)
}

#[test]
fn samples_by_hand_whose_job_is_under_way() {
    let mut app = app_with_budget(1);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let entity = app.world_mut().spawn(plane(3.5)).id();
    app.update();
    disable(&mut app, entity);
    updates(&mut app, 50);
    enable(&mut app, entity);
    updates(&mut app, 4);
    assert_eq!(height(&app, entity), Some(3.5));
    app.world_mut().entity_mut(entity).insert(plane(5.5));
    updates(&mut app, 4);
    assert_eq!(height(&app, entity), Some(5.5));
}

#[test]
fn samples_by_hand_changed_meanwhile() {
    for max_inline_chunks in [0, 8] {
        let mut app = app_with_budget(1);
        app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = max_inline_chunks;
        let entity = app.world_mut().spawn(plane(3.5)).id();
        updates(&mut app, 4);
        assert_eq!(height(&app, entity), Some(3.5));
        disable(&mut app, entity);
        updates(&mut app, 4);
        app.world_mut().entity_mut(entity).insert(plane(5.5));
        updates(&mut app, 50);
        enable(&mut app, entity);
        updates(&mut app, 4);
        assert_eq!(height(&app, entity), Some(5.5));
    }
}

#[test]
fn named_sources_that_come_while_it_is_disabled_are_not_missed() {
    let mut app = app();
    let named = small(Terrain { source: SourceHandle::named("flat"), ..Terrain::default() });
    let terrain = app.world_mut().spawn(named).id();
    app.update();
    assert!(app.world().get::<TerrainError>(terrain).is_some());
    app.world_mut().entity_mut(terrain).insert(Disabled);
    app.world_mut().resource_mut::<TerrainSources>().insert("flat", |[_, y, _]: [f64; 3]| y - 16.5);
    (0..3).for_each(|_| app.update());
    app.world_mut().entity_mut(terrain).remove::<Disabled>();
    settle(&mut app, terrain);
    assert!(app.world().get::<TerrainError>(terrain).is_none() && !geometry(&mut app, terrain).is_empty());
    assert_drawn(&mut app, terrain);
}
