//! Diagnostics report the plugin's work.

use std::time::Duration;

use crate::common::*;
use bevy_app::App;
use bevy_diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::prelude::*;
use bevy_math::Vec3;
use marchless::MeshBuffer;

fn latest(app: &App, path: &DiagnosticPath) -> Option<f64> {
    app.world().resource::<DiagnosticsStore>().get(path).expect("registered").value()
}

#[test]
fn diagnostics_follow_the_work() {
    let mut app = app();
    // All chunks come in the first update, however busy the machine is.
    app.world_mut().resource_mut::<MarchlessSettings>().streaming_budget = Duration::from_secs(1);
    let gate = Gate::default();
    let held = gate.clone();
    let source = move |p: [f64; 3]| {
        held.pass();
        p.map(|v| (v - 16.0) * (v - 16.0)).iter().sum::<f64>().sqrt() - 12.0
    };
    let terrain = app.world_mut().spawn(small(Terrain::new(source))).id();
    app.update();
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::FILL_QUEUE), Some(8.0));
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::EDIT_UPDATES), None);
    gate.open();
    settle(&mut app, terrain);
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::FILL_QUEUE), Some(0.0));
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::MESH_QUEUE), Some(0.0));
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::CHUNKS), Some(8.0));
    let triangles: usize = geometry(&mut app, terrain).iter().map(|(_, mesh)| mesh.triangle_count()).sum();
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::TRIANGLES), Some(triangles as f64));
    assert!(latest(&app, &TerrainDiagnosticsPlugin::MESH_TIME).unwrap() > 0.0);

    app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::splat(10.0), 5.0)));
    app.update();
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::EDIT_UPDATES), Some(0.0), "shown in the update that read it");
    assert!(latest(&app, &TerrainDiagnosticsPlugin::EDIT_TIME).unwrap() > 0.0);

    let drawn = geometry(&mut app, terrain);
    let triangles: usize = drawn.iter().map(|(_, mesh)| mesh.triangle_count()).sum();
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::CHUNKS), Some(drawn.len() as f64));
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::TRIANGLES), Some(triangles as f64), "of the changed chunks too");
    app.update();
    let samples = app.world().get::<TerrainVolume>(terrain).unwrap().sample_bytes();
    let of_mesh = |mesh: &MeshBuffer| 24 * mesh.positions.len() + mesh.materials.len() + 4 * mesh.indices.len();
    let bytes = (samples + drawn.iter().map(|(_, mesh)| of_mesh(mesh)).sum::<usize>()) as f64;
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::RESIDENT_BYTES), Some(bytes));
    assert_eq!(latest(&app, &TerrainDiagnosticsPlugin::BYTES_PER_SURFACE_CHUNK), Some(bytes / drawn.len() as f64));

    app.world_mut().despawn(terrain);
    app.update();
    for path in [
        TerrainDiagnosticsPlugin::CHUNKS,
        TerrainDiagnosticsPlugin::TRIANGLES,
        TerrainDiagnosticsPlugin::RESIDENT_BYTES,
    ] {
        assert_eq!(latest(&app, &path), Some(0.0), "{path}");
    }
}
