//! [`Streaming`]: what becomes of chunks when ranges change.

use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_platform::collections::{HashMap, HashSet};
use bevy_platform::time::Instant;
use bevy_tasks::AsyncComputeTaskPool;
use bevy_transform::components::GlobalTransform;
use bevy_transform::helper::TransformHelper;
use marchless::{Chunk, Region, Source};

use super::agenda::Agenda;
use super::look::Look;
use super::range::{Range, Ranges, Viewed, Wanted};
use super::{StreamStats, TerrainViewer};
use crate::brush::{StampQueue, apply_waiting_stamps};
use crate::chunk::ChunkKey;
use crate::place::{Place, in_double_precision};
use crate::schedule::MarchlessSettings;
use crate::stats::MainThread;
use crate::terrain::{
    ChunkState, Edits, Fill, FillResults, MOST_STAMPS, Repeat, Signs, Terrain, TerrainVolume, fill_chunk,
};
use crate::work::{Ticket, WorkQueue};

/// Chunks per axis of the boxes that the source bounds at once.
const BOX: i32 = 4;
/// Bounds of so many boxes are remembered.
const MOST_BOXES: usize = 4096;
/// Each update at least so many chunks come, and as many go.
const LEAST: usize = 4;

/// Which chunks of a terrain are loaded, and what is to be done about it.
#[derive(Default)]
pub(crate) struct Streaming {
    ranges: Ranges,
    /// The latest good range of each viewer, and what it was made from.
    viewers: HashMap<Entity, (TerrainViewer, Viewed)>,
    /// Chunks that ranges may ask for.
    arriving: Agenda,
    /// Chunks that ranges may no longer ask for.
    leaving: Vec<ChunkKey>,
    /// Chunks that wait to be sampled.
    to_fill: Agenda,
    /// Chunks with a surface, and all samples around it, that wait to be meshed for the first time.
    pub(crate) to_mesh: Agenda,
    /// The ranges that told what is urgent on these agendas.
    urgent_for: Ranges,
    /// How many jobs are sampling, or about to.
    asked: usize,
    /// What the source is certain of, box by box.
    boxes: HashMap<[i32; 3], Option<Chunk<i16>>>,
    /// Chunks that are not loaded, but are being filled for the stamps that wait for them.
    remote: HashMap<[i32; 3], Ticket>,
    /// Whether samples may be dropped, and whether all chunks are to be looked at for that when nothing else is to do.
    drops: bool,
    pub(crate) may_drop_more: bool,
    /// Whether a stamp waits for samples that had been dropped.
    pub(crate) holds_stamps: bool,
}

impl Streaming {
    pub(crate) const fn ranges(&self) -> &Ranges {
        &self.ranges
    }

    /// Chunks whose lot is still to be decided.
    pub(crate) fn on_their_way(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.arriving.iter()
    }

    /// Whether nothing is left to load, to unload or to fill.
    pub(crate) fn is_idle(&self) -> bool {
        self.arriving.is_empty() && self.leaving.is_empty() && self.remote.is_empty() && !self.holds_stamps
    }

    /// Notes that a chunk is to be looked at again.
    pub(crate) fn look_at(&mut self, key: ChunkKey) {
        self.arriving.add_first(key);
    }

    /// Forgets what is being filled: all loaded chunks are to be filled anew.
    pub(crate) fn refill(&mut self, all: impl Iterator<Item = ChunkKey>) {
        self.to_fill.clear();
        self.to_mesh.clear();
        self.boxes.clear();
        self.remote.clear();
        self.asked = 0;
        all.for_each(|key| self.arriving.add(key, &self.ranges));
    }

    /// Whether a job for a chunk that is not loaded has been asked for; it is done now.
    pub(crate) fn take_remote(&mut self, position: [i32; 3]) -> bool {
        let found = self.remote.remove(&position).is_some();
        self.asked -= usize::from(found);
        found
    }

    /// Notes that a chunk is to be meshed for the first time.
    pub(crate) fn add_to_mesh(&mut self, key: ChunkKey) {
        self.to_mesh.add(key, &self.ranges);
    }

