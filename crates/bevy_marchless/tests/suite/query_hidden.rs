//! Rays pass through hidden terrains.

use crate::common::*;
use bevy_app::App;
use bevy_camera::visibility::Visibility;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_math::{Dir3, Ray3d, Vec3};
use bevy_transform::components::Transform;

/// The terrain that a ray along z hits after an update.
fn hit(app: &mut App) -> Option<Entity> {
    app.update();
    cast(app, Vec3::new(16.0, 16.0, 100.0), Vec3::splat(16.0), 1000.0).map(|hit| hit.terrain)
}

/// The first terrain that a ray hits among those for which `filter` is true.
fn hit_where(app: &mut App, filter: impl Fn(&TerrainQuery, Entity) -> bool + Send + Sync + 'static) -> Option<Entity> {
    let ray = Ray3d::new(Vec3::new(16.0, 16.0, 100.0), Dir3::NEG_Z);
    let query = move |terrains: TerrainQuery| {
        terrains.ray_cast_where(ray, 1000.0, |terrain| filter(&terrains, terrain)).map(|hit| hit.terrain)
    };
    app.world_mut().run_system_once(query).unwrap()
}

fn is_visible(app: &mut App, terrain: Entity) -> bool {
    app.world_mut().run_system_once(move |terrains: TerrainQuery| terrains.is_visible(terrain)).unwrap()
}

/// Two balls, the second behind the first.
fn near_and_far(app: &mut App) -> [Entity; 2] {
    let near = settled(app, ball());
    let far = app.world_mut().spawn((ball(), Transform::from_xyz(0.0, 0.0, -100.0))).id();
    settle(app, far);
    app.update();
    [near, far]
}

#[test]
fn a_hidden_terrain_is_passed() {
    // No Bevy plugin computes inherited visibility in this app.
    let mut app = bare_app();
    let [near, far] = near_and_far(&mut app);
    assert_eq!(hit(&mut app), Some(near));
    app.world_mut().entity_mut(near).insert(Visibility::Hidden);
    assert_eq!(hit(&mut app), Some(far));
    assert!(!is_visible(&mut app, near) && is_visible(&mut app, far));
    app.world_mut().entity_mut(far).insert(Visibility::Hidden);
    assert_eq!(hit(&mut app), None);
    app.world_mut().entity_mut(near).insert(Visibility::Visible);
    assert_eq!(hit(&mut app), Some(near));
    app.world_mut().entity_mut(near).remove::<Visibility>();
    assert_eq!(hit(&mut app), Some(near), "nothing hides it");
}

#[test]
fn a_terrain_below_a_hidden_one_is_passed_unless_it_is_visible_by_itself() {
    let mut app = bare_app();
    let [near, far] = near_and_far(&mut app);
    let root = app.world_mut().spawn((Transform::default(), Visibility::Hidden)).id();
    let middle = app.world_mut().spawn((Transform::default(), Visibility::Inherited, ChildOf(root))).id();
    app.world_mut().entity_mut(near).insert(ChildOf(middle));
    assert_eq!(hit(&mut app), Some(far));
    app.world_mut().entity_mut(near).insert(Visibility::Visible);
    assert_eq!(hit(&mut app), Some(near));
    app.world_mut().entity_mut(near).insert(Visibility::Inherited);
    app.world_mut().entity_mut(middle).insert(Visibility::Visible);
    assert_eq!(hit(&mut app), Some(near));
    // A parent without visibility passes none on, as in Bevy.
    app.world_mut().entity_mut(middle).remove::<Visibility>();
    assert_eq!(hit(&mut app), Some(near));
    app.world_mut().entity_mut(middle).insert(Visibility::Inherited);
    assert_eq!(hit(&mut app), Some(far));
}

#[test]
fn a_filter_alone_decides_where_there_is_one() {
    let mut app = bare_app();
    let [near, far] = near_and_far(&mut app);
    app.world_mut().entity_mut(near).insert(Visibility::Hidden);
    app.update();
    assert_eq!(hit_where(&mut app, |_, _| true), Some(near), "hidden ones too");
    assert_eq!(hit_where(&mut app, move |_, terrain| terrain != near), Some(far));
    assert_eq!(hit_where(&mut app, |terrains, terrain| terrains.is_visible(terrain)), Some(far));
    assert_eq!(hit_where(&mut app, |_, _| false), None);

    let ray = Ray3d::new(Vec3::new(16.0, 16.0, 100.0), Dir3::NEG_Z);
    let query = move |terrains: TerrainQuery| terrains.ray_cast_terrain(near, ray, 1000.0).map(|hit| hit.terrain);
    assert_eq!(app.world_mut().run_system_once(query).unwrap(), Some(near), "named, it is hit");
}

#[test]
fn a_system_that_asks_may_change_what_is_visible() {
    let mut app = bare_app();
    let near = settled(&mut app, ball());
    let ray = Ray3d::new(Vec3::new(16.0, 16.0, 100.0), Dir3::NEG_Z);
    let system = move |terrains: TerrainQuery, mut all: Query<(&mut Visibility, &mut Transform)>| {
        let hit = terrains.ray_cast(ray, 1000.0).expect("the ball");
        *all.get_mut(hit.terrain).expect("a terrain").0 = Visibility::Hidden;
    };
    app.world_mut().run_system_once(system).expect("no conflict");
    assert_eq!(hit(&mut app), None);
    assert!(!is_visible(&mut app, near));
}
