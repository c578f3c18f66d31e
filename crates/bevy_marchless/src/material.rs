//! [`TerrainMaterialPlugin`]: chunks are drawn with the `MeshMaterial3d` of their terrain.

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

/// Gives a terrain's `MeshMaterial3d<M>` to its chunks and follows its changes, as [`ChunkComponentPlugin`] does, and has
/// no plain material given to what has one of this type.
///
/// [`StandardTerrainMaterialPlugin`] adds it for [`StandardMaterial`]; add it for each other type of material that terrains have.
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

/// Draws terrains and hand-made [`ChunkSamples`] with [`StandardMaterial`]: their own, or a plain one where they have none.
/// That they have another is known where there is a [`TerrainMaterialPlugin`] for its type.
#[derive(Default)]
pub struct StandardTerrainMaterialPlugin;

impl Plugin for StandardTerrainMaterialPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(TerrainMaterialPlugin::<StandardMaterial>::default())
            .add_observer(take_away_plain_material)
            .add_systems(PostUpdate, give_default_material.in_set(UpdatePhase::Prepare));
    }
}

/// The material components that some [`TerrainMaterialPlugin`] hands on.
#[derive(Resource, Default)]
struct MaterialTypes(Vec<ComponentId>);

/// On terrains and hand-made chunks that have been given the plain material.
#[derive(Component, Clone)]
struct PlainMaterial;

/// Gives terrains and hand-made chunks without any material a plain one, which shows the palette's colours, and takes it
/// away when they get another.
fn give_default_material(
    // Resources are components too; without them, `assets` may be changed meanwhile.
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

/// Without its samples an entity that was a hand-made chunk has no use for the plain material.
fn take_away_plain_material(
    removed: On<Remove, ChunkSamples>,
    plain: Query<(), (With<PlainMaterial>, Without<Terrain>)>,
    mut commands: Commands,
) {
    if plain.contains(removed.entity) {
        commands.entity(removed.entity).try_remove::<(MeshMaterial3d<StandardMaterial>, PlainMaterial)>();
    }
}
