//! [`DebugPlugin`]: diagnostics, and gizmos for the bounds of chunks.

#[cfg(feature = "gizmos")]
mod gizmos;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic as _};
use bevy_ecs::entity::EntityHashMap;
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
    /// How much memory samples and geometry take, in bytes. Samples are gone through a part at a time, so that it lags an
    /// update behind for every 32 chunks that have some.
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
        app.init_resource::<Drawn>().add_observer(add_geometry).add_observer(take_away_geometry);
        app.add_systems(PostUpdate, measure.in_set(MarchlessSystems::Report));
        #[cfg(feature = "gizmos")]
        gizmos::build(app);
    }

    #[cfg(feature = "gizmos")]
    fn finish(&self, app: &mut App) {
        gizmos::finish(app);
    }
}

/// What is drawn, in all.
#[derive(Resource, Default)]
struct Drawn {
    chunks: u32,
    triangles: usize,
    bytes: usize,
}

fn add_geometry(insert: On<Insert, ChunkGeometry>, geometries: Query<&ChunkGeometry>, mut drawn: ResMut<Drawn>) {
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
    mut drawn: ResMut<Drawn>,
) {
    if let Ok(ChunkGeometry { mesh }) = geometries.get(discard.entity)
        && !mesh.is_empty()
    {
        drawn.chunks -= 1;
        drawn.triangles -= mesh.triangle_count();
        drawn.bytes -= geometry_bytes(mesh);
    }
}

/// Going through a volume's samples, a part in each update.
#[derive(Default)]
struct Sweep {
    next: Option<[i32; 3]>,
    so_far: usize,
    /// What the last one that is complete found. Unit: bytes.
    found: Option<usize>,
}

/// So many chunks of a volume are looked at per update.
const SWEPT: usize = 32;

impl Sweep {
    fn go_on(&mut self, volume: &TerrainVolume) {
        let (bytes, next) = volume.sample_bytes_from(self.next.unwrap_or([i32::MIN; 3]), SWEPT);
        (self.so_far, self.next) = (self.so_far + bytes, next);
        if next.is_none() {
            self.found = Some(core::mem::take(&mut self.so_far));
        }
    }
}

fn measure(
    volumes: Query<(Entity, &TerrainVolume)>,
    drawn: Res<Drawn>,
    mut sweeps: Local<EntityHashMap<Sweep>>,
    mut stats: ResMut<Stats>,
    main_thread: Res<MainThread>,
    mut diagnostics: Diagnostics,
) {
    let chunks = f64::from(drawn.chunks);
    diagnostics.add_measurement(&DebugPlugin::CHUNKS, || chunks);
    diagnostics.add_measurement(&DebugPlugin::TRIANGLES, || drawn.triangles as f64);
    let all = |of: fn(&TerrainVolume) -> usize| volumes.iter().map(|(_, volume)| of(volume)).sum::<usize>() as f64;
    diagnostics.add_measurement(&DebugPlugin::FILL_QUEUE, || all(|volume| volume.unfilled));
    diagnostics.add_measurement(&DebugPlugin::MESH_QUEUE, || all(TerrainVolume::waiting_for_meshes));
    diagnostics.add_measurement(&DebugPlugin::WAITING_CHUNKS, || all(TerrainVolume::waiting));
    let milliseconds = |time: core::time::Duration| time.as_secs_f64() * 1e3;
    diagnostics.add_measurement(&DebugPlugin::MAIN_THREAD, || milliseconds(main_thread.so_far()));
    sweeps.retain(|terrain, _| volumes.contains(*terrain));
    let mut samples = Some(0);
    for (terrain, volume) in &volumes {
        let sweep = sweeps.entry(terrain).or_default();
        sweep.go_on(volume);
        samples = samples.zip(sweep.found).map(|(samples, found)| samples + found + volume.notes_bytes());
    }
    if let Some(samples) = samples {
        let bytes = (samples + drawn.bytes) as f64;
        diagnostics.add_measurement(&DebugPlugin::RESIDENT_BYTES, || bytes);
        if drawn.chunks > 0 {
            diagnostics.add_measurement(&DebugPlugin::BYTES_PER_SURFACE_CHUNK, || bytes / chunks);
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
