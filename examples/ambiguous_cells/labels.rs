//! The cubes' titles, figures and corner numbers, drawn over the picture.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use marchless::cell::Corner;

use crate::scene::{Cube, corner_place};

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(EguiPrimaryContextPass, draw_labels);
}

const TITLE: egui::Color32 = egui::Color32::from_rgb(240, 240, 240);
const FIGURES: egui::Color32 = egui::Color32::from_rgb(190, 196, 206);
const SHADOW: egui::Color32 = egui::Color32::from_rgb(20, 22, 28);
const NUMBER: egui::Color32 = egui::Color32::from_rgb(225, 228, 232);

/// Where a cube's title and its figures stand. [Units: cells]
const ABOVE: f32 = 1.2;
const BELOW: f32 = -1.12;
/// How far a corner's number stands from its middle. [Units: cells]
const OFFSET: f32 = 0.17;

fn draw_labels(
    mut contexts: EguiContexts,
    camera: Single<(&Camera, &Transform), Without<Cube>>,
    cubes: Query<(&Cube, &Transform)>,
) -> Result {
    let painter = contexts.ctx_mut()?.layer_painter(egui::LayerId::background());
    let (camera, eye) = *camera;
    let eye = GlobalTransform::from(*eye);
    let to_screen = |place: Vec3| camera.world_to_viewport(&eye, place).ok().map(|at| egui::pos2(at.x, at.y));
    for (cube, transform) in &cubes {
        let middle = transform.translation;
        let places = [ABOVE, BELOW, 0.0].map(|height| to_screen(middle + height * Vec3::Y));
        let [Some(above), Some(below), Some(middle)] = places else { continue };
        // In pixels.
        let cell = (middle.y - above.y) / ABOVE;
        let font = |size: f32| egui::FontId::proportional((size * cell).clamp(5.0, 18.0));
        painter.text(above, egui::Align2::CENTER_CENTER, cube.view.name(), font(0.095), TITLE);
        for (line, text) in cube.surface.figures().into_iter().enumerate() {
            let place = below + egui::vec2(0.0, 1.35 * font(0.08).size * line as f32);
            painter.text(place, egui::Align2::CENTER_TOP, text, font(0.08), FIGURES);
        }
        for corner in Corner::ALL {
            let Some(ball) = to_screen(*transform * corner_place(corner)) else { continue };
            // Beside the ball, away from the cube's middle.
            let place = ball + OFFSET * cell * (ball - middle).normalized();
            for (shift, color) in [(1.0, SHADOW), (0.0, NUMBER)] {
                let place = place + egui::Vec2::splat(shift);
                painter.text(place, egui::Align2::CENTER_CENTER, corner.index(), font(0.085), color);
            }
        }
    }
    Ok(())
}
