//! Changes of levels start, are meshed and are shown.

use std::collections::BTreeSet;
use std::sync::Arc;

use marchless::LeafKey;

use super::{LevelJobs, LevelMesh, MAX_RUNNING, Meshing, Running, finest, members};
use crate::chunk::ChunkKey;
use crate::jobs::{Ticket, new_number};
use crate::volume::Heart;
use crate::volume::groups::ChunkMesh;
use crate::volume::input::{LaterCover, MeshInput};
use crate::volume::mesh::{Shown, is_uniform_around};

impl Heart {
    /// Starts planned changes while few are under way: the samples that they need are requested.
    pub(crate) fn start_level_changes(&mut self) {
        let Some(levels) = &mut self.levels else { return };
        let mut coming = Vec::new();
        loop {
            let id = new_number();
            if levels.running.len() >= MAX_RUNNING {
                break;
            }
            let Some((change, after)) = levels.plan.start_next(id) else { break };
            for position in finest(&change) {
                levels.finest.entry(position).or_insert(false);
                coming.push(position);
            }
            let running = Running { change, after, is_of_edit: false, meshing: None };
            levels.running.insert(id, running);
        }
        self.load_around(&coming);
    }

    /// Requests the samples of chunks of the finest level and of those around them.
    fn load_around(&mut self, positions: &[[i32; 3]]) {
        let Some(extent) = self.extent() else { return };
        let Self { table, arriving, cover, .. } = self;
        for near in positions.iter().flat_map(|position| ChunkKey::finest(*position).around()) {
            if extent.contains(near.position) && !table.contains(near) {
                arriving.add(near, cover);
            }
        }
    }

    /// The next change that can be meshed, while at most `limit` meshes are under way: what to mesh in jobs.
    pub(crate) fn next_level_jobs(&mut self, limit: usize) -> Option<LevelJobs> {
        let makes_meshes = self.table.makes_meshes();
        loop {
            let levels = self.levels.as_ref()?;
            let under_way = |running: &Running| running.meshing.as_ref().map_or(0, |m| m.members - m.meshed.len());
            if levels.running.values().map(under_way).sum::<usize>() >= limit {
                return None;
            }
            let may_begin = |running: &Running| {
                let has_samples = || running.finest().all(|position| self.is_surrounded(position));
                running.meshing.is_none() && !running.is_of_edit && has_samples()
            };
            // In the order in which they are to be shown, where that matters.
            let change = *levels.running.iter().find(|(_, running)| may_begin(running))?.0;
            let inputs = self.begin_meshing(change, makes_meshes);
            let levels = self.levels.as_ref()?;
            let running = levels.running.get(&change)?;
            let attempt = running.meshing.as_ref()?.attempt;
            if !inputs.is_empty() {
                return Some(LevelJobs { change, attempt, inputs });
            }
        }
    }

    fn is_surrounded(&self, position: [i32; 3]) -> bool {
        let key = ChunkKey::finest(position);
        self.table.contains(key) && !self.table.lacks_samples(key)
    }

    /// Whether all changes are shown that this one waits for.
    fn is_next(&self, running: &Running) -> bool {
        let levels = self.levels.as_ref();
        running.after.iter().all(|id| levels.is_none_or(|levels| !levels.running.contains_key(id)))
    }

