//! Stamps change samples; the chunks that they change together become one set to be meshed.

use core::mem;
use std::collections::{BTreeMap, BTreeSet};

use bevy_platform::collections::HashMap;
use marchless::{Edit, GridChunk, QuantisedStamp, Region};

use super::Heart;
use super::groups::Pending;
use crate::chunk::ChunkKey;
use crate::stats::RequestTime;

/// The changes that one update's stamps make to a terrain. Stamps whose chunks overlap form one region; each region is
/// shown and reported by itself.
#[derive(Default)]
pub(crate) struct Edits {
    regions: Vec<Option<EditedRegion>>,
    /// The region of each chunk that has changed samples, or lies beside one that has.
    owners: HashMap<[i32; 3], usize>,
    /// The chunks with changed samples, as they were before.
    before: BTreeMap<[i32; 3], GridChunk<i16>>,
}

/// The changes that some stamps made together.
struct EditedRegion {
    edit: Edit,
    /// Chunks with changed samples.
    chunks: Vec<[i32; 3]>,
    /// Chunks whose meshes read changed samples.
    affected: BTreeSet<[i32; 3]>,
    since: RequestTime,
}

impl Edits {
    /// Adds the changes of one stamp.
    fn add(&mut self, mut new: EditedRegion) {
        let mut overlapping: Vec<usize> =
            new.affected.iter().filter_map(|chunk| self.owners.get(chunk)).copied().collect();
        overlapping.sort_unstable();
        overlapping.dedup();
        // The largest region takes the others in; the stamp's own chunks come last.
        let size = |index: &usize| self.regions[*index].as_ref().map_or(0, |region| region.affected.len());
        let home = overlapping.iter().copied().max_by_key(size);
        let mut all = home.and_then(|home| self.regions[home].take());
        let others = overlapping.into_iter().filter_map(|index| self.regions[index].take()).collect::<Vec<_>>();
        let index = home.unwrap_or(self.regions.len());
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
        match self.regions.get_mut(index) {
            Some(place) => *place = Some(new),
            None => self.regions.push(Some(new)),
        }
    }
}

impl EditedRegion {
    fn merge(&mut self, other: Self) {
        self.edit.merge(&other.edit);
        self.chunks.extend(other.chunks);
        self.affected.extend(other.affected);
        self.since = RequestTime::earlier(Some(self.since), Some(other.since)).unwrap_or(self.since);
    }
}

impl Heart {
    /// Applies a stamp that was read at `since`.
    pub(crate) fn stamp(&mut self, stamp: QuantisedStamp, since: RequestTime, edits: &mut Edits) {
        let changed = self.samples.stamp(stamp, &mut edits.before);
        changed.crowded.into_iter().for_each(|position| self.crowded.push(ChunkKey::finest(position)));
        for position in &changed.chunks {
            self.table.samples_changed(ChunkKey::finest(*position));
        }
        if !changed.edit.is_empty() {
            let super::samples::StampChanges { edit, chunks, affected, .. } = changed;
            edits.add(EditedRegion { edit, chunks, affected, since });
        }
    }

    /// Records the changes of an update's stamps, and queues the chunks to be meshed. Returns the edit of each region.
    pub(crate) fn finish_edits(&mut self, edits: Edits) -> Vec<Edit> {
        let Edits { regions, before, .. } = edits;
        let settings = self.mesh_settings();
        let mut reports = Vec::new();
        for EditedRegion { edit, chunks, affected, since } in regions.into_iter().flatten() {
            let before: BTreeMap<_, _> =
                chunks.iter().filter_map(|chunk| Some((*chunk, before.get(chunk)?.clone()))).collect();
            let redrawn = self.samples.newest().chunks_with_mesh_changes(&before, edit.region, &settings);
            let unchanged_meshes =
                redrawn.map(|redrawn| affected.difference(&redrawn).copied().map(ChunkKey::finest).collect());
            self.changed(Pending {
                chunks: affected.into_iter().map(ChunkKey::finest).collect(),
                unchanged_meshes: unchanged_meshes.unwrap_or_default(),
                since: Some(since),
            });
            reports.push(edit);
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
        if !self.table.makes_meshes() {
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

    fn region(chunks: core::ops::Range<i32>, volume: u64) -> EditedRegion {
        let affected: BTreeSet<_> = chunks.clone().map(|x| [x, 0, 0]).collect();
        let mut edit = Edit { region: Region::new([chunks.start, 0, 0], [chunks.end, 1, 1]), ..Edit::NONE };
        edit.removed.add(0, volume);
        EditedRegion { edit, chunks: vec![[chunks.start, 0, 0]], affected, since: TerrainStats::default().now() }
    }

    #[test]
    fn regions_that_overlap_become_one() {
        let mut edits = Edits::default();
        edits.add(region(0..3, 1));
        edits.add(region(10..13, 2));
        edits.add(region(20..23, 4));
        edits.add(region(2..11, 8));
        edits.add(region(30..31, 16));
        edits.add(region(22..24, 32));
        let mut found: Vec<_> = edits
            .regions
            .iter()
            .flatten()
            .map(|region| (region.affected.len(), region.chunks.len(), region.edit.removed.total()))
            .collect();
        found.sort_unstable();
        assert_eq!(found, [(1, 1, 16), (4, 2, 36), (13, 3, 11)]);
        edits.add(region(12..31, 64));
        assert_eq!(edits.regions.iter().flatten().count(), 1);
        assert_eq!(edits.owners.len(), 31);
        assert!(edits.owners.values().all(|owner| edits.regions[*owner].is_some()));
    }
}
