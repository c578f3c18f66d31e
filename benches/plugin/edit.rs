//! An edit from end to end in a headless app: a stamp is written, and one update reads it, changes the samples, meshes
//! the chunks that it touched, and inserts their new meshes.
//!
//! The terrain is the default one of 8 × 4 × 8 chunks of 32 cells, filled with hills. Each stroke digs a ball into the
//! surface and fills it again, so that the terrain does not change. An update without any change is measured, too.
//!
//! The bench also measures the ray that finds the ground, in an endless world with a view of 8 chunks.

use std::hint::black_box;

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::AssetPlugin;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::Vec3;
use bevy_mesh::{Mesh3d, MeshPlugin};
use bevy_transform::{TransformPlugin, components::Transform};
use criterion::{Criterion, criterion_group, criterion_main};

/// The places of the ball, in voxels: in the middle of a chunk, and where eight chunks meet.
const PLACES: [(&str, [f32; 2]); 2] =
    [("within one column of chunks", [112.0, 112.0]), ("where columns meet", [128.0, 128.0])];

fn settled_app(terrain: Terrain, viewer: Option<TerrainViewer>) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, AssetPlugin::default(), MeshPlugin, MarchlessPlugins));
    let terrain = app.world_mut().spawn(terrain).id();
    if let Some(viewer) = viewer {
        app.world_mut().spawn((viewer, Transform::from_xyz(0.0, 80.0, 0.0)));
    }
    for _ in 0..100_000 {
        app.update();
        if app.world().get::<TerrainVolume>(terrain).is_some_and(TerrainVolume::is_settled) {
            return (app, terrain);
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    panic!("the terrain did not settle");
}

/// The height of the surface over a column, in voxels.
fn surface(app: &App, terrain: Entity, [x, z]: [f32; 2]) -> f32 {
    let grid = app.world().get::<TerrainVolume>(terrain).expect("a terrain has a volume").grid();
    let (origin, down) = ([f64::from(x) + 0.3, 1000.0, f64::from(z) + 0.2], [0.0, -1.0, 0.0]);
    grid.ray_cast(0.0, origin, down, 2000.0).expect("hills have a surface").position[1] as f32
}

fn ray(criterion: &mut Criterion) {
    let (app, terrain) = settled_app(Terrain::endless(NoiseHeights::from_seed(1)), Some(TerrainViewer::new(256.0)));
    criterion.bench_function("ray/to the ground of an endless world", |bencher| {
        bencher.iter(|| surface(&app, terrain, black_box([112.0, 112.0])));
    });
}

fn edit(criterion: &mut Criterion) {
    let (mut app, terrain) = settled_app(Terrain::new(NoiseHeights::from_seed(1)), None);
    let meshes = app.world_mut().query::<&Mesh3d>().iter(app.world()).count();
    println!("{meshes} chunks with a mesh");
    let mut group = criterion.benchmark_group("edit");
    group.bench_function("an update without an edit", |bencher| bencher.iter(|| app.update()));
    for (place, column) in PLACES {
        let center = Vec3::new(column[0], surface(&app, terrain, column), column[1]);
        for radius in [3.0, 6.0, 10.0] {
            let ball = BrushShape::sphere(center, radius);
            group.bench_function(format!("ball of radius {radius} {place}"), |bencher| {
                let mut dig = false;
                bencher.iter(|| {
                    dig = !dig;
                    let stamp = if dig { Stamp::dig(terrain, ball) } else { Stamp::add(terrain, ball, 1) };
                    app.world_mut().write_message(black_box(stamp));
                    app.update();
                    let volume = app.world().get::<TerrainVolume>(terrain).expect("a terrain has a volume");
                    assert!(volume.is_settled(), "the edit shows in the update that read it");
                });
            });
        }
    }
}

criterion_group!(benches, ray, edit);
criterion_main!(benches);
