//! Terrains are where their transforms say, also in apps that do not propagate transforms.

use crate::common::*;
use bevy_app::{App, PostUpdate, TaskPoolPlugin};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{Quat, Vec3};
use bevy_transform::TransformSystems;
use bevy_transform::components::{GlobalTransform, Transform};

fn app_without_propagation() -> App {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), MarchlessPlugins));
    app
}

/// Asserts that rays find a ball at this place, and nowhere else.
fn assert_at(app: &mut App, place: Transform) {
    let middle = place.transform_point(Vec3::splat(16.0));
    let hit = cast(app, middle + Vec3::Y * 50.0, middle, 100.0).expect("the ball");
    assert!((hit.distance - 38.0).abs() < 0.1, "{hit:?}");
    let beside = middle + Vec3::X * 40.0;
    assert_eq!(cast(app, beside + Vec3::Y * 50.0, beside, 100.0), None);
}

fn moved(x: f32) -> Transform {
    Transform::from_xyz(x, 3.0, -20.0).with_rotation(Quat::from_rotation_z(0.7))
}

#[test]
fn a_terrain_that_moves() {
    let mut app = app_without_propagation();
    let terrain = app.world_mut().spawn((ball(), moved(1000.0))).id();
    settle(&mut app, terrain);
    assert_at(&mut app, moved(1000.0));
    for x in [500.0, 0.0, -1000.0] {
        app.world_mut().entity_mut(terrain).insert(moved(x));
        app.update();
        assert_at(&mut app, moved(x));
    }
    app.world_mut().get_mut::<Transform>(terrain).unwrap().translation.x = f32::NAN;
    app.update();
    assert_eq!(cast(&mut app, Vec3::new(-1000.0, 50.0, 0.0), Vec3::new(-1000.0, 0.0, 0.0), 1e6), None);
    app.world_mut().entity_mut(terrain).insert(moved(200.0));
    app.update();
    assert_at(&mut app, moved(200.0));
}

#[test]
fn a_terrain_whose_parents_move() {
    let mut app = app_without_propagation();
    let root = app.world_mut().spawn(Transform::default()).id();
    let parent = app.world_mut().spawn((Transform::default(), ChildOf(root))).id();
    let terrain = app.world_mut().spawn((ball(), ChildOf(parent))).id();
    settle(&mut app, terrain);
    assert_at(&mut app, Transform::default());
    app.world_mut().entity_mut(root).insert(Transform::from_xyz(1000.0, 0.0, 0.0));
    app.update();
    assert_at(&mut app, Transform::from_xyz(1000.0, 0.0, 0.0));
    app.world_mut().entity_mut(parent).insert(moved(5.0));
    app.update();
    assert_at(&mut app, Transform::from_xyz(1000.0, 0.0, 0.0) * moved(5.0));
    app.world_mut().entity_mut(terrain).remove::<ChildOf>();
    app.update();
    assert_at(&mut app, Transform::default());
}

#[test]
fn one_that_was_disabled_and_one_that_comes_after_another_has_gone() {
    let mut app = app_without_propagation();
    let first = app.world_mut().spawn((ball(), moved(1000.0))).id();
    settle(&mut app, first);
    let second = app.world_mut().spawn((ball(), moved(0.0))).id();
    settle(&mut app, second);
    app.world_mut().entity_mut(second).insert((Disabled, moved(-300.0)));
    app.update();
    app.world_mut().despawn(first);
    app.update();
    app.world_mut().entity_mut(second).remove::<Disabled>();
    app.update();
    assert_at(&mut app, moved(-300.0));
    let third = app.world_mut().spawn((ball(), moved(2000.0))).id();
    settle(&mut app, third);
    assert_at(&mut app, moved(2000.0));
}

#[test]
fn where_bevy_propagates_the_plugin_writes_nothing() {
    let mut app = bare_app();
    let terrain = app.world_mut().spawn((ball(), moved(1000.0))).id();
    settle(&mut app, terrain);
    assert_at(&mut app, moved(1000.0));
    // Bevy propagates it again when its transform changes, and not before.
    let elsewhere = GlobalTransform::from(moved(-7.0));
    *app.world_mut().get_mut::<GlobalTransform>(terrain).unwrap() = elsewhere;
    (0..3).for_each(|_| app.update());
    assert_eq!(app.world().get::<GlobalTransform>(terrain), Some(&elsewhere));
}

#[test]
fn where_another_plugin_propagates_this_one_writes_nothing() {
    /// A propagation whose world space is relative to x = 100.
    fn propagate(mut all: Query<(&Transform, &mut GlobalTransform), Changed<Transform>>) {
        for (transform, mut global) in &mut all {
            *global = (Transform::from_xyz(-100.0, 0.0, 0.0) * *transform).into();
        }
    }
    let mut app = app_without_propagation();
    app.add_systems(PostUpdate, propagate.in_set(TransformSystems::Propagate));
    // At the origin of its world space, at the place of the first one.
    for x in [100.0, 1000.0] {
        let terrain = app.world_mut().spawn((ball(), Transform::from_xyz(x, 0.0, 0.0))).id();
        settle(&mut app, terrain);
        assert_at(&mut app, Transform::from_xyz(x - 100.0, 0.0, 0.0));
        app.world_mut().entity_mut(terrain).insert(moved(x + 200.0));
        (0..3).for_each(|_| app.update());
        assert_at(&mut app, moved(x + 100.0));
        app.world_mut().despawn(terrain);
    }
}
