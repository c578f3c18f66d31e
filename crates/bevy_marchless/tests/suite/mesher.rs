//! Terrains with the dual mesher: what is drawn, edited and hit, and changes from one mesher to the other.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_marchless::terrain::TerrainError;
use bevy_math::{DVec3, Dir3, Ray3d, UVec3, Vec3};
use marchless::MeshBuffer;

fn meshers() -> [TerrainMesher; 4] {
    let sharp = SharpMaterials::Only(vec![0, 4]);
    [
        TerrainMesher::Primal,
        DualMesher::default().into(),
        smoothed(5),
        DualMesher { smoothing: 2, sharp, crease: Some(20.0) }.into(),
    ]
}

fn smoothed(smoothing: u32) -> TerrainMesher {
    DualMesher { smoothing, ..DualMesher::default() }.into()
}

/// Waves in chunks of 8 cells, about as high as a border between layers of chunks.
fn waves() -> Terrain {
    let source = |[x, y, z]: [f64; 3]| y - 8.2 - 2.0 * (x * 0.3).sin() * (z * 0.25).cos();
    Terrain::new(source).with_extent(UVec3::new(5, 2, 5)).with_chunk_cells(8)
}

fn dig(terrain: Entity, x: f32, z: f32) -> Stamp {
    Stamp::dig(terrain, BrushShape::sphere(Vec3::new(x, 8.0, z), 2.5))
}

fn set_mesher(app: &mut App, terrain: Entity, mesher: &TerrainMesher) {
    app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain").mesher = mesher.clone();
}

/// Asserts that the drawn meshes are those of the newest samples with one mesher, and closed.
fn assert_mesher(app: &mut App, terrain: Entity, mesher: &TerrainMesher) {
    let drawn = geometry(app, terrain);
    let (grid, mut core) = (volume(app, terrain).grid().clone(), marchless::Mesher::new());
    for position in grid.bounds().expect("bounded").points() {
        let mut expected = MeshBuffer::new();
        grid.mesh_chunk(position, &mut core, mesher.method(0.0), &mut expected).expect("samples of a chunk");
        let found = drawn.iter().find(|(at, _)| at.to_array() == position);
        assert!(found.map(|(_, mesh)| (**mesh).clone()).unwrap_or_default() == expected, "{mesher:?}, {position:?}");
    }
    assert!(report(app, terrain).is_closed());
}

#[test]
fn digs_at_borders_show_in_all_chunks_that_read_them() {
    for mesher in meshers() {
        let mut app = app();
        let terrain = settled(&mut app, waves().with_mesher(mesher.clone()));
        assert_mesher(&mut app, terrain, &mesher);
        let mut stamps = Vec::new();
        for (x, z) in [(8.0, 8.0), (20.0, 16.0), (19.5, 27.0), (1.0, 20.0), (5.5, 5.5)] {
            stamps.push(dig(terrain, x, z));
            app.world_mut().write_message(*stamps.last().expect("one"));
            app.update();
            settle(&mut app, terrain);
            assert_mesher(&mut app, terrain, &mesher);
        }
        assert_as_new(&mut app, terrain, &stamps);
    }
}

#[test]
fn another_mesher_shows_in_one_update_and_digs_meanwhile_in_theirs() {
    let of = |number: usize| meshers()[number].clone();
    for (from, to) in [(0, 1), (1, 2), (2, 0), (0, 3), (3, 1)].map(|(from, to)| (of(from), of(to))) {
        let mut app = app_with_budget(2);
        let terrain = settled(&mut app, waves().with_mesher(from.clone()));
        let first = expected_geometry(&app, terrain);
        set_mesher(&mut app, terrain, &to);
        let (mut digs, mut changed) = (0, None);
        for update in 0..600 {
            if update % 5 == 2 && digs < 3 {
                app.world_mut().write_message(dig(terrain, 8.0 + 12.0 * digs as f32, 16.0));
                digs += 1;
            }
            app.update();
            assert!(report(&mut app, terrain).is_closed(), "{from:?} to {to:?}, update {update}");
            if changed.is_none() && volume(&app, terrain).is_settled() {
                changed = Some(update);
                break;
            }
        }
        assert!(changed.is_some() && digs == 3, "{digs} digs before it was shown");
        assert_mesher(&mut app, terrain, &to);
        assert_drawn(&mut app, terrain);
        assert!(first != expected_geometry(&app, terrain));
    }
}

