//! A game's mistakes do not stop it, and lose nothing that was loaded.

use std::time::Duration;

use crate::common::stream::*;
use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_marchless::stream::LeafState;
use bevy_marchless::terrain::TerrainError;
use bevy_math::{IVec3, Quat, Vec3};
use bevy_transform::components::Transform;

fn patient_app() -> App {
    let mut app = app_with_budget(16);
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
    app
}

fn hills() -> Terrain {
    Terrain::endless(Hills::default()).with_chunk_cells(8)
}

/// A flight that has settled at the origin.
fn settled_flight() -> Flight {
    let mut flight = Flight::new(patient_app(), hills(), Transform::IDENTITY);
    flight.settle_and_compare();
    flight
}

/// Makes a change, checks that drawn chunks stay for some updates, undoes it, and checks that streaming continues.
fn nothing_is_lost_while<C: Component<Mutability = bevy_ecs::component::Mutable> + Clone>(
    flight: &mut Flight,
    entity: Entity,
    name: &str,
    change: impl Fn(&mut C),
) {
    let before = flight.drawn();
    let leaves = volume(&flight.app, flight.terrain).coverage();
    let good = flight.app.world().get::<C>(entity).expect("what is to be changed").clone();
    change(&mut flight.app.world_mut().get_mut::<C>(entity).unwrap());
    for _ in 0..20 {
        flight.app.update();
    }
    assert_eq!(flight.drawn(), before, "{name}");
    assert_eq!(volume(&flight.app, flight.terrain).coverage(), leaves, "{name}");
    // An edit there still works.
    let terrain = flight.terrain;
    flight.stamp(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(4.0, Hills::height(4.0, 4.0) as f32, 4.0), 3.0)));
    flight.app.update();
    *flight.app.world_mut().get_mut::<C>(entity).unwrap() = good;
    flight.settle_and_compare();
    let viewer = flight.viewers[0];
    flight.place(viewer, flight.position(viewer) + Vec3::new(0.7, 0.0, 0.2));
    flight.settle_and_compare();
}

#[test]
fn viewers_without_a_place() {
    let bad = [
        Vec3::NAN,
        Vec3::INFINITY,
        Vec3::NEG_INFINITY,
        Vec3::new(0.0, f32::NAN, 0.0),
        Vec3::new(f32::INFINITY, 0.0, 0.0),
    ];
    for place in bad {
        let mut flight = settled_flight();
        let viewer = flight.viewers[0];
        let name = format!("a viewer at {place}");
        nothing_is_lost_while::<Transform>(&mut flight, viewer, &name, |transform| transform.translation = place);
    }
}

/// The view direction only affects the order of loading.
#[test]
fn viewers_that_look_nowhere() {
    for bad in [
        Transform::from_scale(Vec3::ZERO),
        Transform::from_scale(Vec3::NAN),
        Transform::from_rotation(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)),
        Transform::from_rotation(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
    ] {
        let mut flight = settled_flight();
        let viewer = flight.viewers[0];
        nothing_is_lost_while::<Transform>(&mut flight, viewer, "a viewer that looks nowhere", |transform| {
            *transform = bad;
        });
    }
}

#[test]
fn viewers_with_bad_radii() {
    for radius in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
        for radii in [Vec3::splat(radius), Vec3::new(16.0, radius, 16.0)] {
            let mut flight = settled_flight();
            let viewer = flight.viewers[0];
            let name = format!("radii of {radii}");
            nothing_is_lost_while::<TerrainViewer>(&mut flight, viewer, &name, |viewer| viewer.radii = radii);
        }
    }
}

#[test]
fn viewers_with_bad_margins() {
    for bad in [f32::NAN, -5.0, f32::INFINITY, f32::MAX, f32::NEG_INFINITY] {
        let mut flight = settled_flight();
        let viewer = flight.viewers[0];
        let name = format!("a margin of {bad}");
        nothing_is_lost_while::<TerrainViewer>(&mut flight, viewer, &name, |viewer| viewer.margin = bad);
        let name = format!("samples within {bad}");
        nothing_is_lost_while::<TerrainViewer>(&mut flight, viewer, &name, |viewer| viewer.sample_radius = bad);
    }
}

