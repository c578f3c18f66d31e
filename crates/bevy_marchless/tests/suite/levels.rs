//! Terrains with several levels of detail: closed in every update, and edits and rays at every level.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_marchless::stream::LeafState;
use bevy_marchless::terrain::TerrainError;
use bevy_math::{DVec3, Dir3, IVec3, Ray3d, Vec3};
use bevy_platform::collections::HashSet;
use bevy_transform::components::Transform;
use fastrand::Rng;
use marchless::MeshBuffer;

use crate::common::stream::Hills;
use crate::common::*;

const CELLS: i32 = 8;

/// Hills of 32 × 12 × 32 chunks, all of which are kept, with four levels.
fn terrain() -> Terrain {
    let extent = Extent { min: IVec3::new(-16, -6, -16), max: IVec3::new(16, 6, 16) };
    let levels = TerrainLevels { falloff: 2.0, hysteresis: 0.0, ..4.into() };
    Terrain::new(Hills::default()).with_extent(extent).with_chunk_cells(CELLS as u32).with_levels(levels)
}

fn viewer(app: &mut App, place: Vec3) -> Entity {
    app.world_mut().spawn((TerrainViewer::new(300.0), Transform::from_translation(place))).id()
}

/// The meshes that are drawn, by level and position.
fn meshes(app: &mut App) -> BTreeMap<(u8, [i32; 3]), Arc<MeshBuffer>> {
    let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry)>();
    let drawn = chunks.iter(app.world()).filter(|(_, geometry)| !geometry.mesh.is_empty());
    drawn.map(|(chunk, geometry)| ((chunk.level, chunk.position.to_array()), geometry.mesh.clone())).collect()
}

/// Checks that all meshes form one closed surface, bit for bit, and that none is drawn where another is.
fn check_closed(app: &mut App, terrain: Entity) {
    let mut edges = HashSet::<[[i64; 3]; 2]>::default();
    for ((level, position), mesh) in meshes(app) {
        let leaf = volume(app, terrain).leaf_at(IVec3::from(position) * (1 << level)).expect("it is in the cover");
        assert_eq!((leaf.level, leaf.position), (level, position.into()), "each place is drawn once");
        let size = f64::from(1 << level);
        let point = |index: u32| {
            let point = mesh.positions[index as usize];
            // Crossings lie at multiples of 2⁻¹⁴ voxels.
            [0, 1, 2].map(|axis| {
                let at = f64::from(position[axis] * CELLS) + f64::from(point[axis]);
                (at * size * f64::from(1 << 14)) as i64
            })
        };
        for triangle in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|corner| point(triangle[corner]));
            for [from, to] in [[a, b], [b, c], [c, a]] {
                if !edges.remove(&[to, from]) {
                    assert!(edges.insert([from, to]), "an edge twice in a leaf of level {level} at {position:?}");
                }
            }
        }
    }
    assert!(edges.is_empty(), "{} open edges, one at {:?}", edges.len(), edges.iter().next());
}

/// Whether every chunk of the coarsest level has come.
fn whole(app: &App, terrain: Entity) -> bool {
    let steps = || (-16..16).step_by(8);
    let mut all = steps().flat_map(|z| steps().flat_map(move |x| [-6, 0].map(|y| IVec3::new(x, y, z))));
    all.all(|chunk| volume(app, terrain).leaf_at(chunk).is_some_and(|leaf| leaf.state != LeafState::Waiting))
}

/// A ball on the ground, or near it.
fn stamp(random: &mut Rng, terrain: Entity) -> Stamp {
    let place = |random: &mut Rng| (random.f64() - 0.5) * 220.0;
    let (x, z) = (place(random), place(random));
    let middle = DVec3::new(x, Hills::height(x, z) + (random.f64() - 0.4) * 24.0, z);
    let ball = BrushShape::sphere(middle, 1.5 + 8.0 * random.f32() * random.f32());
    if random.bool() { Stamp::dig(terrain, ball) } else { Stamp::add(terrain, ball, 3) }
}

