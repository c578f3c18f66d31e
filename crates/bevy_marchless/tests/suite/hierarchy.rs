//! Terrains below other entities move with them, change parents, and are despawned with them.

use crate::common::*;
use bevy_camera::visibility::Visibility;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_transform::components::{GlobalTransform, Transform};

#[test]
fn a_terrain_moves_with_its_parents_and_goes_with_them() {
    let mut app = app();
    let parents =
        [100.0, -300.0].map(|x| app.world_mut().spawn((Transform::from_xyz(x, 0.0, 0.0), Visibility::default())).id());
    let terrain = app.world_mut().spawn((ball(), ChildOf(parents[0]))).id();
    settle(&mut app, terrain);
    let chunk = volume(&app, terrain).chunk_entity(IVec3::ONE).expect("a chunk");
    for (parent, x) in [(parents[0], 100.0), (parents[1], -300.0)] {
        app.world_mut().entity_mut(terrain).insert(ChildOf(parent));
        app.update();
        let place = app.world().get::<GlobalTransform>(chunk).expect("a chunk has a place").translation();
        assert_eq!(place, Vec3::new(x + 16.0, 16.0, 16.0));
        let hit = cast(&mut app, Vec3::new(x + 16.0, 16.0, 100.0), Vec3::new(x + 16.0, 16.0, 16.0), 1000.0);
        assert_eq!(hit.map(|hit| hit.terrain), Some(terrain));
    }
    app.world_mut().despawn(parents[0]);
    assert!(app.world().get_entity(terrain).is_ok());
    app.world_mut().despawn(parents[1]);
    app.update();
    app.update();
    assert_eq!(app.world_mut().query::<&Chunk>().iter(app.world()).count(), 0);
    assert_eq!(mesh_assets(&app), 0);
}
