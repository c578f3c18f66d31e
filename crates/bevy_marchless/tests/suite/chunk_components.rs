//! Chunks have the components that a game gives to their terrain.

use crate::common::*;
use bevy_app::{App, PostUpdate};
use bevy_camera::visibility::{NoFrustumCulling, RenderLayers, VisibilityRange};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;

#[derive(Component, Clone, Debug, PartialEq)]
struct Tag(u32);

#[derive(Component, Clone, Debug, PartialEq)]
#[component(immutable)]
struct Fixed(u32);

/// A component that the game gives to one chunk.
#[derive(Component)]
struct Own;

fn app_with_tags() -> App {
    let mut app = app_with_budget(2);
    app.add_plugins((ChunkComponentPlugin::<Tag>::default(), ChunkComponentPlugin::<Fixed>::default()));
    app
}

/// The tags of a terrain's chunks, disabled ones included.
fn found<C: Component + Clone>(app: &mut App, terrain: Entity) -> Vec<Option<C>> {
    let mut chunks = app.world_mut().query_filtered::<(&Chunk, Option<&C>), Allow<Disabled>>();
    let of_terrain = chunks.iter(app.world()).filter(|(chunk, _)| chunk.terrain == terrain);
    of_terrain.map(|(_, component)| component.cloned()).collect()
}

#[test]
fn chunks_have_them_in_the_update_that_spawns_them() {
    let mut app = app_with_tags();
    let layers = RenderLayers::layer(3);
    let range = VisibilityRange::abrupt(0.0, 90.0);
    let terrain =
        app.world_mut().spawn((ball(), Tag(7), Fixed(8), layers.clone(), NoFrustumCulling, range.clone())).id();
    #[cfg(feature = "pbr")]
    app.world_mut().entity_mut(terrain).insert((bevy_light::NotShadowCaster, bevy_light::NotShadowReceiver));
    let mut seen = 0;
    for _ in 0..2_000 {
        app.update();
        let tags = found(&mut app, terrain);
        seen = tags.len();
        assert_eq!(tags, vec![Some(Tag(7)); seen]);
        assert_eq!(found(&mut app, terrain), vec![Some(Fixed(8)); seen]);
        assert_eq!(found(&mut app, terrain), vec![Some(NoFrustumCulling); seen]);
        assert!(found(&mut app, terrain).iter().all(|found| *found == Some(layers.clone())));
        assert!(found(&mut app, terrain).iter().all(|found| *found == Some(range.clone())));
        #[cfg(feature = "pbr")]
        {
            assert_eq!(found(&mut app, terrain), vec![Some(bevy_light::NotShadowCaster); seen]);
            let receivers = found::<bevy_light::NotShadowReceiver>(&mut app, terrain);
            assert!(receivers.iter().all(|found| found.is_some()));
        }
        if volume(&app, terrain).is_settled() {
            break;
        }
    }
    assert_eq!(seen, 8);
}

#[test]
fn chunks_follow_what_their_terrain_gets_changes_and_loses() {
    let mut app = app_with_tags();
    let terrain = settled(&mut app, ball());
    let other = app.world_mut().spawn((ball(), Tag(1))).id();
    settle(&mut app, other);
    // A child that is not a chunk.
    let child = app.world_mut().spawn(ChildOf(terrain)).id();
    assert_eq!(found::<Tag>(&mut app, terrain), vec![None; 8]);

    app.world_mut().entity_mut(terrain).insert((Tag(2), Fixed(2)));
    app.update();
    assert_eq!(found(&mut app, terrain), vec![Some(Tag(2)); 8]);
    assert_eq!(found(&mut app, terrain), vec![Some(Fixed(2)); 8]);

    app.world_mut().get_mut::<Tag>(terrain).unwrap().0 = 3;
    app.world_mut().entity_mut(terrain).insert(Fixed(3));
    app.update();
    assert_eq!(found(&mut app, terrain), vec![Some(Tag(3)); 8]);
    assert_eq!(found(&mut app, terrain), vec![Some(Fixed(3)); 8]);

    app.world_mut().entity_mut(terrain).remove::<(Tag, Fixed)>();
    app.update();
    assert_eq!(found::<Tag>(&mut app, terrain), vec![None; 8]);
    assert_eq!(found::<Fixed>(&mut app, terrain), vec![None; 8]);

    assert_eq!(found(&mut app, other), vec![Some(Tag(1)); 8], "another terrain's stay");
    assert!(!app.world().entity(child).contains::<Tag>());
    app.world_mut().despawn(other);
    app.update();
    assert_eq!(found::<Tag>(&mut app, other), []);
}