/// Says in which update of which flight a check has failed.
struct When {
    seed: u64,
    update: u32,
}

impl Drop for When {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("in update {} of the flight with seed {}", self.update, self.seed);
        }
    }
}

/// Two viewers that fly, jump, and dig near and far.
fn fly(mut app: App, updates: u32, seed: u64) {
    let mut random = Rng::with_seed(seed);
    let mut when = When { seed, update: 0 };
    let ground = app.world_mut().spawn(terrain()).id();
    let viewers = [Vec3::new(-60.0, 10.0, 20.0), Vec3::new(70.0, 12.0, -50.0)].map(|place| viewer(&mut app, place));
    let mut stamps = Vec::new();
    // At first, chunks of the coarsest level come one by one.
    update_until(&mut app, |app| whole(app, ground));
    for update in 0..updates {
        when.update = update;
        for viewer in viewers {
            let mut transform = app.world_mut().get_mut::<Transform>(viewer).expect("it is there");
            let place = match random.u32(0..60) {
                0 => Vec3::new(random.f32() - 0.5, 0.1 * random.f32(), random.f32() - 0.5) * 260.0,
                _ => transform.translation + Vec3::new(random.f32() - 0.4, 0.0, random.f32() - 0.5) * 12.0,
            };
            transform.translation = place.clamp(Vec3::splat(-128.0), Vec3::splat(128.0));
        }
        if random.u32(0..3) == 0 {
            let stamp = stamp(&mut random, ground);
            stamps.push(stamp);
            app.world_mut().write_message(stamp);
        }
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        check_closed(&mut app, ground);
    }
    settle(&mut app, ground);
    check_closed(&mut app, ground);
    assert!(meshes(&mut app).keys().map(|(level, _)| *level).collect::<HashSet<_>>().len() > 2, "several levels");

    // A terrain that was never seen otherwise.
    let mut fresh = app_with_budget(64);
    let same = fresh.world_mut().spawn(terrain()).id();
    fresh.update();
    for mut stamp in stamps {
        stamp.terrain = same;
        fresh.world_mut().write_message(stamp);
        fresh.update();
    }
    for place in viewers.map(|old| *app.world().get::<Transform>(old).expect("it is there")) {
        viewer(&mut fresh, place.translation);
    }
    settle(&mut fresh, same);
    let (found, expected) = (meshes(&mut app), meshes(&mut fresh));
    assert!(found.keys().eq(expected.keys()), "the same leaves");
    for (leaf, mesh) in found {
        assert!(mesh == expected[&leaf], "the mesh of {leaf:?}");
    }
}

#[test]
fn the_surface_is_closed_in_every_update() {
    fly(app(), 240, 1);
}

#[test]
fn the_surface_is_closed_without_threads() {
    fly(app_with_budget(24), 240, 2);
}

/// Run it with `cargo test --release -p bevy_marchless --test suite levels -- --ignored --nocapture`.
#[test]
#[ignore = "takes an hour"]
fn long_flights_are_closed() {
    for seed in 0..50 {
        fly(app(), 2_000, seed);
        println!("flight {seed} is closed");
    }
}

