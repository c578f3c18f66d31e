//! [`ChunkTable`]: every loaded chunk of a terrain, and how far it is.

mod entry;
mod map;

use core::mem;
use std::sync::Arc;

use bevy_ecs::entity::Entity;
use marchless::{MeshBuffer, Region};

pub(crate) use entry::{Counts, Drawn, Shown};
use entry::{Entry, Fill, Role};
use map::{ChunkMap, Marks};

use super::Signs;
use crate::chunk::ChunkKey;
use crate::cover::{LeafState, UniqueQueue, Wanted};
use crate::jobs::Ticket;

/// Every loaded chunk of a terrain. Each event is one function; all counts are kept here.
///
/// A chunk *can be drawn* once its own samples and those of all chunks around it are resident, as far as there are any.
pub(crate) struct ChunkTable {
    /// The chunks that there are.
    extent: Region,
    /// Whether somebody makes meshes; else chunks wait for none.
    makes_meshes: bool,
    chunks: ChunkMap,
    /// Chunks that can be drawn, and of which what is shown is not up to date; each once, some stale.
    ready: UniqueQueue,
    counts: Counts,
    /// Entities that nothing is shown on any more.
    released: Vec<Entity>,
}

/// What became of a job that samples, when its chunk was let go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unloaded {
    /// There was none.
    Nothing,
    /// It has been withdrawn.
    Job,
    /// The samples are there.
    Samples,
}

/// Where to show a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// Nowhere: there is nothing to show, or nobody wants it any more.
    Nowhere,
    /// On its entity.
    On(Entity),
    /// On its entity, whose geometry stays as it is.
    Recolored(Entity),
    /// On a new entity.
    New,
}

impl ChunkTable {
    /// An empty table. `extent`: the chunks that there are. `makes_meshes`: whether somebody makes meshes.
    pub(super) fn new(extent: Region, makes_meshes: bool) -> Self {
        Self {
            extent,
            makes_meshes,
            chunks: ChunkMap::default(),
            ready: UniqueQueue::default(),
            counts: Counts::default(),
            released: Vec::new(),
        }
    }

    /// Whether somebody makes meshes.
    pub(super) const fn makes_meshes(&self) -> bool {
        self.makes_meshes
    }

    pub(crate) const fn counts(&self) -> Counts {
        self.counts
    }

    pub(crate) fn len(&self) -> usize {
        self.chunks.len()
    }

