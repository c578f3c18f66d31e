//! Fills chunks from the terrain's source, in jobs.

use core::time::Duration;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use marchless::Chunk;

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
    /// `None` where the source panicked.
    sampled: Option<Sampled>,
    time: Duration,
}

struct Sampled {
    chunk: Chunk<i16>,
    signs: Signs,
    /// What they are the signs of.
    isovalue: f32,
    /// Whether the source filled it, instead of being certain of it.
    filled: bool,
}

/// Asks for the samples of a chunk; those of the lowest `urgency` come first.
pub(crate) fn fill_chunk(
    entity: Entity,
    terrain: &Terrain,
    filling: u64,
    position: [i32; 3],
    urgency: u32,
    queue: &WorkQueue,
    results: &FillResults,
) -> Ticket {
    let (source, results) = (terrain.source.get().clone(), results.0.clone());
    let (cells, spacing, isovalue) = (terrain.chunk_cells, f64::from(terrain.voxel_size), terrain.isovalue);
    queue.push(Priority::Fill(urgency), move || {
        let start = Instant::now();
        let sample = || Chunk::from_source_counted(source.as_ref(), position, cells, spacing);
        let chunk = catch_unwind(AssertUnwindSafe(sample)).ok();
        let chunk = chunk.map(|(chunk, filled)| {
            let signs = Signs::of(&chunk, isovalue);
            Sampled { chunk, signs, isovalue, filled }
        });
        results.push(Filled { terrain: entity, filling, position, sampled: chunk, time: start.elapsed() });
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
        let Filled { terrain, filling, position, sampled, time } = filled;
        let Ok(mut volume) = volumes.get_mut(terrain) else { continue };
        if volume.filling != filling {
            continue;
        }
        stats.fill_time += time;
        let Sampled { chunk, mut signs, isovalue, filled } = sampled.unwrap_or_else(|| {
            bevy_log::error_once!("a terrain's source panicked; chunk {position:?} of terrain {terrain} stays air");
            Sampled { chunk: Chunk::AIR, signs: Signs::UNKNOWN, isovalue: 0.0, filled: false }
        });
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
                if !volume.edited.contains(&position) {
                    volume.grid.unload(position);
                }
            }
            _ => {}
        }
    }
    main_thread.stop(start);
}
