//! Chunks in the cells of a big space: results at the origin and at ten million voxels are equal bit for bit.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::common::*;
use bevy_app::{App, Last, TaskPoolPlugin};
use bevy_asset::AssetPlugin;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce as _;
use bevy_marchless::prelude::*;
use bevy_math::{DVec3, Dir3, IVec3, Ray3d, Vec3};
use bevy_mesh::MeshPlugin;
use bevy_time::TimePlugin;
use bevy_transform::components::{GlobalTransform, Transform};
use big_space::plugin::BigSpaceMinimalPlugins;
use big_space::prelude::*;
use marchless::MeshBuffer;

const CELLS: i32 = 16;
/// Ten million voxels along each axis, in chunks.
const FAR: IVec3 = IVec3::new(625_000, -625_000, 625_000);
/// The edge of a cell of the grid, which divides ten million. [Units: world]
const EDGE: f32 = 2_000.0;

/// A ball of radius 12 in the middle of 2 × 2 × 2 chunks, the lowest of which is at `offset`.
fn ball_at(offset: IVec3) -> Terrain {
    let middle = (offset * CELLS + 16).as_dvec3();
    let source = move |p: [f64; 3]| DVec3::from(p).distance(middle) - 12.0;
    Terrain::new(source).with_chunk_cells(CELLS as u32).with_extent(Extent { min: offset, max: offset + 2 })
}

/// An app with a big space instead of Bevy's own propagation.
fn space_app(minimal: bool) -> App {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TimePlugin, AssetPlugin::default(), MeshPlugin, MarchlessPlugins));
    if minimal {
        app.add_plugins(BigSpaceMinimalPlugins);
    } else {
        app.add_plugins(BigSpaceDefaultPlugins);
    }
    app.add_systems(Last, chunks_are_in_their_cells);
    app
}

/// Checks in every update that each chunk of a grid has a cell, and the right place relative to the floating origin.
fn chunks_are_in_their_cells(
    chunks: Query<(&Chunk, Option<&CellCoord>, &Transform, &GlobalTransform)>,
    terrains: Query<(&TerrainVolume, &Grid)>,
) {
    for (chunk, cell, transform, global) in &chunks {
        let Ok((volume, grid)) = terrains.get(chunk.terrain) else {
            assert!(cell.is_none());
            continue;
        };
        let cell = cell.expect("a cell from the first update on");
        let edge = f64::from(grid.cell_edge_length());
        let settings = volume.settings().expect("good settings");
        let cells = f64::from(settings.chunk_cells << chunk.level);
        let corner = chunk.position.as_dvec3() * cells * f64::from(settings.voxel_size);
        let within = transform.translation.as_dvec3();
        assert!(within.abs().max_element() <= 0.5 * edge, "{cell:?} and {within}");
        assert!((grid.cell_to_float(cell) + within).distance(corner) < 1e-7 * edge, "{cell:?} and {within}");
        assert_eq!(*global, grid.global_transform(cell, transform), "propagated in the same update");
    }
}

/// Spawns a terrain that is a grid, and the floating origin in this cell, 40 units above its middle.
fn spawn(app: &mut App, terrain: Terrain, edge: f32, cell: CellCoord) -> (Entity, Entity) {
    let root = app.world_mut().spawn(BigSpaceRootBundle::default()).id();
    let grid = (terrain, Grid::new(edge, 100.0), CellCoord::ZERO, ChildOf(root));
    let terrain = app.world_mut().spawn(grid).id();
    let origin = (FloatingOrigin, cell, Transform::from_xyz(16.0, 40.0, 16.0), ChildOf(terrain));
    let origin = app.world_mut().spawn(origin).id();
    (terrain, origin)
}

/// The same ball, `offset` chunks from the origin, with the floating origin beside it.
fn settled_at(offset: IVec3) -> (App, Entity, Entity) {
    let mut app = space_app(false);
    let (terrain, origin) = spawn(&mut app, ball_at(offset), EDGE, cell_of(offset));
    settle(&mut app, terrain);
    app.update();
    (app, terrain, origin)
}

