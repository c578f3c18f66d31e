//! A settled terrain has no waiting leaf, also where viewers have come and gone.

use std::time::Duration;

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_marchless::stream::LeafState;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;

/// Asserts that no leaf waits, in the counts and in the chunks around a place.
fn assert_nothing_waits(app: &App, terrain: Entity, around: Vec3, name: &str) {
    let volume = volume(app, terrain);
    let (mut waiting, middle) = (Vec::new(), (around / volume.grid().chunk_cells() as f32).floor().as_ivec3());
    for offset in marchless::Region::new([-12; 3], [13; 3]).points() {
        let position = middle + IVec3::from(offset);
        if volume.leaf_at(position).is_some_and(|leaf| leaf.state == LeafState::Waiting) {
            waiting.push(position);
        }
    }
    assert!(waiting.is_empty(), "{name}: {} leaves wait, the first at {}", waiting.len(), waiting[0]);
    assert_eq!(volume.coverage().waiting, 0, "{name}");
}

/// Settles, now and some updates later, and asserts each time that no leaf waits.
fn assert_settles(app: &mut App, terrain: Entity, around: Vec3, name: &str) {
    for _ in 0..3 {
        settle(app, terrain);
        assert_nothing_waits(app, terrain, around, name);
        (0..20).for_each(|_| app.update());
    }
}

/// Main-thread budgets: almost none, which leaves the work to later updates, and the default.
const SHARES: [Duration; 2] = [Duration::ZERO, Duration::from_micros(600)];

/// A viewer over hills of small chunks, in an app without threads.
fn hills() -> (App, Entity, Entity) {
    let mut app = app_with_budget(24);
    let terrain = app.world_mut().spawn(Terrain::endless(NoiseHeights::from_seed(3)).with_chunk_cells(16)).id();
    let viewer = TerrainViewer::new(100.0).with_height(50.0);
    let viewer = app.world_mut().spawn((viewer, Transform::from_xyz(0.0, 60.0, 0.0))).id();
    app.update();
    settle(&mut app, terrain);
    (app, terrain, viewer)
}

#[test]
fn no_leaf_waits_behind_a_walk() {
    for (name, step) in
        [("east", Vec3::X), ("north-west", Vec3::new(-0.6, 0.0, -0.8)), ("south-east and up", Vec3::new(0.7, 0.1, 0.7))]
    {
        for streaming_budget in SHARES {
            let (mut app, terrain, viewer) = hills();
            app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = streaming_budget;
            let mut place = Vec3::new(0.0, 60.0, 0.0);
            for _ in 0..100 {
                place += 12.0 * step;
                move_to(&mut app, viewer, place);
                app.update();
            }
            assert_settles(&mut app, terrain, place, name);
        }
    }
}

#[test]
fn no_leaf_waits_after_going_to_and_fro() {
    for streaming_budget in SHARES {
        let (mut app, terrain, viewer) = hills();
        app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = streaming_budget;
        for update in 0..120u8 {
            let x = if update % 24 < 12 { update % 24 } else { 24 - update % 24 };
            move_to(&mut app, viewer, Vec3::new(9.0 * f32::from(x), 60.0, 0.0));
            app.update();
        }
        let place = Vec3::new(20.0, 60.0, 30.0);
        move_to(&mut app, viewer, place);
        app.update();
        assert_settles(&mut app, terrain, place, "to and fro");
    }
}