#[test]
fn viewers_that_would_see_too_much() {
    for radius in [1e6, 1e30, f32::MAX, f32::INFINITY] {
        let mut flight = settled_flight();
        let viewer = flight.viewers[0];
        let good = *flight.app.world().get::<TerrainViewer>(viewer).unwrap();
        flight.app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_millis(2);
        let before = flight.drawn();
        flight.app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap().radii = Vec3::splat(radius);
        for _ in 0..30 {
            flight.app.update();
        }
        let coverage = volume(&flight.app, flight.terrain).coverage();
        let leaves = coverage.waiting + coverage.empty + coverage.drawn;
        let most = Terrain::MAX_CHUNKS as usize;
        assert!(leaves <= most + most / 4, "radius {radius}: {leaves} leaves");
        let now = flight.drawn();
        let stayed =
            before.iter().all(|(position, mesh)| now.iter().any(|(at, other)| at == position && mesh == other));
        assert!(stayed, "radius {radius}: what was drawn stays");
        if radius.is_finite() {
            assert!(leaves > most / 4, "radius {radius}: it is scaled down to {leaves} leaves");
        }
        *flight.app.world_mut().get_mut::<TerrainViewer>(viewer).unwrap() = good;
        flight.app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(5);
        flight.settle_and_compare();
    }
}

#[test]
fn terrains_without_a_place() {
    for bad in [
        Transform::from_scale(Vec3::ZERO),
        Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)),
        Transform::from_scale(Vec3::splat(f32::NAN)),
        Transform::from_translation(Vec3::NAN),
        Transform::from_translation(Vec3::INFINITY),
        Transform::from_scale(Vec3::splat(1e-38)),
    ] {
        let mut flight = settled_flight();
        let terrain = flight.terrain;
        let name = format!("a terrain at {bad:?}");
        nothing_is_lost_while::<Transform>(&mut flight, terrain, &name, |transform| *transform = bad);
    }
}

/// The function in which a source panics.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Panics {
    Fill,
    Bound,
    BoundClosely,
}

/// Hills that panic for regions with the point [`Bad::POINT`].
struct Bad(Hills, Panics);

impl Bad {
    const POINT: [i32; 3] = [20, 4, 4];

    fn check(&self, region: &SourceRegion, when: Panics) {
        let has = (0..3).all(|axis| {
            let offset = i64::from(Self::POINT[axis]) - i64::from(region.min[axis]);
            (0..i64::from(region.size[axis])).contains(&offset)
        });
        assert!(self.1 != when || !has, "on purpose");
    }
}

impl Source for Bad {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.check(region, Panics::Fill);
        self.0.fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        self.check(region, Panics::Bound);
        self.0.bound(region)
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.check(region, Panics::BoundClosely);
        self.0.bound_closely(region)
    }
}

