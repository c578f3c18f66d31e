//! Queues sampling jobs for chunks and takes in their results.

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use bevy_tasks::AsyncComputeTaskPool;

use crate::budget::{FrameBudget, Share};
use crate::jobs::{Priority, WorkQueue};
use crate::schedule::MarchlessSettings;
use crate::stats::TerrainStats;
use crate::terrain::TerrainVolume;
use crate::volume::Filled;

/// The least number of sampled chunks that an update takes in per terrain, whatever the budget.
const MIN_CHUNKS: usize = 4;

/// Takes sampled chunks into their volumes, with the stamps that came before them.
pub(super) fn take_filled_chunks(
    mut volumes: Query<(Entity, &mut TerrainVolume)>,
    mut stats: ResMut<TerrainStats>,
    mut budget: ResMut<FrameBudget>,
) {
    let start = Instant::now();
    let until = budget.until(start, Share::Fill);
    for (terrain, mut volume) in &mut volumes {
        if !volume.heart().has_filled() {
            continue;
        }
        volume.heart_mut().take_filled(MIN_CHUNKS, until, |chunk: &Filled| {
            stats.fill_time += chunk.time;
            stats.filled += u64::from(chunk.is_sampled);
            stats.filled_empty += u64::from(chunk.is_sampled && !chunk.may_have_surface());
            if chunk.panicked {
                let position = chunk.position;
                bevy_log::error_once!("a terrain's source panicked; chunk {position:?} of terrain {terrain} stays air");
            }
        });
    }
    budget.spend(start);
}

/// Queues sampling jobs for pending chunks, the most urgent first, up to the limit in flight; and the job that plans
/// changes of levels.
pub(super) fn ask_for_samples(
    mut volumes: Query<&mut TerrainVolume>,
    queue: Res<WorkQueue>,
    settings: Res<MarchlessSettings>,
    mut budget: ResMut<FrameBudget>,
) {
    let start = Instant::now();
    let threads = AsyncComputeTaskPool::try_get().map_or(1, |pool| pool.thread_num().max(1));
    let limit = settings.in_flight(threads);
    for mut volume in &mut volumes {
        if volume.heart().has_to_plan() {
            volume.heart_mut().start_plan(|job, results| queue.push(Priority::Plan, move || results.push(job.run())));
        }
        if volume.heart().has_to_ask() {
            let results = volume.heart().fill_results().clone();
            volume.heart_mut().ask_for_samples(limit, |job| {
                let results = results.clone();
                queue.push(Priority::Fill(job.urgency), move || results.push(job.run()))
            });
        }
    }
    budget.spend(start);
}
