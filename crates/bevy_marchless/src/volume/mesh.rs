//! Groups are started and shown.

use std::collections::{BTreeMap, BTreeSet};

use bevy_ecs::entity::Entity;
use bevy_platform::time::Instant;
use marchless::{Grid, GridChunk};

use super::groups::{ChunkMesh, Group, Pending, Purpose};
use super::levels::LevelMesh;
use super::samples::shares_samples;
use super::table::{DrawnMesh, ShowTarget};
use super::{Heart, MeshInput, Restyled};
use crate::chunk::ChunkKey;
use crate::jobs::Ticket;
use crate::stats::RequestTime;

/// A group before it starts, and its chunks that are to be meshed.
pub(crate) struct PreparedGroup {
    pub(crate) group: Group,
    pub(crate) to_mesh: Vec<(ChunkKey, MeshInput)>,
    /// The number of chunks to be meshed that have changed; the others make place for the changes.
    pub(crate) changed: usize,
}

/// The result of a meshing job.
pub(crate) enum MeshResult {
    /// A chunk of the group with this number.
    OfGroup(u64, ChunkMesh),
    /// A chunk meshed for the isovalue or the mesher to come.
    Restyled(Restyled),
    /// A leaf of a change of levels.
    OfLevels(LevelMesh),
}

/// A new mesh, and where to show it.
pub(crate) struct Swap {
    pub(crate) key: ChunkKey,
    pub(crate) place: ShowTarget,
    pub(crate) meshed: ChunkMesh,
    /// The appearance of the mesh.
    pub(crate) appearance: u64,
}

/// The meshes to be shown in one update.
#[derive(Default)]
pub(crate) struct Shown {
    pub(crate) swaps: Vec<Swap>,
    /// The request times of the edits among them.
    pub(crate) since: Vec<RequestTime>,
}

impl Heart {
    /// Whether chunks wait to be meshed or shown.
    pub(crate) fn has_to_mesh(&self) -> bool {
        let has_levels = self.levels.as_ref().is_some_and(super::Levels::has_work);
        let has_chunks = self.table.ready_len() > 0 || !self.to_mesh.is_empty();
        self.groups.may_start() || has_chunks || has_levels || self.has_to_restyle()
    }

    /// Whether results of meshing jobs wait to be taken.
    pub(crate) fn has_meshed(&self) -> bool {
        !self.deferred_meshes.is_empty() || !self.mesh_results.is_empty()
    }

    /// Sorts the drawable chunks that are out of date, until the time is over. Chunks without a surface need no job;
    /// the others wait to be meshed.
    pub(crate) fn sort_ready(&mut self, until: Instant) {
        let mut no_longer_drawn = BTreeSet::new();
        let mut done = 0;
        while let Some(key) = self.table.next_ready() {
            if self.groups.is_pending(key) || self.groups.is_claimed(key) {
                // It is drawn with its set, and visited again then.
                continue;
            }
            let is_empty = self.table.is_without_surface(key, self.isovalue())
                || is_uniform_around(self.samples.newest(), key.position);
            if !is_empty {
                self.to_mesh.add(key, &self.cover);
            } else if self.table.set_empty(key) {
                self.samples.show_newest(key.position);
                self.shown(key);
            } else {
                no_longer_drawn.insert(key);
            }
            done += 1;
            if done % 4 == 0 && Instant::now() >= until {
                break;
            }
        }
        self.groups.add(Pending { chunks: no_longer_drawn, ..Pending::default() });
    }

    /// The next changed chunks that no running group claims.
    pub(crate) fn next_changed(&mut self) -> Option<PreparedGroup> {
        while let Some(pending) = self.groups.next_free() {
            if let Some(prepared) = self.prepare(pending, Purpose::Edit) {
                return Some(prepared);
            }
        }
        None
    }