    /// The most urgent chunk that is to be meshed for the first time, and still `waits` for that.
    pub(crate) fn next_to_mesh(&mut self, waits: impl Fn(&ChunkKey) -> bool) -> Option<ChunkKey> {
        self.to_mesh.pop(&self.ranges, waits)
    }

    /// Notes that a job that samples is done or no longer wanted.
    pub(crate) fn job_is_over(&mut self) {
        self.asked -= 1;
    }

    /// Takes new ranges, and notes which chunks they concern.
    fn change(&mut self, new: Ranges, is_loaded: impl Fn(&ChunkKey) -> bool) {
        let old = core::mem::replace(&mut self.ranges, new);
        // What was dropped once has to come back some time.
        self.drops |= self.ranges.0.iter().any(|viewed| viewed.samples.is_some());
        self.may_drop_more |= self.drops;
        let Self { ranges, arriving, leaving, .. } = self;
        ranges.differences(
            &old,
            |position| arriving.add_unsorted(ChunkKey::finest(position)),
            |position| leaving.extend(Some(ChunkKey::finest(position)).filter(&is_loaded)),
        );
        if self.ranges.differ_in_urgency(&self.urgent_for) {
            self.urgent_for = self.ranges.clone();
            [&mut self.arriving, &mut self.to_fill, &mut self.to_mesh].into_iter().for_each(Agenda::sort_again);
        }
    }

    /// The most urgent chunk whose lot is to be decided.
    fn next_arriving(&mut self) -> Option<ChunkKey> {
        let ranges = &self.ranges;
        self.arriving.pop(ranges, |key| ranges.wanted(key.position, Wanted::Samples) > Wanted::Gone)
    }

    /// What a chunk's samples take to be as they were when it was unloaded.
    fn repeat(&mut self, edits: Option<&Edits>, terrain: &Terrain, position: [i32; 3]) -> Repeat {
        let Some(Edits::Stamps(stamps)) = edits else { return Repeat::default() };
        let (source, cells) = (terrain.source.get().as_ref(), terrain.chunk_cells);
        let certain = self.bound(source, position, cells, f64::from(terrain.voxel_size));
        Repeat { certain, stamps: stamps.clone() }
    }

    /// What the source is certain of without sampling. A source that panics is certain of nothing.
    fn bound(&mut self, source: &dyn Source, position: [i32; 3], cells: u32, spacing: f64) -> Option<Chunk<i16>> {
        if self.boxes.len() > MOST_BOXES {
            self.boxes.clear();
        }
        let corner = position.map(|v| v.div_euclid(BOX));
        let of_box = || Chunk::box_without_sampling(source, corner.map(|v| v * BOX), BOX as u32, cells, spacing);
        let whole = self.boxes.entry(corner).or_insert_with(|| catch_unwind(AssertUnwindSafe(of_box)).ok().flatten());
        if whole.is_some() {
            return whole.clone();
        }
        let of_chunk = || Chunk::without_sampling(source, position, cells, spacing);
        catch_unwind(AssertUnwindSafe(of_chunk)).ok().flatten()
    }
}

