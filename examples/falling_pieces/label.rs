//! The text: keys, and the volume of each island.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};

use crate::bodies::Body;

/// As many islands have a line.
const LINES: usize = 8;
const KEYS: &str = "Click, then cut a stem or both legs of the gate: left button digs, WASD Space Shift fly, R anew, Esc frees the mouse";

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(EguiPrimaryContextPass, draw_text);
}

fn draw_text(mut contexts: EguiContexts, bodies: Query<&Body>) -> Result {
    let context = contexts.ctx_mut()?;
    let painter = context.layer_painter(egui::LayerId::background());
    let line = |body: &Body| {
        let state = if body.is_at_rest { "at rest" } else { "falling" };
        format!("{} cubic voxels, {state}, {:.0} voxels down", body.volume, body.fallen)
    };
    let mut largest: Vec<&Body> = bodies.iter().collect();
    largest.sort_by_key(|body| core::cmp::Reverse(body.volume));
    let lines = core::iter::once(KEYS.to_owned()).chain(largest.into_iter().take(LINES).map(line));
    let font = egui::FontId::proportional((context.content_rect().width() / 60.0).clamp(6.0, 18.0));
    for (number, text) in lines.enumerate() {
        let place = egui::pos2(10.0, 8.0 + 1.4 * font.size * number as f32);
        for (shift, color) in [(1.0, egui::Color32::from_black_alpha(170)), (0.0, egui::Color32::WHITE)] {
            painter.text(place + egui::Vec2::splat(shift), egui::Align2::LEFT_TOP, &text, font.clone(), color);
        }
    }
    Ok(())
}
