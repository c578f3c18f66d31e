//! A cloned terrain makes its own chunks.

use crate::common::*;
use bevy_app::App;
use bevy_ecs::entity::EntityCloner;
use bevy_ecs::prelude::*;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

/// Asserts that each chunk belongs to its terrain, and that there are as many chunks as the terrains draw.
fn assert_no_copies(app: &mut App, terrains: &[Entity]) {
    let mut chunks = app.world_mut().query::<(Entity, &Chunk, &ChildOf)>();
    let all: Vec<_> =
        chunks.iter(app.world()).map(|(entity, chunk, parent)| (entity, *chunk, parent.parent())).collect();
    for (entity, chunk, parent) in &all {
        assert!(terrains.contains(&chunk.terrain) && *parent == chunk.terrain);
        assert_eq!(volume(app, chunk.terrain).chunk_entity(chunk.position), Some(*entity));
    }
    let children = |terrain: &Entity| app.world().get::<Children>(*terrain).map_or(0, |children| children.len());
    assert_eq!(terrains.iter().map(children).sum::<usize>(), all.len());
}

#[test]
fn a_clone_makes_its_own_chunks_and_goes_its_own_way() {
    for linked in [false, true] {
        let mut app = app();
        let terrain = settled(&mut app, ground());
        let dig = |terrain| Stamp::dig(terrain, BrushShape::sphere(Vec3::new(10.0, 16.0, 10.0), 4.0));
        app.world_mut().write_message(dig(terrain));
        settle(&mut app, terrain);
        let clone = app.world_mut().spawn_empty().id();
        EntityCloner::build_opt_out(app.world_mut()).linked_cloning(linked).clone_entity(terrain, clone);
        settle(&mut app, clone);
        app.update();
        assert_no_copies(&mut app, &[terrain, clone]);
        // Edits are not part of the settings.
        assert_as_new(&mut app, clone, &[]);
        assert_as_new(&mut app, terrain, &[dig(terrain)]);
        app.world_mut().write_message(dig(clone));
        settle(&mut app, clone);
        assert_as_new(&mut app, clone, &[dig(clone)]);
        app.world_mut().despawn(terrain);
        app.update();
        assert_no_copies(&mut app, &[clone]);
    }
}

#[test]
fn a_parent_is_cloned_with_its_terrains() {
    let mut app = app();
    let parent = app.world_mut().spawn(bevy_transform::components::Transform::default()).id();
    let terrain = app.world_mut().spawn((ground(), ChildOf(parent))).id();
    settle(&mut app, terrain);
    let clone = app.world_mut().spawn_empty().id();
    EntityCloner::build_opt_out(app.world_mut()).linked_cloning(true).clone_entity(parent, clone);
    let cloned = app.world().get::<Children>(clone).expect("a terrain")[0];
    settle(&mut app, cloned);
    app.update();
    assert_no_copies(&mut app, &[terrain, cloned]);
}

#[test]
fn chunks_that_nobody_manages_go() {
    let mut app = app();
    let terrain = settled(&mut app, ground());
    let position = geometry(&mut app, terrain)[0].0;
    let own = volume(&app, terrain).chunk_entity(position).expect("it is drawn");
    let copy = app.world_mut().spawn_empty().id();
    EntityCloner::build_opt_out(app.world_mut()).clone_entity(own, copy);
    // A copy that is not a chunk belongs to the game.
    let debris = app.world_mut().spawn_empty().id();
    EntityCloner::build_opt_out(app.world_mut()).clone_entity(own, debris);
    app.world_mut().entity_mut(debris).remove::<(Chunk, ChildOf)>();
    let stranger = app.world_mut().spawn(Chunk { terrain: copy, level: 0, position }).id();
    app.update();
    assert!(app.world().get_entity(copy).is_err() && app.world().get_entity(stranger).is_err());
    assert!(app.world().get::<ChunkGeometry>(debris).is_some_and(|geometry| !geometry.mesh.is_empty()));
    assert_no_copies(&mut app, &[terrain]);
    let own = geometry(&mut app, terrain);
    app.world_mut().despawn(debris);
    assert_eq!(own.len(), geometry(&mut app, terrain).len());
    assert_drawn(&mut app, terrain);
}
