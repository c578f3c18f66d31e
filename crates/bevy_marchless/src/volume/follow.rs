//! Chunks come and go: each gets the residency that the cover asks for.

use bevy_platform::time::Instant;
use marchless::{GridChunk, Region};

use super::Heart;
use super::groups::Pending;
use super::table::Unloaded;
use crate::budget::ENTITY_TIME;
use crate::chunk::ChunkKey;
use crate::cover::{Residency, ViewId};
use crate::stats::TerrainStats;

/// The least number of arriving chunks, and of leaving ones, that follow in each update.
const MIN_CHUNKS: usize = 4;
/// A view is revealed further while fewer of its chunks than this are queued.
const FEW: usize = 256;

impl Heart {
    /// True if chunks have to follow the cover.
    pub(crate) fn has_to_follow(&self) -> bool {
        let is_idle = self.cover.is_revealed() && self.arriving.is_empty() && self.leaving.is_empty();
        !is_idle || !self.droppable.is_empty() || self.has_lost_leaves()
    }

    /// Lets leaving and arriving chunks follow the cover until the time is over; arriving ones in order of urgency.
    pub(crate) fn follow(&mut self, until: Instant, stats: &mut TerrainStats) {
        if self.sampling_settings.is_none() {
            return;
        }
        self.reveal(until);
        // Both get half of the time. But while more chunks are leaving than viewers see, few arriving ones follow.
        let is_crowded = self.leaving.len() as f64 > self.cover.size();
        let share = if self.arriving.is_empty() || is_crowded { 1 } else { 2 };
        let now = Instant::now();
        let until_gone = now + until.saturating_duration_since(now) / share;
        let despawning = |heart: &Self| heart.table.released_len() as u32 * ENTITY_TIME;
        let mut done = 0;
        while (done < MIN_CHUNKS || Instant::now() + despawning(self) < until_gone)
            && let Some(key) = self.leaving.pop()
        {
            self.follow_residency(key, stats);
            done += 1;
        }
        let mut done = 0;
        while (done < MIN_CHUNKS || !is_crowded && Instant::now() + despawning(self) < until)
            && let Some(key) = self.next_arriving(until)
        {
            self.follow_residency(key, stats);
            done += 1;
        }
        // This goes through all chunks, so it is not done while viewers move.
        if !core::mem::take(&mut self.has_moved) && self.has_lost_leaves() {
            self.give_up_lost_leaves();
        }
        if self.is_filled() && self.transition.is_none() {
            let mut done = 0;
            while (done < MIN_CHUNKS || Instant::now() < until)
                && let Some(key) = self.droppable.pop()
            {
                self.drop_samples(key);
                done += 1;
            }
        }
    }

    /// Whether leaves wait though there is nothing left to do. They went out of range before they were drawn, and the
    /// margin keeps only drawn chunks.
    fn has_lost_leaves(&self) -> bool {
        self.levels.is_none() && self.table.makes_meshes() && self.table.counts().waiting > 0 && self.is_idle()
    }

    /// Visits all chunks, once after viewers have come to rest.
    fn give_up_lost_leaves(&mut self) {
        let waits = |key: &ChunkKey| self.table.is_leaf(*key) && !self.table.is_shown(*key);
        let lost: Vec<ChunkKey> = self.table.keys().filter(waits).collect();
        lost.into_iter().for_each(|key| self.leaving.push(key));
    }

    /// Reveals more of the new views that have few waiting chunks, and of at least one of them. Returns whether there
    /// was one.
    fn reveal(&mut self, until: Instant) -> bool {
        let Self { cover, table, arriving, .. } = self;
        let keeps_samples = !cover.drops_samples();
        let few: Vec<ViewId> = cover.partial().filter(|id| arriving.len_of(*id) < FEW).collect();
        for id in &few {
            cover.reveal(*id, |position, wanted| {
                let key = ChunkKey::finest(position);
                if !(keeps_samples && table.has_all(key, wanted)) {
                    arriving.add_unsorted(key, *id);
                }
            });
            if Instant::now() >= until {
                break;
            }
        }
        !few.is_empty()
    }

