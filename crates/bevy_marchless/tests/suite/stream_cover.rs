//! The cover is whole in every update of a flight, and in the end the drawn chunks equal those of a fresh terrain.

use std::time::Duration;

use crate::common::stream::*;
use crate::common::*;
use bevy_app::App;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_marchless::stream::Coverage;
use bevy_math::{IVec3, Quat, Vec3};
use bevy_transform::components::Transform;
use proptest::prelude::*;

/// Endless hills, in chunks of 8 cells.
fn hills() -> Terrain {
    Terrain::endless(Hills::default()).with_chunk_cells(8)
}

/// An app without threads, with a fixed number of jobs per update, and as much time as it needs to load and unload.
fn patient_app(budget: usize) -> App {
    let mut app = app_with_budget(budget);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
    app
}

/// Flies all legs, and compares the drawn chunks in the end.
fn fly(mut flight: Flight, legs: impl IntoIterator<Item = Leg>) -> Flight {
    for leg in legs {
        flight.fly(&leg);
    }
    flight.settle_and_compare();
    flight
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, max_shrink_iters: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_cover_is_whole_in_every_update(legs in legs(8..32), budget in 1usize..24) {
        fly(Flight::new(patient_app(budget), hills(), Transform::IDENTITY), legs);
    }

    #[test]
    fn the_cover_is_whole_where_samples_are_dropped(legs in legs(8..24), sample_radius in 0f32..12.0) {
        let mut flight = Flight::new(patient_app(16), hills(), Transform::IDENTITY);
        flight.sample_radius = sample_radius;
        let first = flight.viewers[0];
        flight.app.world_mut().get_mut::<TerrainViewer>(first).unwrap().sample_radius = sample_radius;
        fly(flight, legs);
    }

    /// A new app that gets the same edits first draws the same.
    #[test]
    fn a_new_app_with_the_same_edits_draws_the_same(legs in legs(8..24)) {
        let mut flown = fly(Flight::new(patient_app(16), hills(), Transform::IDENTITY), legs);
        let mut new = Flight::new(patient_app(64), hills(), Transform::IDENTITY);
        new.app.world_mut().despawn(new.viewers[0]);
        new.app.update();
        for stamp in flown.stamps.clone() {
            new.stamp(Stamp { terrain: new.terrain, ..stamp });
        }
        for viewer in flown.viewers.clone() {
            let parts = (*flown.app.world().get::<TerrainViewer>(viewer).unwrap(), *flown.app.world().get::<Transform>(viewer).unwrap());
            new.app.world_mut().spawn(parts);
        }
        new.settle();
        let [flown, new] = [&mut flown, &mut new].map(Flight::drawn);
        for (position, mesh) in &new {
            let same = flown.iter().find(|(at, _)| at == position);
            prop_assert!(same.is_some_and(|(_, other)| other == mesh), "chunk {}", position);
        }
    }
}

/// The bounds of the hills that these tests use are true.
#[test]
fn the_bounds_of_the_hills_are_true() {
    let (hills, mut certain) = (Hills::default(), [0; 2]);
    for index in 0..600 {
        let spread = |factor: i32, range: i32| (index * factor).rem_euclid(range) - range / 2;
        let min = [spread(37, 211), spread(53, 151), spread(71, 193)];
        let size = [6, 10, 16, 24][index as usize % 4];
        let region = SourceRegion { min, size: [size; 3], level: 0, spacing: 1.0 };
        let (mut distances, mut materials) = (vec![0.0; region.len()], vec![0; region.len()]);
        for (bound, certain) in [hills.bound(&region), hills.bound_closely(&region)].into_iter().zip(&mut certain) {
            if bound == Bound::Mixed {
                continue;
            }
            *certain += 1;
            hills.fill(&region, &mut distances, &mut materials);
            let right = match bound {
                Bound::Outside => distances.iter().all(|distance| *distance >= 0.0),
                Bound::Inside { material } => {
                    distances.iter().all(|distance| *distance < 0.0) && materials.iter().all(|found| *found == material)
                }
                Bound::Mixed => true,
            };
            assert!(right, "{bound:?} of {region:?}");
        }
    }
    assert!(certain.into_iter().all(|regions| regions > 150), "{certain:?}");
}