/// The cell of the chunk at `offset`, which must be a whole number of cells away.
fn cell_of(offset: IVec3) -> CellCoord {
    let cell = offset * CELLS / EDGE as i32;
    assert_eq!(cell * EDGE as i32, offset * CELLS);
    CellCoord::ZERO + cell
}

/// All drawn chunks: by level and position relative to `offset`, the place relative to the floating origin, bit for bit,
/// and the mesh.
fn drawn(app: &mut App, offset: IVec3) -> BTreeMap<(u8, [i32; 3]), ([u32; 12], Arc<MeshBuffer>)> {
    let mut chunks = app.world_mut().query::<(&Chunk, &GlobalTransform, &ChunkGeometry)>();
    let drawn = chunks.iter(app.world()).map(|(chunk, global, geometry)| {
        let place = global.affine().to_cols_array().map(f32::to_bits);
        let position = chunk.position - (offset >> i32::from(chunk.level));
        ((chunk.level, position.to_array()), (place, geometry.mesh.clone()))
    });
    drawn.collect()
}

/// Rays towards and past the ball, from around the floating origin.
fn rays() -> Vec<Ray3d> {
    let towards = |from: Vec3, to: Vec3| Ray3d::new(from, Dir3::new(to - from).expect("two places"));
    let middle = Vec3::splat(16.0);
    let starts = [Vec3::new(16.0, 40.0, 16.0), Vec3::new(-30.5, 11.25, 3.0), Vec3::new(60.0, -20.0, 77.7)];
    let ends = [middle, middle + Vec3::new(3.3, 5.1, -4.2), middle + Vec3::splat(9.0)];
    starts.iter().flat_map(|&from| ends.map(|to| towards(from, to))).collect()
}

fn hits(app: &mut App) -> Vec<Option<TerrainHit>> {
    let cast = |terrains: TerrainQuery| rays().iter().map(|ray| terrains.ray_cast(*ray, 500.0)).collect::<Vec<_>>();
    app.world_mut().run_system_once(cast).expect("it runs")
}

/// Asserts that both apps, `FAR` apart, draw the same, and that the same rays hit the same points.
fn assert_same(near: &mut App, far: &mut App) {
    assert!(!drawn(near, IVec3::ZERO).is_empty());
    assert_eq!(drawn(near, IVec3::ZERO), drawn(far, FAR));
    let (near, far) = (hits(near), hits(far));
    assert!(near.iter().flatten().count() > 6);
    for (near, far) in near.iter().zip(&far) {
        let (Some(near), Some(far)) = (near, far) else {
            assert!(near.is_none() && far.is_none());
            continue;
        };
        assert!(near.position.distance(far.position) < 1e-5, "{near:?}\n{far:?}");
        assert!((near.lattice + (FAR * CELLS).as_dvec3()).distance(far.lattice) < 1e-6, "{near:?}\n{far:?}");
        assert_eq!((near.material, near.normal), (far.material, far.normal));
    }
}

#[test]
fn ten_million_voxels_away_everything_is_the_same() {
    let (mut near, near_terrain, near_origin) = settled_at(IVec3::ZERO);
    let (mut far, far_terrain, far_origin) = settled_at(FAR);
    assert_same(&mut near, &mut far);
    let mut awake = far.world_mut().query_filtered::<Entity, (With<Chunk>, Without<Stationary>)>();
    assert_eq!(awake.iter(far.world()).count(), 0, "propagation may pass over chunks");

    // A stamp where the first ray hits, and one between lattice points.
    for (app, terrain, offset) in [(&mut near, near_terrain, IVec3::ZERO), (&mut far, far_terrain, FAR * CELLS)] {
        let hit = hits(app)[0].expect("the ball is in the way");
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(hit.lattice, 4.0)));
        let place = offset.as_dvec3() + DVec3::new(8.25, 17.625, 20.5);
        app.world_mut().write_message(Stamp::add(terrain, BrushShape::sphere(place, 5.3), 2));
        app.update();
        settle(app, terrain);
    }
    assert_same(&mut near, &mut far);

    // The floating origin moves to another cell, and everything follows.
    for (app, origin) in [(&mut near, near_origin), (&mut far, far_origin)] {
        app.world_mut().get_mut::<CellCoord>(origin).expect("it has a cell").x += 3;
        app.update();
    }
    let moved = drawn(&mut near, IVec3::ZERO);
    assert_eq!(f32::from_bits(moved[&(0, [0; 3])].0[9]), -3.0 * EDGE);
    assert_eq!(moved, drawn(&mut far, FAR));
}

