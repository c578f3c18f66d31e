//! [`FlyCamera`]: a camera that flies in the direction of the view.
//!
//! A click grabs the mouse, Esc frees it. While it is grabbed the mouse turns the camera; W, A, S and D fly, Space
//! rises, Shift sinks, and Ctrl flies faster.

use core::f32::consts::FRAC_PI_2;

use bevy::input::mouse::AccumulatedMouseMotion;
use bevy::prelude::*;
use bevy::window::{CursorGrabMode, CursorOptions, PrimaryWindow};

/// A camera that flies where one looks. Its rotation is taken over from its `Transform`.
#[derive(Component, Clone, Copy, Debug)]
#[require(Camera3d)]
pub struct FlyCamera {
    /// [Units: world per second] [Default: 40]
    pub speed: f32,
    /// How many times faster it is while Ctrl is held. [Default: 4]
    pub boost: f32,
    /// How far a movement of the mouse turns it. [Units: radians per dot] [Default: 0.002]
    pub sensitivity: f32,
}

impl Default for FlyCamera {
    fn default() -> Self {
        Self { speed: 40.0, boost: 4.0, sensitivity: 0.002 }
    }
}

/// A [`FlyCamera`] at `eye` that looks at `target`.
pub fn fly_camera(eye: Vec3, target: Vec3) -> impl Bundle {
    (FlyCamera::default(), Transform::from_translation(eye).looking_at(target, Vec3::Y))
}

/// Moves every [`FlyCamera`] and grabs the mouse for it.
pub struct FlyCameraPlugin;

impl Plugin for FlyCameraPlugin {
    fn build(&self, app: &mut App) {
        let turn = turn.run_if(mouse_is_grabbed);
        app.add_systems(Update, (free_mouse, grab_mouse.in_set(GrabMouse), turn, fly).chain());
    }
}

/// The system that grabs the mouse where one clicks; give it a run condition where a click may mean something else.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GrabMouse;

/// Whether the mouse turns the camera at the moment.
pub fn mouse_is_grabbed(cursor: Query<&CursorOptions, With<PrimaryWindow>>) -> bool {
    cursor.iter().any(|cursor| cursor.grab_mode != CursorGrabMode::None)
}

fn free_mouse(keys: Res<ButtonInput<KeyCode>>, mut windows: Query<(&Window, &mut CursorOptions), With<PrimaryWindow>>) {
    for (window, mut cursor) in &mut windows {
        let grabbed = cursor.grab_mode != CursorGrabMode::None;
        if grabbed && (keys.just_pressed(KeyCode::Escape) || !window.focused) {
            cursor.grab_mode = CursorGrabMode::None;
            cursor.visible = true;
        }
    }
}

fn grab_mouse(
    buttons: Res<ButtonInput<MouseButton>>,
    mut windows: Query<(&Window, &mut CursorOptions), With<PrimaryWindow>>,
) {
    for (window, mut cursor) in &mut windows {
        let grabbed = cursor.grab_mode != CursorGrabMode::None;
        if !grabbed && window.focused && buttons.just_pressed(MouseButton::Left) {
            cursor.grab_mode = CursorGrabMode::Locked;
            cursor.visible = false;
        }
    }
}

fn turn(motion: Res<AccumulatedMouseMotion>, mut cameras: Query<(&mut Transform, &FlyCamera)>) {
    if motion.delta == Vec2::ZERO {
        return;
    }
    for (mut transform, camera) in &mut cameras {
        let (yaw, pitch, _) = transform.rotation.to_euler(EulerRot::YXZ);
        let yaw = yaw - motion.delta.x * camera.sensitivity;
        let pitch = (pitch - motion.delta.y * camera.sensitivity).clamp(0.01 - FRAC_PI_2, FRAC_PI_2 - 0.01);
        transform.rotation = Quat::from_euler(EulerRot::YXZ, yaw, pitch, 0.0);
    }
}

fn fly(time: Res<Time>, keys: Res<ButtonInput<KeyCode>>, mut cameras: Query<(&mut Transform, &FlyCamera)>) {
    let axis = |more: KeyCode, less: KeyCode| f32::from(keys.pressed(more)) - f32::from(keys.pressed(less));
    let [right, up, back] = [
        axis(KeyCode::KeyD, KeyCode::KeyA),
        axis(KeyCode::Space, KeyCode::ShiftLeft),
        axis(KeyCode::KeyS, KeyCode::KeyW),
    ];
    for (mut transform, camera) in &mut cameras {
        let level = transform.rotation * Vec3::new(right, 0.0, back);
        let direction = (level + Vec3::Y * up).normalize_or_zero();
        let boost = if keys.pressed(KeyCode::ControlLeft) { camera.boost } else { 1.0 };
        if direction != Vec3::ZERO {
            transform.translation += direction * camera.speed * boost * time.delta_secs();
        }
    }
}
