//! [`Groups`]: chunks that changed together, meshed from one snapshot and shown together.

use core::mem;
use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_mesh::Mesh;
use bevy_platform::collections::HashMap;
use marchless::{GridChunk, MeshBuffer};

use crate::chunk::ChunkKey;
use crate::jobs::{Ticket, new_number};
use crate::stats::RequestTime;

/// The changed chunks that wait to be meshed, and the groups that are being meshed.
///
/// No chunk is in two pending sets, or claimed by two running groups, so results cannot be shown out of order.
#[derive(Default)]
pub(crate) struct Groups {
    /// Changed chunks, in the order of their changes.
    pending: BTreeMap<u64, Pending>,
    /// The pending set of each waiting chunk.
    waiting: HashMap<ChunkKey, u64>,
    running: BTreeMap<u64, Group>,
    /// The running group that claims each chunk.
    claims: HashMap<ChunkKey, u64>,
    /// The number of running groups that give way to edits.
    yielding: usize,
    /// Whether a pending set may have become free; those up to `looked_at` have been checked since.
    is_awake: bool,
    looked_at: u64,
}

/// Changed chunks that are to be meshed from one snapshot.
#[derive(Debug, Default)]
pub(crate) struct Pending {
    pub(crate) chunks: BTreeSet<ChunkKey>,
    /// The chunks of the set whose meshes, if drawn, do not change.
    pub(crate) unchanged_meshes: BTreeSet<ChunkKey>,
    /// The changes of levels that make place for its edits, and are shown with it. Their leaves are among the chunks.
    pub(crate) places: BTreeSet<u64>,
    /// The time of the first edit in the set; `None` without edits.
    pub(crate) since: Option<RequestTime>,
}

/// Chunks that are being meshed from one snapshot, to be shown in one update.
pub(crate) struct Group {
    /// The claimed chunks: the members, and those that cannot be meshed yet.
    pub(super) chunks: BTreeSet<ChunkKey>,
    /// The samples of the members and of the chunks around them, unless they are shown already.
    pub(super) snapshot: BTreeMap<[i32; 3], GridChunk<i16>>,
    /// The appearance of its meshes.
    pub(super) appearance: u64,
    /// The changes of levels that are shown with it, as in [`Pending`].
    pub(super) places: BTreeSet<u64>,
    pub(super) since: Option<RequestTime>,
    pub(super) purpose: Purpose,
    /// The number of chunks to be meshed before the group is complete.
    pub(super) members: usize,
    pub(super) meshed: Vec<ChunkMesh>,
    /// The tickets of its jobs.
    pub(super) tickets: Vec<Ticket>,
}

/// The reason why chunks are meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The samples have changed.
    Edit,
    /// A chunk is drawn for the first time; gives way to edits.
    FirstMesh,
    /// A chunk gets another appearance; gives way to edits.
    Restyle,
}

impl Purpose {
    pub(crate) const fn gives_way(self) -> bool {
        !matches!(self, Self::Edit)
    }
}

/// A chunk's new mesh.
pub(crate) struct ChunkMesh {
    pub(crate) key: ChunkKey,
    pub(crate) geometry: Arc<MeshBuffer>,
    /// The mesh as an asset, if assets are wanted and there is something to draw.
    pub(crate) mesh: Option<Mesh>,
    /// The time that meshing took.
    pub(crate) time: Duration,
}

impl ChunkMesh {
    /// A mesh with nothing to draw.
    pub(crate) fn empty(key: ChunkKey) -> Self {
        Self { key, geometry: Arc::default(), mesh: None, time: Duration::ZERO }
    }
}

impl Groups {
    pub(crate) fn is_empty(&self) -> bool {
        self.pending.is_empty() && self.running.is_empty()
    }