#[test]
fn the_last_of_many_meshers_and_isovalues_is_shown() {
    let mut app = app_with_budget(2);
    let terrain = settled(&mut app, waves());
    for step in 0..30usize {
        let mut settings = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
        settings.mesher = meshers()[step % 4].clone();
        settings.isovalue = 0.1 * (step / 4) as f32;
        app.update();
        assert!(report(&mut app, terrain).is_closed(), "step {step}");
    }
    settle(&mut app, terrain);
    assert_drawn(&mut app, terrain);
}

/// The nearest triangle of all chunks' meshes that a ray crosses: distance and normal.
fn nearest(app: &mut App, terrain: Entity, origin: DVec3, direction: DVec3) -> Option<(f64, DVec3)> {
    let cells = f64::from(volume(app, terrain).grid().chunk_cells());
    let mut nearest: Option<(f64, DVec3)> = None;
    for (chunk, mesh) in geometry(app, terrain) {
        let corner = chunk.as_dvec3() * cells;
        for triangle in mesh.indices.chunks_exact(3) {
            let [a, b, c] =
                [0, 1, 2].map(|k| corner + DVec3::from(mesh.positions[triangle[k] as usize].map(f64::from)));
            let normal = (b - a).cross(c - a);
            let distance = (a - origin).dot(normal) / direction.dot(normal);
            let point = origin + direction * distance;
            let is_inside =
                [[a, b], [b, c], [c, a]].iter().all(|[p, q]| (*q - *p).cross(point - *p).dot(normal) >= 0.0);
            if distance >= 0.0 && is_inside && nearest.is_none_or(|(best, _)| distance < best) {
                nearest = Some((distance, normal.normalize()));
            }
        }
    }
    nearest
}

#[test]
fn rays_hit_the_triangles_that_are_drawn() {
    for mesher in meshers() {
        let mut app = app();
        let terrain = settled(&mut app, waves().with_mesher(mesher.clone()));
        app.world_mut().write_message(dig(terrain, 16.0, 16.0));
        app.world_mut().write_message(dig(terrain, 24.0, 13.0));
        app.update();
        settle(&mut app, terrain);
        let (mut random, mut hits, mut misses) = (fastrand::Rng::with_seed(5), 0, 0);
        for _ in 0..400 {
            let mut point = |size: f64| DVec3::from([0, 1, 2].map(|_| (random.f64() - 0.25) * size));
            let (origin, towards) = (point(60.0).as_vec3(), point(40.0).as_vec3());
            let ray = Ray3d::new(origin, Dir3::new(towards - origin).expect("two points"));
            let cast = move |terrains: TerrainQuery| terrains.ray_cast(ray, 200.0);
            let hit = app.world_mut().run_system_once(cast).expect("a system");
            let expected = nearest(&mut app, terrain, origin.as_dvec3(), ray.direction.as_dvec3().normalize());
            assert_eq!(hit.is_some(), expected.is_some(), "{mesher:?}, {ray:?}: {hit:?}, {expected:?}");
            let (Some(hit), Some((distance, normal))) = (hit, expected) else {
                misses += 1;
                continue;
            };
            hits += 1;
            assert!((f64::from(hit.distance) - distance).abs() < 1e-4, "{mesher:?}, {ray:?}: {hit:?}, {distance}");
            assert!(hit.normal.as_dvec3().dot(normal) > 0.9999, "{mesher:?}: {hit:?}, {normal}");
            let mesh = &app.world().get::<ChunkGeometry>(hit.chunk).expect("a chunk").mesh;
            let place = app.world().get::<Chunk>(hit.chunk).expect("a chunk").position.as_dvec3() * 8.0;
            let [min, max] = mesh.bounds.expect("not empty").map(|end| DVec3::from(end.map(f64::from)) + place);
            assert!(hit.lattice.cmpge(min - 1e-3).all() && hit.lattice.cmple(max + 1e-3).all(), "{hit:?}");
        }
        assert!(hits > 100 && misses > 50, "{hits} hits, {misses} misses");
    }
}