/// Small stamps show in the update that reads them, at every level, also where there was nothing but air.
#[test]
fn edits_show_at_every_level_in_the_same_update() {
    let mut app = app();
    // Small chunks: a ball lies in many of them.
    app.insert_resource(MarchlessSettings { max_inline_chunks: 64, ..MarchlessSettings::default() });
    let ground = settled(&mut app, terrain());
    viewer(&mut app, Vec3::new(-120.0, 4.0, -120.0));
    for _ in 0..5 {
        app.update();
    }
    settle(&mut app, ground);
    let mut levels = HashSet::<u8>::default();
    check_closed(&mut app, ground);
    for step in 0..12 {
        let along = f64::from(-114 + 20 * step);
        for above in [0.0, 24.0] {
            let middle = DVec3::new(along, Hills::height(along, along) + above, along);
            let before = meshes(&mut app);
            let shown = app.world().resource::<TerrainStats>().edits_shown;
            let ball = BrushShape::sphere(middle, 4.0);
            let stamp = if above > 0.0 { Stamp::add(ground, ball, 2) } else { Stamp::dig(ground, ball) };
            app.world_mut().write_message(stamp);
            app.update();
            let stats = *app.world().resource::<TerrainStats>();
            if above == 0.0 {
                assert_eq!((stats.edits_shown, stats.edit_updates_last), (shown + 1, 0), "at {middle}");
            }
            check_closed(&mut app, ground);
            let after = meshes(&mut app);
            let chunk = (middle / f64::from(CELLS)).floor().as_ivec3();
            let leaf = volume(&app, ground).leaf_at(chunk).expect("it is in range");
            let key = (leaf.level, leaf.position.to_array());
            let is_other = match (before.get(&key), after.get(&key)) {
                (Some(before), Some(after)) => !Arc::ptr_eq(before, after),
                (before, after) => before.is_some() != after.is_some(),
            };
            // A ball may be too small for the coarsest leaves.
            assert!(is_other || leaf.level > 2, "{leaf:?} at {middle}");
            levels.insert(leaf.level);
        }
    }
    assert!(levels.len() >= 3, "{levels:?}");
}

#[test]
fn rays_hit_what_is_drawn_at_its_level() {
    let mut app = app();
    let ground = settled(&mut app, terrain().with_voxel_size(0.5));
    app.world_mut().get_mut::<Transform>(ground).expect("it is there").rotate_x(0.3);
    viewer(&mut app, Vec3::new(-50.0, 4.0, -50.0));
    for _ in 0..5 {
        app.update();
    }
    settle(&mut app, ground);
    let to_world = *app.world().get::<bevy_transform::components::GlobalTransform>(ground).expect("it is there");
    let triangles: Vec<(u8, [Vec3; 3])> = meshes(&mut app)
        .into_iter()
        .flat_map(|((level, position), mesh)| {
            let size = 0.5 * f32::from(1u8 << level);
            let point = move |index: u32, mesh: &MeshBuffer| {
                let local = Vec3::from(mesh.positions[index as usize]) + IVec3::from(position).as_vec3() * CELLS as f32;
                to_world.transform_point(local * size)
            };
            let all = mesh.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|corner| point(t[corner], &mesh)));
            all.map(|triangle| (level, triangle)).collect::<Vec<_>>()
        })
        .collect();
    let mut random = Rng::with_seed(7);
    let mut hits = [0; 4];
    for _ in 0..400 {
        let number = |random: &mut Rng| random.f32() - 0.5;
        let origin = Vec3::new(number(&mut random) * 140.0, 30.0 + 10.0 * random.f32(), number(&mut random) * 140.0);
        let direction = Vec3::new(number(&mut random), -0.1 - random.f32(), number(&mut random));
        let ray = Ray3d::new(origin, Dir3::new(direction).expect("it has a length"));
        let found = app.world_mut().run_system_once(move |query: TerrainQuery| query.ray_cast(ray, 500.0));
        let found = found.expect("the system runs");
        let distance = |(level, triangle): &(u8, [Vec3; 3])| Some((distance(&ray, triangle)?, *level));
        let expected = triangles.iter().filter_map(distance).min_by(|(a, _), (b, _)| a.total_cmp(b));
        match (found, expected) {
            (Some(found), Some((distance, level))) => {
                assert!(
                    (found.distance - distance).abs() < 0.01,
                    "{} instead of {distance} at level {level}: {found:?}",
                    found.distance
                );
                hits[usize::from(found.level)] += 1;
                assert!(found.level == level || (found.distance - distance).abs() < 1e-3);
            }
            (found, expected) => assert_eq!(found.map(|hit| hit.distance), expected.map(|(distance, _)| distance)),
        }
    }
    assert!(hits[..3].iter().all(|&hits| hits > 5), "{hits:?}");
}

