//! [`ChunkTable`]: every loaded chunk of a terrain, and its state.

mod ask;
mod entry;
mod map;

use core::mem;
use std::sync::Arc;

use bevy_ecs::entity::Entity;
use marchless::{MeshBuffer, Region};

pub(crate) use entry::{Counts, DrawnMesh, Shown};
use entry::{Entry, Fill, Role};
use map::ChunkMap;

use super::KnownSigns;
use crate::chunk::ChunkKey;
use crate::cover::{LeafState, Residency, UniqueQueue};
use crate::jobs::Ticket;

/// Every loaded chunk of a terrain. Each event is one function; all counts are kept here.
///
/// A chunk *can be drawn* when its own samples and those of all existing chunks around it are resident.
pub(crate) struct ChunkTable {
    /// The chunks that exist.
    extent: Region,
    /// Whether chunks are meshed at all; else they do not wait for meshes.
    makes_meshes: bool,
    chunks: ChunkMap,
    /// Chunks that can be drawn and whose shown state is out of date; each once, some stale.
    ready: UniqueQueue,
    counts: Counts,
    /// Entities to be despawned.
    released: Vec<Entity>,
}

/// The state of a chunk's sampling when the chunk was unloaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unloaded {
    /// No job was requested.
    Nothing,
    /// A job was withdrawn.
    Job,
    /// The samples were there.
    Samples,
}

/// The entity that a mesh is to be shown on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ShowTarget {
    /// None: there is nothing to show, or the chunk is not wanted any more.
    Nowhere,
    /// The chunk's entity.
    On(Entity),
    /// The chunk's entity, whose geometry stays.
    Recolored(Entity),
    /// A new entity.
    New,
}

impl ChunkTable {
    /// An empty table. `extent`: the chunks that exist. `makes_meshes`: whether chunks are meshed at all.
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

    /// Whether chunks are meshed at all.
    pub(super) const fn makes_meshes(&self) -> bool {
        self.makes_meshes
    }

    /// The next chunk that can be drawn and is out of date.
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

    /// Takes the entities to be despawned.
    pub(crate) fn take_released(&mut self) -> Vec<Entity> {
        mem::take(&mut self.released)
    }

    pub(crate) fn released_len(&self) -> usize {
        self.released.len()
    }

    /// Adds a chunk that came into range.
    pub(super) fn load(&mut self, key: ChunkKey, wanted: Residency) {
        let role = if wanted == Residency::Mesh { Role::NEW_LEAF } else { Role::Support };
        let entry = Entry { role, fill: Fill::Unasked, signs: KnownSigns::UNKNOWN, is_outdated: false };
        self.counts.add(&entry);
        if let Some(former) = self.chunks.insert(key, entry) {
            debug_assert!(false, "{key:?} was loaded already");
            self.counts.take(&former);
        }
    }

    /// Adds a leaf of a coarser level. Its samples are not kept.
    pub(super) fn load_coarser(&mut self, key: ChunkKey) {
        let signs = KnownSigns::UNKNOWN;
        let entry = Entry { role: Role::NEW_LEAF, fill: Fill::Resident, signs, is_outdated: false };
        self.counts.add(&entry);
        if let Some(former) = self.chunks.insert(key, entry) {
            debug_assert!(false, "{key:?} was loaded already");
            self.counts.take(&former);
        }
    }

    /// Makes a leaf of a chunk that had samples only.
    pub(super) fn promote(&mut self, key: ChunkKey) {
        self.change(key, |entry| {
            if matches!(entry.role, Role::Support) {
                entry.role = Role::NEW_LEAF;
            }
        });
    }

    /// Makes a leaf a chunk that only has samples, for its neighbours.
    pub(super) fn demote(&mut self, key: ChunkKey) {
        if let Some(drawn) = self.drawn(key) {
            self.released.push(drawn.entity);
        }
        self.change(key, |entry| {
            entry.role = Role::Support;
            entry.is_outdated &= !entry.is_filled();
        });
    }

    /// Removes a chunk that went out of range.
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

    /// Notes that a chunk's samples need a job, which waits for its turn.
    pub(super) fn queue(&mut self, key: ChunkKey) {
        self.change(key, |entry| entry.fill = Fill::Queued);
    }

    /// Notes that the sampling job of a chunk was requested.
    pub(super) fn ask(&mut self, key: ChunkKey, job: u64, ticket: Ticket) {
        self.change(key, |entry| entry.fill = Fill::Asked(job, ticket));
    }

    /// Notes that a chunk's samples are there. `signs`: as far as they are known.
    pub(super) fn samples_arrived(&mut self, key: ChunkKey, signs: Option<KnownSigns>) {
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
        self.chunks.change(key, |entry| entry.signs = KnownSigns::UNKNOWN);
    }

    /// Notes that a chunk's samples have been dropped; they can be made again.
    pub(super) fn samples_dropped(&mut self, key: ChunkKey) {
        if self.is_filled(key) {
            self.change(key, |entry| entry.fill = Fill::Dropped);
        }
    }

