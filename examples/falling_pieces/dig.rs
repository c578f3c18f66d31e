//! Digging at the middle of the screen, and building everything anew.

use bevy::input::common_conditions::{input_just_pressed, input_pressed};
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use bevy_marchless::prelude::*;
use marchless_examples::camera::{FlyCamera, GrabMouse, mouse_is_grabbed};

use crate::bodies::Body;
use crate::scene;

/// [Units: voxels]
const RADIUS: f32 = 3.5;

pub(crate) fn plugin(app: &mut App) {
    // The click that grabs the mouse does not dig.
    let dig = dig.run_if(mouse_is_grabbed).run_if(input_pressed(MouseButton::Left)).before(GrabMouse);
    app.add_systems(Update, (dig, build_anew.run_if(input_just_pressed(KeyCode::KeyR))))
        .add_systems(EguiPrimaryContextPass, draw_crosshair.run_if(mouse_is_grabbed));
}

fn dig(camera: Single<&Transform, With<FlyCamera>>, terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
    if let Some(hit) = terrains.ray_cast(Ray3d::new(camera.translation, camera.forward()), 1000.0) {
        stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, RADIUS)));
    }
}

fn build_anew(mut terrain: Single<&mut Terrain>, bodies: Query<Entity, With<Body>>, mut commands: Commands) {
    **terrain = scene::terrain();
    for body in &bodies {
        commands.entity(body).despawn();
    }
}

fn draw_crosshair(mut contexts: EguiContexts) -> Result {
    let context = contexts.ctx_mut()?;
    let painter = context.layer_painter(egui::LayerId::background());
    painter.circle_stroke(context.content_rect().center(), 5.0, egui::Stroke::new(1.5, egui::Color32::WHITE));
    Ok(())
}
