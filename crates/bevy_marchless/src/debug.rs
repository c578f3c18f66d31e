//! [`DebugPlugin`]: diagnostics, and gizmos for the bounds of chunks.

#[cfg(feature = "gizmos")]
mod gizmos;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic as _};
use bevy_ecs::prelude::*;
#[cfg(feature = "gizmos")]
pub use gizmos::{ChunkBoundsGizmos, ShowChunkBounds};

use crate::chunk::ChunkGeometry;
use crate::mesh::geometry_bytes;
use crate::schedule::MarchlessSystems;
use crate::stats::{MainThread, Stats};
use crate::terrain::TerrainVolume;

/// Measures the plugin's work in Bevy's `DiagnosticsStore`, and with the feature `gizmos` draws the bounds of chunks.
#[derive(Default)]
pub struct DebugPlugin;

impl DebugPlugin {
    /// How many chunks have something to draw.
    pub const CHUNKS: DiagnosticPath = DiagnosticPath::const_new("marchless/chunks");
    /// How many triangles they have in all.
    pub const TRIANGLES: DiagnosticPath = DiagnosticPath::const_new("marchless/triangles");
    /// How many chunks wait for their samples.
    pub const FILL_QUEUE: DiagnosticPath = DiagnosticPath::const_new("marchless/fill_queue");
    /// How many chunks wait for a new mesh.
    pub const MESH_QUEUE: DiagnosticPath = DiagnosticPath::const_new("marchless/mesh_queue");
    /// How long it took to mesh a chunk, in milliseconds; measured in updates in which some chunk was meshed.
    pub const MESH_TIME: DiagnosticPath = DiagnosticPath::const_new("marchless/mesh_time");
    /// How many updates after the one that read its stamp an edit was shown; 0 is the same one.
    pub const EDIT_UPDATES: DiagnosticPath = DiagnosticPath::const_new("marchless/edit_updates");
    /// How long after its stamp was read an edit was shown, in milliseconds.
    pub const EDIT_TIME: DiagnosticPath = DiagnosticPath::const_new("marchless/edit_time");
    /// How many chunks in range wait for their samples or their mesh.
    pub const WAITING_CHUNKS: DiagnosticPath = DiagnosticPath::const_new("marchless/waiting_chunks");
    /// How long the plugin's systems took in an update, in milliseconds.
    pub const MAIN_THREAD: DiagnosticPath = DiagnosticPath::const_new("marchless/main_thread");
    /// How much memory samples and geometry take, in bytes; measured every 64 updates.
    pub const RESIDENT_BYTES: DiagnosticPath = DiagnosticPath::const_new("marchless/resident_bytes");
    /// The same, divided by how many chunks have something to draw.
    pub const BYTES_PER_SURFACE_CHUNK: DiagnosticPath = DiagnosticPath::const_new("marchless/bytes_per_surface_chunk");
}

impl Plugin for DebugPlugin {
    fn build(&self, app: &mut App) {
        for (path, suffix) in [
            (Self::CHUNKS, ""),
            (Self::TRIANGLES, ""),
            (Self::FILL_QUEUE, ""),
            (Self::MESH_QUEUE, ""),
            (Self::MESH_TIME, "ms"),
            (Self::EDIT_UPDATES, ""),
            (Self::EDIT_TIME, "ms"),
            (Self::WAITING_CHUNKS, ""),
            (Self::MAIN_THREAD, "ms"),
            (Self::RESIDENT_BYTES, "B"),
            (Self::BYTES_PER_SURFACE_CHUNK, "B"),
        ] {
            app.register_diagnostic(Diagnostic::new(path).with_suffix(suffix));
        }
        app.add_systems(PostUpdate, measure.in_set(MarchlessSystems::Report));
        #[cfg(feature = "gizmos")]
        gizmos::build(app);
    }

    #[cfg(feature = "gizmos")]
    fn finish(&self, app: &mut App) {
        gizmos::finish(app);
    }
}

fn measure(
    geometries: Query<&ChunkGeometry>,
    volumes: Query<&TerrainVolume>,
    mut stats: ResMut<Stats>,
    main_thread: Res<MainThread>,
    mut diagnostics: Diagnostics,
) {
    let (mut drawn, mut triangles, mut bytes) = (0u32, 0, 0);
    for mesh in geometries.iter().map(|geometry| &geometry.mesh).filter(|mesh| !mesh.is_empty()) {
        (drawn, triangles, bytes) = (drawn + 1, triangles + mesh.triangle_count(), bytes + geometry_bytes(mesh));
    }
    diagnostics.add_measurement(&DebugPlugin::CHUNKS, || f64::from(drawn));
    diagnostics.add_measurement(&DebugPlugin::TRIANGLES, || triangles as f64);
    let unfilled = || volumes.iter().map(|volume| volume.unfilled).sum::<usize>();
    diagnostics.add_measurement(&DebugPlugin::FILL_QUEUE, || unfilled() as f64);
    let unmeshed = || volumes.iter().map(TerrainVolume::waiting_for_meshes).sum::<usize>();
    diagnostics.add_measurement(&DebugPlugin::MESH_QUEUE, || unmeshed() as f64);
    let waiting = || volumes.iter().map(TerrainVolume::waiting).sum::<usize>();
    diagnostics.add_measurement(&DebugPlugin::WAITING_CHUNKS, || waiting() as f64);
    let milliseconds = |time: core::time::Duration| time.as_secs_f64() * 1e3;
    diagnostics.add_measurement(&DebugPlugin::MAIN_THREAD, || milliseconds(main_thread.so_far()));
    if stats.update % 64 == 1 {
        bytes += volumes.iter().map(TerrainVolume::sample_bytes).sum::<usize>();
        diagnostics.add_measurement(&DebugPlugin::RESIDENT_BYTES, || bytes as f64);
        if drawn > 0 {
            diagnostics.add_measurement(&DebugPlugin::BYTES_PER_SURFACE_CHUNK, || bytes as f64 / f64::from(drawn));
        }
    }
    let meshed = core::mem::take(&mut stats.meshed);
    let mesh_time = core::mem::take(&mut stats.mesh_time);
    if meshed > 0 {
        diagnostics.add_measurement(&DebugPlugin::MESH_TIME, || milliseconds(mesh_time) / f64::from(meshed));
    }
    if let Some((updates, time)) = stats.edit_to_visible.take() {
        diagnostics.add_measurement(&DebugPlugin::EDIT_UPDATES, || updates as f64);
        diagnostics.add_measurement(&DebugPlugin::EDIT_TIME, || milliseconds(time));
    }
}