    /// Changes the terrain's extent. Chunks inside both extents stay, with all edits; of those beyond, only the edits
    /// stay. Walls appear and disappear chunk by chunk, as soon as the chunks around them are there.
    pub(crate) fn resize(&mut self, extent: Region) {
        let Some(settings) = &mut self.sampling_settings else { return };
        let former = core::mem::replace(&mut settings.extent, extent);
        self.samples.resize(extent);
        self.table.resize(extent);
        if self.levels.is_some() {
            return self.restart_levels();
        }
        let layers = self.layers_at_border();
        let is_inner = |key: &ChunkKey, region: Region| {
            (0..3).all(|axis| (region.min[axis] + layers..region.max[axis] - layers).contains(&key.position[axis]))
        };
        let keys: Vec<ChunkKey> =
            self.table.keys().filter(|key| !is_inner(key, former) || !is_inner(key, extent)).collect();
        for key in keys {
            if extent.contains(key.position) {
                self.at_other_border(key);
            } else {
                self.leaving.push(key);
            }
        }
    }

    /// Another part of a chunk lies at the terrain's border, or none.
    fn at_other_border(&mut self, key: ChunkKey) {
        self.table.samples_changed(key);
        if self.groups.is_claimed(key) {
            // The chunk is being meshed with the former border.
            self.changed(Pending { chunks: [key].into(), ..Pending::default() });
        } else {
            self.table.set_stale(key);
            self.renew_in_transition(key);
        }
        if self.table.lacks_samples(key) {
            self.look_at(key);
        } else {
            // The chunk may have waited for samples that are not wanted any more.
            self.groups.wake();
            self.unblock_transition(key);
        }
    }

    /// Takes in that the game has despawned a chunk's entity. The samples stay: the meshes of its neighbours need them.
    pub(crate) fn despawned(&mut self, key: ChunkKey, entity: bevy_ecs::entity::Entity) {
        self.table.despawned(key, entity);
    }

    /// The next chunk that may be wanted more than now.
    fn next_arriving(&mut self, until: Instant) -> Option<ChunkKey> {
        loop {
            let Self { arriving, cover, levels, table, .. } = self;
            let wanted = |position| match &*levels {
                Some(levels) => levels.wanted(position),
                None => cover.wanted(position, Residency::Samples),
            };
            let waits = |key: &ChunkKey| table.contains(*key) || wanted(key.position) > Residency::Gone;
            let next = arriving.pop(cover, waits);
            if next.is_some() || Instant::now() >= until || !self.reveal(until) {
                return next;
            }
        }
    }

    /// Gives a chunk the residency that the cover asks for.
    fn follow_residency(&mut self, key: ChunkKey, stats: &mut TerrainStats) {
        let Some(extent) = self.extent() else { return };
        let is_there = extent.contains(key.position);
        let wanted = if is_there { self.wanted(key) } else { Residency::Gone };
        match (self.table.contains(key), wanted) {
            (false, Residency::Gone) => return,
            (false, _) => self.load(key, wanted, stats),
            (true, Residency::Gone) => return self.unload(key, stats),
            (true, Residency::Samples) => self.hide(key),
            (true, Residency::Mesh) if self.table.is_leaf(key) => self.load_lost_neighbours(key, extent, stats),
            (true, Residency::Mesh) => self.table.promote(key),
        }
        if self.cover.drops_samples() {
            self.revive_or_drop(key);
        }
        if self.table.is_unasked(key) {
            self.fill(key, stats);
        }
    }

    /// The residency that viewers ask for, for a chunk as it is.
    fn wanted(&self, key: ChunkKey) -> Residency {
        match &self.levels {
            Some(levels) => levels.wanted(key.position),
            None => self.cover.wanted(key.position, self.table.kept(key)),
        }
    }

