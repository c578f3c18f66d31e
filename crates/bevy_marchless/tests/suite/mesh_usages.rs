//! Mesh assets are kept where the settings say.

use crate::common::*;
use bevy_app::App;
use bevy_asset::{Assets, RenderAssetUsages};
use bevy_color::Color;
use bevy_marchless::mesh::ChunkSamples;
use bevy_marchless::prelude::*;
use bevy_math::{UVec3, Vec3};
use bevy_mesh::{Mesh, Mesh3d};

const BOTH: RenderAssetUsages = RenderAssetUsages::RENDER_WORLD.union(RenderAssetUsages::MAIN_WORLD);

/// The usages of all mesh assets, with the number of assets for each.
fn counts(app: &mut App) -> [usize; 2] {
    let mut meshes = app.world_mut().query::<&Mesh3d>();
    let assets = app.world().resource::<Assets<Mesh>>();
    let usages: Vec<_> = meshes.iter(app.world()).map(|mesh| assets.get(&mesh.0).unwrap().asset_usage).collect();
    let count = |wanted| usages.iter().filter(|usage| **usage == wanted).count();
    let found = [RenderAssetUsages::RENDER_WORLD, BOTH].map(count);
    assert_eq!(found[0] + found[1], usages.len());
    found
}

fn set(app: &mut App, usages: RenderAssetUsages) {
    app.world_mut().resource_mut::<MarchlessSettings>().mesh_usages = usages;
}

#[test]
fn chunks_meshed_by_jobs_and_at_once() {
    for max_inline_chunks in [0, 8] {
        let mut app = app();
        app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = max_inline_chunks;
        let terrain = settled(&mut app, ball());
        assert_eq!(counts(&mut app), [8, 0], "the default");
        set(&mut app, BOTH);
        let before = geometry(&mut app, terrain);
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(6.0), 6.0)));
        app.update();
        settle(&mut app, terrain);
        let after = geometry(&mut app, terrain);
        let changed = before.iter().zip(&after).filter(|(before, after)| before != after).count();
        assert!((1..8).contains(&changed), "{changed}");
        assert_eq!(counts(&mut app), [8 - changed, changed], "those made from then on");
    }
}

#[test]
fn first_meshes() {
    let mut app = app();
    set(&mut app, BOTH);
    let terrain = settled(&mut app, ball());
    assert_eq!(counts(&mut app), [0, 8]);
    let mut chunks = app.world_mut().query::<(&ChunkGeometry, &Mesh3d)>();
    for (geometry, mesh) in chunks.iter(app.world()) {
        let mesh = app.world().resource::<Assets<Mesh>>().get(&mesh.0).unwrap();
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).unwrap();
        assert_eq!(positions, &geometry.mesh.positions[..]);
    }
    assert_coloured(&mut app, terrain);
}

#[test]
fn other_colours_normals_and_isovalues() {
    let changes: [fn(&mut Terrain); 3] = [
        |terrain| terrain.palette = Palette::new([Color::BLACK]),
        |terrain| terrain.normals = false,
        |terrain| terrain.isovalue = 1.5,
    ];
    for change in changes {
        let mut app = app();
        let terrain = settled(&mut app, ball());
        set(&mut app, BOTH);
        change(&mut app.world_mut().get_mut::<Terrain>(terrain).unwrap());
        app.update();
        settle(&mut app, terrain);
        assert_eq!(counts(&mut app), [0, 8]);
    }
}

#[test]
fn samples_by_hand_at_once_and_by_jobs() {
    let distances: Vec<f32> = (0..729).map(|index| (index / 9 % 9) as f32 - 3.5).collect();
    let samples = ChunkSamples::from_distances(UVec3::splat(9), &distances).unwrap();
    for max_inline_chunks in [0, 8] {
        let mut app = app_with_budget(4);
        app.world_mut().resource_mut::<MarchlessSettings>().max_inline_chunks = max_inline_chunks;
        app.world_mut().spawn(samples.clone());
        (0..4).for_each(|_| app.update());
        assert_eq!(counts(&mut app), [1, 0]);
        set(&mut app, BOTH);
        app.world_mut().spawn(samples.clone());
        (0..4).for_each(|_| app.update());
        assert_eq!(counts(&mut app), [1, 1]);
    }
}