/// A viewer loads what is around it, and returns the number of levels that it sees.
fn follow(levels: u8) -> usize {
    let world = |offset: IVec3| {
        let origin = (offset * CELLS).as_dvec3();
        let waves = move |p: [f64; 3]| {
            let p = DVec3::from(p) - origin;
            p.y - 6.0 * (p.x * 0.1).sin() * (p.z * 0.07).cos()
        };
        let mut app = space_app(false);
        let terrain = Terrain::endless(waves).with_chunk_cells(CELLS as u32).with_levels(levels);
        let (terrain, viewer) = spawn(&mut app, terrain, EDGE, cell_of(offset));
        app.world_mut().entity_mut(viewer).insert(TerrainViewer::new(50.0 * f32::from(levels)));
        (app, terrain, viewer)
    };
    let (mut near, mut far) = (world(IVec3::ZERO), world(FAR));
    let mut former = BTreeMap::new();
    // At its own place, within the same cell, and in another one.
    for step in [0.0, 800.0, EDGE] {
        for (app, terrain, viewer) in [&mut near, &mut far] {
            app.world_mut().get_mut::<Transform>(*viewer).expect("it has a place").translation.x += step;
            // The terrain follows as soon as the new place has been propagated.
            app.update();
            app.update();
            settle(app, *terrain);
        }
        let [here, there] = [drawn(&mut near.0, IVec3::ZERO), drawn(&mut far.0, FAR)];
        assert!(here.len() > 12 && here == there, "{} and {} chunks", here.len(), there.len());
        assert!(former.keys().all(|position| !here.contains_key(position)), "those before are gone");
        former = here;
    }
    assert!(near.0.world().get::<CellCoord>(near.2).expect("it has a cell").x > 0, "it went to another cell");
    former.keys().map(|(level, _)| level).collect::<BTreeSet<_>>().len()
}

#[test]
fn a_viewer_loads_what_is_around_it() {
    assert_eq!(follow(1), 1);
}

#[test]
fn a_viewer_sees_levels_of_detail() {
    assert!(follow(3) > 1);
}

#[test]
fn positions_in_world_space_and_in_the_lattice_belong_together() {
    // An `f32` cannot hold the distance of the floating origin's cell.
    let (edge, cell) = (500.5, CellCoord::new(19_981, -19_981, 19_981));
    let mut app = space_app(false);
    let (terrain, _) = spawn(&mut app, ball_at(FAR), edge, cell);
    settle(&mut app, terrain);
    let place = (FAR * CELLS).as_dvec3() + DVec3::new(16.25, 27.5, 15.875);
    let answers = app.world_mut().run_system_once(move |terrains: TerrainQuery| {
        let world = terrains.to_world(terrain, place)?;
        Some((world, terrains.to_lattice(terrain, world)?, terrains.weight_at(terrain, world)?))
    });
    let (world, lattice, weight) = answers.expect("it runs").expect("there is a terrain");
    let origin = DVec3::new(cell.x as f64, cell.y as f64, cell.z as f64) * f64::from(edge);
    assert_eq!((world.as_dvec3(), lattice), (place - origin, place));
    assert!((weight + 0.5).abs() < 0.1, "{weight}");
}