#[test]
fn sources_that_panic_leave_out_a_chunk() {
    for threads in [false, true] {
        for when in [Panics::Fill, Panics::Bound, Panics::BoundClosely] {
            let mut app = if threads { app() } else { patient_app() };
            let terrain = app.world_mut().spawn(Terrain::endless(Bad(Hills::default(), when)).with_chunk_cells(8)).id();
            let viewer = app.world_mut().spawn(TerrainViewer::new(24.0).with_margin(0.0)).id();
            settle(&mut app, terrain);
            let mut fresh = Fresh::new(&hills());
            let view = View::all(&mut app, terrain)[0];
            let left_out = IVec3::from(Bad::POINT).div_euclid(IVec3::splat(8));
            for position in view.chunks(8, 0.0).into_iter().map(IVec3::from) {
                // Chunks beside it see air there, and bounds cover some points more.
                if (position - left_out).abs().max_element() <= 2 {
                    continue;
                }
                let expected = fresh.mesh(position.to_array());
                let entity = volume(&app, terrain).chunk_entity(position);
                assert_eq!(entity.is_none(), expected.is_empty(), "{when:?}: {position}");
                if let Some(entity) = entity {
                    assert_eq!(
                        *app.world().get::<ChunkGeometry>(entity).unwrap().mesh,
                        expected,
                        "{when:?}: {position}"
                    );
                }
            }
            let leaf = volume(&app, terrain).leaf_at(left_out).expect("it is in range");
            assert_ne!(leaf.state, LeafState::Waiting, "{when:?}");
            // The game continues, and this chunk can be edited.
            let shape = BrushShape::sphere(Vec3::from(Bad::POINT.map(|v| v as f32)), 3.0);
            app.world_mut().write_message(Stamp::add(terrain, shape, 1));
            settle(&mut app, terrain);
            assert!(volume(&app, terrain).grid().get(Bad::POINT).weight < 0, "{when:?}");
            app.world_mut().get_mut::<Transform>(viewer).unwrap().translation.x = -100.0;
            settle(&mut app, terrain);
            app.world_mut().get_mut::<Transform>(viewer).unwrap().translation.x = 8.0;
            settle(&mut app, terrain);
            assert!(volume(&app, terrain).grid().get(Bad::POINT).weight < 0, "{when:?}: the edit stays");
        }
    }
}

/// Some updates of a flight that has just begun.
fn flight_under_way(updates: u32) -> Flight {
    let mut flight = Flight::new(patient_app(), hills(), Transform::IDENTITY);
    let viewer = flight.viewers[0];
    for update in 0..updates {
        flight.place(viewer, Vec3::X * update as f32 * 0.2);
        flight.update();
    }
    flight
}

#[test]
fn terrains_and_viewers_despawned_in_flight() {
    for updates in [0, 1, 3, 10, 40] {
        for (terrain, viewer) in [(true, false), (false, true), (true, true)] {
            let mut flight = flight_under_way(updates);
            if terrain {
                flight.app.world_mut().despawn(flight.terrain);
            }
            if viewer {
                flight.app.world_mut().despawn(flight.viewers[0]);
            }
            for _ in 0..60 {
                flight.app.update();
            }
            let mut chunks = flight.app.world_mut().query::<&Chunk>();
            assert_eq!(chunks.iter(flight.app.world()).count(), 0, "after {updates} updates");
            assert_eq!(mesh_assets(&flight.app), 0);
            // The next terrain loads as usual.
            if terrain {
                let terrain = flight.app.world_mut().spawn(hills()).id();
                flight.app.world_mut().spawn(TerrainViewer::new(12.0));
                settle(&mut flight.app, terrain);
                assert!(volume(&flight.app, terrain).coverage().drawn > 0);
            }
        }
    }
}

/// Changes a terrain's settings on the way, and compares with a fresh terrain of the new settings.
fn changed_in_flight(change: impl Fn(&mut Terrain)) {
    for updates in [0, 1, 4, 40] {
        let mut flight = flight_under_way(updates);
        let terrain = flight.terrain;
        change(&mut flight.app.world_mut().get_mut::<Terrain>(terrain).unwrap());
        let settings = flight.app.world().get::<Terrain>(terrain).unwrap().clone();
        flight.fresh = Fresh::new(&settings);
        // The drawn chunks may go at once, or stay until the new meshes are there.
        for _ in 0..2_000 {
            flight.app.update();
            if volume(&flight.app, terrain).is_settled() {
                break;
            }
        }
        flight.forget_what_was_drawn();
        flight.settle_and_compare();
        let viewer = flight.viewers[0];
        flight.place(viewer, Vec3::new(-1.0, 0.0, 3.0));
        flight.settle_and_compare();
    }
}

