//! Digging at the middle of the screen.

use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy_egui::input::egui_wants_any_pointer_input;
use bevy_marchless::prelude::*;
use marchless_examples::camera::{FlyCamera, GrabMouse, mouse_is_grabbed};

/// [Units: voxels]
const RADIUS: f32 = 12.0;

pub(crate) fn plugin(app: &mut App) {
    // The click that grabs the mouse does not dig.
    let dig = dig.run_if(mouse_is_grabbed).run_if(input_just_pressed(MouseButton::Left)).before(GrabMouse);
    app.configure_sets(Update, GrabMouse.run_if(not(egui_wants_any_pointer_input))).add_systems(Update, dig);
}

fn dig(camera: Single<&Transform, With<FlyCamera>>, terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
    if let Some(hit) = terrains.ray_cast(Ray3d::new(camera.translation, camera.forward()), 2_000.0) {
        stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, RADIUS)));
    }
}
