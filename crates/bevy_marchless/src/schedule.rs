//! [`MarchlessSystems`]: what the plugin does in an update, in order, and [`MarchlessSettings`], how much of it at once.

use core::time::Duration;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::AssetEventSystems;
use bevy_ecs::prelude::*;
use bevy_reflect::prelude::*;
use bevy_transform::TransformSystems;

use crate::stats::{MainThread, Stats, count_update, sum_up};
use crate::stream::StreamStats;
use crate::work::{WorkQueue, start_work};

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
    /// Everything below, and the set that a run condition may pause.
    Work,
    /// Gives new terrains their volume and chunks, and follows changes of their settings. In `Work`.
    Prepare,
    /// Takes sampled chunks into the volumes and asks for more. In `Work`.
    Fill,
    /// Applies stamps to the samples. In `Work`.
    Edit,
    /// Meshes groups of changed chunks and shows those that are complete. In `Work`.
    Mesh,
    /// Measures. In `Work`.
    Report,
}

/// How the plugin shares out its work; the defaults fit most games.
#[derive(Resource, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct MarchlessSettings {
    /// A group of at most so many chunks is meshed within the update that changed it; a larger one in tasks, to be
    /// shown updates later. Unit: chunks with a surface. Default 8: what a small stamp at a corner of chunks touches.
    pub inline_chunks: usize,
    /// How many chunks may be on their way through the jobs that sample and mesh them for the first time, for each thread
    /// of the pool: few, so that what is seen first comes first; enough for an update. At least 1. Default 64.
    pub chunks_in_flight: usize,
    /// So many bytes of new meshes are shown per update, and one chunk more, so that the graphics card is not flooded;
    /// edits are shown at once whatever their size. Default 4 MiB.
    pub upload_bytes: usize,
    /// How long the main thread may load and unload chunks per update; what is left waits. Each update does some. Default:
    /// six tenths of a millisecond.
    pub main_thread: Duration,
    /// Without threads: how many chunks may be sampled or meshed per update, on the main thread; `Some(0)` lets them all
    /// wait, and only what `inline_chunks` allows is meshed. `None`: in tasks,
    /// as many at once as the pool of asynchronous tasks has threads. Default: 8 on the web, `None` elsewhere; also 8 where there is no such pool.
    pub budget: Option<usize>,
}

impl Default for MarchlessSettings {
    fn default() -> Self {
        Self {
            inline_chunks: 8,
            chunks_in_flight: 64,
            upload_bytes: 4 << 20,
            main_thread: Duration::from_micros(600),
            budget: cfg!(target_arch = "wasm32").then_some(8),
        }
    }
}

/// Orders the plugin's systems. The other parts of [`MarchlessPlugins`](crate::MarchlessPlugins) need it.
#[derive(Default)]
pub struct SchedulePlugin;

impl Plugin for SchedulePlugin {
    fn build(&self, app: &mut App) {
        use MarchlessSystems::{Edit, Fill, Mesh, Prepare, ReadStamps, Report, Work};

        app.init_resource::<MarchlessSettings>()
            .register_type::<MarchlessSettings>()
            .init_resource::<WorkQueue>()
            .init_resource::<Stats>()
            .add_systems(PostUpdate, count_update.in_set(MarchlessSystems::ReadStamps))
            .configure_sets(
                PostUpdate,
                (ReadStamps, Work).chain().before(TransformSystems::Propagate).before(AssetEventSystems),
            )
            .configure_sets(PostUpdate, (Prepare, Fill, Edit, Mesh, Report).chain().in_set(Work))
            .init_resource::<MainThread>()
            .init_resource::<StreamStats>()
            .add_systems(PostUpdate, start_work.in_set(Work).after(Mesh).before(Report))
            .add_systems(PostUpdate, sum_up.in_set(Work).after(Report));
    }
}
