//! [`render`]: small things on an empty stage, as a picture for a page of documentation.

use core::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;

use crate::graphics;
use crate::picture::{FewColors, PicturePlugin, PictureReady, check_picture, picture_plugins};

/// What is drawn, and from where.
#[derive(Resource)]
pub struct Stage {
    /// The things.
    pub props: Vec<Prop>,
    /// The middle of what is looked at. [Units: world]
    pub target: Vec3,
    /// From there to the camera. [Units: world]
    pub eye: Vec3,
    /// The direction in which the sun shines.
    pub sun: Vec3,
}

/// A thing in its place, in the colours of its vertices.
pub struct Prop {
    /// Its shape and colours.
    pub mesh: Mesh,
    /// Where its origin is. [Units: world]
    pub place: Vec3,
}

/// Why there is nothing to draw.
pub type Failure = Box<dyn Error + Send + Sync>;

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// There is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

/// Renders a stage into a picture file of at most 256 colours, without a window. `size`: in pixels.
///
/// Where that fails it says so, after `name`, and returns code 2, or 3 where there is no graphics adapter.
pub fn render(
    name: &str,
    picture: PathBuf,
    size: UVec2,
    stage: impl FnOnce() -> core::result::Result<Stage, Failure>,
) -> ExitCode {
    let stage = match check_picture(&picture).map_err(Into::into).and_then(|()| stage()) {
        Ok(stage) => stage,
        Err(error) => {
            eprintln!("{name}: {error}");
            return ExitCode::from(BAD_INPUT);
        }
    };
    let picture = PicturePlugin { path: picture, size };
    match graphics::build(|app| _ = app.add_plugins((picture_plugins(), picture))) {
        Err(reason) => {
            eprintln!("{name}: no picture can be rendered, since {reason}");
            ExitCode::from(NO_GRAPHICS)
        }
        Ok(mut app) => {
            app.insert_resource(ClearColor(Color::srgb(0.93, 0.94, 0.96)))
                .insert_resource(GlobalAmbientLight { brightness: 900.0, ..default() })
                .insert_resource(FewColors)
                .insert_resource(stage)
                .add_systems(Startup, set_up)
                .add_systems(Update, be_ready);
            match app.run() {
                AppExit::Success => ExitCode::SUCCESS,
                AppExit::Error(code) => ExitCode::from(code.get()),
            }
        }
    }
}

fn set_up(
    mut stage: ResMut<Stage>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    let material = materials.add(StandardMaterial { perceptual_roughness: 0.9, reflectance: 0.2, ..default() });
    for Prop { mesh, place } in stage.props.drain(..) {
        let mesh = Mesh3d(meshes.add(mesh));
        commands.spawn((mesh, MeshMaterial3d(material.clone()), Transform::from_translation(place)));
    }
    commands.spawn((
        Camera3d::default(),
        Projection::from(PerspectiveProjection { fov: 0.6, ..default() }),
        Transform::from_translation(stage.target + stage.eye).looking_at(stage.target, Vec3::Y),
        Tonemapping::AcesFitted,
    ));
    let maximum_distance = 2.5 * stage.eye.length();
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { num_cascades: 2, maximum_distance, ..default() }.build(),
        Transform::default().looking_to(stage.sun, Vec3::Y),
    ));
}

/// Meshes and materials arrive with the first updates.
fn be_ready(mut updates: Local<u32>, mut ready: ResMut<PictureReady>) {
    *updates += 1;
    ready.0 = *updates > 3;
}