/// Moves the ranges of all terrains with their viewers, and lets chunks follow as far as the update's time allows.
pub(crate) fn follow_viewers(
    mut terrains: Query<(Entity, &mut TerrainVolume, Place)>,
    viewers: Query<(Entity, &TerrainViewer, Ref<GlobalTransform>)>,
    transforms: TransformHelper,
    settings: Res<MarchlessSettings>,
    stamps: Option<Res<StampQueue>>,
    mut stats: ResMut<StreamStats>,
    mut main_thread: ResMut<MainThread>,
    mut commands: Commands,
    mut reported: Local<HashSet<(Entity, Entity)>>,
) {
    let start = main_thread.start();
    let mut viewers: Vec<_> = viewers.iter().collect();
    viewers.sort_by_key(|(viewer, ..)| *viewer);
    reported.retain(|(terrain, about)| {
        terrains.contains(*terrain) && (terrain == about || viewers.iter().any(|(viewer, ..)| viewer == about))
    });
    for (terrain, mut volume, place) in &mut terrains {
        let Some(settings_in_effect) = &volume.settings else { continue };
        // Where things are in this very update; in a floating space, where they were when transforms were last propagated.
        let now = |entity: Entity| transforms.compute_global_transform(entity).ok();
        let to_world = if place.is_floating() {
            Some(place.to_world())
        } else {
            now(terrain).map(|transform| in_double_precision(&transform))
        };
        let mut look =
            Look { terrain: settings_in_effect, to_terrain: to_world.map(|it| it.inverse()), reported: &mut reported };
        let mut found = HashMap::default();
        for (viewer, settings, propagated) in &viewers {
            let at = if place.is_floating() { (!propagated.is_added()).then_some(**propagated) } else { now(*viewer) };
            let known = volume.streaming.viewers.get(viewer).copied();
            let seen = at.and_then(|at| look.at(terrain, *viewer, settings, &at, known));
            if let Some(seen) = seen.map(|viewed| (**settings, viewed)).or(known) {
                found.insert(*viewer, seen);
            }
        }
        let (extent, kept) = (settings_in_effect.chunk_region(), settings_in_effect.kept_region());
        let mut ranges = Ranges::default();
        if !kept.is_empty() {
            let range = Range::of_box(kept, extent);
            ranges.0.push(Viewed { range, margin: 0.0, samples: None, forward: [0.0; 3] });
        }
        ranges.0.extend(viewers.iter().filter_map(|(viewer, ..)| found.get(viewer)).map(|(_, viewed)| *viewed));
        if found != volume.streaming.viewers {
            volume.streaming.viewers = found;
        }
        if ranges != volume.streaming.ranges {
            let TerrainVolume { streaming, chunks, .. } = &mut *volume;
            streaming.change(ranges, |key| chunks.contains_key(key));
        }
        if volume.streaming.drops && volume.streaming.may_drop_more && volume.is_settled() {
            volume.streaming.may_drop_more = false;
            let all: Vec<ChunkKey> = volume.chunks.keys().copied().collect();
            volume.streaming.leaving.extend(all);
        }
        if !volume.streaming.arriving.is_empty() || !volume.streaming.leaving.is_empty() {
            // Half of the time is for what follows; new edits take theirs first.
            let edits = stamps.as_ref().is_some_and(|it| !it.is_empty()) && !volume.streaming.holds_stamps;
            let until = main_thread.until(start, settings.main_thread / if edits { 8 } else { 2 });
            let mut follow = Follow { volume: &mut volume, commands: &mut commands, stats: &mut stats, despawned: 0 };
            follow.go_on(until);
        }
    }
    main_thread.stop(start);
}

/// Letting the chunks of one terrain follow.
struct Follow<'a, 'w, 's> {
    volume: &'a mut TerrainVolume,
    commands: &'a mut Commands<'w, 's>,
    stats: &'a mut StreamStats,
    /// How many entities are to be despawned.
    despawned: u32,
}

/// About how long it takes to spawn or despawn a chunk's entity, which commands do later.
pub(crate) const ENTITY_TIME: Duration = Duration::from_micros(10);

