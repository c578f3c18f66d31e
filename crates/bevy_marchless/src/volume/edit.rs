//! Stamps change samples; the chunks that they change together become one set to be meshed.

use core::mem;
use std::collections::{BTreeMap, BTreeSet};

use bevy_platform::collections::HashMap;
use marchless::{Edit, GridChunk, QuantisedStamp, Region};

use super::Heart;
use super::groups::Pending;
use crate::chunk::ChunkKey;
use crate::stats::RequestTime;

/// The changes that one update's stamps make to a terrain. Stamps whose chunks overlap form one set; each set is shown
/// and reported by itself.
#[derive(Default)]
pub(crate) struct Edits {
    /// The sets by number; `None` for those that were merged into others.
    sets: Vec<Option<EditedSet>>,
    /// The set of each chunk that has changed samples, or lies beside one that has.
    owners: HashMap<ChunkKey, usize>,
    /// The chunks with changed samples, as they were before.
    before: BTreeMap<[i32; 3], GridChunk<i16>>,
}

/// The changes that some stamps made together.
struct EditedSet {
    edit: Edit,
    /// Chunks with changed samples.
    chunks: Vec<[i32; 3]>,
    /// Chunks, and leaves of coarser levels, whose meshes read changed samples; and the leaves of `places`.
    affected: BTreeSet<ChunkKey>,
    /// The changes of levels that make place for it.
    places: BTreeSet<u64>,
    since: RequestTime,
}

impl Edits {
    /// Adds the changes of one stamp.
    fn add(&mut self, mut new: EditedSet) {
        let mut overlapping: Vec<usize> =
            new.affected.iter().filter_map(|chunk| self.owners.get(chunk)).copied().collect();
        overlapping.sort_unstable();
        overlapping.dedup();
        // The others merge into the largest set, and the stamp's own chunks come last.
        let size = |index: &usize| self.sets[*index].as_ref().map_or(0, |set| set.affected.len());
        let home = overlapping.iter().copied().max_by_key(size);
        let mut all = home.and_then(|home| self.sets[home].take());
        let others = overlapping.into_iter().filter_map(|index| self.sets[index].take()).collect::<Vec<_>>();
        let index = home.unwrap_or(self.sets.len());
        for other in others {
            self.owners.extend(other.affected.iter().map(|chunk| (*chunk, index)));
            match &mut all {
                Some(all) => all.merge(other),
                None => all = Some(other),
            }
        }
        self.owners.extend(new.affected.iter().map(|chunk| (*chunk, index)));
        if let Some(mut all) = all {
            all.merge(new);
            new = all;
        }
        match self.sets.get_mut(index) {
            Some(place) => *place = Some(new),
            None => self.sets.push(Some(new)),
        }
    }
}

impl EditedSet {
    fn merge(&mut self, other: Self) {
        self.edit.merge(&other.edit);
        self.chunks.extend(other.chunks);
        self.affected.extend(other.affected);
        self.places.extend(other.places);
        self.since = RequestTime::earlier(Some(self.since), Some(other.since)).unwrap_or(self.since);
    }
}

impl Heart {
    /// Applies a stamp that was read at `since`.
    pub(crate) fn stamp(&mut self, stamp: QuantisedStamp, since: RequestTime, edits: &mut Edits) {
        let touched = stamp.region();
        let place = self.make_place(touched);
        let changed = self.samples.stamp(stamp, &mut edits.before);
        changed.crowded.into_iter().for_each(|position| self.crowded.push(ChunkKey::finest(position)));
        for position in &changed.chunks {
            self.table.samples_changed(ChunkKey::finest(*position));
        }
        let mut coarser = self.stamped_leaves(touched);
        coarser.extend(place.iter().flat_map(|id| self.leaves_of_place(*id)));
        if !changed.edit.is_empty() || !coarser.is_empty() {
            let super::samples::StampChanges { edit, chunks, affected, .. } = changed;
            let affected = affected.into_iter().map(ChunkKey::finest).chain(coarser).collect();
            edits.add(EditedSet { edit, chunks, affected, places: place.into_iter().collect(), since });
        }
    }

