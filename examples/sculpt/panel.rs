//! The panel: settings of brush and world, switches, figures and keys. And the crosshair.

use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore, FrameTimeDiagnosticsPlugin};
use bevy::ecs::system::SystemParam;
use bevy::pbr::wireframe::WireframeConfig;
use bevy::prelude::*;
use bevy::window::{CursorOptions, PrimaryWindow};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::prelude::*;
use marchless_examples::camera::mouse_is_grabbed;
use marchless_examples::look::{LOOKS, MATERIALS};

use crate::brush::{Brush, RADII};
use crate::world::{Kind, World};

pub(crate) fn plugin(app: &mut App) {
    app.add_plugins(EguiPlugin::default())
        .add_systems(EguiPrimaryContextPass, (show_panel, draw_crosshair.run_if(mouse_is_grabbed)).chain());
}

/// What the panel shows and changes.
#[derive(SystemParam)]
struct Panel<'w> {
    brush: ResMut<'w, Brush>,
    world: ResMut<'w, World>,
    bounds: ResMut<'w, ShowChunkBounds>,
    wireframe: ResMut<'w, WireframeConfig>,
    diagnostics: Res<'w, DiagnosticsStore>,
}

/// `draft`: the world as the sliders stand; it becomes the world once the mouse lets go of them.
fn show_panel(
    mut contexts: EguiContexts,
    mut panel: Panel,
    mut draft: Local<Option<World>>,
    cursor: Query<&CursorOptions, With<PrimaryWindow>>,
) -> Result {
    let context = contexts.ctx_mut()?;
    let mut world = draft.take().unwrap_or_else(|| panel.world.clone());
    // A grabbed mouse digs, wherever its pointer may be.
    let window = egui::Window::new("sculpt").interactable(!mouse_is_grabbed(cursor));
    window.default_pos([12.0, 12.0]).default_width(230.0).show(context, |ui| {
        panel.brush(ui);
        ui.separator();
        panel.world(ui, &mut world);
        ui.separator();
        panel.figures(ui);
        ui.collapsing("Keys", show_keys);
    });
    if context.egui_is_using_pointer() {
        *draft = Some(world);
    } else {
        panel.world.set_if_neq(world);
    }
    Ok(())
}

impl Panel<'_> {
    fn brush(&mut self, ui: &mut egui::Ui) {
        let brush = &mut *self.brush;
        ui.add(egui::Slider::new(&mut brush.radius, RADII).logarithmic(true).text("brush, voxels"));
        ui.add(egui::Slider::new(&mut brush.rate, 1.0..=60.0).text("voxels per second"));
        ui.add(egui::Slider::new(&mut brush.distance, 5.0..=200.0).text("distance in the void"));
        let name = |material: u8| MATERIALS[usize::from(material) % MATERIALS.len()];
        egui::ComboBox::from_label("material (Q, E)").selected_text(name(brush.material)).show_ui(ui, |ui| {
            for material in 0..MATERIALS.len() as u8 {
                ui.selectable_value(&mut brush.material, material, name(material));
            }
        });
    }

    fn world(&mut self, ui: &mut egui::Ui, world: &mut World) {
        let name = Kind::ALL.iter().find(|(kind, _)| *kind == world.kind).map_or("", |(_, name)| name);
        egui::ComboBox::from_label("source").selected_text(name).show_ui(ui, |ui| {
            for (kind, name) in Kind::ALL {
                // Only where one was given on the command line.
                if kind != Kind::HeightMap || world.map.is_some() {
                    ui.selectable_value(&mut world.kind, kind, name);
                }
            }
        });
        egui::ComboBox::from_label("look").selected_text(LOOKS[world.look].name).show_ui(ui, |ui| {
            for (index, look) in LOOKS.iter().enumerate() {
                ui.selectable_value(&mut world.look, index, look.name);
            }
        });
        ui.horizontal(|ui| {
            ui.add(egui::DragValue::new(&mut world.seed));
            ui.label("seed");
        });
        ui.add(egui::Slider::new(&mut world.zoom, 20.0..=400.0).logarithmic(true).text("zoom, voxels"));
        ui.add(egui::Slider::new(&mut world.octaves, 1..=8).text("octaves"));
        ui.add(egui::Slider::new(&mut world.isovalue, -3.0..=3.0).text("isovalue, voxels"));
        ui.horizontal(|ui| {
            if ui.button("New world (R)").clicked() {
                world.shuffle();
            }
            if ui.button("Clear (C)").clicked() {
                world.clear();
            }
        });
        ui.horizontal(|ui| {
            ui.checkbox(&mut self.bounds.0, "chunk bounds");
            // Not touched where it stays as it is, so that nothing is drawn anew for its sake.
            let mut wireframe = self.wireframe.global;
            if ui.checkbox(&mut wireframe, "wireframe").changed() {
                self.wireframe.global = wireframe;
            }
        });
    }

    fn figures(&self, ui: &mut egui::Ui) {
        let mean = |path: &DiagnosticPath| self.diagnostics.get(path).and_then(|diagnostic| diagnostic.average());
        let newest = |path: &DiagnosticPath| self.diagnostics.get(path).and_then(|diagnostic| diagnostic.value());
        let waiting = [TerrainDiagnosticsPlugin::FILL_QUEUE, TerrainDiagnosticsPlugin::MESH_QUEUE]
            .iter()
            .filter_map(newest)
            .sum();
        egui::Grid::new("figures").num_columns(2).show(ui, |ui| {
            for (name, value, decimals, unit) in [
                ("chunks", newest(&TerrainDiagnosticsPlugin::CHUNKS), 0, ""),
                ("triangles", newest(&TerrainDiagnosticsPlugin::TRIANGLES), 0, ""),
                ("waiting", Some(waiting), 0, ""),
                ("mesh time, mean", mean(&TerrainDiagnosticsPlugin::MESH_TIME), 2, " ms"),
                ("edit to visible", newest(&TerrainDiagnosticsPlugin::EDIT_TIME), 2, " ms"),
                ("… in updates", newest(&TerrainDiagnosticsPlugin::EDIT_UPDATES), 0, ""),
                ("frame time, mean", mean(&FrameTimeDiagnosticsPlugin::FRAME_TIME), 1, " ms"),
            ] {
                ui.label(name);
                ui.monospace(value.map_or("–".to_owned(), |value| format!("{value:.decimals$}{unit}")));
                ui.end_row();
            }
        });
    }
}

fn show_keys(ui: &mut egui::Ui) {
    egui::Grid::new("keys").num_columns(2).show(ui, |ui| {
        for (key, what) in [
            ("click, Esc", "grab and free the mouse"),
            ("W A S D", "fly"),
            ("Space, Shift", "up, down"),
            ("Ctrl", "faster"),
            ("left button", "dig"),
            ("right button", "add"),
            ("middle button", "paint"),
            ("wheel", "size of the brush"),
            ("Q, E", "material"),
            ("R, C", "new world, clear"),
        ] {
            ui.monospace(key);
            ui.label(what);
            ui.end_row();
        }
    });
}

fn draw_crosshair(mut contexts: EguiContexts) -> Result {
    let context = contexts.ctx_mut()?;
    let middle = context.content_rect().center();
    let painter = context.layer_painter(egui::LayerId::background());
    for arm in [egui::vec2(7.0, 0.0), egui::vec2(0.0, 7.0)] {
        for (width, color) in [(3.0, egui::Color32::from_black_alpha(110)), (1.0, egui::Color32::WHITE)] {
            painter.line_segment([middle - arm, middle + arm], egui::Stroke::new(width, color));
        }
    }
    Ok(())
}