impl Follow<'_, '_, '_> {
    /// Goes through chunks, those that are wanted first, until it is late.
    fn go_on(&mut self, until: Instant) {
        let Some(terrain) = &self.volume.settings else { return };
        let asked = Asked {
            source: terrain.source.get().clone(),
            extent: terrain.chunk_region(),
            cells: terrain.chunk_cells,
            spacing: f64::from(terrain.voxel_size),
            isovalue: terrain.isovalue,
        };
        // Both have half of the time, unless as many are on their way out as the ranges hold: then hardly any come.
        let Streaming { ranges, arriving, leaving, .. } = &self.volume.streaming;
        let is_crowded = leaving.len() as f64 > ranges.0.iter().map(|viewed| viewed.range.box_size()).sum();
        let share = if arriving.is_empty() || is_crowded { 1 } else { 2 };
        let until_gone = Instant::now() + until.saturating_duration_since(Instant::now()) / share;
        let mut done = 0;
        while (done < LEAST || Instant::now() + self.despawned * ENTITY_TIME < until_gone)
            && let Some(key) = self.volume.streaming.leaving.pop()
        {
            self.settle(key, &asked);
            done += 1;
        }
        let mut done = 0;
        while (done < LEAST || !is_crowded && Instant::now() + self.despawned * ENTITY_TIME < until)
            && let Some(key) = self.volume.streaming.next_arriving()
        {
            self.settle(key, &asked);
            done += 1;
        }
    }

    /// Makes of a chunk what the ranges ask of it.
    fn settle(&mut self, key: ChunkKey, asked: &Asked) {
        let now = self.volume.chunks.get(&key).map_or(Wanted::Gone, |state| state.wanted);
        let wanted = self.volume.streaming.ranges.wanted(key.position, now);
        match (now, wanted) {
            (Wanted::Gone, Wanted::Gone) => return,
            (Wanted::Gone, _) => self.load(key, wanted, asked),
            (_, Wanted::Gone) => return self.unload(key),
            (Wanted::Samples, Wanted::Mesh) => {
                let Some(state) = self.volume.chunks.get_mut(&key) else { return };
                state.wanted = Wanted::Mesh;
                if state.missing == 0 {
                    self.volume.ready.push(key);
                }
            }
            (Wanted::Mesh, Wanted::Samples) => self.hide(key),
            (Wanted::Mesh, Wanted::Mesh) => self.load_lost_neighbours(key, asked),
            (Wanted::Samples, Wanted::Samples) => {}
        }
        if self.volume.streaming.drops {
            self.drop_or_revive(key);
        }
        if self.volume.chunks.get(&key).is_some_and(|state| matches!(state.fill, Fill::Unasked)) {
            self.fill(key, asked);
        }
    }

    fn load(&mut self, key: ChunkKey, wanted: Wanted, asked: &Asked) {
        let missing = self.volume.missing_around(key, asked.extent);
        self.volume.chunks.insert(key, ChunkState::new(wanted, missing));
        self.volume.unfilled += 1;
        self.stats.loaded += 1;
    }

    /// Loads neighbours of a chunk that stays for the margin's sake alone, where they went before the ranges came back:
    /// nobody else would, and edits of the chunk would wait for them for ever.
    fn load_lost_neighbours(&mut self, key: ChunkKey, asked: &Asked) {
        let lacks_some = self.volume.chunks.get(&key).is_some_and(|state| state.missing > 0);
        if !lacks_some || self.volume.streaming.ranges.contains(key.position) {
            return; // What a chunk in range lacks comes anyway.
        }
        for near in key.around().filter(|near| asked.extent.contains(near.position)) {
            let wanted = self.volume.streaming.ranges.wanted(near.position, Wanted::Samples);
            if wanted > Wanted::Gone && !self.volume.chunks.contains_key(&near) {
                self.load(near, wanted, asked);
                self.fill(near, asked);
            }
        }
    }

    /// Fills a chunk at once where that needs no job.
    fn fill(&mut self, key: ChunkKey, Asked { source, cells, spacing, isovalue, .. }: &Asked) {
        let volume = &mut *self.volume;
        if volume.grid.chunk(key.position).is_some() {
            volume.take_samples(key, None);
        } else if !volume.edited.contains_key(&key.position)
            && let Some(chunk) = volume.streaming.bound(source.as_ref(), key.position, *cells, *spacing)
        {
            self.stats.bounded += 1;
            let signs = Signs::of(&chunk, *isovalue);
            volume.take_samples(key, Some((chunk, signs)));
        } else if let Some(state) = volume.chunks.get_mut(&key) {
            state.fill = Fill::Waiting;
            let Streaming { to_fill, ranges, .. } = &mut volume.streaming;
            to_fill.add(key, ranges);
        }
    }

    /// Forgets a chunk, but for its edits.
    fn unload(&mut self, key: ChunkKey) {
        self.hide(key);
        let Some(state) = self.volume.chunks.remove(&key) else { return };
        self.stats.unloaded += 1;
        match state.fill {
            Fill::Unasked | Fill::Waiting => self.volume.unfilled -= 1,
            Fill::Asked(_) => {
                self.volume.unfilled -= 1;
                self.volume.streaming.job_is_over();
            }
            Fill::Done => {
                self.volume.set_unfilled(key);
                self.volume.forget_samples(key.position);
            }
            Fill::Dropped => {}
        }
        self.volume.forget_shown(key.position);
    }

    /// Takes a chunk from the screen.
    fn hide(&mut self, key: ChunkKey) {
        let first_mesh = self.volume.claims.get(&key).copied();
        if let Some(id) = first_mesh.filter(|id| self.volume.groups.get(id).is_some_and(|group| group.withdrawable)) {
            self.volume.take_group(id);
        }
        let Some(state) = self.volume.chunks.get_mut(&key) else { return };
        state.wanted = Wanted::Samples;
        (state.drawn, state.empty, state.stale, state.hidden) = (false, true, false, false);
        if let Some(entity) = state.entity.take() {
            self.commands.entity(entity).try_despawn();
            self.despawned += 1;
        }
    }

    /// Drops the samples of a chunk that nobody needs for now, or wants them again.
    fn drop_or_revive(&mut self, key: ChunkKey) {
        let volume = &mut *self.volume;
        let Some(state) = volume.chunks.get(&key) else { return };
        if state.missing > 0 && state.wanted == Wanted::Mesh && (!state.drawn || state.stale) {
            volume.revive_around(key);
        } else if matches!(state.fill, Fill::Dropped) {
            if volume.streaming.ranges.wants_samples(key.position) {
                volume.revive(key);
            }
        } else if volume.may_drop(key) && volume.streaming.ranges.may_drop_samples(key.position) {
            volume.grid.unload(key.position);
            volume.forget_shown(key.position);
            volume.bits.forget(key.position);
            if let Some(state) = volume.chunks.get_mut(&key) {
                state.fill = Fill::Dropped;
            }
            volume.set_unfilled(key);
        }
    }
}

