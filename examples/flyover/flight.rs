//! [`Flight`]: flying on towards the horizon, the same in the window and without any renderer.

use bevy::prelude::*;
use bevy_egui::input::egui_wants_any_keyboard_input;
use bevy_marchless::prelude::*;
use marchless_examples::camera::{FlyCamera, fly_camera};

use crate::world::{FLIGHT_LEVEL, World};

/// How fast the keys 1 to 9 fly. [Units: voxels per second]
pub(crate) const SPEEDS: [f32; 9] = [10.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0, 1_600.0, 3_200.0];

const DIGITS: [KeyCode; 9] = [
    KeyCode::Digit1,
    KeyCode::Digit2,
    KeyCode::Digit3,
    KeyCode::Digit4,
    KeyCode::Digit5,
    KeyCode::Digit6,
    KeyCode::Digit7,
    KeyCode::Digit8,
    KeyCode::Digit9,
];

/// How the viewers fly.
#[derive(Resource, Clone, Copy, Debug)]
pub(crate) struct Flight {
    /// [Units: voxels per second]
    pub(crate) speed: f32,
    /// Whether they fly on by themselves, level, in the direction in which they look.
    pub(crate) goes_on: bool,
}

/// What a window takes to fly; [`fly_on`] is all that a flight without one needs.
pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Update, (press_keys.run_if(not(egui_wants_any_keyboard_input)), fly_on).chain());
}

/// Where the flight begins, and where it looks.
pub(crate) fn start() -> Transform {
    Transform::from_xyz(0.0, FLIGHT_LEVEL, 0.0).looking_to(Vec3::new(0.3, -0.22, -1.0), Vec3::Y)
}

pub(crate) fn spawn_camera(world: Res<World>, flight: Res<Flight>, mut commands: Commands) {
    let start = start();
    let camera =
        commands.spawn((fly_camera(start.translation, start.translation + *start.forward()), world.viewer())).id();
    commands.entity(camera).insert(FlyCamera { speed: flight.speed, ..default() });
}

/// Moves all viewers.
pub(crate) fn fly_on(time: Res<Time>, flight: Res<Flight>, mut viewers: Query<&mut Transform, With<TerrainViewer>>) {
    if !flight.goes_on {
        return;
    }
    for mut transform in &mut viewers {
        let level = transform.forward().with_y(0.0).normalize_or_zero();
        transform.translation += level * flight.speed * time.delta_secs();
    }
}

fn press_keys(keys: Res<ButtonInput<KeyCode>>, mut flight: ResMut<Flight>, mut cameras: Query<&mut FlyCamera>) {
    if keys.just_pressed(KeyCode::KeyF) {
        flight.goes_on = !flight.goes_on;
    }
    if let Some(number) = DIGITS.iter().position(|key| keys.just_pressed(*key)) {
        flight.speed = SPEEDS[number];
        cameras.iter_mut().for_each(|mut camera| camera.speed = flight.speed);
    }
}
