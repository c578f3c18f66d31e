//! Saving and loading: the terrains of the level are written as a scene, in RON, and read again. A terrain is its
//! settings; it makes its own chunks, and what was dug is not written.

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_world_serialization::DynamicWorldBuilder;
use bevy_world_serialization::serde::WorldDeserializer;
use serde::de::DeserializeSeed as _;

use crate::level::{Hills, Island, Wall};
use crate::shell::Pace;

/// What was saved last, as text.
#[derive(Resource, Default)]
pub(crate) struct Saved(pub(crate) Option<String>);

pub(crate) fn plugin(app: &mut App) {
    // `DefaultPlugins` register Bevy's types; an app without a renderer does it itself.
    app.init_resource::<Saved>()
        .register_type::<Transform>()
        .register_type::<Visibility>()
        .register_type::<Hills>()
        .register_type::<Island>()
        .register_type::<Wall>()
        .add_systems(
            Update,
            // A terrain that is paused is not found by plain queries.
            (save.run_if(input_just_pressed(KeyCode::F5)), load.run_if(input_just_pressed(KeyCode::F9)))
                .run_if(in_state(Pace::Running)),
        );
}

/// Writes all terrains, with their place, their visibility and what they are in the game. All else the level knows.
fn save(world: &mut World) {
    let terrains: Vec<Entity> = world.query_filtered::<Entity, With<Terrain>>().iter(world).collect();
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let scene = DynamicWorldBuilder::from_world(world, &registry)
        .deny_all()
        .allow_component::<Terrain>()
        .allow_component::<Transform>()
        .allow_component::<Visibility>()
        .allow_component::<Hills>()
        .allow_component::<Island>()
        .allow_component::<Wall>()
        .extract_entities(terrains.into_iter())
        .build();
    match scene.serialize(&registry) {
        Ok(text) => world.resource_mut::<Saved>().0 = Some(text),
        Err(error) => error!("the level cannot be saved: {error}"),
    }
}

/// Replaces all terrains by those that were saved.
fn load(world: &mut World) {
    let Some(text) = world.resource::<Saved>().0.clone() else { return };
    if let Err(error) = try_load(world, &text) {
        error!("the level cannot be loaded: {error}");
    }
}

fn try_load(world: &mut World, text: &str) -> Result {
    let registry = world.resource::<AppTypeRegistry>().clone();
    let scene = {
        let registry = registry.read();
        let mut assets = world.resource::<AssetServer>();
        let deserializer = WorldDeserializer { type_registry: &registry, load_from_path: &mut assets };
        deserializer.deserialize(&mut ron::Deserializer::from_str(text)?)?
    };
    let terrains: Vec<Entity> = world.query_filtered::<Entity, With<Terrain>>().iter(world).collect();
    for terrain in terrains {
        world.despawn(terrain);
    }
    scene.write_to_world(world, &mut EntityHashMap::default())?;
    Ok(())
}