    /// The most urgent chunk that is to be drawn for the first time or anew, and its urgency. `None` if none waits, or
    /// if `limit` groups that give way are under way.
    pub(crate) fn next_first_mesh(&mut self, limit: usize) -> Option<(PreparedGroup, u32)> {
        while self.groups.yielding() < limit {
            let Self { to_mesh, cover, table, groups, .. } = self;
            let waits = |key: &ChunkKey| table.is_ready(*key) && !groups.is_pending(*key) && !groups.is_claimed(*key);
            let key = to_mesh.pop(cover, waits)?;
            let urgency = cover.urgency(key.position);
            if let Some(prepared) = self.prepare_one(key, Purpose::FirstMesh) {
                return Some((prepared, urgency));
            }
        }
        None
    }

    pub(super) fn prepare_one(&mut self, key: ChunkKey, purpose: Purpose) -> Option<PreparedGroup> {
        self.prepare(Pending { chunks: BTreeSet::from([key]), ..Pending::default() }, purpose)
    }

    /// Prepares a group from changed chunks; `None` if none needs a new mesh, or they have to wait for samples.
    fn prepare(&mut self, pending: Pending, purpose: Purpose) -> Option<PreparedGroup> {
        let place = self.place(&pending.places);
        // All chunks of a set change together: if samples around a drawn one are missing, all wait for them.
        let lacks = |key: &ChunkKey| match place.leaves.get(key) {
            Some(is_added) => *is_added && self.table.lacks_samples(*key),
            None => self.table.is_shown(*key) && self.lacks_samples(*key),
        };
        let lacking: Vec<ChunkKey> = pending.chunks.iter().copied().filter(lacks).collect();
        if !lacking.is_empty() {
            for key in lacking {
                self.table.set_stale(key);
                self.look_at(key);
            }
            if purpose == Purpose::Edit {
                self.groups.put_back(pending);
            }
            return None;
        }
        let Pending { chunks, unchanged_meshes, places, since } = pending;
        let mut group = Group {
            chunks,
            snapshot: BTreeMap::new(),
            appearance: self.appearance.number,
            places,
            since,
            purpose,
            members: 0,
            meshed: Vec::new(),
            tickets: Vec::new(),
        };
        let mut to_mesh = Vec::new();
        for key in group.chunks.iter().copied() {
            let is_added = place.leaves.get(&key).copied();
            if !is_added.unwrap_or_else(|| self.table.can_be_drawn(key)) || !self.table.makes_meshes() {
                continue;
            }
            if key.level > 0 {
                group.members += 1;
                to_mesh.push((key, self.input_in(&place, key)));
                continue;
            }
            let samples = self.samples.newest().neighbourhood_view(key.position);
            let shown = self.samples.shown().neighbourhood_view(key.position);
            for (near, (chunk, shown)) in key.around().zip(samples.chunks().iter().zip(shown.chunks())) {
                let Some(chunk) = chunk.filter(|chunk| !shown.is_some_and(|shown| shares_samples(shown, chunk))) else {
                    continue;
                };
                if group.chunks.contains(&near) || !self.table.is_shown(near) {
                    group.snapshot.entry(near.position).or_insert_with(|| chunk.clone());
                }
            }
            if is_added.is_none() && self.table.is_current(key) && unchanged_meshes.contains(&key) {
                continue;
            }
            group.members += 1;
            if samples.is_uniform() {
                group.meshed.push(ChunkMesh::empty(key));
            } else {
                to_mesh.push((key, self.input_in(&place, key)));
            }
        }
        if group.members == 0 && group.snapshot.is_empty() && group.places.is_empty() {
            return None;
        }
        let changed = to_mesh.iter().filter(|(key, _)| !place.has_mesh(*key)).count();
        Some(PreparedGroup { group, to_mesh, changed })
    }

    /// Starts a group whose chunks are meshed in jobs. `start` starts the job for a chunk, for the group with this
    /// number.
    pub(crate) fn start(&mut self, prepared: PreparedGroup, start: impl Fn(u64, ChunkKey, MeshInput) -> Ticket) {
        let PreparedGroup { group, to_mesh, .. } = prepared;
        let id = self.groups.start(group);
        let tickets: Vec<Ticket> = to_mesh.into_iter().map(|(key, input)| start(id, key, input)).collect();
        if let Some(group) = self.groups.get_mut(id) {
            group.tickets = tickets;
        }
    }

