//! A single chunk may be hidden: edits leave it hidden, and rays still hit it.

use crate::common::*;
use bevy_camera::visibility::Visibility;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, Vec3};

#[test]
fn a_hidden_chunk_stays_hidden_and_is_hit() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let chunk = volume(&app, terrain).chunk_entity(IVec3::ZERO).expect("a chunk");
    app.world_mut().entity_mut(chunk).insert(Visibility::Hidden);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(8.0), 5.0)));
    app.update();
    settle(&mut app, terrain);
    assert_eq!(volume(&app, terrain).chunk_entity(IVec3::ZERO), Some(chunk));
    assert_eq!(app.world().get::<Visibility>(chunk), Some(&Visibility::Hidden));
    app.update();
    let hit = cast(&mut app, Vec3::ZERO, Vec3::splat(16.0), 100.0).expect("the ball");
    assert_eq!(hit.chunk, chunk);
}