    fn load(&mut self, key: ChunkKey, wanted: Residency, stats: &mut TerrainStats) {
        self.table.load(key, wanted);
        stats.loaded += 1;
    }

    /// Loads missing neighbours of a leaf that only the margin keeps: they went before the viewer came back. Nothing
    /// else would load them, and edits of the chunk would wait for them for ever.
    fn load_lost_neighbours(&mut self, key: ChunkKey, extent: Region, stats: &mut TerrainStats) {
        // The missing neighbours of a chunk in range are loaded anyway, once they have been reported.
        let is_reported = self.cover.is_revealed() && self.cover.contains(key.position);
        if self.levels.is_some() || is_reported || !self.table.lacks_samples(key) {
            return;
        }
        for near in key.around().filter(|near| extent.contains(near.position)) {
            let wanted = self.cover.wanted(near.position, Residency::Samples);
            if wanted > Residency::Gone && !self.table.contains(near) {
                self.load(near, wanted, stats);
                self.fill(near, stats);
            }
        }
    }

    /// Unloads a chunk; only its edits stay.
    pub(super) fn unload(&mut self, key: ChunkKey, stats: &mut TerrainStats) {
        self.hide(key);
        match self.table.unload(key) {
            Unloaded::Nothing => {}
            Unloaded::Job => self.sampling -= 1,
            Unloaded::Samples => self.samples.unload(key.position),
        }
        self.samples.unload_shown(key.position);
        stats.unloaded += 1;
    }

    /// Stops drawing a chunk.
    pub(super) fn hide(&mut self, key: ChunkKey) {
        if self.table.is_leaf(key) {
            self.groups.withdraw_from(key);
            self.groups.wake();
            self.table.demote(key);
            self.leave_transition(key);
        }
    }

    /// Requests the dropped samples of a chunk again, or notes that its samples may be dropped.
    fn revive_or_drop(&mut self, key: ChunkKey) {
        if self.table.waits_for_samples(key) || self.transition_lacks(key) {
            self.revive_around(key);
        } else if self.table.is_dropped(key) {
            if self.cover.wants_samples(key.position) {
                self.revive(key);
            }
        } else {
            self.droppable.push(key);
        }
    }

    /// Drops the samples of a chunk if nothing needs them at present.
    fn drop_samples(&mut self, key: ChunkKey) {
        if self.may_drop(key) && self.cover.may_drop_samples(key.position) {
            self.samples.unload(key.position);
            self.samples.unload_shown(key.position);
            self.table.samples_dropped(key);
        }
    }

    /// Whether samples can be made again, and nothing reads them at present.
    fn may_drop(&self, key: ChunkKey) -> bool {
        let Some(settings) = &self.sampling_settings else { return false };
        let is_done = |near: ChunkKey| {
            self.table.is_current(near) && !self.groups.is_claimed(near) && !self.groups.is_pending(near)
        };
        self.table.is_filled(key)
            && matches!(self.samples.newest().chunk(key.position), Some(GridChunk::Samples(_)))
            && !self.samples.is_held(key.position)
            && key.around().filter(|near| settings.extent.contains(near.position)).all(is_done)
    }

    /// Notes that the samples of a chunk, and of those around it, may now be dropped.
    pub(super) fn may_drop_around(&mut self, key: ChunkKey) {
        if self.cover.drops_samples() {
            key.around().for_each(|near| self.droppable.push(near));
        }
    }

    /// Requests the dropped samples of a chunk.
    pub(super) fn revive(&mut self, key: ChunkKey) {
        if self.table.revive(key) {
            self.arriving.add_first(key);
        }
    }

    /// Requests all dropped samples around a chunk.
    fn revive_around(&mut self, key: ChunkKey) {
        key.around().for_each(|near| self.revive(near));
    }

    /// Moves the missing samples of a chunk to the front of the queue.
    pub(super) fn look_at(&mut self, key: ChunkKey) {
        self.arriving.add_first(key);
    }
}