#[test]
fn sources_replaced_in_flight() {
    changed_in_flight(|terrain| terrain.set_source(|[x, y, _]: [f64; 3]| y - 3.0 * (x * 0.2).sin()));
}

#[test]
fn extents_changed_in_flight() {
    changed_in_flight(|terrain| terrain.extent = Extent::ENDLESS.with_y(-1..1).with_z(-1..7));
    changed_in_flight(|terrain| terrain.extent = Extent::new(IVec3::new(2, -3, -3), IVec3::new(4, 3, 3)));
}

#[test]
fn chunks_of_another_size_in_flight() {
    changed_in_flight(|terrain| terrain.chunk_cells = 13);
    changed_in_flight(|terrain| terrain.voxel_size = 0.75);
}

#[test]
fn other_meshes_in_flight() {
    changed_in_flight(|terrain| terrain.isovalue = 0.75);
    changed_in_flight(|terrain| terrain.normals = false);
}

#[test]
fn what_is_kept_changed_in_flight() {
    changed_in_flight(|terrain| terrain.keep = Keep::Chunks(Extent::new(IVec3::new(8, -1, 0), IVec3::new(10, 2, 2))));
}

#[test]
fn refused_settings_in_flight_leave_what_was() {
    let mut flight = flight_under_way(20);
    let terrain = flight.terrain;
    let good = flight.app.world().get::<Terrain>(terrain).unwrap().clone();
    *flight.app.world_mut().get_mut::<Terrain>(terrain).unwrap() = good.clone().with_keep(Keep::Everything);
    for _ in 0..10 {
        flight.app.update();
    }
    assert!(flight.app.world().get::<TerrainError>(terrain).is_some(), "endless cannot be kept");
    *flight.app.world_mut().get_mut::<Terrain>(terrain).unwrap() = good;
    flight.settle_and_compare();
    assert!(flight.app.world().get::<TerrainError>(terrain).is_none());
}

/// A terrain ends where lattice positions end.
#[test]
fn viewers_at_the_end_of_the_lattice() {
    let end = 2.0f32.powi(31);
    let source = |[x, _, _]: [f64; 3]| (x * 0.1).sin();
    for place in [
        Vec3::new(end, 0.0, 0.0),
        Vec3::new(-end, 0.0, 0.0),
        Vec3::new(end, end, -end),
        Vec3::splat(end * 1.01),
        Vec3::splat(-1e12),
        Vec3::splat(f32::MAX),
        Vec3::splat(f32::MIN),
    ] {
        let mut app = patient_app();
        let terrain = app.world_mut().spawn(Terrain::endless(source).with_chunk_cells(32)).id();
        let viewer = app.world_mut().spawn((TerrainViewer::new(40.0), Transform::from_translation(place))).id();
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(place, 8.0)));
        settle(&mut app, terrain);
        for chunk in geometry(&mut app, terrain) {
            assert!(marchless::Grid::<i16>::largest(32).contains(chunk.0.to_array()));
        }
        app.world_mut().get_mut::<Transform>(viewer).unwrap().translation = Vec3::ZERO;
        settle(&mut app, terrain);
        assert!(volume(&app, terrain).coverage().drawn > 0, "back from {place}");
    }
}

/// Each viewer loads the nearby chunks of each terrain.
#[test]
fn many_terrains_and_viewers() {
    let mut app = patient_app();
    let terrains: Vec<_> = (0..10)
        .map(|index| app.world_mut().spawn((hills(), Transform::from_xyz(0.0, index as f32 * 40.0, 0.0))).id())
        .collect();
    for index in 0..10 {
        app.world_mut().spawn((TerrainViewer::new(8.0), Transform::from_xyz(0.0, index as f32 * 40.0, 0.0)));
    }
    for terrain in terrains {
        settle(&mut app, terrain);
        assert!(volume(&app, terrain).coverage().drawn > 0);
    }
}
