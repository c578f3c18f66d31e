//! Each problem is logged once, in a sentence, and not in every update.

#[path = "suite/common/mod.rs"]
mod common;

use std::time::Duration;

use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use bevy_transform::components::Transform;
use common::stream::*;
use common::*;

/// Sets an app up, runs 100 updates without a problem and 100 after a change, and returns the log messages.
fn said(terrain: Terrain, change: impl Fn(&mut App, Entity, Entity)) -> Vec<String> {
    let mut app = app_with_budget(16);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_millis(1);
    let terrain = app.world_mut().spawn(terrain.with_chunk_cells(8)).id();
    let viewer = app.world_mut().spawn(TerrainViewer::new(12.0)).id();
    for _ in 0..100 {
        app.update();
    }
    change(&mut app, terrain, viewer);
    for _ in 0..100 {
        app.update();
    }
    log::said()
}

fn place(app: &mut App, entity: Entity, change: impl Fn(&mut Transform)) {
    change(&mut app.world_mut().get_mut::<Transform>(entity).unwrap());
}

fn see(app: &mut App, viewer: Entity, radius: f32) {
    app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().radii = Vec3::splat(radius);
}

/// A single test, because a process has one log.
#[test]
fn each_fault_is_reported_once() {
    log::record();
    let hills = || Terrain::endless(Hills::default());

    assert_eq!(said(hills(), |_, _, _| ()), [""; 0], "nothing is wrong");
    let nowhere = said(hills(), |app, _, viewer| place(app, viewer, |place| place.translation.x = f32::NAN));
    assert_eq!(nowhere.len(), 1, "{nowhere:?}");
    let sees_nothing = said(hills(), |app, _, viewer| see(app, viewer, 0.0));
    assert_eq!(sees_nothing.len(), 1, "{sees_nothing:?}");
    let sees_too_much = said(hills(), |app, _, viewer| see(app, viewer, 1e6));
    assert_eq!(sees_too_much.len(), 1, "{sees_too_much:?}");
    let flat = said(hills(), |app, terrain, _| place(app, terrain, |place| place.scale = Vec3::ZERO));
    assert_eq!(flat.len(), 1, "{flat:?}");
    let panics = said(Terrain::endless(|_: [f64; 3]| -> f64 { panic!("on purpose") }), |_, _, _| ());
    assert_eq!(panics.len(), 1, "{panics:?}");
    assert!(panics[0].contains("panicked"), "{panics:?}");
}