    /// Notes that dropped samples are wanted again. Returns whether they had been dropped.
    pub(super) fn revive(&mut self, key: ChunkKey) -> bool {
        let is_dropped = self.is_dropped(key);
        if is_dropped {
            self.change(key, |entry| entry.fill = Fill::Unasked);
        }
        is_dropped
    }

    /// Marks a leaf as out of date; it is drawn anew as soon as it can be.
    pub(super) fn set_stale(&mut self, key: ChunkKey) {
        self.change(key, |entry| {
            if let Role::Leaf { shown: Shown::Empty | Shown::Mesh(_), is_stale } = &mut entry.role {
                *is_stale = true;
            }
        });
    }

    /// Checks again whether a chunk is ready.
    pub(super) fn look_again(&mut self, key: ChunkKey) {
        self.change(key, |_| {});
    }

    /// Notes that a chunk has nothing to draw. Returns whether nothing of it is on the screen; if something is, nothing
    /// changes.
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

    /// Notes that a chunk's mesh has another appearance; its geometry stays.
    pub(super) fn set_appearance(&mut self, key: ChunkKey, appearance: u64) {
        self.change(key, |entry| {
            if let Role::Leaf { shown: Shown::Mesh(drawn), .. } = &mut entry.role {
                drawn.appearance = appearance;
            }
        });
    }

    /// Takes in a chunk's new mesh. Returns where to show it; for a new entity, [`spawned`](Self::spawned) must follow.
    pub(super) fn meshed(&mut self, key: ChunkKey, geometry: &Arc<MeshBuffer>, appearance: u64) -> ShowTarget {
        let mut place = ShowTarget::Nowhere;
        self.change(key, |entry| {
            let Role::Leaf { shown, is_stale } = &mut entry.role else { return };
            if let Shown::Mesh(drawn) = shown
                && Arc::ptr_eq(&drawn.geometry, geometry)
            {
                // The colours changed, but the geometry is as old as before.
                drawn.appearance = appearance;
                place = ShowTarget::Recolored(drawn.entity);
                return;
            }
            (*is_stale, entry.is_outdated) = (false, false);
            match shown {
                Shown::Despawned => {}
                Shown::Nothing | Shown::Empty if geometry.is_empty() => *shown = Shown::Empty,
                Shown::Nothing | Shown::Empty => place = ShowTarget::New,
                Shown::Mesh(drawn) => {
                    if !(drawn.geometry.is_empty() && geometry.is_empty()) {
                        place = ShowTarget::On(drawn.entity);
                        drawn.geometry = geometry.clone();
                    }
                    drawn.appearance = appearance;
                }
            }
        });
        place
    }

    /// Notes the new entity of a chunk's mesh.
    pub(super) fn spawned(&mut self, key: ChunkKey, drawn: DrawnMesh) {
        self.change(key, |entry| {
            if let Role::Leaf { shown, .. } = &mut entry.role {
                *shown = Shown::Mesh(drawn);
            }
        });
    }

    /// Notes that the game has despawned a chunk's entity.
    pub(super) fn despawned(&mut self, key: ChunkKey, entity: Entity) {
        if self.drawn(key).is_some_and(|drawn| drawn.entity == entity) {
            self.change(key, |entry| {
                entry.role = Role::Leaf { shown: Shown::Despawned, is_stale: false };
                entry.is_outdated &= !entry.is_filled();
            });
        }
    }

    /// Changes the chunks that exist. The caller unloads those beyond.
    pub(super) fn resize(&mut self, extent: Region) {
        self.extent = extent;
    }

    /// Marks all samples to be made anew. Everything shown stays until then.
    pub(super) fn refill(&mut self) {
        self.ready = UniqueQueue::default();
        let mut counts = Counts::default();
        self.chunks.change_all(|entry| {
            entry.fill = Fill::Unasked;
            entry.signs = KnownSigns::UNKNOWN;
            if let Role::Leaf { shown, is_stale } = &mut entry.role {
                *is_stale = matches!(shown, Shown::Empty | Shown::Mesh(_));
            }
            entry.is_outdated = true;
            counts.add(entry);
        });
        self.counts = counts;
    }

    /// Changes an entry. Every change goes through here, which keeps the counts and finds chunks that become ready.
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
            // Nothing of the present source will be shown of it.
            self.counts.outdated -= 1;
            self.chunks.change(key, |entry| entry.is_outdated = false);
        }
    }

    /// Checks the invariants of any table.
    #[cfg(test)]
    pub(super) fn check(&self) {
        let mut counts = Counts::default();
        for (key, entry) in self.chunks.iter() {
            counts.add(entry);
            let is_there = |near: ChunkKey| self.is_filled(near) || !self.extent.contains(near.position);
            assert_eq!(self.is_surrounded(key), key.level > 0 || key.around().all(is_there), "{key:?}");
            assert_eq!(self.chunks.marks(key), entry.marks(), "{key:?}");
        }
        assert_eq!(self.counts, counts);
    }
}