/// Where a ray meets a triangle.
fn distance(ray: &Ray3d, [a, b, c]: &[Vec3; 3]) -> Option<f32> {
    let [a, b, c, from, along] = [*a, *b, *c, ray.origin, *ray.direction].map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    let distance = (a - from).dot(normal) / along.dot(normal);
    let at = from + along * distance;
    let is_within = [[a, b], [b, c], [c, a]]
        .iter()
        .all(|[p, q]| (*q - *p).cross(at - *p).dot(normal) >= -1e-9 * normal.length_squared());
    (distance >= 0.0 && is_within).then_some(distance as f32)
}

/// What changes the look or the settings of a drawn terrain ends as if it had always been so.
#[test]
fn settings_change_as_with_one_level() {
    type Change = fn(&mut Terrain);
    let changes: [Change; 7] = [
        |terrain| terrain.isovalue = 1.5,
        |terrain| terrain.normals = false,
        |terrain| terrain.palette = Palette::new([bevy_color::Color::BLACK]),
        |terrain| terrain.extent.max.x = 9,
        |terrain| terrain.levels.count = 1,
        |terrain| terrain.levels = TerrainLevels { falloff: 1.75, hysteresis: 0.0, ..3.into() },
        |terrain| terrain.set_source(|[x, y, z]: [f64; 3]| y - 4.0 * (x * 0.1).sin() * (z * 0.1).cos()),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut app = app();
        let ground = settled(&mut app, terrain());
        let seen_from = Vec3::new(-50.0, 4.0, -50.0);
        viewer(&mut app, seen_from);
        for _ in 0..20 {
            app.update();
        }
        let mut settings = terrain();
        change(&mut settings);
        change(&mut app.world_mut().get_mut::<Terrain>(ground).expect("it is there"));
        for _ in 0..3 {
            app.update();
        }
        settle(&mut app, ground);
        check_closed(&mut app, ground);

        let mut fresh = app_with_budget(64);
        let same = settled(&mut fresh, settings);
        viewer(&mut fresh, seen_from);
        for _ in 0..3 {
            fresh.update();
        }
        settle(&mut fresh, same);
        let (found, expected) = (meshes(&mut app), meshes(&mut fresh));
        assert!(found == expected, "change {number}: {} and {} meshes", found.len(), expected.len());
    }
}

#[test]
fn bad_levels_are_refused() {
    let good = TerrainLevels::default();
    let error = |levels: TerrainLevels| terrain().with_levels(levels).check().expect_err("they are bad");
    for count in [0, 8] {
        assert_eq!(error(count.into()), TerrainError::Levels { found: count });
    }
    assert!(matches!(error(TerrainLevels { falloff: f32::NAN, ..good }), TerrainError::Falloff { .. }));
    assert!(matches!(error(TerrainLevels { falloff: 1.0, ..good }), TerrainError::Falloff { .. }));
    assert!(matches!(error(TerrainLevels { hysteresis: -0.1, ..good }), TerrainError::Hysteresis { .. }));
    assert_eq!(error(8.into()).to_string(), "a terrain must have 1 to 7 levels of detail, but `levels.count` is 8");
}

/// A viewer that sees farther than any cover may reach is reported; what is drawn stays.
#[test]
fn views_that_are_too_large_change_nothing() {
    let mut app = app();
    let ground = app.world_mut().spawn(Terrain::endless(Hills::default()).with_chunk_cells(8).with_levels(2)).id();
    let eye = viewer(&mut app, Vec3::ZERO);
    app.world_mut().get_mut::<TerrainViewer>(eye).expect("it is there").radii = Vec3::splat(100.0);
    for _ in 0..3 {
        app.update();
    }
    settle(&mut app, ground);
    let before = meshes(&mut app).len();
    app.world_mut().get_mut::<TerrainViewer>(eye).expect("it is there").radii = Vec3::splat(1e9);
    for _ in 0..30 {
        app.update();
    }
    assert!(before > 20 && meshes(&mut app).len() == before);
}
