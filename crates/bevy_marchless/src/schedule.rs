//! [`MarchlessSystems`]: what the plugin does in an update, in order, and [`MarchlessSettings`], how much of it at once.

use core::time::Duration;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::{AssetEventSystems, RenderAssetUsages};
use bevy_ecs::prelude::*;
use bevy_reflect::prelude::*;
use bevy_transform::TransformSystems;

use crate::budget::FrameBudget;
use crate::jobs::WorkQueue;
use crate::stats::{TerrainStats, count_main_thread, count_update};

/// The plugin's systems. All of them run in [`PostUpdate`], before transforms are propagated and asset events are
/// sent, so that what is written in `Update` shows in the same frame.
///
/// To pause terrain, give [`MarchlessSystems::Work`] a run condition. [`MarchlessSystems::ReadStamps`] should go on
/// running, because messages that nobody reads are dropped; the stamps then wait in a queue, in order.
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
    /// All else, and the set that a run condition may pause. [`TerrainEdited`](crate::brush::TerrainEdited) messages are
    /// written in it, and meshes shown.
    Work,
    /// In `Work`, once the update's new chunks are there: the place for what adds to them, so that it is there before they
    /// are first drawn; see module [`inherit`](crate::inherit).
    Decorate,
}

/// What the plugin does in [`MarchlessSystems::Work`], in order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum UpdatePhase {
    /// Gives new terrains their volume, and follows changes of their settings.
    Prepare,
    /// Lets chunks come and go.
    Load,
    /// Takes sampled chunks into the volumes and asks for more.
    Fill,
    /// Applies stamps to the samples.
    Edit,
    /// Meshes groups of changed chunks and shows those that are complete.
    Mesh,
    /// Has threads begin what has been asked for.
    StartJobs,
    /// Measures.
    Report,
}

/// Somebody makes meshes of chunks: else they do not wait for them.
#[derive(Resource, Default)]
pub(crate) struct MakesMeshes;

/// How the plugin shares out its work; the defaults fit most games.
#[derive(Resource, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct MarchlessSettings {
    /// A group of at most this many chunks is meshed within the update that changed it; a larger one in tasks, to be
    /// shown updates later. Groups of 1,024 chunks in all are meshed within one update at most.
    /// Unit: chunks with a surface. Default 8: what a small stamp at a corner of chunks touches.
    pub max_inline_chunks: usize,
    /// How many chunks may be on their way through the jobs that sample and mesh them for the first time, for each thread
    /// of the pool: few, so that what is seen first comes first; enough for an update. At least 1. Default 64.
    pub max_chunks_in_flight: usize,
    /// So many bytes of new meshes are shown per update, and one chunk more, so that the graphics card is not flooded;
    /// edits are shown at once whatever their size. Default 4 MiB.
    pub max_upload_bytes: usize,
    /// How long the main thread may load and unload chunks per update; what is left waits. Each update does some. Edits take
    /// what they need beside it; streaming holds back for them in one of five updates at most. Default: six tenths of a
    /// millisecond.
    pub streaming_budget: Duration,
    /// Where the [`Mesh`](bevy_mesh::Mesh) assets of chunks are kept; counts for meshes made from then on. Default:
    /// `RENDER_WORLD` alone, which frees the main world's copy once it has been uploaded. With `MAIN_WORLD` too, mesh ray casts,
    /// picking and other crates' colliders can read them, at the cost of that memory. Without `RENDER_WORLD`, nothing is drawn.
    pub mesh_usages: RenderAssetUsages,
    /// Without threads: how many chunks may be sampled or meshed per update, on the main thread; `Some(0)` lets them all
    /// wait, and only what `max_inline_chunks` allows is meshed. `None`: in tasks,
    /// as many at once as the pool of asynchronous tasks has threads. Default: 8 on the web, `None` elsewhere; also 8 where there is no such pool.
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
    /// How many chunks of a terrain may be sampled, and how many meshed without an edit, at once.
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

/// Begins the update's time.
fn begin_update(settings: Res<MarchlessSettings>, edits: Option<Res<NewEdits>>, mut budget: ResMut<FrameBudget>) {
    budget.begin(settings.streaming_budget, edits.is_some_and(|edits| edits.0));
}

/// Has threads begin what has been asked for or, without threads, does a part of it.
fn start_jobs(queue: Res<WorkQueue>, settings: Res<MarchlessSettings>) {
    queue.start(settings.max_jobs_per_update);
}

/// Whether stamps are to be applied in this update, for which streaming holds back.
#[derive(Resource, Default)]
pub(crate) struct NewEdits(pub(crate) bool);