    /// How much memory it takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.chunks.bytes()
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.chunks.iter().map(|(key, _)| key)
    }

    pub(crate) fn contains(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).is_loaded
    }

    /// What there is of a chunk, as the cover sees it: a leaf that has not been drawn is no more than its samples.
    pub(super) fn kept(&self, key: ChunkKey) -> Wanted {
        match self.chunks.get(key) {
            None => Wanted::Gone,
            Some(Entry { role: Role::Leaf { shown, .. }, .. }) if !matches!(shown, Shown::Nothing) => Wanted::Mesh,
            Some(_) => Wanted::Samples,
        }
    }

    pub(super) fn is_leaf(&self, key: ChunkKey) -> bool {
        let Marks { is_current, waits, .. } = self.chunks.marks(key);
        is_current || waits
    }

    /// What is shown of a leaf.
    pub(super) fn shown(&self, key: ChunkKey) -> Option<&Shown> {
        match &self.chunks.get(key)?.role {
            Role::Support => None,
            Role::Leaf { shown, .. } => Some(shown),
        }
    }

    /// The mesh of a chunk, and its entity.
    pub(crate) fn drawn(&self, key: ChunkKey) -> Option<&Drawn> {
        match self.shown(key)? {
            Shown::Mesh(drawn) => Some(drawn),
            _ => None,
        }
    }

    pub(super) fn leaf_state(&self, key: ChunkKey) -> Option<LeafState> {
        self.shown(key).map(Shown::state)
    }

    /// Whether something is shown of a chunk, if only that it is empty.
    pub(super) fn is_shown(&self, key: ChunkKey) -> bool {
        self.shown(key).is_some_and(|shown| !matches!(shown, Shown::Nothing))
    }

    /// Whether a chunk has its samples.
    pub(super) fn is_filled(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).is_filled
    }

    /// Whether a chunk is to be filled.
    pub(super) fn is_queued(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Queued))
    }

    /// Whether nobody has seen to a chunk's samples.
    pub(super) fn is_unasked(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Unasked))
    }

    pub(super) fn is_dropped(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Dropped))
    }

    /// Whether a chunk waits for the result of this job.
    pub(super) fn is_asked(&self, key: ChunkKey, job: u64) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Asked(number, _) if number == job))
    }

    /// Whether samples of a chunk, or some around it, are missing.
    pub(super) fn lacks_samples(&self, key: ChunkKey) -> bool {
        self.contains(key) && !self.is_surrounded(key)
    }

    /// Whether a chunk is a leaf that can be drawn.
    pub(super) fn can_be_drawn(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(Entry::may_be_drawn) && self.is_surrounded(key)
    }

    /// Whether a chunk can be drawn, and what is shown is not up to date.
    pub(super) fn is_ready(&self, key: ChunkKey) -> bool {
        self.makes_meshes && self.chunks.marks(key).waits && self.is_surrounded(key)
    }

    /// Whether a leaf waits for samples around it.
    pub(super) fn waits_for_samples(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).waits && !self.is_surrounded(key)
    }

    /// Whether a chunk and all around it have their samples, as far as there are any.
    fn is_surrounded(&self, key: ChunkKey) -> bool {
        self.chunks.is_surrounded(key, &self.extent)
    }

    /// Whether a chunk is as far as it gets if no more is wanted than this.
    pub(super) fn has_all(&self, key: ChunkKey, wanted: Wanted) -> bool {
        let Marks { is_loaded, is_current, waits, .. } = self.chunks.marks(key);
        if wanted == Wanted::Mesh { is_current } else { is_loaded && !waits }
    }

    /// Whether there is more of a chunk than this.
    pub(super) fn has_more(&self, key: ChunkKey, most: Wanted) -> bool {
        let Marks { is_loaded, is_current, waits, .. } = self.chunks.marks(key);
        match most {
            Wanted::Gone => is_loaded,
            Wanted::Samples => is_current || waits,
            Wanted::Mesh => false,
        }
    }

    /// Whether what is shown of a chunk is up to date, as far as is known without looking at groups.
    pub(super) fn is_current(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| match &entry.role {
            Role::Leaf { shown, is_stale } => !is_stale && !matches!(shown, Shown::Nothing),
            Role::Support => false,
        })
    }

    /// Whether a chunk is known to have no surface at an isovalue.
    pub(super) fn is_without_surface(&self, key: ChunkKey, isovalue: f32) -> bool {
        let signs = |key: ChunkKey| self.chunks.get(key).map(|entry| entry.signs.at(isovalue));
        let ChunkKey { level, position } = key;
        signs(key).is_some_and(|own| {
            own.are_without_surface(|step| {
                let position = [0, 1, 2].map(|axis| position[axis].saturating_add(step[axis]));
                signs(ChunkKey { level, position })
            })
        })
    }

    /// The next of the chunks that can be drawn and are not up to date.
    pub(super) fn next_ready(&mut self) -> Option<ChunkKey> {
        while let Some(key) = self.ready.pop() {
            if self.is_ready(key) {
                return Some(key);
            }
        }
        None
    }

    pub(crate) fn ready_len(&self) -> usize {
        self.ready.len()
    }

    /// Entities to be despawned: nothing is shown on them any more.
    pub(crate) fn take_released(&mut self) -> Vec<Entity> {
        mem::take(&mut self.released)
    }

    pub(crate) fn released_len(&self) -> usize {
        self.released.len()
    }

    /// All entities that something is shown on.
    pub(crate) fn entities(&self) -> impl Iterator<Item = (ChunkKey, Entity)> + '_ {
        self.chunks.iter().filter_map(|(key, entry)| match &entry.role {
            Role::Leaf { shown: Shown::Mesh(drawn), .. } => Some((key, drawn.entity)),
            _ => None,
        })
    }

    /// A chunk came into range.
    pub(super) fn load(&mut self, key: ChunkKey, wanted: Wanted) {
        let role = if wanted == Wanted::Mesh { Role::NEW_LEAF } else { Role::Support };
        let entry = Entry { role, fill: Fill::Unasked, signs: Signs::UNKNOWN, is_outdated: false };
        self.counts.add(&entry);
        if let Some(former) = self.chunks.insert(key, entry) {
            debug_assert!(false, "{key:?} was loaded already");
            self.counts.take(&former);
        }
    }

    /// A chunk that had samples only is to be drawn.
    pub(super) fn promote(&mut self, key: ChunkKey) {
        self.change(key, |entry| {
            if matches!(entry.role, Role::Support) {
                entry.role = Role::NEW_LEAF;
            }
        });
    }

    /// A leaf is to be drawn no longer, and stays for its neighbours.
    pub(super) fn demote(&mut self, key: ChunkKey) {
        if let Some(drawn) = self.drawn(key) {
            self.released.push(drawn.entity);
        }
        self.change(key, |entry| {
            entry.role = Role::Support;
            entry.is_outdated &= !entry.is_filled();
        });
    }

    /// A chunk went out of range.
    pub(super) fn unload(&mut self, key: ChunkKey) -> Unloaded {
        self.demote(key);
        let Some(entry) = self.chunks.remove(key) else { return Unloaded::Nothing };
        self.counts.take(&entry);
        match entry.fill {
            Fill::Unasked | Fill::Queued | Fill::Dropped => Unloaded::Nothing,
            Fill::Asked(..) => Unloaded::Job,
            Fill::Resident => Unloaded::Samples,
        }
    }

    /// A chunk's samples take a job, which waits for its turn.
    pub(super) fn queue(&mut self, key: ChunkKey) {
        self.change(key, |entry| entry.fill = Fill::Queued);
    }

    /// The job that samples a chunk has been asked for.
    pub(super) fn ask(&mut self, key: ChunkKey, job: u64, ticket: Ticket) {
        self.change(key, |entry| entry.fill = Fill::Asked(job, ticket));
    }

    /// A chunk's samples are there. `signs`: where they are known.
    pub(super) fn samples_arrived(&mut self, key: ChunkKey, signs: Option<Signs>) {
        let was_filled = self.is_filled(key);
        self.change(key, |entry| {
            entry.fill = Fill::Resident;
            entry.signs = signs.unwrap_or(entry.signs);
            entry.is_outdated &= matches!(&entry.role, Role::Leaf { shown, .. } if !matches!(shown, Shown::Despawned));
        });
        if !was_filled && self.contains(key) {
            self.chunks.surrounded_around(key, &self.extent).for_each(|near| self.look_again(near));
        }
    }

    /// Stamps have changed a chunk's samples.
    pub(super) fn samples_changed(&mut self, key: ChunkKey) {
        self.chunks.change(key, |entry| entry.signs = Signs::UNKNOWN);
    }

    /// A chunk's samples have been dropped; they can be had again.
    pub(super) fn samples_dropped(&mut self, key: ChunkKey) {
        if self.is_filled(key) {
            self.change(key, |entry| entry.fill = Fill::Dropped);
        }
    }

    /// Dropped samples are wanted again. Returns whether they had been dropped.
    pub(super) fn revive(&mut self, key: ChunkKey) -> bool {
        let is_dropped = self.is_dropped(key);
        if is_dropped {
            self.change(key, |entry| entry.fill = Fill::Unasked);
        }
        is_dropped
    }

    /// What is shown of a leaf is older than its samples, and it is drawn anew as soon as it can be.
    pub(super) fn set_stale(&mut self, key: ChunkKey) {
        self.change(key, |entry| {
            if let Role::Leaf { shown: Shown::Empty | Shown::Mesh(_), is_stale } = &mut entry.role {
                *is_stale = true;
            }
        });
    }

    /// A chunk may be ready after all: looks again.
    pub(super) fn look_again(&mut self, key: ChunkKey) {
        self.change(key, |_| {});
    }

    /// A chunk is known to have nothing to draw. Returns whether it has nothing on the screen either; else nothing changes.
    pub(super) fn set_empty(&mut self, key: ChunkKey) -> bool {
        let mut is_empty = false;
        self.change(key, |entry| {
            let Role::Leaf { shown, is_stale } = &mut entry.role else { return };
            is_empty = shown.state() != LeafState::Drawn;
            if is_empty {
                (*is_stale, entry.is_outdated) = (false, false);
                if matches!(shown, Shown::Nothing) {
                    *shown = Shown::Empty;
                }
            }
        });
        is_empty
    }

    /// A chunk's mesh has the look of this number, though its geometry is what it was.
    pub(super) fn set_look(&mut self, key: ChunkKey, look: u64) {
        self.change(key, |entry| {
            if let Role::Leaf { shown: Shown::Mesh(drawn), .. } = &mut entry.role {
                drawn.look = look;
            }
        });
    }

    /// A chunk has been meshed, and is to be shown so. Returns where; for a new entity, [`spawned`](Self::spawned) follows.
    pub(super) fn meshed(&mut self, key: ChunkKey, geometry: &Arc<MeshBuffer>, look: u64) -> Place {
        let mut place = Place::Nowhere;
        self.change(key, |entry| {
            let Role::Leaf { shown, is_stale } = &mut entry.role else { return };
            if let Shown::Mesh(drawn) = shown
                && Arc::ptr_eq(&drawn.geometry, geometry)
            {
                // Its colours are other ones, but it is as old as it was.
                drawn.look = look;
                place = Place::Recolored(drawn.entity);
                return;
            }
            (*is_stale, entry.is_outdated) = (false, false);
            match shown {
                Shown::Despawned => {}
                Shown::Nothing | Shown::Empty if geometry.is_empty() => *shown = Shown::Empty,
                Shown::Nothing | Shown::Empty => place = Place::New,
                Shown::Mesh(drawn) => {
                    if !(drawn.geometry.is_empty() && geometry.is_empty()) {
                        place = Place::On(drawn.entity);
                        drawn.geometry = geometry.clone();
                    }
                    drawn.look = look;
                }
            }
        });
        place
    }

    /// A chunk's mesh is on this new entity.
    pub(super) fn spawned(&mut self, key: ChunkKey, drawn: Drawn) {
        self.change(key, |entry| {
            if let Role::Leaf { shown, .. } = &mut entry.role {
                *shown = Shown::Mesh(drawn);
            }
        });
    }

    /// The game has despawned a chunk's entity.
    pub(super) fn despawned(&mut self, key: ChunkKey, entity: Entity) {
        if self.drawn(key).is_some_and(|drawn| drawn.entity == entity) {
            self.change(key, |entry| {
                entry.role = Role::Leaf { shown: Shown::Despawned, is_stale: false };
                entry.is_outdated &= !entry.is_filled();
            });
        }
    }

    /// All samples are to be had anew. What is shown stays until then.
    pub(super) fn refill(&mut self) {
        self.ready = UniqueQueue::default();
        let mut counts = Counts::default();
        self.chunks.change_all(|entry| {
            entry.fill = Fill::Unasked;
            entry.signs = Signs::UNKNOWN;
            if let Role::Leaf { shown, is_stale } = &mut entry.role {
                *is_stale = matches!(shown, Shown::Empty | Shown::Mesh(_));
            }
            entry.is_outdated = true;
            counts.add(entry);
        });
        self.counts = counts;
    }

    /// Every change that counts goes through here: it keeps the counts and finds what becomes ready.
    fn change(&mut self, key: ChunkKey, change: impl FnOnce(&mut Entry)) {
        let Self { chunks, counts, .. } = self;
        let change = |entry: &mut Entry| {
            counts.take(entry);
            change(entry);
            counts.add(entry);
            if self.makes_meshes { entry.is_to_be_drawn() } else { entry.is_outdated && entry.may_be_drawn() }
        };
        let may_become_ready = chunks.change(key, change).unwrap_or(false);
        if !may_become_ready || !self.is_surrounded(key) {
            return;
        }
        if self.makes_meshes {
            self.ready.push(key);
        } else {
            // Nothing of the present source will be shown.
            self.counts.outdated -= 1;
            self.chunks.change(key, |entry| entry.is_outdated = false);
        }
    }

    /// All that holds of any table.
    #[cfg(test)]
    pub(super) fn check(&self) {
        let mut counts = Counts::default();
        for (key, entry) in self.chunks.iter() {
            counts.add(entry);
            let is_there = |near: ChunkKey| self.is_filled(near) || !self.extent.contains(near.position);
            assert_eq!(self.is_surrounded(key), key.around().all(is_there), "{key:?}");
            assert_eq!(self.chunks.marks(key), entry.marks(), "{key:?}");
        }
        assert_eq!(self.counts, counts);
    }
}
