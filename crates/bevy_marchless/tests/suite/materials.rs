//! Chunks are drawn with their terrain's material.

use crate::common::*;
use bevy_app::App;
use bevy_asset::{AssetApp as _, Assets, Handle};
use bevy_ecs::prelude::*;
use bevy_marchless::material::TerrainMaterialPlugin;
use bevy_marchless::mesh::ChunkSamples;
use bevy_marchless::prelude::*;
use bevy_pbr::decal::ForwardDecalMaterial;
use bevy_pbr::{Material, MeshMaterial3d, StandardMaterial};

type Other = ForwardDecalMaterial<StandardMaterial>;

fn app_with_materials() -> App {
    let mut app = app();
    app.init_asset::<StandardMaterial>().init_asset::<Other>();
    app.add_plugins(TerrainMaterialPlugin::<Other>::default());
    app
}

/// The materials of one type that chunks have.
fn materials<M: Material>(app: &mut App) -> Vec<Handle<M>> {
    let mut chunks = app.world_mut().query_filtered::<&MeshMaterial3d<M>, With<Chunk>>();
    chunks.iter(app.world()).map(|material| material.0.clone()).collect()
}

fn add_standard(app: &mut App) -> Handle<StandardMaterial> {
    app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default())
}

#[test]
fn chunks_follow_their_terrains_material() {
    let mut app = app_with_materials();
    let (red, blue) = (add_standard(&mut app), add_standard(&mut app));
    let terrain = settled(&mut app, ball());
    app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(red.clone()));
    app.update();
    assert_eq!(materials(&mut app), vec![red; 8]);
    app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(blue.clone()));
    app.update();
    assert_eq!(materials(&mut app), vec![blue; 8]);
}

#[test]
fn a_terrain_without_material_gets_a_plain_one_until_it_has_its_own() {
    let mut app = app_with_materials();
    let terrain = settled(&mut app, ball());
    assert_eq!(materials::<StandardMaterial>(&mut app).len(), 8);
    app.world_mut().entity_mut(terrain).insert(MeshMaterial3d::<Other>::default());
    app.update();
    assert_eq!(materials::<Other>(&mut app).len(), 8);
    assert_eq!(materials::<StandardMaterial>(&mut app).len(), 0);
}

#[test]
fn a_chunk_has_its_material_in_the_update_that_spawns_it() {
    let mut app = app_with_materials();
    app.world_mut().spawn(ball());
    for _ in 0..2_000 {
        app.update();
        let mut chunks = app.world_mut().query_filtered::<Has<MeshMaterial3d<StandardMaterial>>, With<Chunk>>();
        let with_material: Vec<bool> = chunks.iter(app.world()).collect();
        assert!(with_material.iter().all(|has_material| *has_material));
        if with_material.len() == 8 {
            return;
        }
    }
    panic!("eight chunks have a surface");
}

#[test]
fn another_type_of_material_is_left_alone() {
    let mut app = app_with_materials();
    let terrain = app.world_mut().spawn((ball(), MeshMaterial3d::<Other>::default())).id();
    settle(&mut app, terrain);
    assert_eq!(materials::<Other>(&mut app).len(), 8);
    assert_eq!(materials::<StandardMaterial>(&mut app).len(), 0);
}

#[test]
fn samples_by_hand_get_a_plain_material_as_long_as_they_have_no_other() {
    let mut app = app_with_materials();
    let samples = || ChunkSamples::from_distances(bevy_math::UVec3::splat(2), &[0.5; 8]).unwrap();
    let plain = app.world_mut().spawn(samples()).id();
    let own = app.world_mut().spawn((samples(), MeshMaterial3d::<Other>::default())).id();
    app.update();
    let has_plain = |app: &App, entity| app.world().get::<MeshMaterial3d<StandardMaterial>>(entity).is_some();
    assert!(has_plain(&app, plain) && !has_plain(&app, own));
    app.world_mut().entity_mut(plain).remove::<ChunkSamples>();
    app.update();
    assert!(!has_plain(&app, plain));
}
