//! [`TerrainDiagnosticsPlugin`]: measurements of the plugin's work in Bevy's `DiagnosticsStore`.

use bevy_app::{App, Plugin, PostUpdate};
use bevy_diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic as _};
use bevy_ecs::entity::EntityHashMap;
use bevy_ecs::prelude::*;

use crate::budget::FrameBudget;
use crate::chunk::ChunkGeometry;
use crate::mesh::geometry_bytes;
use crate::schedule::UpdatePhase;
use crate::stats::TerrainStats;
use crate::terrain::TerrainVolume;

/// Measures the plugin's work in Bevy's `DiagnosticsStore`.
#[derive(Default)]
pub struct TerrainDiagnosticsPlugin;

impl TerrainDiagnosticsPlugin {
    /// The number of chunks whose mesh is not empty.
    pub const CHUNKS: DiagnosticPath = DiagnosticPath::const_new("marchless/chunks");
    /// The number of triangles of all chunks.
    pub const TRIANGLES: DiagnosticPath = DiagnosticPath::const_new("marchless/triangles");
    /// The number of chunks that wait for their samples.
    pub const FILL_QUEUE: DiagnosticPath = DiagnosticPath::const_new("marchless/fill_queue");
    /// The number of chunks that wait for a new mesh.
    pub const MESH_QUEUE: DiagnosticPath = DiagnosticPath::const_new("marchless/mesh_queue");
    /// The average time to mesh a chunk, in milliseconds; measured in updates in which a chunk was meshed.
    pub const MESH_TIME: DiagnosticPath = DiagnosticPath::const_new("marchless/mesh_time");
    /// The number of updates from reading a stamp to showing its edit; 0 means within the same update.
    pub const EDIT_UPDATES: DiagnosticPath = DiagnosticPath::const_new("marchless/edit_updates");
    /// The time from reading a stamp to showing its edit, in milliseconds.
    pub const EDIT_TIME: DiagnosticPath = DiagnosticPath::const_new("marchless/edit_time");
    /// The number of chunks in range that wait for their samples or their mesh.
    pub const WAITING_CHUNKS: DiagnosticPath = DiagnosticPath::const_new("marchless/waiting_chunks");
    /// The time that the plugin's systems took in an update, in milliseconds.
    pub const MAIN_THREAD: DiagnosticPath = DiagnosticPath::const_new("marchless/main_thread");
    /// The memory of samples and geometry, in bytes. Each update counts the samples of 32 chunks, so the value lags one
    /// update behind for every 32 chunks with samples.
    pub const RESIDENT_BYTES: DiagnosticPath = DiagnosticPath::const_new("marchless/resident_bytes");
    /// The memory of samples and geometry, in bytes per chunk whose mesh is not empty.
    pub const BYTES_PER_SURFACE_CHUNK: DiagnosticPath = DiagnosticPath::const_new("marchless/bytes_per_surface_chunk");
}

impl Plugin for TerrainDiagnosticsPlugin {
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
        app.init_resource::<GeometryTotals>().add_observer(add_geometry).add_observer(take_away_geometry);
        app.add_systems(PostUpdate, measure.in_set(UpdatePhase::Report));
    }
}

/// The totals of all meshes that are drawn.
#[derive(Resource, Default)]
struct GeometryTotals {
    chunks: u32,
    triangles: usize,
    bytes: usize,
}

fn add_geometry(
    insert: On<Insert, ChunkGeometry>,
    geometries: Query<&ChunkGeometry>,
    mut drawn: ResMut<GeometryTotals>,
) {
    if let Ok(ChunkGeometry { mesh }) = geometries.get(insert.entity)
        && !mesh.is_empty()
    {
        drawn.chunks += 1;
        drawn.triangles += mesh.triangle_count();
        drawn.bytes += geometry_bytes(mesh);
    }
}

fn take_away_geometry(
    discard: On<Discard, ChunkGeometry>,
    geometries: Query<&ChunkGeometry>,
    mut drawn: ResMut<GeometryTotals>,
) {
    if let Ok(ChunkGeometry { mesh }) = geometries.get(discard.entity)
        && !mesh.is_empty()
    {
        drawn.chunks -= 1;
        drawn.triangles -= mesh.triangle_count();
        drawn.bytes -= geometry_bytes(mesh);
    }
}

