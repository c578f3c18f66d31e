//! The text: the position and the keys.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};

use crate::shell::{Pace, Screen};

const KEYS: &str = "Click to look round: WASD Space Shift fly, Esc frees the mouse\n\
    E digs by mesh ray cast, F drills, H shows or hides the wall\nP pauses, T slows time down, F5 saves, F9 loads, Backspace: menu";

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(EguiPrimaryContextPass, draw_text);
}

fn draw_text(
    mut contexts: EguiContexts,
    screen: Res<State<Screen>>,
    pace: Option<Res<State<Pace>>>,
    time: Res<Time<Virtual>>,
) -> Result {
    let text = match (screen.get(), pace.as_deref().map(State::get)) {
        (Screen::Menu, _) => "Enter: play".to_owned(),
        (Screen::Level, Some(Pace::Paused)) => format!("Paused\n{KEYS}"),
        (Screen::Level, _) if time.relative_speed() < 1.0 => format!("Slow motion\n{KEYS}"),
        (Screen::Level, _) => KEYS.to_owned(),
    };
    let context = contexts.ctx_mut()?;
    let painter = context.layer_painter(egui::LayerId::background());
    for (shift, color) in [(1.0, egui::Color32::from_black_alpha(170)), (0.0, egui::Color32::WHITE)] {
        let place = egui::pos2(10.0 + shift, 8.0 + shift);
        painter.text(place, egui::Align2::LEFT_TOP, &text, egui::FontId::proportional(16.0), color);
    }
    let middle = context.content_rect().center();
    painter.circle_stroke(middle, 5.0, egui::Stroke::new(1.5, egui::Color32::WHITE));
    Ok(())
}
