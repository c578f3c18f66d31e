//! Fills chunks from the terrain's source, in jobs.

use core::time::Duration;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use marchless::{Chunk, Grid, SpareSamples, Stamp};

use super::{Fill, Signs, Terrain, TerrainVolume};
use crate::brush::{StampQueue, apply_waiting_stamps};
use crate::chunk::ChunkKey;
use crate::schedule::MarchlessSettings;
use crate::stats::MainThread;
use crate::stream::StreamStats;
use crate::work::{Priority, Results, Ticket, WorkQueue};

/// Each update takes at least so many chunks.
const LEAST: usize = 8;

/// What the jobs have sampled.
#[derive(Resource, Default)]
pub(crate) struct FillResults(Results<Filled>);

/// A chunk that has been sampled.
pub(crate) struct Filled {
    terrain: Entity,
    filling: u64,
    position: [i32; 3],
    chunk: Chunk<i16>,
    signs: Signs,
    /// What they are the signs of.
    isovalue: f32,
    /// Whether the source filled it, instead of being certain of it.
    filled: bool,
    /// Whether the source panicked.
    panicked: bool,
    /// How many stamps have been applied again.
    repeated: usize,
    time: Duration,
}

/// What has been done to a chunk since it was first filled, and is to be done again.
#[derive(Default)]
pub(crate) struct Repeat {
    /// The chunk, where the source was certain of it.
    pub(crate) certain: Option<Chunk<i16>>,
    pub(crate) stamps: Vec<Arc<Stamp>>,
}

impl Repeat {
    /// Applies the stamps as the terrain's own grid did.
    fn apply(&self, chunk: Chunk<i16>, position: [i32; 3], mut grid: Grid<i16>) -> Chunk<i16> {
        if self.stamps.is_empty() || grid.load(position, chunk.clone()).is_err() {
            return chunk;
        }
        for stamp in &self.stamps {
            grid.apply_to_chunk(position, stamp, &mut SpareSamples::new());
        }
        grid.unload(position).unwrap_or(chunk)
    }
}

/// Asks for the samples of a chunk; those of the lowest `urgency` come first.
pub(crate) fn fill_chunk(
    entity: Entity,
    terrain: &Terrain,
    filling: u64,
    position: [i32; 3],
    repeat: Repeat,
    urgency: u32,
    queue: &WorkQueue,
    results: &FillResults,
) -> Ticket {
    let (source, results, grid) = (terrain.source.get().clone(), results.0.clone(), terrain.empty_grid());
    let (cells, spacing, isovalue) = (terrain.chunk_cells, f64::from(terrain.voxel_size), terrain.isovalue);
    queue.push(Priority::Fill(urgency), move || {
        let start = Instant::now();
        let sample = || match &repeat.certain {
            Some(chunk) => (chunk.clone(), false),
            None => Chunk::from_source_counted(source.as_ref(), position, cells, spacing),
        };
        let sampled = catch_unwind(AssertUnwindSafe(sample));
        let panicked = sampled.is_err();
        let (chunk, filled) = sampled.unwrap_or((Chunk::AIR, false));
        let chunk = repeat.apply(chunk, position, grid);
        let signs = if panicked { Signs::UNKNOWN } else { Signs::of(&chunk, isovalue) };
        let time = start.elapsed();
        let repeated = repeat.stamps.len();
        results.push(Filled {
            terrain: entity,
            filling,
            position,
            chunk,
            signs,
            isovalue,
            filled,
            panicked,
            repeated,
            time,
        });
    })
}

/// Takes sampled chunks into their volumes, with the stamps that came before them.
pub(crate) fn take_filled_chunks(
    results: Res<FillResults>,
    mut waiting: Local<VecDeque<Filled>>,
    mut volumes: Query<&mut TerrainVolume>,
    settings: Res<MarchlessSettings>,
    stamps: Option<Res<StampQueue>>,
    mut stats: ResMut<StreamStats>,
    mut main_thread: ResMut<MainThread>,
) {
    let start = main_thread.start();
    // New edits come first, unless they wait for samples.
    let edits = stamps.is_some_and(|it| !it.is_empty()) && !volumes.iter().any(|it| it.streaming.holds_stamps);
    let share = if edits { settings.main_thread / 8 } else { settings.main_thread / 4 * 3 };
    let until = main_thread.until(start, share);
    waiting.extend(results.0.take());
    let mut taken = 0;
    while (taken < LEAST || Instant::now() < until)
        && let Some(filled) = waiting.pop_front()
    {
        taken += 1;
        let Filled { terrain, filling, position, chunk, mut signs, isovalue, filled, panicked, repeated, time } =
            filled;
        let Ok(mut volume) = volumes.get_mut(terrain) else { continue };
        // A job that took very long may have begun before the chunk's last edits.
        if volume.filling != filling || volume.stamps_to_repeat(position) != repeated {
            continue;
        }
        stats.fill_time += time;
        if panicked {
            bevy_log::error_once!("a terrain's source panicked; chunk {position:?} of terrain {terrain} stays air");
        }
        stats.filled += u64::from(filled);
        stats.filled_empty += u64::from(filled && !signs.may_have_surface());
        if volume.settings.as_ref().is_none_or(|settings| settings.isovalue != isovalue) {
            signs = Signs::UNKNOWN;
        }
        let (volume, key) = (&mut *volume, ChunkKey::finest(position));
        let is_remote = volume.streaming.take_remote(position);
        match volume.chunks.get(&key).map(|state| &state.fill) {
            Some(Fill::Asked(_)) => {
                volume.streaming.job_is_over();
                volume.take_samples(key, Some((chunk, signs)));
            }
            None if is_remote && volume.grid.chunk(position).is_none() => {
                volume.grid.load(position, chunk).expect("stamps wait within the extent only");
                apply_waiting_stamps(volume, position);
                volume.grid.take_dirty();
                volume.forget_samples(position);
            }
            _ => {}
        }
    }
    main_thread.stop(start);
}
