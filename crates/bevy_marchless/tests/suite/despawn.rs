//! Despawning a terrain leaks neither tasks nor assets.

use crate::common::*;
use bevy_marchless::prelude::*;
use bevy_math::UVec3;
use std::sync::Arc;

#[test]
fn despawning_a_terrain_frees_its_assets_and_entities() {
    let mut app = app();
    let count = |app: &mut bevy_app::App| app.world_mut().query::<&Chunk>().iter(app.world()).count();
    let terrain = settled(&mut app, ball());
    assert_eq!((mesh_assets(&app), count(&mut app)), (8, 8));
    app.world_mut().despawn(terrain);
    app.update();
    app.update();
    assert_eq!((mesh_assets(&app), count(&mut app)), (0, 0));
}

#[test]
fn despawning_a_terrain_ends_its_work() {
    let mut app = app();
    let (gate, alive) = (Gate::default(), Arc::new(()));
    let held = (gate.clone(), alive.clone());
    let source = move |[_, y, _]: [f64; 3]| {
        let (gate, _alive) = &held;
        gate.pass();
        y - 16.5
    };
    let terrain = app.world_mut().spawn(Terrain::new(source).with_extent(UVec3::splat(4)).with_chunk_cells(8)).id();
    update_until(&mut app, |_| gate.reached() > 0);
    app.world_mut().despawn(terrain);
    app.update();
    let reached = gate.reached();
    gate.open();
    update_until(&mut app, |_| Arc::strong_count(&alive) == 1);
    // Each thread finishes its current chunk; no other chunk is started.
    let begun = (gate.reached() - reached).div_ceil(8 * 8 * 8) + 1;
    assert!(begun <= 5, "{begun} of 64 chunks were sampled for nobody");
}

#[test]
fn replaced_meshes_are_freed() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    for size in [2.0, 3.0, 4.0] {
        let shape = BrushShape::sphere(bevy_math::Vec3::splat(16.0), size * 4.0);
        app.world_mut().write_message(Stamp::dig(terrain, shape));
        settle(&mut app, terrain);
    }
    app.update();
    assert_eq!(app.world_mut().query::<&bevy_mesh::Mesh3d>().iter(app.world()).count(), mesh_assets(&app));
    assert_eq!(mesh_assets(&app), 0, "all has been dug away");
}

#[test]
fn a_despawned_chunk_is_left_alone() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let chunk = volume(&app, terrain).chunk_entity(bevy_math::IVec3::ZERO).unwrap();
    app.world_mut().despawn(chunk);
    let shape = BrushShape::sphere(bevy_math::Vec3::splat(16.0), 14.0);
    app.world_mut().write_message(Stamp::dig(terrain, shape));
    settle(&mut app, terrain);
    assert_eq!(volume(&app, terrain).chunk_entity(bevy_math::IVec3::ZERO), None);
    assert_eq!(geometry(&mut app, terrain).len(), 7);
    assert!(geometry(&mut app, terrain).iter().all(|(_, mesh)| mesh.is_empty()));
}
