//! How chunks get components beyond the plugin's own.
//!
//! Chunks are entities that the plugin spawns and despawns as terrain loads, so a game gives their components to the
//! terrain, or has a system or an observer give them to each chunk.
//!
//! # The same for all chunks of a terrain
//! Give the component to the terrain, and add a [`ChunkComponentPlugin`] for its type. Chunks get a copy as soon as they
//! are there, before they are first drawn, and follow its changes and its removal.
//!
//! It is there for `RenderLayers`, `NoFrustumCulling` and `VisibilityRange` ([`InheritPlugin`]), with feature `pbr` for
//! `NotShadowCaster` and `NotShadowReceiver` too, and for each type of material that has a `TerrainMaterialPlugin`.
//!
//! ```
//! use bevy_app::prelude::*;
//! use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//!
//! /// Which footsteps are heard.
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
//! # Another for each chunk
//! Observe `On<Add, Chunk>`, which costs nothing while no chunk is new. The chunk has its place, its
//! [`ChunkGeometry`](crate::chunk::ChunkGeometry) and its `Aabb` by then; its `Mesh3d` follows with the same commands.
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
//! Or put a system with a query for `Added<Chunk>` into
//! [`MarchlessSystems::Decorate`], where the update's new chunks have all their components, `Mesh3d` included. Bevy finds
//! what was added by a look at every chunk.
//!
//! A chunk to which the game gives a value of its own keeps it until the terrain's changes or goes.

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

/// Gives a terrain's `C` to its chunks and follows its changes, also while the terrain is disabled (`Disabled`).
///
/// It may be added at any time and more than once; terrains and chunks that are there already count. Changes reach
/// chunks in [`MarchlessSystems::Decorate`], removals at once. `C` may be immutable. It must be none of the components
/// that the plugin itself gives to chunks, such as `Transform`: those would be overwritten.
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

/// Gives chunks those components of their terrain by which Bevy decides who sees them: `RenderLayers`,
/// `NoFrustumCulling` and `VisibilityRange`, and with feature `pbr` `NotShadowCaster` and `NotShadowReceiver`.
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

/// The components that chunks get from their terrains.
#[derive(Resource, Default)]
struct Inherited(Vec<Inheritance>);

/// One of them.
struct Inheritance {
    component: ComponentId,
    /// Gives a new chunk a copy of its terrain's.
    give: fn(EntityRef, &mut EntityCommands),
}

/// A new chunk gets its terrain's components as soon as it is there: one observer for all types.
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

/// Another observer may have given the chunk a value of its own already, which stays.
fn give<C: Component + Clone>(terrain: EntityRef, chunk: &mut EntityCommands) {
    if let Some(component) = terrain.get::<C>() {
        chunk.try_insert_if_new(component.clone());
    }
}

/// Gives the chunks of terrains what has changed on them.
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

/// Chunks lose what their terrain loses.
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
