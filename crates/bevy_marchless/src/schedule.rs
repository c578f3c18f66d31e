//! [`MarchlessSystems`]: the order of the plugin's systems in an update. [`MarchlessSettings`]: how much work one
//! update does.

use core::time::Duration;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::{AssetEventSystems, RenderAssetUsages};
use bevy_ecs::prelude::*;
use bevy_reflect::prelude::*;
use bevy_transform::TransformSystems;

use crate::budget::FrameBudget;
use crate::jobs::WorkQueue;
use crate::stats::{TerrainStats, count_main_thread, count_update};

/// The system sets of the plugin. All run in [`PostUpdate`], before transforms are propagated and asset events are
/// sent, so changes made in `Update` show in the same frame.
///
/// To pause terrain, give [`MarchlessSystems::Work`] a run condition. Keep [`MarchlessSystems::ReadStamps`] running,
/// because Bevy drops unread messages; the stamps then wait in a queue, in order.
///
/// ```
/// # use bevy_app::{App, PostUpdate};
/// # use bevy_ecs::prelude::*;
/// # use bevy_marchless::prelude::*;
/// #[derive(Resource, Default)]
/// struct Paused(bool);
///
/// # let mut app = App::new();
/// app.init_resource::<Paused>();
/// app.configure_sets(PostUpdate, MarchlessSystems::Work.run_if(|paused: Res<Paused>| !paused.0));
/// ```
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MarchlessSystems {
    /// Reads [`Stamp`](crate::brush::Stamp) messages into a queue.
    ReadStamps,
    /// All other work; a run condition may pause this set. It writes [`TerrainEdited`](crate::brush::TerrainEdited)
    /// messages and shows meshes.
    Work,
    /// Part of `Work`, after the update's new chunks are spawned. Systems that add components to chunks belong here, so
    /// that the components are present when the chunks are first drawn; see module [`inherit`](crate::inherit).
    Decorate,
}

/// The phases of [`MarchlessSystems::Work`], in order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum UpdatePhase {
    /// Gives new terrains their volume and applies changes of settings.
    Prepare,
    /// Loads and unloads chunks.
    Load,
    /// Takes sampled chunks into the volumes and queues sampling jobs.
    Fill,
    /// Applies stamps to the samples.
    Edit,
    /// Meshes groups of changed chunks and shows complete groups.
    Mesh,
    /// Starts tasks for queued jobs.
    StartJobs,
    /// Updates the statistics.
    Report,
}

/// Present if a plugin meshes chunks; without it, chunks do not wait for meshes.
#[derive(Resource, Default)]
pub(crate) struct MakesMeshes;

/// Limits on the plugin's work per update; the defaults fit most games.
#[derive(Resource, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct MarchlessSettings {
    /// A group of at most this many chunks is meshed within the update that changed it. Tasks mesh larger groups, which
    /// are shown some updates later. One update meshes groups of at most 1,024 chunks in all, or of this many if it is
    /// larger. Unit: chunks with a surface. Default 8: a small stamp at a corner of chunks touches this many.
    pub max_inline_chunks: usize,
    /// The most chunks in the jobs that sample chunks and mesh them for the first time, per thread of the pool. A low
    /// value keeps visible chunks first; a high value keeps threads busy for a whole update. At least 1. Default 64.
    pub max_chunks_in_flight: usize,
    /// New meshes are shown until an update has shown this many bytes, so that uploads do not flood the graphics card;
    /// the last chunk may exceed the limit. Edits are shown at once, whatever their size. Default 4 MiB.
    pub max_upload_bytes: usize,
    /// The time per update that streaming may take on the main thread: loading and unloading chunks, taking in samples,
    /// starting and showing first meshes. The rest of that work waits; each update does some of it. Edits are not part
    /// of this budget and take the time they need; streaming holds back for them in at most one of five updates.
    /// Default: 0.6 milliseconds.
    pub streaming_budget: Duration,
    /// The worlds that keep the [`Mesh`](bevy_mesh::Mesh) assets of chunks; applies to meshes made after a change.
    /// Default: `RENDER_WORLD` alone, which frees the main world's copy after its upload. With `MAIN_WORLD` too, mesh
    /// ray casts, picking and other crates' colliders can read the meshes, at the cost of that memory. Without
    /// `RENDER_WORLD`, nothing is drawn.
    pub mesh_usages: RenderAssetUsages,
    /// The most chunks that the main thread samples or meshes per update, for platforms without threads. With `Some(0)`
    /// they all wait, and only groups within `max_inline_chunks` are meshed. With `None`, tasks do this work, at most
    /// as many at once as the pool of asynchronous tasks has threads. Default: 8 on the web, `None` elsewhere; without
    /// such a pool, `None` acts as 8.
    pub max_jobs_per_update: Option<usize>,
}

impl Default for MarchlessSettings {
    fn default() -> Self {
        Self {
            max_inline_chunks: 8,
            max_chunks_in_flight: 64,
            max_upload_bytes: 4 << 20,
            streaming_budget: Duration::from_micros(600),
            mesh_usages: RenderAssetUsages::RENDER_WORLD,
            max_jobs_per_update: cfg!(target_arch = "wasm32").then_some(8),
        }
    }
}

impl MarchlessSettings {
    /// The most chunks of a terrain that may be sampled at once, and the most that may be meshed without an edit at
    /// once.
    pub(crate) fn in_flight(&self, threads: usize) -> usize {
        self.max_chunks_in_flight.max(1).saturating_mul(if self.max_jobs_per_update.is_some() { 1 } else { threads })
    }
}

/// Orders the plugin's systems. The other parts of [`MarchlessPlugins`](crate::MarchlessPlugins) need it.
#[derive(Default)]
pub struct SchedulePlugin;

impl Plugin for SchedulePlugin {
    fn build(&self, app: &mut App) {
        use MarchlessSystems::{Decorate, ReadStamps, Work};
        use UpdatePhase::{Edit, Fill, Load, Mesh, Prepare, Report, StartJobs};

        app.register_type::<MarchlessSettings>()
            .register_type::<TerrainStats>()
            .init_resource::<MarchlessSettings>()
            .init_resource::<TerrainStats>()
            .init_resource::<FrameBudget>()
            .init_resource::<WorkQueue>()
            .configure_sets(
                PostUpdate,
                (ReadStamps, Work).chain().before(TransformSystems::Propagate).before(AssetEventSystems),
            )
            .configure_sets(
                PostUpdate,
                (Prepare, Load, Fill, Edit, Mesh, Decorate, StartJobs, Report).chain().in_set(Work),
            )
            .add_systems(PostUpdate, count_update.in_set(ReadStamps))
            .add_systems(PostUpdate, begin_update.in_set(Work).before(Prepare))
            .add_systems(PostUpdate, start_jobs.in_set(StartJobs))
            .add_systems(PostUpdate, count_main_thread.in_set(Work).after(Report));
    }
}

/// Begins the update's time budget.
fn begin_update(settings: Res<MarchlessSettings>, edits: Option<Res<NewEdits>>, mut budget: ResMut<FrameBudget>) {
    budget.begin(settings.streaming_budget, edits.is_some_and(|edits| edits.0));
}

/// Starts tasks for queued jobs; without threads, runs some of the jobs.
fn start_jobs(queue: Res<WorkQueue>, settings: Res<MarchlessSettings>) {
    queue.start(settings.max_jobs_per_update);
}

/// Whether this update has new stamps to apply; streaming holds back for them.
#[derive(Resource, Default)]
pub(crate) struct NewEdits(pub(crate) bool);