#[test]
fn voxels_of_any_size_are_in_their_places() {
    for size in [0.1, 0.3, 7.7] {
        let mut app = space_app(false);
        let terrain = ball_at(FAR).with_voxel_size(size);
        let corner = (FAR * CELLS).as_dvec3() * f64::from(size);
        let (cell, _) = Grid::new(EDGE, 100.0).translation_to_grid(corner);
        let (terrain, _) = spawn(&mut app, terrain, EDGE, cell);
        settle(&mut app, terrain);
        app.update();
        let mut chunks = app.world_mut().query::<(&Chunk, &GlobalTransform)>();
        for (chunk, global) in chunks.iter(app.world()) {
            let exact = (chunk.position * CELLS).as_dvec3() * f64::from(size);
            let exact = exact - DVec3::new(cell.x as f64, cell.y as f64, cell.z as f64) * f64::from(EDGE);
            assert!(
                global.translation().as_dvec3().distance(exact) < 1e-3,
                "voxels of {size}, chunk {}",
                chunk.position
            );
        }
        // Drawn with this voxel size, then with another one: the chunks move.
        app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain").voxel_size = 2.0 * size;
        app.update();
        settle(&mut app, terrain);
    }
}

#[test]
fn a_terrain_may_become_a_grid_and_cease_to_be_one() {
    for minimal in [false, true] {
        let mut app = space_app(minimal);
        let (terrain, origin) = spawn(&mut app, ball_at(IVec3::ZERO), EDGE, CellCoord::ZERO);
        settle(&mut app, terrain);
        app.update();
        let sleeping = app.world_mut().query_filtered::<&Chunk, With<Stationary>>().iter(app.world()).count();
        assert_eq!(sleeping == 0, minimal, "without its plugin, `Stationary` costs more than it saves");
        let expected = drawn(&mut app, IVec3::ZERO);
        // Another grid, with smaller cells: the chunks change their cells.
        app.world_mut().entity_mut(terrain).insert(Grid::new(10.0, 1.0));
        app.update();
        app.update();
        let mut cells = app.world_mut().query_filtered::<&CellCoord, With<Chunk>>();
        assert!(cells.iter(app.world()).any(|cell| *cell != CellCoord::ZERO));
        let root = app.world().get::<ChildOf>(terrain).expect("it is in the space").parent();
        app.world_mut().entity_mut(origin).insert((CellCoord::ZERO, ChildOf(root)));
        app.world_mut().entity_mut(terrain).remove::<Grid>();
        app.update();
        app.update();
        assert_eq!(drawn(&mut app, IVec3::ZERO), expected);
        app.world_mut().entity_mut(terrain).despawn();
        app.update();
        assert!(drawn(&mut app, IVec3::ZERO).is_empty());
    }
}

#[test]
fn a_terrain_that_is_no_grid_stays_where_the_space_puts_it() {
    let mut app = space_app(false);
    let root = app.world_mut().spawn(BigSpaceRootBundle::default()).id();
    let place = Transform::from_xyz(100.0, 0.0, 0.0);
    let grid = app.world_mut().spawn((Grid::new(EDGE, 100.0), CellCoord::ZERO, place, ChildOf(root))).id();
    let cell = CellCoord::new(3, 0, 0);
    let terrain = app.world_mut().spawn((ball(), cell, ChildOf(grid))).id();
    let origin = app.world_mut().spawn((FloatingOrigin, cell, Transform::default(), ChildOf(grid))).id();
    settle(&mut app, terrain);
    // At the origin of world space, as if its transform had not been propagated.
    assert_eq!(app.world().get::<GlobalTransform>(terrain), Some(&GlobalTransform::IDENTITY));
    *app.world_mut().get_mut::<CellCoord>(origin).unwrap() = CellCoord::new(2, 0, 0);
    (0..3).for_each(|_| app.update());
    let moved = app.world().get::<GlobalTransform>(terrain).map(|global| global.translation());
    assert_eq!(moved, Some(Vec3::new(EDGE, 0.0, 0.0)));
}