#[test]
fn the_cover_is_whole_while_threads_work() {
    for seed in 1..=3 {
        println!("seed {seed}");
        let mut app = app();
        app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
        let mut flight = Flight::new(app, hills(), Transform::IDENTITY);
        flight.pause = Duration::from_micros(200);
        fly(flight, legs_of_seed(seed).take(60));
    }
}

/// With any time budget, each update does some work, and chunks that come into range are in the cover at once.
#[test]
fn the_cover_is_whole_with_hardly_any_time() {
    for seed in 4..=5 {
        println!("seed {seed}");
        let mut app = app_with_budget(8);
        app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::ZERO;
        let mut flight = Flight::new(app, hills(), Transform::IDENTITY);
        flight.lags = true;
        fly(flight, legs_of_seed(seed).take(40));
    }
}

#[test]
fn few_chunks_in_flight_and_few_bytes_an_update_only_take_longer() {
    println!("seed 6");
    let mut app = patient_app(8);
    let mut settings = app.world_mut().resource_mut::<MarchlessSettings>();
    (settings.max_chunks_in_flight, settings.max_upload_bytes, settings.max_inline_chunks) = (1, 1, 1);
    fly(Flight::new(app, hills(), Transform::IDENTITY), legs_of_seed(6).take(30));
}

/// Radii are in voxels along the terrain's own axes, for any transform of the terrain.
#[test]
fn the_cover_of_a_terrain_that_is_moved_turned_and_scaled() {
    println!("seed 7");
    let terrain = hills().with_chunk_cells(16).with_voxel_size(0.5);
    let place = Transform {
        translation: Vec3::new(100.0, -3.0, 7.5),
        rotation: Quat::from_rotation_y(1.1),
        scale: Vec3::splat(2.0),
    };
    // Far away, `f32` is too coarse for rotated positions.
    let mut flight = Flight::new(patient_app(8), terrain, place);
    flight.area = 10.0;
    fly(flight, legs_of_seed(7).take(40));
}

#[test]
fn a_terrain_with_borders_that_keeps_some_chunks() {
    println!("seed 8");
    let extent = Extent::ENDLESS.with_y(-2..2).with_x(-6..5);
    let kept = Extent::new(IVec3::new(-1, -1, -1), IVec3::new(2, 4, 1));
    let terrain = hills().with_extent(extent).with_keep(Keep::Chunks(kept));
    let flight = fly(Flight::new(patient_app(8), terrain, Transform::IDENTITY), legs_of_seed(8).take(60));
    let volume = volume(&flight.app, flight.terrain);
    assert!(volume.leaf_at(IVec3::new(1, 1, 0)).is_some(), "it is kept");
    assert!(volume.leaf_at(IVec3::new(1, 2, 0)).is_none(), "there is no such chunk");
}

#[test]
fn without_viewers_nothing_is_loaded_and_after_them_nothing_is_left() {
    let mut flight = Flight::new(patient_app(16), hills(), Transform::IDENTITY);
    flight.settle_and_compare();
    let mesh_assets_before = mesh_assets(&flight.app);
    assert!(mesh_assets_before > 0);
    flight.app.world_mut().despawn(flight.viewers.remove(0));
    flight.settle();
    flight.update();
    let volume = volume(&flight.app, flight.terrain);
    assert_eq!(volume.coverage(), Coverage::default());
    assert_eq!(volume.grid().chunks().count(), 0, "no samples are left");
    assert_eq!(mesh_assets(&flight.app), 0);
    let mut entities = flight.app.world_mut().query::<&Chunk>();
    assert_eq!(entities.iter(flight.app.world()).count(), 0);
}

/// A viewer spawned far away loads nothing around the origin before its place is known.
#[test]
fn a_viewer_loads_where_it_is_from_its_first_update_on() {
    let mut flight = Flight::new(patient_app(16), hills(), Transform::IDENTITY);
    let first = flight.viewers.remove(0);
    flight.app.world_mut().despawn(first);
    flight.spawn(Vec3::new(50.0, 0.0, 50.0), Vec3::splat(2.0), 0.0);
    for _ in 0..30 {
        flight.update();
        assert!(volume(&flight.app, flight.terrain).leaf_at(IVec3::ZERO).is_none());
    }
    flight.settle_and_compare();
}
