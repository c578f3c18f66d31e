//! [`TerrainMaterialPlugin`]: draws chunks with the `MeshMaterial3d` of their terrain.

use core::marker::PhantomData;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::{Assets, Handle};
use bevy_ecs::component::ComponentId;
use bevy_ecs::prelude::*;
use bevy_ecs::resource::IsResource;
use bevy_pbr::{Material, MeshMaterial3d, StandardMaterial};

use crate::inherit::ChunkComponentPlugin;
use crate::mesh::ChunkSamples;
use crate::schedule::UpdatePhase;
use crate::terrain::Terrain;

/// Gives a terrain's `MeshMaterial3d<M>` to its chunks and follows its changes, as [`ChunkComponentPlugin`] does.
///
/// Terrains and standalone chunks with a material of this type get no plain material. [`StandardTerrainMaterialPlugin`]
/// adds this plugin for [`StandardMaterial`]; add it for each other type of material that your terrains use.
pub struct TerrainMaterialPlugin<M: Material>(PhantomData<M>);

impl<M: Material> Default for TerrainMaterialPlugin<M> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<M: Material> Plugin for TerrainMaterialPlugin<M> {
    fn build(&self, app: &mut App) {
        let component = app.world_mut().register_component::<MeshMaterial3d<M>>();
        app.init_resource::<MaterialTypes>();
        app.world_mut().resource_mut::<MaterialTypes>().0.push(component);
        app.add_plugins(ChunkComponentPlugin::<MeshMaterial3d<M>>::default());
    }
}

/// Draws terrains and standalone [`ChunkSamples`] with [`StandardMaterial`]: their own, or a plain one if they have no
/// material.
///
/// A material of another type is recognised only if there is a [`TerrainMaterialPlugin`] for its type.
#[derive(Default)]
pub struct StandardTerrainMaterialPlugin;

impl Plugin for StandardTerrainMaterialPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(TerrainMaterialPlugin::<StandardMaterial>::default())
            .add_observer(take_away_plain_material)
            .add_systems(PostUpdate, give_default_material.in_set(UpdatePhase::Prepare));
    }
}

/// The types of material that have a [`TerrainMaterialPlugin`].
#[derive(Resource, Default)]
struct MaterialTypes(Vec<ComponentId>);

/// Marks terrains and standalone chunks that have been given the plain material.
#[derive(Component, Clone)]
struct PlainMaterial;

/// Gives terrains and standalone chunks without a material a plain one, which shows the palette's colours. Removes it
/// when they get a material of another type.
fn give_default_material(
    // Resources are components, too; this query must leave them out, because `assets` is borrowed mutably.
    drawn: Query<EntityRef, (Or<(With<Terrain>, With<ChunkSamples>)>, Without<IsResource>)>,
    types: Res<MaterialTypes>,
    assets: Option<ResMut<Assets<StandardMaterial>>>,
    mut plain: Local<Option<Handle<StandardMaterial>>>,
    mut commands: Commands,
) {
    let Some(mut assets) = assets else { return };
    for found in &drawn {
        let materials = types.0.iter().filter(|component| found.contains_id(**component)).count();
        let mut entity = commands.entity(found.id());
        if materials == 0 {
            let make = || assets.add(StandardMaterial { perceptual_roughness: 0.9, ..StandardMaterial::default() });
            entity.try_insert((MeshMaterial3d(plain.get_or_insert_with(make).clone()), PlainMaterial));
        } else if materials > 1 && found.contains::<PlainMaterial>() {
            entity.try_remove::<(MeshMaterial3d<StandardMaterial>, PlainMaterial)>();
        }
    }
}

/// Removes the plain material from a standalone chunk that loses its samples.
fn take_away_plain_material(
    removed: On<Remove, ChunkSamples>,
    plain: Query<(), (With<PlainMaterial>, Without<Terrain>)>,
    mut commands: Commands,
) {
    if plain.contains(removed.entity) {
        commands.entity(removed.entity).try_remove::<(MeshMaterial3d<StandardMaterial>, PlainMaterial)>();
    }
}