    /// The number of chunks that wait to be meshed or are being meshed.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len() + self.claims.len()
    }

    /// Whether a pending set may start.
    pub(super) const fn may_start(&self) -> bool {
        self.is_awake
    }

    /// Whether an edit for which levels make place has not been shown.
    pub(super) fn makes_place(&self) -> bool {
        let pending = self.pending.values().map(|pending| &pending.places);
        pending.chain(self.running.values().map(|group| &group.places)).any(|places| !places.is_empty())
    }

    /// The number of running groups that give way to edits.
    pub(super) const fn yielding(&self) -> usize {
        self.yielding
    }

    /// Whether a changed chunk waits to be meshed.
    pub(super) fn is_pending(&self, key: ChunkKey) -> bool {
        self.waiting.contains_key(&key)
    }

    /// Whether a running group claims a chunk.
    pub(super) fn is_claimed(&self, key: ChunkKey) -> bool {
        self.claims.contains_key(&key)
    }

    /// Records that chunks have changed together; overlapping sets merge.
    pub(super) fn add(&mut self, mut new: Pending) {
        if new.chunks.is_empty() {
            return;
        }
        let overlapping: BTreeSet<u64> = new.chunks.iter().filter_map(|key| self.waiting.get(key)).copied().collect();
        for mut other in overlapping.into_iter().filter_map(|id| self.pending.remove(&id)) {
            new.merge(&mut other);
        }
        self.insert(new_number(), new);
        self.wake();
    }

    /// Puts the latest [free](Self::next_free) set back, until something wakes the groups.
    pub(super) fn put_back(&mut self, pending: Pending) {
        self.insert(self.looked_at, pending);
    }

    fn insert(&mut self, id: u64, pending: Pending) {
        self.waiting.extend(pending.chunks.iter().map(|key| (*key, id)));
        self.pending.insert(id, pending);
    }

    /// Wakes pending sets: something that they may wait for has changed.
    pub(super) const fn wake(&mut self) {
        (self.is_awake, self.looked_at) = (true, 0);
    }

    /// The next pending set without claimed chunks. Groups that give way are withdrawn.
    pub(super) fn next_free(&mut self) -> Option<Pending> {
        while self.is_awake {
            let Some(id) = self.pending.range(self.looked_at + 1..).next().map(|(id, _)| *id) else {
                self.is_awake = false;
                break;
            };
            self.looked_at = id;
            let Some(pending) = self.pending.remove(&id) else { continue };
            if self.give_way(&pending.chunks) {
                pending.chunks.iter().for_each(|key| _ = self.waiting.remove(key));
                return Some(pending);
            }
            self.pending.insert(id, pending);
        }
        None
    }

    /// Whether chunks are unclaimed once the groups that give way have done so.
    fn give_way(&mut self, chunks: &BTreeSet<ChunkKey>) -> bool {
        let claimed: BTreeSet<u64> = chunks.iter().filter_map(|key| self.claims.get(key)).copied().collect();
        claimed.into_iter().all(|id| self.withdraw(id))
    }

    /// Withdraws a group if it gives way.
    fn withdraw(&mut self, id: u64) -> bool {
        let gives_way = self.running.get(&id).is_none_or(|group| group.purpose.gives_way());
        if gives_way {
            self.remove(id);
        }
        gives_way
    }

    /// Takes in that a chunk is not to be drawn any more. A group that claims it and gives way is withdrawn; any other
    /// loses the chunk. If the chunk comes back, its samples may be newer than the group's.
    pub(super) fn withdraw_from(&mut self, key: ChunkKey) {
        let Some(id) = self.claims.get(&key).copied() else { return };
        if !self.withdraw(id) {
            self.claims.remove(&key);
            self.running.entry(id).and_modify(|group| _ = group.chunks.remove(&key));
        }
    }

    /// Starts a group; its jobs carry its number.
    pub(super) fn start(&mut self, group: Group) -> u64 {
        let id = new_number();
        self.claims.extend(group.chunks.iter().map(|key| (*key, id)));
        self.yielding += usize::from(group.purpose.gives_way());
        self.running.insert(id, group);
        id
    }

    /// The running group with a number.
    pub(super) fn get_mut(&mut self, id: u64) -> Option<&mut Group> {
        self.running.get_mut(&id)
    }

    /// Removes a group, and frees the chunks that it claims.
    pub(super) fn remove(&mut self, id: u64) -> Option<Group> {
        let group = self.running.remove(&id)?;
        group.chunks.iter().for_each(|key| _ = self.claims.remove(key));
        self.yielding -= usize::from(group.purpose.gives_way());
        if !group.purpose.gives_way() {
            self.wake();
        }
        Some(group)
    }

    /// Removes all groups, and returns their chunks. Jobs that have not begun are withdrawn.
    pub(super) fn take_all(&mut self) -> Vec<Pending> {
        let Self { pending, running, .. } = mem::take(self);
        let of_group = |group: Group| {
            let unchanged_meshes = BTreeSet::new();
            Pending { chunks: group.chunks, unchanged_meshes, places: group.places, since: group.since }
        };
        running.into_values().map(of_group).chain(pending.into_values()).collect()
    }

    /// Checks the invariants of any groups.
    #[cfg(test)]
    pub(super) fn check(&self) {
        for (id, pending) in &self.pending {
            assert!(pending.chunks.iter().all(|key| self.waiting.get(key) == Some(id)));
        }
        for (id, group) in &self.running {
            assert!(group.chunks.iter().all(|key| self.claims.get(key) == Some(id)));
            assert!(group.meshed.len() < group.members);
        }
        assert_eq!(self.waiting.len(), self.pending.values().map(|pending| pending.chunks.len()).sum::<usize>());
        assert_eq!(self.claims.len(), self.running.values().map(|group| group.chunks.len()).sum::<usize>());
        assert_eq!(self.yielding, self.running.values().filter(|group| group.purpose.gives_way()).count());
    }
}

