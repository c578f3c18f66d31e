//! Stamps may be written and reports read in `FixedUpdate`, however often it runs in an update.

use core::time::Duration;

use crate::common::*;
use bevy_app::{App, FixedUpdate, Update};
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_time::{Fixed, Time, TimePlugin, TimeUpdateStrategy};

/// The number of stamps written, and the cubic voxels that they removed.
#[derive(Resource, Default)]
struct Work {
    stamps: u32,
    removed: u64,
}

/// The next ball of a row of balls that do not touch.
fn dig(terrain: Single<Entity, With<Terrain>>, mut work: ResMut<Work>, mut stamps: MessageWriter<Stamp>) {
    let column = work.stamps % 5;
    let row = work.stamps / 5 % 5;
    work.stamps += 1;
    let place = Vec3::new(4.0 + 6.0 * column as f32, 12.0, 4.0 + 6.0 * row as f32);
    stamps.write(Stamp::dig(*terrain, BrushShape::sphere(place, 2.0)));
}

fn count(mut edits: MessageReader<TerrainEdited>, mut work: ResMut<Work>) {
    work.removed += edits.read().flat_map(|edit| edit.removed.values()).sum::<u64>();
}

/// `step`: of `FixedUpdate`, in updates.
fn app_with_time(step: f64) -> (App, Entity) {
    let mut app = app();
    app.add_plugins(TimePlugin).init_resource::<Work>();
    let terrain = settled(&mut app, ground());
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)))
        .insert_resource(Time::<Fixed>::from_seconds(0.01 * step));
    (app, terrain)
}

/// The cubic voxels that one of the balls removes.
fn one_ball() -> u64 {
    let (mut app, _) = app_with_time(1.0);
    app.add_systems(Update, dig.run_if(|work: Res<Work>| work.stamps == 0)).add_systems(Update, count);
    (0..4).for_each(|_| app.update());
    let removed = app.world().resource::<Work>().removed;
    assert!(removed > 20, "{removed} cubic voxels");
    removed
}

#[test]
fn stamps_of_several_steps_show_in_their_update() {
    let (mut app, terrain) = app_with_time(0.25);
    app.add_systems(FixedUpdate, dig.run_if(|work: Res<Work>| work.stamps < 12)).add_systems(Update, count);
    for _ in 0..6 {
        app.update();
        assert!(volume(&app, terrain).is_settled(), "what was dug shows in the update that dug it");
    }
    let work = app.world().resource::<Work>();
    assert_eq!((work.stamps, work.removed), (12, 12 * one_ball()));
    assert_drawn(&mut app, terrain);
}

#[test]
fn steps_that_are_rare_miss_no_report() {
    let (mut app, _) = app_with_time(7.0);
    app.add_systems(Update, dig.run_if(|work: Res<Work>| work.stamps < 12)).add_systems(FixedUpdate, count);
    (0..40).for_each(|_| app.update());
    let work = app.world().resource::<Work>();
    assert_eq!((work.stamps, work.removed), (12, 12 * one_ball()));
}