#[test]
fn walls_come_and_go_with_the_extent() {
    for mesher in meshers() {
        let mut app = app();
        let terrain = settled(&mut app, waves().with_mesher(mesher.clone()));
        for extent in [UVec3::new(3, 2, 4), UVec3::new(6, 3, 3), UVec3::new(5, 1, 5)] {
            app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain").extent = extent.into();
            app.update();
            settle(&mut app, terrain);
            assert_mesher(&mut app, terrain, &mesher);
        }
    }
}

fn error(app: &App, terrain: Entity) -> Option<TerrainError> {
    app.world().get::<TerrainError>(terrain).cloned()
}

#[test]
fn several_levels_and_too_much_smoothing_are_refused() {
    let mut app = app();
    let (dual, levels) = (smoothed(0), TerrainLevels::from(2));
    let refused = Some(TerrainError::DualLevels { levels: 2 });
    let both = app.world_mut().spawn(waves().with_mesher(dual.clone()).with_levels(2)).id();
    let [first_dual, first_levels] = [waves().with_mesher(dual.clone()), waves().with_levels(2)].map(|terrain| {
        let terrain = app.world_mut().spawn(terrain).id();
        settle(&mut app, terrain);
        terrain
    });
    assert_eq!(error(&app, both), refused);
    assert!(volume(&app, both).settings().is_none());

    app.world_mut().get_mut::<Terrain>(first_dual).expect("a terrain").levels = levels;
    set_mesher(&mut app, first_levels, &dual);
    app.update();
    for terrain in [first_dual, first_levels] {
        assert_eq!(error(&app, terrain), refused);
        settle(&mut app, terrain);
    }
    assert_mesher(&mut app, first_dual, &dual);
    assert_eq!(volume(&app, first_levels).settings().expect("the former ones").mesher, TerrainMesher::Primal);

    // Each becomes the other, at once.
    set_mesher(&mut app, first_dual, &TerrainMesher::Primal);
    app.world_mut().get_mut::<Terrain>(first_levels).expect("a terrain").levels = TerrainLevels::default();
    app.update();
    for terrain in [first_dual, first_levels] {
        assert_eq!(error(&app, terrain), None);
        settle(&mut app, terrain);
    }
    assert_mesher(&mut app, first_levels, &dual);
    let levels = volume(&app, first_dual).leaves().map(|leaf| leaf.level).max();
    assert_eq!(levels, Some(1), "coarser leaves are drawn");

    let with_creases =
        |smoothing, degrees| DualMesher { smoothing, crease: Some(degrees), ..DualMesher::default() }.into();
    for (mesher, expected) in [
        (smoothed(7), Some(TerrainError::Smoothing { found: 7, most: 6 })),
        (smoothed(6), None),
        (smoothed(u32::MAX), Some(TerrainError::Smoothing { found: u32::MAX, most: 8 })),
        (with_creases(6, 30.0), Some(TerrainError::Smoothing { found: 6, most: 5 })),
        (with_creases(0, 180.0), None),
        (with_creases(0, 181.0), Some(TerrainError::Crease { found: 181.0 })),
        (with_creases(0, -1.0), Some(TerrainError::Crease { found: -1.0 })),
    ] {
        set_mesher(&mut app, first_levels, &mesher);
        app.update();
        assert_eq!(error(&app, first_levels), expected);
    }
    set_mesher(&mut app, first_levels, &with_creases(0, f32::NAN));
    app.update();
    assert!(matches!(error(&app, first_levels), Some(TerrainError::Crease { .. })));
}

#[test]
fn fewer_cells_may_come_with_another_mesher() {
    let mut app = app();
    let terrain = settled(&mut app, waves());
    for (cells, mesher) in [(16, smoothed(8)), (8, smoothed(5)), (12, smoothed(8)), (8, TerrainMesher::Primal)] {
        let mut settings = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
        (settings.chunk_cells, settings.mesher) = (cells, mesher.clone());
        app.update();
        assert_eq!(error(&app, terrain), None);
        settle(&mut app, terrain);
        assert_mesher(&mut app, terrain, &mesher);
    }
}
