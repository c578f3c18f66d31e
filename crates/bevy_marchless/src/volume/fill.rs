//! Samples are requested, and arrive.

use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bevy_platform::time::Instant;
use marchless::{BOUND_BOX_CHUNKS, GridChunk, Source};

use super::groups::Pending;
use super::samples::{Replay, Replayed};
use super::{Heart, KnownSigns, SamplingSettings};
use crate::chunk::ChunkKey;
use crate::cover::Residency;
use crate::jobs::{Ticket, new_number};
use crate::stats::TerrainStats;

/// The number of boxes whose bounds are cached.
const MOST_BOXES: usize = 4096;

/// A job that samples one chunk.
pub(crate) struct FillJob {
    job: u64,
    generation: u64,
    position: [i32; 3],
    source: Arc<dyn Source>,
    cells: u32,
    spacing: f64,
    isovalue: f32,
    replay: Replay,
    /// The urgency: lower comes sooner.
    pub(crate) urgency: u32,
}

/// The result of a sampling job.
pub(crate) struct Filled {
    job: u64,
    generation: u64,
    pub(crate) position: [i32; 3],
    chunk: GridChunk<i16>,
    signs: KnownSigns,
    replayed: Replayed,
    /// True if the source was sampled; false if its bound was enough.
    pub(crate) is_sampled: bool,
    /// Whether the source panicked.
    pub(crate) panicked: bool,
    pub(crate) time: Duration,
}

impl Filled {
    /// Whether the chunk may have samples on both sides of the surface.
    pub(crate) const fn may_have_surface(&self) -> bool {
        self.signs.may_have_surface()
    }
}

impl FillJob {
    /// Samples the chunk, on any thread. If the source panics, the chunk is air.
    pub(crate) fn run(self) -> Filled {
        let start = Instant::now();
        let Self { job, generation, position, source, cells, spacing, isovalue, replay, .. } = self;
        let (of_box, sample) = (bound_box(source.as_ref(), position, cells, spacing), || {
            GridChunk::from_uncertain_source(source.as_ref(), position, cells, spacing)
        });
        let sampled = match bound_chunk(source.as_ref(), of_box, position, cells, spacing) {
            Some(chunk) => Ok((chunk, false)),
            None => catch_unwind(AssertUnwindSafe(sample)),
        };
        let panicked = sampled.is_err();
        let (chunk, is_sampled) = sampled.unwrap_or((GridChunk::AIR, false));
        let (chunk, replayed) = replay.run(chunk);
        let signs = if panicked { KnownSigns::UNKNOWN } else { KnownSigns::of(&chunk, isovalue) };
        let time = start.elapsed();
        Filled { job, generation, position, chunk, signs, replayed, is_sampled, panicked, time }
    }
}

impl Heart {
    /// Whether chunks wait to be sampled.
    pub(crate) fn has_to_ask(&self) -> bool {
        !self.to_fill.is_empty() || !self.crowded.is_empty()
    }

    /// Requests the samples of waiting chunks, the most urgent first, until `limit` jobs are under way. `start` starts
    /// a job.
    pub(crate) fn ask_for_samples(&mut self, limit: usize, mut start: impl FnMut(FillJob) -> Ticket) {
        let Some(settings) = self.sampling_settings.clone() else { return };
        while self.sampling < limit {
            let Self { to_fill, cover, table, .. } = self;
            let Some(key) = to_fill.pop(cover, |key| table.is_queued(*key)) else { break };
            let urgency = cover.urgency(key.position);
            let job = self.fill_job(&settings, key.position, urgency);
            self.table.ask(key, job.job, start(job));
            self.sampling += 1;
        }
        while self.sampling < limit
            && let Some(key) = self.crowded.pop()
        {
            let is_coming = self.table.contains(key) || self.remote.contains_key(&key.position);
            if is_coming || self.samples.is_resident(key.position) {
                continue;
            }
            let job = self.fill_job(&settings, key.position, u32::MAX);
            self.remote.insert(key.position, (job.job, start(job)));
            self.sampling += 1;
        }
    }

    /// Takes results of sampling jobs while there is time, and at least `least` of them. Returns those that were taken.
    pub(crate) fn take_filled(&mut self, least: usize, until: Instant, mut note: impl FnMut(&Filled)) {
        self.deferred_fills.extend(self.fill_results.take());
        let mut taken = 0;
        while (taken < least || Instant::now() < until)
            && let Some(result) = self.deferred_fills.pop_front()
        {
            taken += 1;
            if result.generation == self.samples.generation() {
                note(&result);
                self.samples_arrived(result);
            }
        }
    }

    /// Whether results of sampling jobs wait to be taken.
    pub(crate) fn has_filled(&self) -> bool {
        !self.deferred_fills.is_empty() || !self.fill_results.is_empty()
    }

    /// Takes the result of a job.
    fn samples_arrived(&mut self, result: Filled) {
        let Filled { job, position, chunk, signs, replayed, .. } = result;
        let key = ChunkKey::finest(position);
        if self.table.is_asked(key, job) {
            self.sampling -= 1;
            self.take_in(key, chunk, signs, Some(replayed));
        } else if self.remote.get(&position).is_some_and(|(number, _)| *number == job) {
            self.remote.remove(&position);
            self.sampling -= 1;
            if !self.table.contains(key) && !self.samples.is_resident(position) {
                let (edit, _) = self.samples.load(position, chunk, Some(replayed));
                self.late_edits.extend(Some(edit).filter(|edit| !edit.is_empty()));
                self.samples.unload(position);
            }
        }
    }