/// A sweep over the samples of all terrains that counts their memory, a part in each update.
#[derive(Default)]
struct Sweep {
    /// The current terrain, the chunk from which to continue, and the bytes counted so far.
    at: Option<(Entity, [i32; 3], usize)>,
    /// The result of the last complete sweep over each terrain. [Units: bytes]
    found: EntityHashMap<usize>,
}

/// The number of chunks that a sweep counts per update.
const SWEPT: usize = 32;

impl Sweep {
    /// Continues the sweep by one part; after the end of a terrain, the next one follows.
    fn advance(&mut self, volumes: &Query<(Entity, &TerrainVolume)>) {
        if self.found.len() > volumes.iter().len() {
            self.found.retain(|terrain, _| volumes.contains(*terrain));
        }
        let next = |after: Option<Entity>| {
            let later = volumes.iter().map(|(terrain, _)| terrain).filter(|terrain| Some(*terrain) > after);
            later.min().map(|terrain| (terrain, [i32::MIN; 3], 0))
        };
        let at = self.at.filter(|(terrain, ..)| volumes.contains(*terrain));
        let Some((terrain, from, so_far)) = at.or_else(|| next(None)) else { return };
        let Ok((_, volume)) = volumes.get(terrain) else { return };
        let (bytes, rest) = volume.heart().sample_bytes_from(from, SWEPT);
        let bytes = so_far + bytes;
        self.at = match rest {
            Some(rest) => Some((terrain, rest, bytes)),
            None => {
                self.found.insert(terrain, bytes);
                next(Some(terrain))
            }
        };
    }
}

fn measure(
    volumes: Query<(Entity, &TerrainVolume)>,
    drawn: Res<GeometryTotals>,
    mut sweep: Local<Sweep>,
    mut before: Local<TerrainStats>,
    stats: Res<TerrainStats>,
    budget: Res<FrameBudget>,
    mut diagnostics: Diagnostics,
) {
    let chunks = f64::from(drawn.chunks);
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::CHUNKS, || chunks);
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::TRIANGLES, || drawn.triangles as f64);
    let (mut to_fill, mut to_mesh, mut to_come, mut notes) = (0, 0, 0, 0);
    for (_, volume) in &volumes {
        let heart = volume.heart();
        to_fill += heart.waiting_for_samples();
        to_mesh += heart.waiting_for_meshes();
        to_come += heart.waiting_to_come();
        notes += heart.notes_bytes();
    }
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::FILL_QUEUE, || to_fill as f64);
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::MESH_QUEUE, || to_mesh as f64);
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::WAITING_CHUNKS, || (to_come + to_fill + to_mesh) as f64);
    let milliseconds = |time: core::time::Duration| time.as_secs_f64() * 1e3;
    diagnostics.add_measurement(&TerrainDiagnosticsPlugin::MAIN_THREAD, || milliseconds(budget.spent()));
    sweep.advance(&volumes);
    if sweep.found.len() == volumes.iter().len() {
        let bytes = (sweep.found.values().sum::<usize>() + notes + drawn.bytes) as f64;
        diagnostics.add_measurement(&TerrainDiagnosticsPlugin::RESIDENT_BYTES, || bytes);
        if drawn.chunks > 0 {
            diagnostics.add_measurement(&TerrainDiagnosticsPlugin::BYTES_PER_SURFACE_CHUNK, || bytes / chunks);
        }
    }
    let meshed = stats.meshed - before.meshed;
    if meshed > 0 {
        let mesh_time = milliseconds(stats.mesh_time - before.mesh_time);
        diagnostics.add_measurement(&TerrainDiagnosticsPlugin::MESH_TIME, || mesh_time / meshed as f64);
    }
    if stats.edits_shown > before.edits_shown {
        diagnostics.add_measurement(&TerrainDiagnosticsPlugin::EDIT_UPDATES, || stats.edit_updates_last as f64);
        diagnostics.add_measurement(&TerrainDiagnosticsPlugin::EDIT_TIME, || milliseconds(stats.edit_time_last));
    }
    *before = *stats;
}
