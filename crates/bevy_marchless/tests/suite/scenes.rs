//! Terrains are written with a scene and read again.

use crate::common::{assert_drawn, geometry, ground, settle, settled, small, volume};
use bevy_app::App;
use bevy_asset::AssetServer;
use bevy_camera::visibility::Visibility;
use bevy_color::Color;
use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;
use bevy_ecs::reflect::AppTypeRegistry;
use bevy_marchless::mesh::ChunkSamples;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_marchless::terrain::{SourceHandle, TerrainError, TerrainSources};
use bevy_math::UVec3;
use bevy_mesh::Mesh3d;
use bevy_transform::components::Transform;
use bevy_world_serialization::serde::WorldDeserializer;
use bevy_world_serialization::{DynamicWorld, DynamicWorldBuilder};
use serde::de::DeserializeSeed as _;

/// An app with the type registrations of a game.
fn app() -> App {
    let mut app = crate::common::app();
    app.register_type::<Transform>().register_type::<Visibility>().register_type::<Name>();
    app.register_type::<ChildOf>().register_type::<Children>();
    app
}

/// Writes entities with all components that can be written.
fn write(app: &App, entities: &[Entity]) -> Result<String, ron::Error> {
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let builder = DynamicWorldBuilder::from_world(app.world(), &registry).deny_component::<Mesh3d>();
    builder.extract_entities(entities.iter().copied()).build().serialize(&registry)
}

fn read(app: &App, text: &str) -> Result<DynamicWorld, String> {
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let mut deserializer = ron::Deserializer::from_str(text).map_err(|error| error.to_string())?;
    let mut server = app.world().resource::<AssetServer>();
    WorldDeserializer { type_registry: &registry, load_from_path: &mut server }
        .deserialize(&mut deserializer)
        .map_err(|error| error.to_string())
}

fn spawn(app: &mut App, text: &str) -> EntityHashMap<Entity> {
    let world = read(app, text).expect("a scene");
    let mut map = EntityHashMap::default();
    world.write_to_world(app.world_mut(), &mut map).expect("all types are registered");
    map
}

fn settings() -> Vec<Terrain> {
    let landscape = LandscapeSettings { solid: Solid::from(Sdf::cuboid([8.0; 3], [5.0; 3])), ..Default::default() };
    let palette = Palette::new([Color::srgb(0.25, 0.5, 0.75)]);
    let sources = [
        Terrain::new(NoiseHeights::from_seed(7)),
        Terrain::new(NoiseDensity::new(NoiseDensitySettings::default()).expect("the default")),
        Terrain::new(Landscape::new(landscape).expect("a box")),
        Terrain::new(Sdf::sphere([9.0; 3], 6.0).with_material(3)),
        Terrain::default(),
    ];
    let more = |terrain: Terrain| terrain.with_extent(UVec3::new(2, 3, 2)).with_palette(palette.clone());
    sources.into_iter().map(|terrain| more(terrain).with_chunk_cells(8).with_isovalue(0.25)).collect()
}

#[test]
fn settings_and_data_sources_come_back() {
    for terrain in settings() {
        let mut app = app();
        let entity = app.world_mut().spawn((terrain, Transform::from_xyz(3.0, 4.0, 5.0), Name::new("ground"))).id();
        settle(&mut app, entity);
        let before = geometry(&mut app, entity);
        let text = write(&app, &[entity]).expect("it is data");
        let mut other = self::app();
        let copy = spawn(&mut other, &text)[&entity];
        settle(&mut other, copy);
        assert_eq!(other.world().get::<Transform>(copy), Some(&Transform::from_xyz(3.0, 4.0, 5.0)));
        let [a, b] =
            [(&app, entity), (&other, copy)].map(|(app, entity)| app.world().get::<Terrain>(entity).unwrap().clone());
        assert_eq!((a.extent, a.keep, a.chunk_cells, a.voxel_size), (b.extent, b.keep, b.chunk_cells, b.voxel_size));
        assert_eq!((a.isovalue, a.normals, a.palette), (b.isovalue, b.normals, b.palette));
        let after = geometry(&mut other, copy);
        assert_eq!(before.len(), after.len());
        for ((position, mesh), (at, read)) in before.into_iter().zip(after) {
            assert!(position == at && mesh == read, "the chunk at {position}");
        }
        assert_drawn(&mut other, copy);
        // Nothing is left behind when the terrain is despawned.
        other.world_mut().despawn(copy);
        other.update();
        assert_eq!(other.world_mut().query::<&Chunk>().iter(other.world()).count(), 0);
    }
}

