//! Reflection as an inspector uses it: settings change by name, and terrains and chunks lead to each other.

use crate::common::*;
use bevy_ecs::prelude::*;
use bevy_ecs::reflect::{AppTypeRegistry, ReflectComponent};
use bevy_marchless::prelude::*;
use bevy_reflect::{GetPath as _, PartialReflect as _};

#[test]
fn a_setting_changed_by_its_name_takes_effect() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let component = {
        let registry = registry.read();
        let found = registry.get_with_short_type_path("Terrain").expect("it is registered");
        found.data::<ReflectComponent>().expect("it is a component").clone()
    };
    let mut settings = component.reflect_mut(app.world_mut().entity_mut(terrain)).expect("it has one");
    settings.reflect_path_mut("isovalue").expect("a field").apply(1.5_f32.as_partial_reflect());
    settings.reflect_path_mut("palette.colors[0]").expect("a field");
    app.update();
    settle(&mut app, terrain);
    assert_eq!(volume(&app, terrain).shown_isovalue(), 1.5);
    assert_as_new(&mut app, terrain, &[]);
}

#[test]
fn terrains_and_chunks_lead_to_each_other() {
    let mut app = app();
    let terrain = settled(&mut app, ball());
    let children: Vec<Entity> = app.world().get::<Children>(terrain).expect("chunks").iter().collect();
    assert_eq!(children.len(), 8);
    for entity in children {
        let chunk = app.world().get::<Chunk>(entity).expect("a chunk");
        assert_eq!(chunk.terrain, terrain);
        assert_eq!(volume(&app, terrain).chunk_entity(chunk.position), Some(entity));
    }
}
