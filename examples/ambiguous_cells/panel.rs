//! The panel: sliders, presets, figures of the cell, and keys.

use std::hash::{BuildHasher as _, Hasher as _, RandomState};

use bevy::prelude::*;
use bevy_egui::input::egui_wants_any_keyboard_input;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use marchless::cell::Corner;

use crate::cell::{Cell, RANGE};
use crate::presets::PRESETS;
use crate::scene::Covered;

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(Update, press_keys.run_if(not(egui_wants_any_keyboard_input)))
        .add_systems(EguiPrimaryContextPass, show_panel);
}

/// By the face's number.
const FACES: [&str; 6] = ["−x", "+x", "−y", "+y", "−z", "+z"];

fn press_keys(keys: Res<ButtonInput<KeyCode>>, mut cell: ResMut<Cell>) {
    if keys.just_pressed(KeyCode::KeyR) {
        *cell = random_ambiguous();
    }
    if keys.just_pressed(KeyCode::KeyF) {
        cell.flip();
    }
}

fn show_panel(mut contexts: EguiContexts, mut cell: ResMut<Cell>, mut covered: ResMut<Covered>) -> Result {
    // Not touched where it stays as it is, so that nothing is made anew for its sake.
    let mut draft = cell.clone();
    let panel = egui::Window::new("cell").title_bar(false).resizable(false);
    let shown = panel.anchor(egui::Align2::CENTER_BOTTOM, [0.0, -8.0]).show(contexts.ctx_mut()?, |ui| {
        ui.horizontal(|ui| {
            show_sliders(ui, &mut draft);
            ui.separator();
            ui.vertical(|ui| show_choices(ui, &mut draft));
        });
    });
    covered.0 = shown.map_or(0.0, |shown| shown.response.rect.height() + 16.0);
    cell.set_if_neq(draft);
    Ok(())
}

/// Four rows of two: corners with z = 0 on the left, those with z = 1 on the right.
fn show_sliders(ui: &mut egui::Ui, cell: &mut Cell) {
    ui.spacing_mut().slider_width = 140.0;
    egui::Grid::new("weights").num_columns(2).show(ui, |ui| {
        for low in 0..4 {
            for corner in [Corner::ALL[low], Corner::ALL[low + 4]] {
                let [x, y, z] = corner.offset();
                let name = format!("{}  ({x}, {y}, {z})", corner.index());
                slider(ui, &mut cell.weights[corner.index()], name);
            }
            ui.end_row();
        }
        slider(ui, &mut cell.isovalue, "isovalue".to_owned());
    });
}

fn slider(ui: &mut egui::Ui, value: &mut f32, name: String) {
    ui.add(egui::Slider::new(value, RANGE).step_by(0.01).fixed_decimals(2).text(name));
}

fn show_choices(ui: &mut egui::Ui, cell: &mut Cell) {
    ui.set_max_width(560.0);
    ui.horizontal_wrapped(|ui| {
        for (name, what, weights) in PRESETS {
            if ui.selectable_label(cell.weights == weights, name).on_hover_text(what).clicked() {
                *cell = Cell { weights, isovalue: 0.0 };
            }
        }
    });
    ui.horizontal(|ui| {
        if ui.button("random ambiguous (R)").clicked() {
            *cell = random_ambiguous();
        }
        if ui.button("flip signs (F)").clicked() {
            cell.flip();
        }
        ui.weak("drag: turn · wheel: zoom");
    });
    let preset = PRESETS.iter().find(|(_, _, weights)| *weights == cell.weights);
    ui.label(preset.map_or("other weights".to_owned(), |(name, what, _)| format!("{name}: {what}")));
    let faces: Vec<_> = cell.ambiguous_faces().map(|face| FACES[face.index()]).collect();
    let faces = if faces.is_empty() { "none".to_owned() } else { faces.join(", ") };
    ui.label(format!("ambiguous faces: {faces}"));
}

/// Random weights that leave open which way the surface goes, on a face or in the interior.
fn random_ambiguous() -> Cell {
    loop {
        let cell = Cell { weights: [(); 8].map(|()| random_weight()), isovalue: 0.0 };
        if cell.is_case_4() || cell.ambiguous_faces().next().is_some() {
            return cell;
        }
    }
}

/// One of ±0.01 to ±1.
fn random_weight() -> f32 {
    let bits = RandomState::new().build_hasher().finish();
    let size = (1 + (bits >> 1) % 100) as f32 / 100.0;
    if bits & 1 == 0 { size } else { -size }
}