impl Group {
    /// Takes in a mesh of one of its members.
    pub(crate) fn push(&mut self, meshed: ChunkMesh) {
        self.meshed.push(meshed);
    }

    pub(crate) const fn gives_way(&self) -> bool {
        self.purpose.gives_way()
    }
}

impl Pending {
    /// Merges another set into this one. A mesh that one change leaves alone may be changed by the other.
    fn merge(&mut self, other: &mut Self) {
        self.unchanged_meshes.retain(|key| !other.chunks.contains(key) || other.unchanged_meshes.contains(key));
        other.unchanged_meshes.retain(|key| !self.chunks.contains(key) || self.unchanged_meshes.contains(key));
        self.unchanged_meshes.append(&mut other.unchanged_meshes);
        self.chunks.append(&mut other.chunks);
        self.places.append(&mut other.places);
        self.since = RequestTime::earlier(self.since, other.since);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(xs: &[i32]) -> BTreeSet<ChunkKey> {
        xs.iter().map(|&x| ChunkKey::finest([x, 0, 0])).collect()
    }

    fn pending(xs: &[i32], same: &[i32]) -> Pending {
        Pending { chunks: set(xs), unchanged_meshes: set(same), ..Pending::default() }
    }

    fn group(xs: &[i32], purpose: Purpose) -> Group {
        Group {
            chunks: set(xs),
            snapshot: BTreeMap::new(),
            appearance: 0,
            places: BTreeSet::new(),
            since: None,
            purpose,
            members: 1,
            meshed: Vec::new(),
            tickets: Vec::new(),
        }
    }

    #[test]
    fn an_edit_waits_for_edits_alone() {
        let mut groups = Groups::default();
        let edit = groups.start(group(&[0], Purpose::Edit));
        groups.start(group(&[1], Purpose::FirstMesh));
        groups.start(group(&[2], Purpose::Restyle));
        groups.add(pending(&[1, 2], &[]));
        groups.add(pending(&[0, 3], &[]));
        assert_eq!(groups.next_free().expect("the others give way").chunks, set(&[1, 2]));
        assert!(groups.next_free().is_none(), "the edit is shown first");
        assert_eq!((groups.yielding(), groups.is_claimed(ChunkKey::finest([1, 0, 0]))), (0, false));
        groups.check();
        assert!(groups.remove(edit).is_some());
        assert_eq!(groups.next_free().expect("it is done").chunks, set(&[0, 3]));
        assert!(groups.next_free().is_none() && groups.is_empty());
    }

    #[test]
    fn a_set_that_is_put_back_waits_for_a_change() {
        let mut groups = Groups::default();
        groups.add(pending(&[0], &[]));
        let again = groups.next_free().expect("nobody works on it");
        groups.put_back(again);
        assert!(groups.next_free().is_none());
        groups.wake();
        assert!(groups.next_free().is_some());
    }

    #[test]
    fn sets_that_overlap_become_one() {
        let mut groups = Groups::default();
        groups.add(pending(&[0, 1], &[0, 1]));
        groups.add(pending(&[4, 5], &[4]));
        assert_eq!(groups.pending.len(), 2);
        groups.add(pending(&[1, 2, 4, 6], &[4, 6]));
        groups.check();
        let only = groups.next_free().expect("one set");
        assert_eq!(only.chunks, set(&[0, 1, 2, 4, 5, 6]));
        assert_eq!(only.unchanged_meshes, set(&[0, 4, 6]), "1 changes with the later set, 5 with the earlier");
        groups.add(pending(&[], &[]));
        assert!(groups.next_free().is_none() && groups.is_empty());
    }
}