    /// Takes results of meshing jobs, and returns the groups that are complete. Results of groups that give way are
    /// taken while `may_take_more` says so; results of edits always. `note` gets each result, and whether it is shown soon:
    /// those of changes of levels wait for each other.
    pub(crate) fn take_meshed(
        &mut self,
        mut may_take_more: impl FnMut() -> bool,
        mut note: impl FnMut(&ChunkMesh, bool),
    ) -> Option<Group> {
        self.deferred_meshes.extend(self.mesh_results.take());
        for _ in 0..self.deferred_meshes.len() {
            match self.deferred_meshes.pop_front()? {
                MeshResult::Restyled(restyled) => {
                    note(&restyled.meshed, true);
                    self.take_restyled(restyled);
                }
                MeshResult::OfLevels(mesh) => {
                    note(&mesh.meshed, false);
                    self.take_level_mesh(mesh);
                }
                MeshResult::OfGroup(id, meshed) => {
                    let Some(group) = self.groups.get_mut(id) else { continue };
                    if group.gives_way() && !may_take_more() {
                        self.deferred_meshes.push_back(MeshResult::OfGroup(id, meshed));
                        continue;
                    }
                    note(&meshed, true);
                    group.meshed.push(meshed);
                    if group.meshed.len() == group.members {
                        return self.groups.remove(id);
                    }
                }
            }
        }
        None
    }

    /// Shows all chunks of a complete group.
    pub(crate) fn show(&mut self, group: Group) -> Shown {
        let Group { chunks, snapshot, appearance, places, since, meshed, .. } = group;
        let mut left = Vec::new();
        for id in places {
            left.extend(self.change_leaves(id));
        }
        let is_left = |meshed: &ChunkMesh| chunks.contains(&meshed.key);
        let swaps = meshed.into_iter().filter(is_left).map(|meshed| self.swap(meshed, appearance)).collect();
        for (position, chunk) in snapshot {
            let key = ChunkKey::finest(position);
            if self.table.contains(key) && (chunks.contains(&key) || !self.table.is_shown(key)) {
                self.samples.show(position, chunk);
            }
        }
        for key in chunks {
            self.shown(key);
        }
        self.leaving_around(&left);
        Shown { swaps, since: since.into_iter().collect() }
    }

    /// Notes the new entity of a chunk's mesh.
    pub(crate) fn spawned(&mut self, key: ChunkKey, drawn: DrawnMesh) {
        self.table.spawned(key, drawn);
        self.shown(key);
    }

    /// Takes in a new mesh, and says where it is to be shown.
    pub(super) fn swap(&mut self, meshed: ChunkMesh, appearance: u64) -> Swap {
        let key = meshed.key;
        self.has_shown = true;
        Swap { key, place: self.table.meshed(key, &meshed.geometry, appearance), meshed, appearance }
    }

    /// Follows up on a change of a shown chunk.
    pub(super) fn shown(&mut self, key: ChunkKey) {
        self.has_shown = true;
        self.table.look_again(key);
        self.may_drop_around(key);
        self.renew_in_transition(key);
        if self.table.drawn(key).is_some_and(|drawn| drawn.appearance != self.appearance.number) {
            self.to_restyle.push(key);
        }
    }

    fn lacks_samples(&self, key: ChunkKey) -> bool {
        self.table.lacks_samples(key) && !matches!(self.table.shown(key), Some(super::table::Shown::Despawned))
    }

    /// The place where a chunk's mesh is shown at present.
    pub(crate) fn entity(&self, key: ChunkKey) -> Option<Entity> {
        self.table.drawn(key).map(|drawn| drawn.entity)
    }
}

/// Whether a chunk and all around it are uniform and equal, as far as can be told without reading samples.
pub(super) fn is_uniform_around(grid: &Grid<i16>, position: [i32; 3]) -> bool {
    !matches!(grid.chunk(position), Some(GridChunk::Samples(_))) && grid.neighbourhood_view(position).is_uniform()
}