#[test]
fn a_plugin_that_comes_later_or_twice_works_all_the_same() {
    let mut app = app_with_budget(2);
    let terrain = app.world_mut().spawn((ball(), Tag(4))).id();
    settle(&mut app, terrain);
    assert_eq!(found::<Tag>(&mut app, terrain), vec![None; 8]);
    app.add_plugins(ChunkComponentPlugin::<Tag>::default());
    app.add_plugins(ChunkComponentPlugin::<Tag>::default());
    app.add_plugins(ChunkComponentPlugin::<RenderLayers>::default());
    app.update();
    assert_eq!(found(&mut app, terrain), vec![Some(Tag(4)); 8]);
}

#[test]
fn changes_of_a_disabled_terrain_count() {
    for chunks_too in [false, true] {
        let mut app = app_with_tags();
        let terrain = app.world_mut().spawn((ball(), Tag(1), Fixed(1))).id();
        settle(&mut app, terrain);
        if chunks_too {
            app.world_mut().entity_mut(terrain).insert_recursive::<Children>(Disabled);
        } else {
            app.world_mut().entity_mut(terrain).insert(Disabled);
        }
        app.update();
        app.world_mut().get_mut::<Tag>(terrain).unwrap().0 = 2;
        app.world_mut().entity_mut(terrain).remove::<Fixed>();
        app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(5));
        (0..5).for_each(|_| app.update());
        app.world_mut().entity_mut(terrain).remove_recursive::<Children, Disabled>();
        app.update();
        assert_eq!(found(&mut app, terrain), vec![Some(Tag(2)); 8]);
        assert_eq!(found::<Fixed>(&mut app, terrain), vec![None; 8]);
        assert!(found(&mut app, terrain).iter().all(|found| *found == Some(RenderLayers::layer(5))));
    }
}

/// The tags of the chunk that the game has marked, and of all others.
fn own_and_others(app: &mut App) -> (Vec<u32>, Vec<u32>) {
    let mut chunks = app.world_mut().query_filtered::<(&Tag, Has<Own>), With<Chunk>>();
    let (own, others): (Vec<_>, Vec<_>) = chunks.iter(app.world()).partition(|(_, is_own)| *is_own);
    let tags = |found: Vec<(&Tag, bool)>| found.into_iter().map(|(tag, _)| tag.0).collect();
    (tags(own), tags(others))
}

fn give_own(chunk: &Chunk, commands: &mut EntityCommands) {
    if chunk.position == bevy_math::IVec3::ZERO {
        commands.insert((Own, Tag(99)));
    }
}

#[test]
fn a_chunk_keeps_a_value_of_its_own_until_the_terrains_changes() {
    let observe = |added: On<Add, Chunk>, chunks: Query<&Chunk>, mut commands: Commands| {
        give_own(chunks.get(added.entity).unwrap(), &mut commands.entity(added.entity));
    };
    let decorate = |chunks: Query<(Entity, &Chunk), Added<Chunk>>, mut commands: Commands| {
        chunks.iter().for_each(|(entity, chunk)| give_own(chunk, &mut commands.entity(entity)));
    };
    // The game's observer, before and after the plugin's, and the game's system.
    for way in 0..3 {
        let mut app = app_with_budget(2);
        if way == 0 {
            app.add_observer(observe);
        }
        app.add_plugins(ChunkComponentPlugin::<Tag>::default());
        match way {
            1 => _ = app.add_observer(observe),
            2 => _ = app.add_systems(PostUpdate, decorate.in_set(MarchlessSystems::Decorate)),
            _ => {}
        }
        let terrain = app.world_mut().spawn((ball(), Tag(1))).id();
        settle(&mut app, terrain);
        assert_eq!(own_and_others(&mut app), (vec![99], vec![1; 7]), "way {way}");
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(10.0), 4.0)));
        (0..3).for_each(|_| app.update());
        assert_eq!(own_and_others(&mut app), (vec![99], vec![1; 7]), "an edit changes nothing");
        app.world_mut().entity_mut(terrain).insert(Tag(2));
        app.update();
        assert_eq!(own_and_others(&mut app), (vec![2], vec![2; 7]));
    }
}
