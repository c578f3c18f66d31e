//! The block, the light and the camera, and growing beside the drawing.

use core::error::Error;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use marchless_examples::camera::fly_camera;
use marchless_examples::picture::PictureReady;

use crate::caves::{Caves, Figures, Settings};

/// How large the block is drawn. [Units: world]
const EXTENT: f32 = 100.0;
const BACKGROUND: Color = Color::srgb(0.055, 0.065, 0.09);

/// Caves in the making; there is never more than one.
#[derive(Resource, Default)]
pub(crate) struct Growing {
    task: Option<Task<Result<Grown, Box<dyn Error + Send + Sync>>>>,
    /// What is shown, or being made.
    settings: Option<Settings>,
}

/// What the task leaves.
struct Grown {
    mesh: Mesh,
    figures: Figures,
}

/// The figures of the caves that are shown.
#[derive(Resource, Default)]
pub(crate) struct Shown(pub(crate) Option<Figures>);

/// The body that is shown.
#[derive(Component)]
struct Block;

pub(crate) fn plugin(app: &mut App) {
    app.insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 700.0, color: Color::srgb(0.80, 0.87, 1.0), ..default() })
        .init_resource::<Growing>()
        .init_resource::<Shown>()
        .add_systems(Startup, set_up)
        .add_systems(Update, (show, grow).chain());
}

impl Growing {
    /// Whether what is shown is not yet what the settings say.
    pub(crate) fn is_busy(&self) -> bool {
        self.task.is_some()
    }
}

fn set_up(mut commands: Commands) {
    let eye = EXTENT * Vec3::new(1.22, 0.98, 1.36);
    commands.spawn((fly_camera(eye, EXTENT * Vec3::new(0.0, -0.11, 0.0)), Tonemapping::AcesFitted)).with_child((
        // A lamp in the hand.
        PointLight { intensity: 4.0e6, range: 60.0, color: Color::srgb(1.0, 0.86, 0.68), ..default() },
    ));
    let shadows = CascadeShadowConfigBuilder { num_cascades: 2, maximum_distance: 4.0 * EXTENT, ..default() };
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        shadows.build(),
        Transform::default().looking_to(Vec3::new(-0.55, -1.0, -0.8), Vec3::Y),
    ));
}

/// Starts growing where the settings are no longer those of what is shown, or being made. What comes meanwhile waits,
/// so that sliders move freely and only their last place counts.
fn grow(settings: Res<Settings>, mut growing: ResMut<Growing>) {
    if growing.task.is_some() || growing.settings.as_ref() == Some(&*settings) {
        return;
    }
    let settings = settings.clone();
    growing.settings = Some(settings.clone());
    growing.task = Some(AsyncComputeTaskPool::get().spawn(async move {
        let caves = Caves::grow(&settings)?;
        let mesh = caves.solid.to_asset(|position, _, _| caves.color(position));
        Ok(Grown { mesh, figures: caves.figures })
    }));
}

/// Shows what has been made.
fn show(
    mut growing: ResMut<Growing>,
    mut shown: ResMut<Shown>,
    blocks: Query<Entity, With<Block>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) -> Result {
    let Some(grown) = growing.task.as_mut().and_then(|task| block_on(poll_once(task))) else { return Ok(()) };
    growing.task = None;
    let Grown { mesh, figures } = grown?;
    for block in &blocks {
        commands.entity(block).despawn();
    }
    let edge = growing.settings.as_ref().map_or(1, |settings| settings.edge) as f32;
    let scale = EXTENT / edge;
    let material = StandardMaterial { perceptual_roughness: 0.95, reflectance: 0.2, ..default() };
    commands.spawn((
        Block,
        Mesh3d(meshes.add(mesh)),
        MeshMaterial3d(materials.add(material)),
        Transform::from_translation(Vec3::splat(-0.5 * scale * (edge - 1.0))).with_scale(Vec3::splat(scale)),
    ));
    shown.0 = Some(figures);
    Ok(())
}

/// The picture waits for the caves.
pub(crate) fn be_ready(shown: Res<Shown>, mut ready: ResMut<PictureReady>) {
    if !ready.0
        && let Some(figures) = &shown.0
    {
        for (name, value) in figures.lines() {
            println!("{name}: {value}");
        }
        ready.0 = true;
    }
}
