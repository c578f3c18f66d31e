//! Lengths convert between world units and voxels.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_math::{Quat, Vec3};
use bevy_transform::components::Transform;

/// A length in world units as voxels, and a length in voxels as world units.
fn lengths(app: &mut App, terrain: Entity, length: f32) -> [Option<f32>; 2] {
    let query = move |terrains: TerrainQuery| {
        [terrains.to_lattice_length(terrain, length), terrains.to_world_length(terrain, length)]
    };
    app.world_mut().run_system_once(query).unwrap()
}

fn spawn(app: &mut App, voxel_size: f32, scale: Vec3) -> Entity {
    let place = Transform::from_xyz(50.0, 0.0, 9.0).with_rotation(Quat::from_rotation_y(0.9)).with_scale(scale);
    let terrain = app.world_mut().spawn((ball().with_voxel_size(voxel_size), place)).id();
    settle(app, terrain);
    app.update();
    terrain
}

fn assert_near(found: [Option<f32>; 2], wanted: [f32; 2]) {
    for (found, wanted) in found.into_iter().zip(wanted) {
        let found = found.expect("a length");
        assert!((found - wanted).abs() <= 1e-5 * wanted.abs(), "{found}, {wanted}");
    }
}

#[test]
fn by_the_size_of_voxels_and_the_terrains_scale() {
    let mut app = app();
    let terrain = spawn(&mut app, 0.5, Vec3::splat(4.0));
    assert_near(lengths(&mut app, terrain, 2.0), [1.0, 4.0]);
    assert_near(lengths(&mut app, terrain, 0.0), [0.0, 0.0]);
    let mirrored = spawn(&mut app, 0.5, Vec3::new(-1.0, 1.0, 1.0));
    assert_near(lengths(&mut app, mirrored, 3.0), [6.0, 1.5]);
}

#[test]
fn by_the_volume_where_axes_differ() {
    let mut app = app();
    let terrain = spawn(&mut app, 1.0, Vec3::new(1.0, 2.0, 4.0));
    assert_near(lengths(&mut app, terrain, 3.0), [1.5, 6.0]);
}

#[test]
fn a_dig_of_two_world_units_reaches_so_far_down() {
    let mut app = app();
    let terrain = app.world_mut().spawn((ground().with_voxel_size(0.5), Transform::from_scale(Vec3::splat(0.5)))).id();
    settle(&mut app, terrain);
    app.update();
    let above = Vec3::new(4.1, 20.0, 4.1);
    let height = |app: &mut App| cast(app, above, Vec3::new(above.x, 0.0, above.z), 100.0).unwrap().position.y;
    let before = height(&mut app);
    let hit = cast(&mut app, above, Vec3::new(above.x, 0.0, above.z), 100.0).unwrap();
    let [radius, _] = lengths(&mut app, terrain, 2.0);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(hit.lattice, radius.unwrap())));
    app.update();
    settle(&mut app, terrain);
    assert!((before - height(&mut app) - 2.0).abs() < 0.1);
}

#[test]
fn none_where_there_is_no_length() {
    let mut app = app();
    let flat = spawn(&mut app, 1.0, Vec3::new(1.0, 0.0, 1.0));
    assert_eq!(lengths(&mut app, flat, 1.0), [None; 2]);
    let endless = spawn(&mut app, 1.0, Vec3::splat(f32::INFINITY));
    assert_eq!(lengths(&mut app, endless, 1.0), [None; 2]);
    let nowhere = spawn(&mut app, 1.0, Vec3::splat(f32::NAN));
    assert_eq!(lengths(&mut app, nowhere, 1.0), [None; 2]);
    let good = spawn(&mut app, 1.0, Vec3::ONE);
    assert_eq!(lengths(&mut app, good, f32::NAN), [None; 2]);
    assert_eq!(lengths(&mut app, good, f32::INFINITY), [None; 2]);
    let none = app.world_mut().spawn_empty().id();
    assert_eq!(lengths(&mut app, none, 1.0), [None; 2]);
}
