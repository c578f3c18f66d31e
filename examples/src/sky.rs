//! [`Sky`]: a dome round the camera with a gradient, a sun and clouds.

use bevy::asset::uuid_handle;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::pbr::wireframe::NoWireframe;
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, ShaderType};
use bevy::shader::{Shader, ShaderRef};

use crate::look::{LOOKS, Look, air, linear};

/// The dome; it follows the camera.
#[derive(Component)]
pub struct Sky;

/// What the sky looks like.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct SkyMaterial {
    #[uniform(0)]
    sky: SkyUniform,
}

/// Colours are linear.
#[derive(ShaderType, Clone, Copy, Debug)]
struct SkyUniform {
    zenith: Vec4,
    horizon: Vec4,
    /// The alpha is the share of clouds.
    sun: Vec4,
    to_sun: Vec4,
}

impl SkyMaterial {
    /// The sky of `look`.
    pub fn new(look: &Look) -> Self {
        Self {
            sky: SkyUniform {
                zenith: air(look.zenith).to_vec4(),
                horizon: air(look.horizon).to_vec4(),
                sun: linear(look.sun).to_vec4().with_w(look.clouds),
                to_sun: look.to_sun().extend(0.0),
            },
        }
    }
}

const SHADER: Handle<Shader> = uuid_handle!("b8a2f6d1-94c7-4e0c-a4d5-3f1f5b6e7c02");

impl Material for SkyMaterial {
    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }
}

/// The dome's radius, within the far plane of a camera as Bevy makes it. [Units: world]
const RADIUS: f32 = 900.0;

pub(crate) fn plugin(app: &mut App) {
    let shader = Shader::from_wgsl(include_str!("sky.wgsl"), "marchless_examples/sky.wgsl");
    let inserted = app.world_mut().resource_mut::<Assets<Shader>>().insert(&SHADER, shader);
    debug_assert!(inserted.is_ok(), "the handle of the sky's shader is not taken");
    app.add_plugins(MaterialPlugin::<SkyMaterial>::default())
        .add_systems(PreStartup, spawn_sky)
        .add_systems(PostUpdate, follow_camera.before(TransformSystems::Propagate));
}

fn spawn_sky(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<SkyMaterial>>) {
    commands.spawn((
        Sky,
        // Seen from inside.
        Mesh3d(meshes.add(Sphere::new(RADIUS).mesh().uv(32, 16).scaled_by(Vec3::new(-1.0, 1.0, 1.0)))),
        MeshMaterial3d(materials.add(SkyMaterial::new(&LOOKS[0]))),
        NoFrustumCulling,
        NoWireframe,
        NotShadowCaster,
        NotShadowReceiver,
    ));
}

fn follow_camera(
    mut skies: Query<&mut Transform, With<Sky>>,
    cameras: Query<(&Transform, &Projection), (With<Camera3d>, Without<Sky>)>,
) {
    let Some((camera, projection)) = cameras.iter().next() else { return };
    let far = if let Projection::Perspective(perspective) = projection { perspective.far } else { RADIUS / 0.9 };
    for mut sky in &mut skies {
        *sky = Transform::from_translation(camera.translation).with_scale(Vec3::splat(0.9 * far / RADIUS));
    }
}
