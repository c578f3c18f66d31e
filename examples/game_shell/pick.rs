//! Bevy's own ray casts find chunks, too: they read the meshes, which the plugin keeps for them if told to.

use bevy::asset::RenderAssetUsages;
use bevy::input::common_conditions::input_just_pressed;
use bevy::picking::mesh_picking::ray_cast::{MeshRayCast, MeshRayCastSettings};
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use marchless_examples::camera::FlyCamera;

/// [Units: world]
const RADIUS: f32 = 6.0;

/// The chunk that was hit last, and its terrain.
#[derive(Resource, Default)]
pub(crate) struct Picked(pub(crate) Option<[Entity; 2]>);

pub(crate) fn plugin(app: &mut App) {
    let mesh_usages = RenderAssetUsages::RENDER_WORLD | RenderAssetUsages::MAIN_WORLD;
    app.insert_resource(MarchlessSettings { mesh_usages, ..default() })
        .init_resource::<Picked>()
        .add_systems(Update, pick.run_if(input_just_pressed(KeyCode::KeyE)));
}

/// Digs where the camera looks: from the mesh to the chunk, from the chunk to its terrain, from the place in the world
/// to one in the terrain.
fn pick(
    camera: Single<&Transform, With<FlyCamera>>,
    mut meshes: MeshRayCast,
    chunks: Query<&Chunk>,
    terrains: TerrainQuery,
    mut stamps: MessageWriter<Stamp>,
    mut picked: ResMut<Picked>,
) {
    let ray = Ray3d::new(camera.translation, camera.forward());
    let Some((entity, hit)) = meshes.cast_ray(ray, &MeshRayCastSettings::default()).first() else { return };
    let Ok(&Chunk { terrain, .. }) = chunks.get(*entity) else { return };
    picked.0 = Some([*entity, terrain]);
    if let (Some(place), Some(radius)) =
        (terrains.to_lattice(terrain, hit.point), terrains.to_lattice_length(terrain, RADIUS))
    {
        stamps.write(Stamp::dig(terrain, BrushShape::sphere(place, radius)));
    }
}
