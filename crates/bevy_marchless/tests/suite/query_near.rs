//! Terrains that a ray does not come near are skipped, and no hit is lost.

use std::cell::Cell;

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::{RunSystemOnce as _, SystemState};
use bevy_marchless::prelude::*;
use bevy_math::{Affine3A, Dir3, IVec3, Mat3, Ray3d, Vec3};
use bevy_transform::components::{GlobalTransform, Transform};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Random transforms, including shearing, mirrored, flat and huge ones.
fn place() -> impl Strategy<Value = Affine3A> {
    let column = || [-1.5f32..1.5, -1.5f32..1.5, -1.5f32..1.5];
    let scale = prop_oneof![6 => 0.2f32..4.0, 1 => Just(1e-3), 1 => Just(500.0), 1 => Just(-1.0), 1 => Just(0.0)];
    let far =
        prop_oneof![6 => Just(1.0f32), 1 => Just(1e4), 1 => Just(1e6), 1 => Just(f32::INFINITY), 1 => Just(f32::NAN)];
    let at = [-60.0f32..60.0, -60.0f32..60.0, -60.0f32..60.0];
    (column(), column(), column(), scale, at, far).prop_map(|(x, y, z, scale, at, far)| {
        let matrix = Mat3::from_cols_array_2d(&[x, y, z].map(|column| column.map(|v| v * scale)));
        Affine3A::from_mat3_translation(matrix, Vec3::from(at) * far)
    })
}

/// The index of a terrain, a target in it in voxels, the distance from it, the direction, and the ray's length.
fn aim() -> impl Strategy<Value = (usize, [f32; 3], f32, [f32; 3], f32)> {
    let near = || prop_oneof![3 => 4.0f32..28.0, 1 => -40.0f32..50.0];
    let within = [near(), near(), near()];
    let away = prop_oneof![Just(0.0f32), 1.0f32..100.0, Just(1e5)];
    let towards = [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0];
    let length =
        prop_oneof![3 => Just(f32::INFINITY), 3 => 0.0f32..200.0, 1 => Just(0.0), 1 => Just(-1.0), 1 => Just(f32::NAN)];
    (0..4usize, within, away, towards, length)
}

/// Four terrains: a ball, a ball at negative positions, ground, and endless waves.
fn terrains(app: &mut App) -> [Entity; 4] {
    let negative = Terrain::new(|p: [f64; 3]| p.map(|v| (v + 16.0) * (v + 16.0)).iter().sum::<f64>().sqrt() - 12.0)
        .with_extent(Extent::new(IVec3::splat(-2), IVec3::ZERO))
        .with_chunk_cells(16);
    let all =
        [ball().with_voxel_size(0.5), negative, ground(), world()].map(|terrain| app.world_mut().spawn(terrain).id());
    app.world_mut().spawn((TerrainViewer::new(32.0), Transform::default()));
    all.iter().for_each(|terrain| settle(app, *terrain));
    all
}

#[test]
fn the_hits_are_those_of_each_terrain_by_itself() {
    let mut app = app();
    let all = terrains(&mut app);
    let world = app.world_mut();
    let mut state = SystemState::<TerrainQuery>::new(world);
    let world = std::cell::RefCell::new(world);
    let (hits, passed) = (Cell::new(0), Cell::new(0));
    let mut runner = TestRunner::new_with_rng(
        Config { cases: 4_000, failure_persistence: None, ..Config::default() },
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let state = std::cell::RefCell::new(&mut state);
    let cases = ([place(), place(), place(), place()], aim());
    let result = runner.run(&cases, |(places, (target, within, away, towards, length))| {
        let world = &mut **world.borrow_mut();
        for (terrain, place) in all.iter().zip(places) {
            world.entity_mut(*terrain).insert(GlobalTransform::from(place));
        }
        let Ok(direction) = Dir3::new(Vec3::from(towards)) else { return Ok(()) };
        let (scale, offset) = [(0.5, 0.0), (1.0, -32.0), (1.0, 0.0), (1.0, -16.0)][target];
        let origin = places[target].transform_point3(Vec3::from(within) * scale + offset) - direction * away;
        let ray = Ray3d::new(origin, direction);
        let mut state = state.borrow_mut();
        let terrains = state.get(world).expect("it reads what is there");
        let near = Cell::new(0);
        let found = terrains.ray_cast_where(ray, length, |_| {
            near.set(near.get() + 1);
            true
        });
        let one_by_one = all.iter().filter_map(|terrain| terrains.ray_cast_terrain(*terrain, ray, length));
        let nearest = one_by_one.map(|hit| hit.distance).min_by(f32::total_cmp);
        prop_assert_eq!(found.map(|hit| hit.distance), nearest);
        hits.set(hits.get() + u32::from(found.is_some()));
        passed.set(passed.get() + 4 - near.get());
        Ok(())
    });
    result.unwrap();
    assert!(hits.get() > 500, "only {} rays hit something", hits.get());
    assert!(passed.get() > 4_000, "only {} terrains were passed over", passed.get());
}

#[test]
fn a_filter_is_asked_only_about_terrains_near_the_ray() {
    let mut app = app();
    let near = settled(&mut app, ball());
    let beside = app.world_mut().spawn((ball(), Transform::from_xyz(100.0, 0.0, 0.0))).id();
    settle(&mut app, beside);
    app.update();
    let ray = Ray3d::new(Vec3::new(16.0, 16.0, 100.0), Dir3::NEG_Z);
    let asked = app.world_mut().run_system_once(move |terrains: TerrainQuery| {
        let asked = Cell::new(Vec::new());
        terrains.ray_cast_where(ray, 1000.0, |terrain| {
            asked.set([asked.take(), vec![terrain]].concat());
            true
        });
        asked.into_inner()
    });
    assert_eq!(asked.unwrap(), [near]);
}