    /// Begins to mesh a change, and returns what is to be meshed.
    fn begin_meshing(&mut self, id: u64, makes_meshes: bool) -> Vec<(ChunkKey, MeshInput)> {
        let Some(levels) = &self.levels else { return Vec::new() };
        let Some(running) = levels.running.get(&id) else { return Vec::new() };
        let cover = LaterCover::new(levels.shown.clone(), levels.until(id));
        let all: Vec<ChunkKey> = if makes_meshes { running.members().collect() } else { Vec::new() };
        let is_empty = |key: &ChunkKey| {
            key.level == 0
                && (self.table.is_without_surface(*key, self.isovalue())
                    || is_uniform_around(self.samples.newest(), key.position))
        };
        let (empty, to_mesh): (Vec<ChunkKey>, Vec<ChunkKey>) = all.iter().partition(|key| is_empty(key));
        let inputs = to_mesh.into_iter().map(|key| (key, self.input(key, &cover))).collect();
        let meshing = Meshing {
            attempt: new_number(),
            cover,
            appearance: self.appearance.number,
            members: all.len(),
            meshed: empty.into_iter().map(ChunkMesh::empty).collect(),
            stale: BTreeSet::new(),
            tickets: Vec::new(),
        };
        if let Some(running) = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&id)) {
            running.meshing = Some(meshing);
        }
        inputs
    }

    /// Notes the jobs that mesh a change.
    pub(crate) fn started_level_jobs(&mut self, change: u64, tickets: Vec<Ticket>) {
        let running = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&change));
        if let Some(meshing) = running.and_then(|running| running.meshing.as_mut()) {
            meshing.tickets = tickets;
        }
    }

    /// Takes in a mesh that a job has made.
    pub(in crate::volume) fn take_level_mesh(&mut self, mesh: LevelMesh) {
        let running = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&mesh.change));
        if let Some(meshing) = running.and_then(|running| running.meshing.as_mut())
            && meshing.attempt == mesh.attempt
        {
            meshing.meshed.push(mesh.meshed);
        }
    }

    /// The next change that can be shown, and what is to be meshed first.
    pub(crate) fn next_level_change(&mut self) -> Option<(u64, Vec<(ChunkKey, MeshInput)>)> {
        let levels = self.levels.as_ref()?;
        let may_be_shown = |running: &Running| running.is_meshed() && self.is_next(running) && self.is_free(running);
        let (id, running) = levels.running.iter().find(|(_, running)| may_be_shown(running))?;
        let Meshing { cover, stale, .. } = running.meshing.as_ref()?;
        Some((*id, stale.iter().map(|key| (*key, self.input(*key, cover))).collect()))
    }

    /// Whether no edit that reaches a change's leaves is being meshed.
    fn is_free(&self, running: &Running) -> bool {
        let change = &running.change;
        let is_free = |leaf: LeafKey| !self.groups.is_claimed(leaf.into()) && !self.groups.is_pending(leaf.into());
        // An edit that reaches a new leaf reaches those that it replaces; where there were none, those beside it.
        let is_beside_free = |leaf: LeafKey| {
            let replaces = |other: &LeafKey| !other.region().intersection(&leaf.region()).is_empty();
            let near = || self.levels.iter().flat_map(|levels| levels.shown.leaves_near(leaf.region()));
            change.removed.iter().any(replaces) || near().all(|(near, _)| is_free(near))
        };
        change.removed.iter().chain(&change.remeshed).all(|leaf| is_free(*leaf))
            && change.added.iter().all(|(leaf, is_empty)| *is_empty || is_beside_free(*leaf))
    }

    /// Shows a change, with meshes that were made at once.
    pub(crate) fn show_level_change(&mut self, id: u64, at_once: Vec<ChunkMesh>) -> Shown {
        let mut shown = Shown::default();
        let running = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&id));
        let Some(running) = running else { return shown };
        let (change, Some(meshing)) = (running.change.clone(), running.meshing.take()) else { return shown };
        let left = self.change_leaves(id);
        let remade: BTreeSet<ChunkKey> = at_once.iter().map(|meshed| meshed.key).collect();
        let Meshing { appearance, meshed, .. } = meshing;
        let kept = meshed.into_iter().filter(|meshed| !remade.contains(&meshed.key)).map(|meshed| (meshed, appearance));
        let now = self.appearance.number;
        let all: Vec<(ChunkMesh, u64)> = kept.chain(at_once.into_iter().map(|meshed| (meshed, now))).collect();
        for (meshed, appearance) in all {
            shown.swaps.push(self.swap(meshed, appearance));
        }
        for position in finest(&change) {
            for near in ChunkKey::finest(position).around() {
                let is_new = || finest(&change).any(|new| new == near.position);
                if self.table.contains(near) && (!self.table.is_shown(near) || is_new()) {
                    self.samples.show_newest(near.position);
                }
            }
        }
        members(&change).for_each(|key| self.shown(key));
        self.leaving_around(&left);
        shown
    }

    /// Makes a change of leaves; their meshes follow. Returns the chunks of the finest level that are no leaves any more.
    pub(in crate::volume) fn change_leaves(&mut self, id: u64) -> Vec<[i32; 3]> {
        let mut left = Vec::new();
        let Some(running) = self.levels.as_mut().and_then(|levels| levels.running.remove(&id)) else { return left };
        let change = running.change;
        for leaf in &change.removed {
            self.drop_leaf((*leaf).into());
            left.extend((leaf.level == 0).then_some(leaf.position));
        }
        for (leaf, _) in change.added.iter().filter(|(_, is_empty)| !is_empty) {
            if leaf.level == 0 {
                self.table.promote((*leaf).into());
            } else if self.table.makes_meshes() {
                self.table.load_coarser((*leaf).into());
            }
        }
        if let Some(levels) = &mut self.levels {
            levels.leave_finest(&left, true);
            levels.finest.extend(finest(&change).map(|position| (position, true)));
            Arc::make_mut(&mut levels.shown).apply(&change);
        }
        left
    }

    /// Notes that chunks of the finest level, and those around them, may not be needed any more.
    pub(in crate::volume) fn leaving_around(&mut self, positions: &[[i32; 3]]) {
        for near in positions.iter().flat_map(|position| ChunkKey::finest(*position).around()) {
            if self.table.contains(near) {
                self.leaving.push(near);
            }
        }
    }

    /// Meshes changes under way again, for another isovalue.
    pub(in crate::volume) fn restart_level_meshes(&mut self) {
        if let Some(levels) = &mut self.levels {
            levels.running.values_mut().for_each(|running| running.meshing = None);
        }
    }
}
