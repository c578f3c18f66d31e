//! The panel: how far and how fast, figures and keys. And the crosshair.

use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore, FrameTimeDiagnosticsPlugin};
use bevy::ecs::system::SystemParam;
use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy::window::{CursorOptions, PrimaryWindow};
use bevy_egui::input::egui_wants_any_keyboard_input;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::gizmos::ChunkColors;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use marchless_examples::camera::{FlyCamera, mouse_is_grabbed};

use crate::figures::{self, PerSecond};
use crate::flight::Flight;
use crate::triangles;
use crate::world::{RADII, World};

pub(crate) fn plugin(app: &mut App) {
    let show_chunks = show_chunks.run_if(input_just_pressed(KeyCode::KeyG));
    let show_levels = show_levels.run_if(input_just_pressed(KeyCode::KeyL));
    let show_triangles = triangles::show_or_hide.run_if(input_just_pressed(KeyCode::KeyT));
    let keys = (show_chunks, show_levels, show_triangles).run_if(not(egui_wants_any_keyboard_input));
    app.add_plugins((EguiPlugin::default(), figures::plugin))
        .add_systems(Update, keys)
        .add_systems(EguiPrimaryContextPass, (show_panel, draw_crosshair.run_if(mouse_is_grabbed)).chain());
}

fn show_chunks(mut show: ResMut<ShowChunkBounds>, mut colors: ResMut<ChunkColors>) {
    show.0 = !show.0;
    *colors = ChunkColors::States;
}

/// Shows the chunks in the colours of their levels, or not at all.
fn show_levels(mut show: ResMut<ShowChunkBounds>, mut colors: ResMut<ChunkColors>) {
    show.0 = !show.0 || *colors != ChunkColors::Levels;
    *colors = ChunkColors::Levels;
}

/// What the panel shows and changes.
#[derive(SystemParam)]
struct Panel<'w, 's> {
    world: ResMut<'w, World>,
    flight: ResMut<'w, Flight>,
    bounds: ResMut<'w, ShowChunkBounds>,
    diagnostics: Res<'w, DiagnosticsStore>,
    stats: Res<'w, TerrainStats>,
    per_second: Res<'w, PerSecond>,
    camera: Single<'w, 's, &'static Transform, With<FlyCamera>>,
}

/// `draft`: how far one sees as the slider stands; it takes effect once the mouse lets go of it.
fn show_panel(
    mut contexts: EguiContexts,
    mut panel: Panel,
    mut draft: Local<Option<f32>>,
    cursor: Query<&CursorOptions, With<PrimaryWindow>>,
) -> Result {
    let context = contexts.ctx_mut()?;
    let mut radius = draft.take().unwrap_or(panel.world.radius);
    // A grabbed mouse digs, wherever its pointer may be.
    let window = egui::Window::new("flyover").interactable(!mouse_is_grabbed(cursor));
    window.default_pos([12.0, 12.0]).default_width(240.0).show(context, |ui| {
        ui.add(egui::Slider::new(&mut radius, RADII).step_by(16.0).text("voxels seen"));
        ui.checkbox(&mut panel.flight.goes_on, "fly on (F)");
        ui.checkbox(&mut panel.bounds.0, "chunks (G)");
        ui.separator();
        panel.figures(ui);
        ui.collapsing("Keys", show_keys);
    });
    if context.egui_is_using_pointer() {
        *draft = Some(radius);
    } else {
        let world = World { radius, ..*panel.world };
        panel.world.set_if_neq(world);
    }
    Ok(())
}

impl Panel<'_, '_> {
    fn figures(&self, ui: &mut egui::Ui) {
        let mean = |path: &DiagnosticPath| self.diagnostics.get(path).and_then(|diagnostic| diagnostic.average());
        let newest = |path: &DiagnosticPath| self.diagnostics.get(path).and_then(|diagnostic| diagnostic.value());
        let mebibytes = |bytes: f64| bytes / f64::from(1 << 20);
        let share = |part: u64, whole: u64| (whole > 0).then(|| 100.0 * part as f64 / whole as f64);
        let per_second = &*self.per_second;
        egui::Grid::new("figures").num_columns(2).show(ui, |ui| {
            let [x, y, z] = self.camera.translation.to_array();
            row(ui, "speed (1 to 9)", &format!("{} voxels/s", self.flight.speed));
            row(ui, "position", &format!("{x:.0}, {y:.0}, {z:.0}"));
            for (name, value, decimals, unit) in [
                ("frame time, mean", mean(&FrameTimeDiagnosticsPlugin::FRAME_TIME), 1, " ms"),
                ("main thread, mean", mean(&TerrainDiagnosticsPlugin::MAIN_THREAD), 2, " ms"),
                ("… at most, last second", Some(per_second.slowest.as_secs_f64() * 1e3), 2, " ms"),
                ("chunks drawn", newest(&TerrainDiagnosticsPlugin::CHUNKS), 0, ""),
                ("chunks waiting", newest(&TerrainDiagnosticsPlugin::WAITING_CHUNKS), 0, ""),
                ("loaded per second", Some(per_second.loaded as f64), 0, ""),
                ("unloaded per second", Some(per_second.unloaded as f64), 0, ""),
                ("meshed per second", Some(per_second.meshed as f64), 0, ""),
                ("filled for nothing", share(self.stats.filled_empty, self.stats.filled), 1, " %"),
                ("samples and meshes", newest(&TerrainDiagnosticsPlugin::RESIDENT_BYTES).map(mebibytes), 1, " MiB"),
                ("triangles", newest(&TerrainDiagnosticsPlugin::TRIANGLES), 0, ""),
            ] {
                row(ui, name, &value.map_or("–".to_owned(), |value| format!("{value:.decimals$}{unit}")));
            }
        });
    }
}

fn row(ui: &mut egui::Ui, name: &str, value: &str) {
    ui.label(name);
    ui.monospace(value);
    ui.end_row();
}

fn show_keys(ui: &mut egui::Ui) {
    egui::Grid::new("keys").num_columns(2).show(ui, |ui| {
        for (key, what) in [
            ("1 to 9", "speed"),
            ("F", "fly on, or stay"),
            ("click, Esc", "grab and free the mouse"),
            ("W A S D", "fly"),
            ("Space, Shift", "up, down"),
            ("Ctrl", "faster"),
            ("left button", "dig"),
            ("G", "chunks: drawn blue, waiting orange, empty grey"),
            ("L", "chunks in the colours of their levels"),
            ("T", "triangles in the colours of their levels"),
        ] {
            row(ui, key, what);
        }
    });
}

fn draw_crosshair(mut contexts: EguiContexts) -> Result {
    let context = contexts.ctx_mut()?;
    let painter = context.layer_painter(egui::LayerId::background());
    painter.circle_stroke(context.content_rect().center(), 5.0, egui::Stroke::new(1.5, egui::Color32::WHITE));
    Ok(())
}
