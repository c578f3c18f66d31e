//! The level: ground, an island that floats above it, and a wall, hidden at first, between the ground and the camera.

use bevy::camera::visibility::RenderLayers;
use bevy::input::common_conditions::input_just_pressed;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::fly_camera;

use crate::layers;
use crate::shell::Screen;

/// The hills that one digs. What scenes do not hold comes with it.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default)]
#[require(RenderLayers = layers::of_hills(), DespawnOnExit<Screen> = of_level())]
pub(crate) struct Hills;

/// What floats above them.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default)]
#[require(NotShadowCaster, DespawnOnExit<Screen> = of_level())]
pub(crate) struct Island;

/// What stands in front of them, if it is shown.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default)]
#[require(DespawnOnExit<Screen> = of_level())]
pub(crate) struct Wall;

fn of_level() -> DespawnOnExit<Screen> {
    DespawnOnExit(Screen::Level)
}

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn_camera)
        .add_systems(OnEnter(Screen::Level), spawn_level)
        .add_systems(Update, show_or_hide_wall.run_if(input_just_pressed(KeyCode::KeyH)));
}

/// The camera is there in the menu, too.
fn spawn_camera(mut commands: Commands) {
    commands.spawn(fly_camera(Vec3::new(64.0, 130.0, 220.0), Vec3::new(64.0, 50.0, 64.0)));
}

fn spawn_level(mut commands: Commands) {
    let hills = Terrain::new(NoiseHeights::from_seed(7)).with_extent(UVec3::new(4, 3, 4));
    commands.spawn((hills, Hills));

    let island = Sdf::sphere(Vec3::new(32.0, 26.0, 32.0), 20.0)
        .intersection(Sdf::cuboid(Vec3::new(32.0, 10.0, 32.0), Vec3::new(30.0, 10.0, 30.0)))
        .with_material(2);
    commands.spawn((
        Terrain::new(island).with_extent(UVec3::new(2, 1, 2)),
        Transform::from_xyz(32.0, 96.0, 24.0),
        Island,
    ));

    let wall = Sdf::cuboid(Vec3::new(64.0, 32.0, 16.0), Vec3::new(60.0, 28.0, 4.0)).with_material(5);
    commands.spawn((
        Terrain::new(wall).with_extent(UVec3::new(4, 2, 1)),
        Transform::from_xyz(0.0, 60.0, 140.0),
        Visibility::Hidden,
        Wall,
    ));
}

/// A terrain's `Visibility` is that of its chunks, and of rays: what is hidden is loaded, but hit by none.
fn show_or_hide_wall(mut walls: Query<&mut Visibility, With<Wall>>) {
    for mut visibility in &mut walls {
        visibility.toggle_visible_hidden();
    }
}
