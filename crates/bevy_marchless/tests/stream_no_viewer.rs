//! A terrain that loads nothing because it has no viewer is reported once, and not too soon.

#[path = "suite/common/mod.rs"]
mod common;

use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::Transform;
use common::*;

fn with_terrain(terrain: Terrain) -> (App, Entity) {
    let mut app = app_with_budget(4);
    let terrain = app.world_mut().spawn(terrain).id();
    (app, terrain)
}

/// Runs updates and returns the log messages of the plugin.
fn said_in(app: &mut App, updates: u32) -> Vec<String> {
    (0..updates).for_each(|_| app.update());
    log::said()
}

/// A single test, because a process has one log.
#[test]
fn a_terrain_without_viewers_is_reported_once() {
    log::record();
    let (mut app, terrain) = with_terrain(world());
    assert_eq!(said_in(&mut app, 100), [""; 0], "a viewer may still come");
    let said = said_in(&mut app, 300);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("TerrainViewer") && said[0].contains(&terrain.to_string()), "{said:?}");
    let second = app.world_mut().spawn(world()).id();
    let said = said_in(&mut app, 300);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains(&second.to_string()), "{said:?}");

    // A bounded terrain that keeps chunks only outside its extent.
    let outside = Keep::Chunks(Extent::new(IVec3::splat(50), IVec3::splat(60)));
    let (mut app, terrain) = with_terrain(ground().with_keep(outside));
    assert_eq!(said_in(&mut app, 300).len(), 1);
    app.world_mut().get_mut::<Terrain>(terrain).unwrap().keep = Keep::Everything;
    assert_eq!(said_in(&mut app, 300), [""; 0]);

    // Settings that later keep no chunks.
    let (mut app, terrain) = with_terrain(ground());
    assert_eq!(said_in(&mut app, 300), [""; 0], "it keeps its chunks");
    app.world_mut().get_mut::<Terrain>(terrain).unwrap().keep = Keep::Nothing;
    assert_eq!(said_in(&mut app, 300).len(), 1);

    // A viewer that is spawned later, and despawned again.
    let (mut app, _) = with_terrain(world());
    assert_eq!(said_in(&mut app, 100), [""; 0]);
    let viewer = app.world_mut().spawn(TerrainViewer::new(8.0)).id();
    assert_eq!(said_in(&mut app, 300), [""; 0]);
    app.world_mut().despawn(viewer);
    assert_eq!(said_in(&mut app, 300), [""; 0], "the game knows of viewers");

    // Viewers out of range of the terrain.
    let (mut app, _) = with_terrain(world().with_extent(Extent::new(IVec3::ZERO, IVec3::splat(4))));
    app.world_mut().spawn((TerrainViewer::new(8.0), Transform::from_xyz(1e5, 0.0, 0.0)));
    assert_eq!(said_in(&mut app, 300), [""; 0]);
    let (mut app, _) = with_terrain(world());
    app.world_mut().spawn((TerrainViewer::new(8.0), Transform::from_translation(Vec3::NAN)));
    let said = said_in(&mut app, 300);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("finite position"), "{said:?}");
}