#[test]
fn a_whole_scene_is_read_without_orphans() {
    let mut app = app();
    let parent = app.world_mut().spawn(Transform::from_xyz(100.0, 0.0, 0.0)).id();
    let source = NoiseHeights::from_seed(3);
    let terrain = app.world_mut().spawn((small(Terrain::new(source)), ChildOf(parent))).id();
    settle(&mut app, terrain);
    // Chunks included, as from a query of all entities.
    let mut all = app.world_mut().query_filtered::<Entity, With<Transform>>();
    let all: Vec<_> = all.iter(app.world()).collect();
    let drawn = geometry(&mut app, terrain).len();
    assert!(drawn > 0 && all.len() == drawn + 2);
    let text = write(&app, &all).expect("all is data");
    for app in [&mut app, &mut self::app()] {
        let map = spawn(app, &text);
        let copy = map[&terrain];
        settle(app, copy);
        app.update();
        assert_eq!(geometry(app, copy).len(), drawn);
        assert_drawn(app, copy);
        let children = app.world().get::<Children>(copy).expect("chunks");
        assert!(
            children.iter().all(|child| app.world().get::<Chunk>(child).is_some_and(|chunk| chunk.terrain == copy))
        );
        let mut chunks = app.world_mut().query::<(Entity, &Chunk)>();
        let own: Vec<_> = chunks.iter(app.world()).map(|(entity, chunk)| (entity, *chunk)).collect();
        for (entity, chunk) in own {
            assert_eq!(volume(app, chunk.terrain).chunk_entity(chunk.position), Some(entity), "an orphan");
        }
        assert_eq!(app.world().get::<ChildOf>(copy).map(ChildOf::parent), Some(map[&parent]));
    }
}

#[test]
fn sources_of_the_games_own_go_by_name() {
    let waves = |[x, y, _]: [f64; 3]| y - 12.0 - (0.5 * x).sin();
    let mut app = app();
    app.world_mut().resource_mut::<TerrainSources>().insert("waves", waves);
    let named = small(Terrain { source: SourceHandle::named("waves"), ..Terrain::default() });
    let terrain = settled(&mut app, named);
    assert!(!geometry(&mut app, terrain).is_empty());
    let text = write(&app, &[terrain]).expect("it has a name");
    assert!(text.contains("Named(\"waves\")"), "{text}");

    // The name is not registered: one error, and an empty terrain.
    let mut other = self::app();
    let copy = spawn(&mut other, &text)[&terrain];
    (0..5).for_each(|_| other.update());
    let error = other.world().get::<TerrainError>(copy).expect("an error").clone();
    assert_eq!(error, TerrainError::Source { name: "waves".into() });
    assert!(error.to_string().contains("'waves'"));
    assert!(geometry(&mut other, copy).is_empty() && volume(&other, copy).settings().is_none());
    // As soon as the name is registered, the terrain is there; another source of that name replaces it.
    other.world_mut().resource_mut::<TerrainSources>().insert("waves", waves);
    settle(&mut other, copy);
    assert!(other.world().get::<TerrainError>(copy).is_none());
    let [before, after] = [(&mut app, terrain), (&mut other, copy)].map(|(app, terrain)| geometry(app, terrain));
    assert_eq!(before, after);
    other.world_mut().resource_mut::<TerrainSources>().insert("waves", |[_, y, _]: [f64; 3]| y - 20.0);
    other.update();
    settle(&mut other, copy);
    assert_ne!(geometry(&mut other, copy), before);
    assert_drawn(&mut other, copy);

    // A closure without a name cannot be written, and the error says what to do.
    let nameless = settled(&mut app, ground());
    let error = write(&app, &[nameless]).expect_err("a closure").to_string();
    assert!(error.contains("SourceHandle::named"), "{error}");
}

#[test]
fn bad_sources_are_refused_when_read() {
    let mut app = app();
    let terrain = settled(&mut app, small(Terrain::new(Sdf::sphere([9.0; 3], 6.5))));
    let text = write(&app, &[terrain]).expect("it is data");
    assert!(read(&app, &text).is_ok() && text.contains("6.5"));
    for number in ["-1.0", "inf", "NaN"] {
        assert!(read(&app, &text.replace("6.5", number)).is_err(), "a radius of {number}");
    }
    assert!(read(&app, &text.replace("Sdf(", "Sfd(")).is_err());
}

#[test]
fn viewers_and_hand_made_samples_come_back() {
    let mut app = app();
    let distances: Vec<f32> = (0u8..64).map(|index| f32::from(index / 4 % 4) - 1.5).collect();
    let samples = ChunkSamples::from_distances(UVec3::splat(4), &distances).expect("64 distances");
    let samples = samples.with_materials((0..64).collect()).expect("64 materials");
    let body = app.world_mut().spawn(samples).id();
    let viewer = app.world_mut().spawn(TerrainViewer::new(99.0).with_margin(7.0)).id();
    app.update();
    let text = write(&app, &[body, viewer]).expect("they are data");
    let mut other = self::app();
    let map = spawn(&mut other, &text);
    other.update();
    let [a, b] = [(&app, body), (&other, map[&body])]
        .map(|(app, body)| app.world().get::<ChunkGeometry>(body).unwrap().mesh.clone());
    assert!(!a.is_empty() && a == b);
    assert_eq!(other.world().get::<TerrainViewer>(map[&viewer]), Some(&TerrainViewer::new(99.0).with_margin(7.0)));
    let materials = "    0,\n";
    assert!(text.contains(materials));
}
