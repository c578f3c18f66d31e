//! Standalone samples get a mesh, and another after each change.

use crate::common::*;
use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::NoAutoAabb;
use bevy_ecs::prelude::*;
use bevy_marchless::mesh::ChunkSamples;
use bevy_marchless::prelude::*;
use bevy_math::{UVec3, Vec3};
use bevy_mesh::Mesh3d;

/// A plane at `height` in `size`³ samples.
fn plane(size: u32, height: f32) -> ChunkSamples {
    let distances: Vec<f32> = (0..size.pow(3)).map(|index| (index / size % size) as f32 - height).collect();
    ChunkSamples::from_distances(UVec3::splat(size), &distances).unwrap()
}

fn heights(app: &bevy_app::App, entity: Entity) -> Vec<f32> {
    let mesh = &app.world().get::<ChunkGeometry>(entity).unwrap().mesh;
    mesh.positions.iter().map(|position| Vec3::from(*position).y).collect()
}

#[test]
fn samples_by_hand_get_a_mesh_and_another_after_each_change() {
    let mut app = app();
    let entity = app.world_mut().spawn(plane(9, 3.5)).id();
    app.update();
    assert_eq!(heights(&app, entity), vec![3.5; 81]);
    let first = app.world().get::<Mesh3d>(entity).expect("something to draw").clone();

    app.world_mut().entity_mut(entity).insert(plane(9, 5.25));
    app.update();
    assert_eq!(heights(&app, entity), vec![5.25; 81]);
    assert_ne!(*app.world().get::<Mesh3d>(entity).unwrap(), first);

    app.world_mut().get_mut::<ChunkSamples>(entity).unwrap().isovalue = -0.5;
    app.update();
    assert_eq!(heights(&app, entity), vec![4.75; 81]);

    // The dual mesher has a vertex in each of the 8 × 8 cells.
    app.world_mut().get_mut::<ChunkSamples>(entity).unwrap().mesher =
        DualMesher { smoothing: 3, ..DualMesher::default() }.into();
    app.update();
    assert_eq!(heights(&app, entity), vec![4.75; 64]);

    app.world_mut().entity_mut(entity).insert(plane(9, 100.0));
    app.update();
    assert!(app.world().get::<Mesh3d>(entity).is_none(), "all is solid");

    app.world_mut().entity_mut(entity).insert(plane(9, 2.5)).remove::<ChunkSamples>();
    app.update();
    assert!(app.world().get::<ChunkGeometry>(entity).is_none());
}

#[test]
fn large_samples_are_meshed_in_tasks_and_the_newest_comes_last() {
    let mut app = app();
    app.insert_resource(MarchlessSettings { max_inline_chunks: 0, ..MarchlessSettings::default() });
    let entity = app.world_mut().spawn(plane(40, 3.5)).id();
    app.update();
    app.world_mut().entity_mut(entity).insert(plane(40, 5.5));
    update_until(&mut app, |app| heights(app, entity).first() == Some(&5.5));
    for _ in 0..5 {
        app.update();
        assert_eq!(heights(&app, entity).first(), Some(&5.5));
    }
    app.world_mut().despawn(entity);
    app.update();
    app.update();
    assert_eq!(mesh_assets(&app), 0);
}

#[test]
fn bad_samples_are_refused_in_a_sentence() {
    let error = ChunkSamples::new(UVec3::new(4, 4, 4), vec![0; 63]).unwrap_err().to_string();
    assert!(error.contains("64") && error.contains("63"), "{error}");
    let error = ChunkSamples::new(UVec3::new(4, 1, 4), vec![0; 16]).unwrap_err().to_string();
    assert!(error.contains("at least 2"), "{error}");
    let error = ChunkSamples::new(UVec3::splat(2), vec![0; 8]).unwrap().with_materials(vec![1; 7]).unwrap_err();
    assert!(error.to_string().contains('7'), "{error}");
    assert!(ChunkSamples::new(UVec3::MAX, vec![]).is_err());
    let mut app = app();
    let mut samples = plane(4, 1.5);
    samples.isovalue = f32::NAN;
    app.world_mut().spawn(samples);
    app.update();
}

#[test]
fn a_late_mesh_of_removed_samples_is_not_shown() {
    let mut app = app_with_budget(1);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let entity = app.world_mut().spawn(plane(9, 3.5)).id();
    // The first job has run, but its mesh has not been shown.
    app.update();
    app.world_mut().entity_mut(entity).remove::<ChunkSamples>();
    assert!(app.world().get::<Aabb>(entity).is_none() && app.world().get::<NoAutoAabb>(entity).is_none());
    app.world_mut().entity_mut(entity).insert(plane(9, 5.5));
    app.update();
    assert_eq!(heights(&app, entity), vec![], "neither the former mesh nor the new one yet");
    app.update();
    assert_eq!(heights(&app, entity), vec![5.5; 81]);
}

#[test]
fn any_number_of_inline_chunks_may_be_asked_for() {
    let mut app = app();
    app.insert_resource(MarchlessSettings { max_inline_chunks: usize::MAX, ..MarchlessSettings::default() });
    let entity = app.world_mut().spawn(plane(9, 3.5)).id();
    app.update();
    assert_eq!(heights(&app, entity), vec![3.5; 81]);
}