    /// Fills a loaded chunk at once if that needs no job.
    pub(super) fn fill(&mut self, key: ChunkKey, stats: &mut TerrainStats) {
        if self.samples.is_resident(key.position) {
            self.table.samples_arrived(key, None);
            self.filled_around(key);
        } else if !self.samples.needs_replay(key.position)
            && let Some(chunk) = self.bound(key.position)
        {
            stats.bounded += 1;
            let signs = KnownSigns::of(&chunk, self.isovalue());
            self.take_in(key, chunk, signs, None);
        } else {
            self.table.queue(key);
            self.to_fill.add(key, &self.cover);
        }
    }

    /// Loads and fills a chunk within this update, as an edit needs it.
    pub(super) fn fill_now(&mut self, key: ChunkKey) {
        let Some(settings) = self.sampling_settings.clone() else { return };
        if !self.table.contains(key) {
            self.table.load(key, Residency::Samples);
        }
        if self.table.is_filled(key) {
            return;
        }
        if self.samples.is_resident(key.position) {
            self.table.samples_arrived(key, None);
            return self.filled_around(key);
        }
        if self.table.has_job(key) {
            self.sampling -= 1;
        }
        let Filled { chunk, signs, replayed, .. } = self.fill_job(&settings, key.position, 0).run();
        self.take_in(key, chunk, signs, Some(replayed));
    }

    /// Takes in the samples of a loaded chunk, with the stamps that came before them.
    fn take_in(&mut self, key: ChunkKey, chunk: GridChunk<i16>, signs: KnownSigns, replayed: Option<Replayed>) {
        // A job that was to sample the chunk for its stamps alone comes too late.
        if self.remote.remove(&key.position).is_some() {
            self.sampling -= 1;
        }
        let (edit, affected) = self.samples.load(key.position, chunk, replayed);
        self.late_edits.extend(Some(edit).filter(|edit| !edit.is_empty()));
        // At the border meshes clip the samples.
        let at_border = self.samples.newest().bounds().is_some_and(|bounds| {
            (0..3).any(|axis| [bounds.min[axis], bounds.max[axis] - 1].contains(&key.position[axis]))
        });
        let signs = if at_border || !affected.is_empty() { KnownSigns::UNKNOWN } else { signs };
        self.table.samples_arrived(key, Some(signs));
        self.filled_around(key);
        // A chunk that was never drawn is meshed when all chunks around it are filled.
        let chunks = affected.into_iter().map(ChunkKey::finest);
        self.changed(Pending {
            chunks: chunks.filter(|key| self.table.is_shown(*key)).collect(),
            ..Pending::default()
        });
    }

    /// Wakes everything that waited for the samples of a chunk.
    fn filled_around(&mut self, key: ChunkKey) {
        self.groups.wake();
        self.unblock_transition(key);
        if self.cover.drops_samples() {
            self.droppable.push(key);
        }
    }

    fn fill_job(&self, settings: &SamplingSettings, position: [i32; 3], urgency: u32) -> FillJob {
        FillJob {
            job: new_number(),
            generation: self.samples.generation(),
            position,
            source: settings.source.clone(),
            cells: settings.cells,
            spacing: settings.spacing,
            isovalue: self.isovalue(),
            replay: self.samples.replay(position, settings.empty_grid()),
            urgency,
        }
    }

    /// The bound of a chunk by its source, without sampling.
    fn bound(&mut self, position: [i32; 3]) -> Option<GridChunk<i16>> {
        let SamplingSettings { source, cells, spacing, .. } = self.sampling_settings.as_ref()?;
        if self.bounds.len() > MOST_BOXES {
            self.bounds.clear();
        }
        let of_box = || bound_box(source.as_ref(), position, *cells, *spacing);
        let of_box = self.bounds.entry(GridChunk::<i16>::bound_box(position)).or_insert_with(of_box).clone();
        bound_chunk(source.as_ref(), of_box, position, *cells, *spacing)
    }
}

/// The source's bound of the box of chunks around one. A source that panics is certain of nothing.
fn bound_box(source: &dyn Source, position: [i32; 3], cells: u32, spacing: f64) -> Option<GridChunk<i16>> {
    let lowest = GridChunk::<i16>::bound_box(position).map(|v| v * BOUND_BOX_CHUNKS);
    let of_box = || GridChunk::box_without_sampling(source, lowest, BOUND_BOX_CHUNKS as u32, cells, spacing);
    catch_unwind(AssertUnwindSafe(of_box)).ok().flatten()
}

/// The source's bound of a chunk, given the bound of the box around it.
fn bound_chunk(
    source: &dyn Source,
    of_box: Option<GridChunk<i16>>,
    position: [i32; 3],
    cells: u32,
    spacing: f64,
) -> Option<GridChunk<i16>> {
    let of_chunk = || GridChunk::without_sampling_in(of_box, source, position, cells, spacing);
    catch_unwind(AssertUnwindSafe(of_chunk)).ok().flatten()
}
