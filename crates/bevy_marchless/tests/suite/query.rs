//! Queries hit the meshes that are drawn.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_math::{DVec3, Quat, Vec3};
use bevy_transform::components::Transform;

#[test]
fn a_ray_hits_a_moved_turned_and_scaled_terrain() {
    let mut app = app();
    let transform = Transform::from_xyz(100.0, 50.0, -20.0)
        .with_rotation(Quat::from_euler(bevy_math::EulerRot::XYZ, 0.3, 1.0, -0.4))
        .with_scale(Vec3::splat(2.0));
    let source = |p: [f64; 3]| p.map(|v| (v - 8.0) * (v - 8.0)).iter().sum::<f64>().sqrt() - 6.0;
    let terrain = app.world_mut().spawn((small(Terrain::new(source)).with_voxel_size(0.5), transform)).id();
    settle(&mut app, terrain);
    app.update();
    // The ball's radius: 12 voxels of 0.5 units, scaled by 2.
    let middle = transform.transform_point(Vec3::splat(8.0));
    for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(1.0, 2.0, -3.0).normalize()] {
        let origin = middle + direction * 50.0;
        let hit = cast(&mut app, origin, middle, 100.0).expect("the ball is in the way");
        assert_eq!(hit.terrain, terrain);
        assert!((hit.distance - 38.0).abs() < 0.1, "{hit:?}");
        assert!((hit.position - (middle + direction * 12.0)).length() < 0.1, "{hit:?}");
        assert!(hit.normal.dot(direction) > 0.95, "{hit:?}");
        assert!((hit.lattice.distance(DVec3::splat(16.0)) - 12.0).abs() < 0.1, "{hit:?}");
        let chunk = app.world().get::<Chunk>(hit.chunk).expect("a chunk's entity");
        assert_eq!(chunk.position, (hit.lattice / 16.0).floor().as_ivec3());
        assert!(cast(&mut app, origin, middle, 37.0).is_none(), "too far away");
    }
    let world = app.world_mut();
    let outside = middle + Vec3::X * 14.0;
    let weights = world.run_system_once(move |terrains: TerrainQuery| {
        let lattice = terrains.to_lattice(terrain, outside)?;
        let back = terrains.to_world(terrain, lattice)?;
        assert!(back.distance(outside) < 1e-3);
        Some([terrains.weight_at(terrain, middle)?, terrains.weight_at(terrain, outside)?])
    });
    let [inside, outside] = weights.unwrap().expect("filled");
    assert!((inside + 12.0).abs() < 0.7, "{inside}");
    assert!((outside - 2.0).abs() < 0.1, "{outside}");
}

#[test]
fn the_nearest_of_several_terrains_is_hit() {
    let mut app = app();
    let far = app.world_mut().spawn((ball(), Transform::from_xyz(0.0, 0.0, -100.0))).id();
    let near = settled(&mut app, ball());
    settle(&mut app, far);
    app.update();
    let hit = cast(&mut app, Vec3::new(16.0, 16.0, 100.0), Vec3::splat(16.0), 1000.0).unwrap();
    assert_eq!(hit.terrain, near);
    let hit = cast(&mut app, Vec3::new(16.0, 16.0, -200.0), Vec3::splat(16.0), 1000.0).unwrap();
    assert_eq!(hit.terrain, far);
}

#[test]
fn rays_hit_what_is_drawn_not_what_will_be() {
    let mut app = app_with_budget(1);
    app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = 0;
    let terrain = settled(&mut app, ground());
    let height = |app: &mut App| {
        let hit = cast(app, Vec3::new(15.3, 40.0, 15.6), Vec3::new(15.3, 0.0, 15.6), 100.0).expect("ground");
        hit.position.y
    };
    assert!((height(&mut app) - 16.5).abs() < 0.01);
    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(16.0), 5.0)));
    let before = geometry(&mut app, terrain);
    while geometry(&mut app, terrain) == before {
        assert!((height(&mut app) - 16.5).abs() < 0.01, "not shown yet");
        app.update();
    }
    assert!((height(&mut app) - 11.0).abs() < 0.3, "shown");

    app.world_mut().get_mut::<Terrain>(terrain).unwrap().set_source(|[_, y, _]: [f64; 3]| y - 20.5);
    app.update();
    assert!((height(&mut app) - 11.0).abs() < 0.3, "still drawn");
    settle(&mut app, terrain);
    assert!((height(&mut app) - 20.5).abs() < 0.01, "drawn anew");
}

#[test]
fn bad_rays_and_bad_transforms_hit_nothing() {
    let mut app = app();
    let flat = app.world_mut().spawn((ball(), Transform::from_scale(Vec3::ZERO))).id();
    settle(&mut app, flat);
    app.update();
    assert!(cast(&mut app, Vec3::splat(50.0), Vec3::splat(16.0), 1000.0).is_none());
    assert!(cast(&mut app, Vec3::splat(50.0), Vec3::splat(16.0), f32::NAN).is_none());
}

#[test]
fn a_weight_beside_a_chunk_that_is_not_filled_is_unknown() {
    let mut app = app_with_budget(1);
    let terrain = app.world_mut().spawn(ground()).id();
    let filled = |app: &App| {
        let grid = volume(app, terrain).grid();
        grid.bounds().map_or(0, |chunks| chunks.points().filter(|position| grid.chunk(*position).is_some()).count())
    };
    update_until(&mut app, |app| filled(app) == 1);
    let grid = volume(&app, terrain).grid();
    let first = grid.bounds().unwrap().points().find(|position| grid.chunk(*position).is_some()).unwrap();
    let corner = Vec3::from(first.map(|v| v as f32)) * 16.0;
    assert_eq!(first[0], 0, "it has a neighbour along x");
    // Inside that neighbour, and half a voxel before it.
    let (within, beside) = (corner + 1.5, corner + Vec3::new(15.5, 1.5, 1.5));
    let weights = app.world_mut().run_system_once(move |terrains: TerrainQuery| {
        [within, beside].map(|position| terrains.weight_at(terrain, position))
    });
    let [within, beside] = weights.unwrap();
    assert!(within.is_some() && beside.is_none());
}