/// What filling a terrain's chunks takes.
struct Asked {
    source: Arc<dyn Source>,
    extent: Region,
    cells: u32,
    spacing: f64,
    isovalue: f32,
}

impl TerrainVolume {
    /// Takes in a chunk's samples, `None` where the grid has them already, and the stamps that came before them.
    pub(crate) fn take_samples(&mut self, key: ChunkKey, samples: Option<(Chunk<i16>, Signs)>) {
        // The samples are there: whoever was to fill them for stamps alone comes too late.
        self.streaming.take_remote(key.position);
        if let Some((chunk, signs)) = samples {
            self.grid.load(key.position, chunk).expect("a chunk of the extent, with the grid's own number of cells");
            if let Some(state) = self.chunks.get_mut(&key) {
                // At the border the samples have been clipped.
                let at_border = self.grid.bounds().is_some_and(|bounds| {
                    (0..3).any(|axis| [bounds.min[axis], bounds.max[axis] - 1].contains(&key.position[axis]))
                });
                state.signs = if at_border { Signs::UNKNOWN } else { signs };
            }
        }
        apply_waiting_stamps(self, key.position);
        self.set_filled(key);
        // What has not been drawn is meshed once all around it is filled.
        let is_drawn = |position: &[i32; 3]| {
            self.chunks
                .get(&ChunkKey::finest(*position))
                .is_some_and(|state| state.drawn && state.wanted == Wanted::Mesh)
        };
        let changed = self.grid.take_dirty().into_iter().filter(is_drawn).collect();
        self.add_changed(changed, None);
    }

    /// Whether samples could be filled again, and nothing reads them for now.
    fn may_drop(&self, key: ChunkKey) -> bool {
        let is_done = |state: &ChunkState| state.wanted == Wanted::Mesh && state.drawn && !state.stale;
        self.chunks.get(&key).is_some_and(|state| state.is_filled())
            && matches!(self.grid.chunk(key.position), Some(Chunk::Samples(_)))
            && !self.edited.contains_key(&key.position)
            && key
                .around()
                .filter(|near| self.grid.bounds().is_none_or(|bounds| bounds.contains(near.position)))
                .all(|near| self.chunks.get(&near).is_some_and(is_done) && !self.claims.contains_key(&near))
            && !self.pending.iter().any(|pending| pending.chunks.contains(&key))
    }

