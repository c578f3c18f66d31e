//! Fills chunks from the terrain's source, in jobs.

use core::time::Duration;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use marchless::Chunk;

use super::{Fill, Terrain, TerrainVolume};
use crate::brush::apply_waiting_stamps;
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
    /// The samples, and whether the source filled them; `None` where it panicked.
    chunk: Option<(Chunk<i16>, bool)>,
    /// Whether they all lie on one side of the surface.
    is_empty: bool,
    time: Duration,
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
        let is_empty = chunk.as_ref().is_none_or(|(chunk, _)| !has_surface(chunk, isovalue));
        results.push(Filled { terrain: entity, filling, position, chunk, is_empty, time: start.elapsed() });
    })
}

/// Whether some samples lie inside and some outside.
fn has_surface(chunk: &Chunk<i16>, isovalue: f32) -> bool {
    match chunk {
        Chunk::Uniform(_) => false,
        Chunk::Samples(samples) => {
            let threshold = isovalue * 256.0;
            let inside = samples.weights.iter().filter(|weight| f32::from(**weight) < threshold).count();
            inside > 0 && inside < samples.weights.len()
        }
    }
}

/// Takes sampled chunks into their volumes, with the stamps that came before them.
pub(crate) fn take_filled_chunks(
    results: Res<FillResults>,
    mut waiting: Local<VecDeque<Filled>>,
    mut volumes: Query<&mut TerrainVolume>,
    settings: Res<MarchlessSettings>,
    mut stats: ResMut<StreamStats>,
    mut main_thread: ResMut<MainThread>,
) {
    let start = main_thread.start();
    let until = main_thread.until(start, settings.main_thread / 4 * 3);
    waiting.extend(results.0.take());
    let mut taken = 0;
    while (taken < LEAST || Instant::now() < until)
        && let Some(filled) = waiting.pop_front()
    {
        taken += 1;
        let Filled { terrain, filling, position, chunk, is_empty, time } = filled;
        let Ok(mut volume) = volumes.get_mut(terrain) else { continue };
        if volume.filling != filling {
            continue;
        }
        stats.fill_time += time;
        let was_filled = chunk.as_ref().is_some_and(|(_, filled)| *filled);
        stats.filled += u64::from(was_filled);
        stats.filled_empty += u64::from(was_filled && is_empty);
        let (chunk, _) = chunk.unwrap_or_else(|| {
            bevy_log::error_once!("a terrain's source panicked; chunk {position:?} of terrain {terrain} stays air");
            (Chunk::AIR, false)
        });
        let (volume, key) = (&mut *volume, ChunkKey::finest(position));
        let is_remote = volume.streaming.take_remote(position);
        match volume.chunks.get(&key).map(|state| &state.fill) {
            Some(Fill::Asked(_)) => {
                volume.streaming.job_is_over();
                volume.take_samples(key, Some(chunk));
            }
            None if is_remote => {
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
