//! The panel: sliders, figures and keys.

use bevy::prelude::*;
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use marchless_examples::camera::{GrabMouse, mouse_is_grabbed};

use crate::caves::{EDGES, Settings, View};
use crate::scene::{Growing, Shown};

pub(crate) fn plugin(app: &mut App) {
    app.configure_sets(Update, GrabMouse.run_if(not(egui_wants_any_pointer_input)))
        .add_systems(Update, press_keys.run_if(not(egui_wants_any_keyboard_input)))
        .add_systems(EguiPrimaryContextPass, show_panel);
}

fn press_keys(keys: Res<ButtonInput<KeyCode>>, mut settings: ResMut<Settings>) {
    if keys.just_pressed(KeyCode::KeyR) {
        settings.seed = settings.seed.wrapping_add(1);
    }
    if keys.just_pressed(KeyCode::KeyV) {
        settings.view = if settings.view == View::Rock { View::Caves } else { View::Rock };
    }
}

fn show_panel(
    mut contexts: EguiContexts,
    mut settings: ResMut<Settings>,
    growing: Res<Growing>,
    shown: Res<Shown>,
    cursor: Query<&bevy::window::CursorOptions, With<bevy::window::PrimaryWindow>>,
) -> Result {
    let mut draft = settings.clone();
    let window = egui::Window::new("caves").resizable(false).interactable(!mouse_is_grabbed(cursor));
    window.default_pos([12.0, 12.0]).show(contexts.ctx_mut()?, |ui| {
        show_sliders(ui, &mut draft);
        ui.separator();
        if let Some(figures) = &shown.0 {
            egui::Grid::new("figures").num_columns(2).show(ui, |ui| {
                for (name, value) in figures.lines() {
                    ui.label(name);
                    ui.label(value);
                    ui.end_row();
                }
            });
        }
        ui.label(if growing.is_busy() { "growing …" } else { "" });
        ui.separator();
        ui.weak("click: grab the mouse · Esc: free it\nW A S D Space Shift: fly · Ctrl: faster\nR: another seed · V: rock or caves");
    });
    settings.set_if_neq(draft);
    Ok(())
}

fn show_sliders(ui: &mut egui::Ui, settings: &mut Settings) {
    ui.spacing_mut().slider_width = 160.0;
    ui.add(egui::Slider::new(&mut settings.fill, 0.0..=1.0).step_by(0.005).text("rock in the noise"));
    ui.add(egui::Slider::new(&mut settings.birth, 0..=27).text("birth: neighbours, at least"));
    ui.add(egui::Slider::new(&mut settings.survival, 0..=27).text("survival: neighbours, at least"));
    ui.add(egui::Slider::new(&mut settings.steps, 0..=30).text("steps"));
    ui.add(egui::Slider::new(&mut settings.edge, EDGES).step_by(8.0).text("size"));
    ui.add(egui::Slider::new(&mut settings.seed, 0..=999).clamping(egui::SliderClamping::Never).text("seed"));
    ui.add(egui::Slider::new(&mut settings.cut, 0.0..=1.0).step_by(0.01).text("cut open"));
    ui.horizontal(|ui| {
        ui.selectable_value(&mut settings.view, View::Rock, "rock");
        ui.selectable_value(&mut settings.view, View::Caves, "largest cave");
    });
}
