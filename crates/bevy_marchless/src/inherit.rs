//! Components that chunks inherit from their terrain: [`ChunkComponentPlugin`].
//!
//! The plugin spawns and despawns chunks as terrain loads. So a game gives its components to the terrain, or lets an
//! observer or a system give them to each chunk.
//!
//! # The same component for all chunks
//! Give the component to the terrain, and add a [`ChunkComponentPlugin`] for its type. Each chunk gets a copy when it
//! is spawned, before it is first drawn. Chunks follow when the terrain's component changes or is removed.
//!
//! [`InheritPlugin`] does this for `RenderLayers`, `NoFrustumCulling` and `VisibilityRange`, and with feature `pbr` for
//! `NotShadowCaster` and `NotShadowReceiver`. A `TerrainMaterialPlugin` does it for a type of material.
//!
//! ```
//! use bevy_app::prelude::*;
//! use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//!
//! /// The ground that footsteps sound like.
//! #[derive(Component, Clone)]
//! enum Ground { Gravel, Snow }
//!
//! fn plugin(app: &mut App) {
//!     app.add_plugins(ChunkComponentPlugin::<Ground>::default()).add_systems(Startup, setup);
//! }
//!
//! fn setup(mut commands: Commands) {
//!     commands.spawn((Terrain::new(|[_, y, _]: [f64; 3]| y - 30.0), Ground::Gravel));
//! }
//! ```
//!
//! # A component of its own for each chunk
//! Observe `On<Add, Chunk>`, which costs nothing while no chunk is new. The chunk already has its transform, its
//! [`ChunkGeometry`](crate::chunk::ChunkGeometry) and its `Aabb`; its `Mesh3d` follows with the same commands.
//!
//! ```
//! use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//!
//! # #[derive(Component)]
//! # struct Deep;
//! /// Marks chunks below sea level. Add it with `app.add_observer(mark_deep_chunk)`.
//! fn mark_deep_chunk(added: On<Add, Chunk>, chunks: Query<&Chunk>, mut commands: Commands) {
//!     if chunks.get(added.entity).is_ok_and(|chunk| chunk.position.y < 0) {
//!         commands.entity(added.entity).insert(Deep);
//!     }
//! }
//! ```
//!
//! Or add a system with a query for `Added<Chunk>` to [`MarchlessSystems::Decorate`]. There the update's new chunks
//! have all their components, including `Mesh3d`. Such a query checks every chunk in every update.
//!
//! A value that the game gives to a single chunk stays until the terrain's component changes or is removed.

use core::marker::PhantomData;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_camera::visibility::{NoFrustumCulling, RenderLayers, VisibilityRange};
use bevy_ecs::component::ComponentId;
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;
#[cfg(feature = "pbr")]
use bevy_light::{NotShadowCaster, NotShadowReceiver};

use crate::chunk::Chunk;
use crate::schedule::MarchlessSystems;
use crate::terrain::Terrain;

/// Gives a terrain's component `C` to its chunks and follows its changes, also while the terrain is `Disabled`.
///
/// It may be added at any time, and more than once; terrains and chunks that exist already are included. Changes reach
/// chunks in [`MarchlessSystems::Decorate`], removals at once. `C` may be immutable. It must not be a component that
/// the plugin itself gives to chunks, such as `Transform`, because it would overwrite the chunk's own.
pub struct ChunkComponentPlugin<C: Component + Clone>(PhantomData<fn() -> C>);

impl<C: Component + Clone> Default for ChunkComponentPlugin<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<C: Component + Clone> Plugin for ChunkComponentPlugin<C> {
    fn build(&self, app: &mut App) {
        let component = app.world_mut().register_component::<C>();
        if !app.world().contains_resource::<Inherited>() {
            app.init_resource::<Inherited>().add_observer(give_components);
        }
        let inherited = &mut app.world_mut().resource_mut::<Inherited>().0;
        if inherited.iter().all(|known| known.component != component) {
            inherited.push(Inheritance { component, give: give::<C> });
            app.add_observer(take_away::<C>).add_systems(PostUpdate, hand_on::<C>.in_set(MarchlessSystems::Decorate));
        }
    }

    fn is_unique(&self) -> bool {
        false
    }
}

/// Gives chunks the rendering components of their terrain: `RenderLayers`, `NoFrustumCulling` and `VisibilityRange`,
/// and with feature `pbr` also `NotShadowCaster` and `NotShadowReceiver`.
#[derive(Default)]
pub struct InheritPlugin;

impl Plugin for InheritPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            ChunkComponentPlugin::<RenderLayers>::default(),
            ChunkComponentPlugin::<NoFrustumCulling>::default(),
            ChunkComponentPlugin::<VisibilityRange>::default(),
        ));
        #[cfg(feature = "pbr")]
        app.add_plugins((
            ChunkComponentPlugin::<NotShadowCaster>::default(),
            ChunkComponentPlugin::<NotShadowReceiver>::default(),
        ));
    }
}

/// The component types that chunks inherit from their terrains.
#[derive(Resource, Default)]
struct Inherited(Vec<Inheritance>);

/// A component type that chunks inherit.
struct Inheritance {
    component: ComponentId,
    /// Gives a new chunk a copy of its terrain's component.
    give: fn(EntityRef, &mut EntityCommands),
}

/// Gives a new chunk its terrain's components, of all types in one observer.
fn give_components(
    added: On<Add, Chunk>,
    chunks: Query<&Chunk>,
    terrains: Query<EntityRef, Allow<Disabled>>,
    inherited: Res<Inherited>,
    mut commands: Commands,
) {
    let Ok(chunk) = chunks.get(added.entity) else { return };
    let Ok(terrain) = terrains.get(chunk.terrain) else { return };
    for Inheritance { component, give } in &inherited.0 {
        if terrain.contains_id(*component) {
            give(terrain, &mut commands.entity(added.entity));
        }
    }
}

/// Copies the terrain's component to a new chunk, but keeps a value that another observer has given it already.
fn give<C: Component + Clone>(terrain: EntityRef, chunk: &mut EntityCommands) {
    if let Some(component) = terrain.get::<C>() {
        chunk.try_insert_if_new(component.clone());
    }
}

/// Copies changed components from terrains to their chunks.
fn hand_on<C: Component + Clone>(
    changed: Query<(&C, &Children), (Changed<C>, With<Terrain>, Allow<Disabled>)>,
    chunks: Query<Entity, (With<Chunk>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    for (component, children) in &changed {
        for chunk in chunks.iter_many(children) {
            commands.entity(chunk).try_insert(component.clone());
        }
    }
}

/// Removes a component from the chunks of a terrain that loses it.
fn take_away<C: Component + Clone>(
    removed: On<Remove, C>,
    terrains: Query<&Children, (With<Terrain>, Allow<Disabled>)>,
    chunks: Query<Entity, (With<Chunk>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    if let Ok(children) = terrains.get(removed.entity) {
        for chunk in chunks.iter_many(children) {
            commands.entity(chunk).try_remove::<C>();
        }
    }
}