    /// Asks for the dropped samples of a chunk.
    fn revive(&mut self, key: ChunkKey) {
        if let Some(state) = self.chunks.get_mut(&key)
            && matches!(state.fill, Fill::Dropped)
        {
            state.fill = Fill::Unasked;
            self.unfilled += 1;
            self.streaming.look_at(key);
        }
    }

    /// Asks for all dropped samples around a chunk.
    fn revive_around(&mut self, key: ChunkKey) {
        for near in key.around() {
            self.revive(near);
        }
    }
}

/// Whether all samples that a change of `changed` (lattice points) needs are there, or may come as they are filled. Those that
/// have been dropped are asked for.
pub(crate) fn free_samples_for(volume: &mut TerrainVolume, changed: Region) -> bool {
    if !volume.streaming.drops || changed.is_empty() {
        return true;
    }
    let affected = volume.grid.chunks_affected_by(changed).grown(1, 1);
    let lost = |volume: &TerrainVolume, key: &ChunkKey| {
        // What is being filled again still has its neighbours on the screen.
        volume.chunks.get(key).is_some_and(|state| state.drawn && !state.is_filled())
    };
    let all = affected.size().into_iter().map(u64::from).product::<u64>();
    let lost: Vec<ChunkKey> = if all < volume.chunks.len() as u64 {
        affected.points().map(ChunkKey::finest).filter(|key| lost(volume, key)).collect()
    } else {
        volume.chunks.keys().copied().filter(|key| affected.contains(key.position) && lost(volume, key)).collect()
    };
    for key in &lost {
        volume.revive(*key);
    }
    lost.is_empty()
}

/// Asks for the samples of the chunks that wait for them, the most urgent first, as many as may be in flight.
pub(crate) fn ask_for_samples(
    mut terrains: Query<(Entity, &mut TerrainVolume)>,
    queue: Res<WorkQueue>,
    results: Res<FillResults>,
    settings: Res<MarchlessSettings>,
    mut main_thread: ResMut<MainThread>,
) {
    let start = main_thread.start();
    let limit = in_flight(&settings);
    for (entity, mut volume) in &mut terrains {
        if volume.streaming.to_fill.is_empty() && volume.stamps.is_empty() {
            continue;
        }
        let volume = &mut *volume;
        let Some(terrain) = &volume.settings else { continue };
        let streaming = &mut volume.streaming;
        let chunks = &mut volume.chunks;
        while streaming.asked < limit {
            let waits = |key: &ChunkKey| chunks.get(key).is_some_and(|state| matches!(state.fill, Fill::Waiting));
            let Some(key) = streaming.to_fill.pop(&streaming.ranges, waits) else { break };
            let Some(state) = chunks.get_mut(&key) else { break };
            let urgency = streaming.ranges.urgency(key.position);
            let repeat = streaming.repeat(volume.edited.get(&key.position), terrain, key.position);
            let ticket = fill_chunk(entity, terrain, volume.filling, key.position, repeat, urgency, &queue, &results);
            state.fill = Fill::Asked(ticket);
            streaming.asked += 1;
        }
        let crowded =
            volume.stamps.iter().filter(|(_, stamps)| stamps.len() > MOST_STAMPS).map(|(position, _)| *position);
        let crowded: Vec<_> = crowded.take(limit).collect();
        for position in crowded {
            if !volume.chunks.contains_key(&ChunkKey::finest(position)) && !streaming.remote.contains_key(&position) {
                let repeat = streaming.repeat(volume.edited.get(&position), terrain, position);
                let ticket = fill_chunk(entity, terrain, volume.filling, position, repeat, u32::MAX, &queue, &results);
                streaming.remote.insert(position, ticket);
                streaming.asked += 1;
            }
        }
    }
    main_thread.stop(start);
}

/// How many chunks may be sampled, and how many meshed for the first time, at once.
pub(crate) fn in_flight(settings: &MarchlessSettings) -> usize {
    let threads = AsyncComputeTaskPool::try_get().map_or(1, |pool| pool.thread_num().max(1));
    settings.chunks_in_flight.max(1).saturating_mul(if settings.budget.is_some() { 1 } else { threads })
}