    /// Records the changes of an update's stamps, and queues the chunks to be meshed. Returns the edit of each set.
    pub(crate) fn finish_edits(&mut self, edits: Edits) -> Vec<Edit> {
        let Edits { sets, before, .. } = edits;
        let settings = self.mesh_settings();
        let mut reports = Vec::new();
        for EditedSet { edit, chunks, affected, places, since } in sets.into_iter().flatten() {
            let before: BTreeMap<_, _> =
                chunks.iter().filter_map(|chunk| Some((*chunk, before.get(chunk)?.clone()))).collect();
            let redrawn = self.samples.newest().chunks_with_mesh_changes(&before, edit.region, settings);
            let is_same =
                |key: &&ChunkKey| key.level == 0 && redrawn.as_ref().is_some_and(|r| !r.contains(&key.position));
            let unchanged_meshes = affected.iter().filter(is_same).copied().collect();
            self.changed(Pending { chunks: affected, unchanged_meshes, places, since: Some(since) });
            reports.extend(Some(edit).filter(|edit| !edit.is_empty()));
        }
        reports
    }

    /// Whether stamps have changed chunks that have just got their samples.
    pub(crate) const fn has_late_edits(&self) -> bool {
        !self.late_edits.is_empty()
    }

    /// The edits made in this update to chunks that have just got their samples. Edits that touch are merged.
    pub(crate) fn take_late_edits(&mut self) -> Vec<Edit> {
        let mut merged: Vec<Edit> = Vec::new();
        for edit in mem::take(&mut self.late_edits) {
            let reach = edit.region.grown(1, 1);
            match merged.iter_mut().find(|other| !other.region.intersection(&reach).is_empty()) {
                Some(other) => other.merge(&edit),
                None => merged.push(edit),
            }
        }
        merged
    }

    /// Whether all samples are resident that a change of these lattice points needs, or are being filled. Dropped
    /// samples are requested again.
    pub(crate) fn has_samples_for(&mut self, changed: Region) -> bool {
        if !self.cover.drops_samples() || changed.is_empty() {
            return true;
        }
        let affected = self.samples.newest().chunks_affected_by(changed).grown(1, 1);
        // A chunk that is being filled again still has its neighbours on the screen.
        let is_lost = |key: &ChunkKey| self.table.is_shown(*key) && !self.table.is_filled(*key);
        let all = affected.size().into_iter().map(u64::from).product::<u64>();
        let lost: Vec<ChunkKey> = if all < self.table.len() as u64 {
            affected.points().map(ChunkKey::finest).filter(is_lost).collect()
        } else {
            self.table.keys().filter(|key| affected.contains(key.position) && is_lost(key)).collect()
        };
        lost.iter().for_each(|key| self.revive(*key));
        lost.is_empty()
    }

    /// Records that chunks have changed together.
    pub(super) fn changed(&mut self, pending: Pending) {
        if !self.table.makes_meshes() && pending.places.is_empty() {
            return;
        }
        for key in &pending.chunks {
            self.renew_in_transition(*key);
        }
        self.groups.add(pending);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::TerrainStats;

    fn set(chunks: core::ops::Range<i32>, volume: u64) -> EditedSet {
        let affected: BTreeSet<_> = chunks.clone().map(|x| ChunkKey::finest([x, 0, 0])).collect();
        let mut edit = Edit { region: Region::new([chunks.start, 0, 0], [chunks.end, 1, 1]), ..Edit::NONE };
        edit.removed.add(0, volume);
        let (chunks, places) = (vec![[chunks.start, 0, 0]], BTreeSet::new());
        EditedSet { edit, chunks, affected, places, since: TerrainStats::default().now() }
    }

    #[test]
    fn overlapping_sets_merge() {
        let mut edits = Edits::default();
        edits.add(set(0..3, 1));
        edits.add(set(10..13, 2));
        edits.add(set(20..23, 4));
        edits.add(set(2..11, 8));
        edits.add(set(30..31, 16));
        edits.add(set(22..24, 32));
        let mut found: Vec<_> = edits
            .sets
            .iter()
            .flatten()
            .map(|set| (set.affected.len(), set.chunks.len(), set.edit.removed.total()))
            .collect();
        found.sort_unstable();
        assert_eq!(found, [(1, 1, 16), (4, 2, 36), (13, 3, 11)]);
        edits.add(set(12..31, 64));
        assert_eq!(edits.sets.iter().flatten().count(), 1);
        assert_eq!(edits.owners.len(), 31);
        assert!(edits.owners.values().all(|owner| edits.sets[*owner].is_some()));
    }
}
