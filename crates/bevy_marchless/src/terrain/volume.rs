//! [`TerrainVolume`]: where a terrain's samples live, and what is being done with each of its chunks.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;
use marchless::{Chunk, DEFAULT_CHUNK_CELLS, Edit, Grid, Region, Stamp};

use super::Terrain;
use crate::bits::BitsCache;
use crate::mesh::{Colors, Meshed};
use crate::stats::Since;
use crate::stream::{Coverage, Leaf, LeafState};
use crate::work::{Ticket, new_number};

/// A terrain's samples. The plugin fills and changes them; read them here, change them with
/// [`Stamp`](crate::brush::Stamp) messages.
#[derive(Component, Reflect)]
#[reflect(Component, Default, from_reflect = false)]
pub struct TerrainVolume {
    /// The newest samples.
    #[reflect(ignore)]
    pub(crate) grid: Grid<i16>,
    /// The samples as drawn, and those that chunks not drawn yet will have beside drawn ones.
    #[reflect(ignore)]
    pub(crate) shown: Grid<i16>,
    /// The isovalue as drawn.
    #[reflect(ignore)]
    pub(crate) shown_isovalue: f32,
    /// Every chunk of the extent.
    #[reflect(ignore)]
    pub(crate) chunks: BTreeMap<[i32; 3], ChunkState>,
    /// The settings in effect.
    #[reflect(ignore)]
    pub(crate) settings: Option<Terrain>,
    /// The colours of the settings' palette.
    #[reflect(ignore)]
    pub(crate) colors: Colors,
    /// What stamps have changed in this update.
    #[reflect(ignore)]
    pub(crate) edit: Edit,
    /// Which filling it is, so that a chunk sampled for an earlier one is recognised; 0 before the first.
    #[reflect(ignore)]
    pub(crate) filling: u64,
    /// How many chunks wait for their samples.
    #[reflect(ignore)]
    pub(crate) unfilled: usize,
    /// Chunks whose surroundings are filled, but which have not been meshed since.
    #[reflect(ignore)]
    pub(crate) ready: BTreeSet<[i32; 3]>,
    /// Changed chunks that wait to be meshed. No chunk is in two sets.
    #[reflect(ignore)]
    pub(crate) pending: Vec<Pending>,
    /// Groups that are being meshed, by number.
    #[reflect(ignore)]
    pub(crate) groups: BTreeMap<u64, Group>,
    /// Which group works on a chunk. No chunk is in two groups, so results can never be shown out of order.
    #[reflect(ignore)]
    pub(crate) claims: BTreeMap<[i32; 3], u64>,
    /// Which of the newest samples are solid.
    #[reflect(ignore)]
    pub(crate) bits: BitsCache,
}

/// One chunk of a volume.
pub(crate) struct ChunkState {
    /// Its entity; `None` once that has been despawned.
    pub(crate) entity: Option<Entity>,
    /// The job that samples it, until it is filled.
    pub(crate) fill: Option<Ticket>,
    /// How many chunks of its 3 × 3 × 3 surroundings, itself included, are not filled.
    pub(crate) missing: u8,
    /// Whether it has ever been meshed; after a new filling its former mesh stays until the next.
    pub(crate) drawn: bool,
    /// Whether nothing is shown of it.
    pub(crate) empty: bool,
    /// Stamps that came before its samples, in order.
    pub(crate) stamps: Vec<Arc<Stamp>>,
}

/// Changed chunks that are to be meshed from one snapshot.
#[derive(Debug)]
pub(crate) struct Pending {
    pub(crate) chunks: BTreeSet<[i32; 3]>,
    /// When the first of the edits was asked for; `None` where none was (a change of settings).
    pub(crate) since: Option<Since>,
}

/// Chunks that are being meshed from one snapshot, to be shown in one update.
pub(crate) struct Group {
    /// The chunks it claims: its members, and those that cannot be meshed yet.
    pub(crate) chunks: BTreeSet<[i32; 3]>,
    /// The samples of its members and of the chunks around them.
    pub(crate) snapshot: BTreeMap<[i32; 3], Chunk<i16>>,
    pub(crate) isovalue: f32,
    pub(crate) since: Option<Since>,
    /// Whether it may give way to an edit before its jobs have begun.
    pub(crate) withdrawable: bool,
    pub(crate) tickets: Vec<Ticket>,
    /// How many chunks will have been meshed when it is complete.
    pub(crate) members: usize,
    pub(crate) meshed: Vec<Meshed>,
}

impl Default for TerrainVolume {
    fn default() -> Self {
        let grid = Grid::new(DEFAULT_CHUNK_CELLS).expect("the default is within the limits");
        Self {
            shown: grid.clone(),
            grid,
            shown_isovalue: 0.0,
            chunks: BTreeMap::new(),
            settings: None,
            colors: Arc::new([[1.0; 4]; 256]),
            edit: Edit::NONE,
            filling: 0,
            unfilled: 0,
            ready: BTreeSet::new(),
            pending: Vec::new(),
            groups: BTreeMap::new(),
            claims: BTreeMap::new(),
            bits: BitsCache::default(),
        }
    }
}

impl TerrainVolume {
    /// The newest samples, with every edit; perhaps not shown yet. Absent chunks are not filled yet.
    pub const fn grid(&self) -> &Grid<i16> {
        &self.grid
    }

    /// The samples as they are drawn at the moment.
    pub const fn shown(&self) -> &Grid<i16> {
        &self.shown
    }

    /// The isovalue as it is drawn at the moment, in voxels.
    pub const fn shown_isovalue(&self) -> f32 {
        self.shown_isovalue
    }

    /// The settings in effect; `None` before the plugin has first seen the terrain, or where it refused its settings.
    pub const fn settings(&self) -> Option<&Terrain> {
        self.settings.as_ref()
    }

    /// The entity of the chunk at `position`, in chunks.
    pub fn chunk_entity(&self, position: IVec3) -> Option<Entity> {
        self.chunks.get(&position.to_array())?.entity
    }

    /// What is shown of the chunk at a place, in chunks; `None` where it is in no range.
    pub fn leaf_at(&self, position: IVec3) -> Option<Leaf> {
        let state = self.chunks.get(&position.to_array())?;
        let state = match (state.drawn, state.empty) {
            (false, _) => LeafState::Waiting,
            (true, true) => LeafState::Empty,
            (true, false) => LeafState::Drawn,
        };
        Some(Leaf { level: 0, position, state })
    }

    /// How many leaves of each state there are.
    pub fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        for leaf in self.chunks.keys().filter_map(|position| self.leaf_at(IVec3::from(*position))) {
            match leaf.state {
                LeafState::Waiting => coverage.waiting += 1,
                LeafState::Empty => coverage.empty += 1,
                LeafState::Drawn => coverage.drawn += 1,
            }
        }
        coverage
    }

    /// Whether all chunks have their samples.
    pub const fn is_filled(&self) -> bool {
        self.settings.is_some() && self.unfilled == 0
    }

    /// Whether all chunks have their samples and everything is drawn as it is.
    pub fn is_settled(&self) -> bool {
        self.is_filled() && self.ready.is_empty() && self.pending.is_empty() && self.groups.is_empty()
    }

    /// How many chunks can be meshed, or are being meshed.
    pub(crate) fn waiting_for_meshes(&self) -> usize {
        let pending = self.pending.iter().map(|pending| pending.chunks.len());
        let in_groups = self.groups.values().map(|group| group.members - group.meshed.len());
        self.ready.len() + pending.sum::<usize>() + in_groups.sum::<usize>()
    }

    /// Notes that chunks have changed; sets that overlap become one.
    pub(crate) fn add_pending(&mut self, mut chunks: BTreeSet<[i32; 3]>, mut since: Option<Since>) {
        if chunks.is_empty() {
            return;
        }
        self.pending.retain_mut(|other| {
            let overlaps = !chunks.is_disjoint(&other.chunks);
            if overlaps {
                chunks.append(&mut other.chunks);
                since = Since::earlier(since, other.since);
            }
            !overlaps
        });
        self.pending.push(Pending { chunks, since });
    }

    /// Takes in a chunk's samples, and finds which chunks can now be meshed.
    pub(crate) fn set_filled(&mut self, position: [i32; 3]) {
        self.unfilled -= 1;
        for neighbour in around(position) {
            if let Some(state) = self.chunks.get_mut(&neighbour) {
                state.missing -= 1;
                if state.missing == 0 {
                    self.ready.insert(neighbour);
                }
            }
        }
    }

    /// Whether no group works on `chunks`. Groups that may give way to an edit do so where none of their jobs has begun.
    pub(crate) fn free_for_edit(&mut self, chunks: &BTreeSet<[i32; 3]>) -> bool {
        let claimed: BTreeSet<u64> = chunks.iter().filter_map(|position| self.claims.get(position)).copied().collect();
        let mut free = true;
        for id in claimed {
            let gives_way = |group: &Group| group.withdrawable && group.tickets.iter().all(|ticket| ticket.withdraw());
            if self.groups.get(&id).is_none_or(gives_way) {
                self.take_group(id);
            } else {
                free = false;
            }
        }
        free
    }

    /// Claims chunks for a new group, and gives it a number.
    pub(crate) fn claim(&mut self, chunks: &BTreeSet<[i32; 3]>) -> u64 {
        let number = new_number();
        self.claims.extend(chunks.iter().map(|position| (*position, number)));
        number
    }

    /// Takes out a group, and frees the chunks that it claims.
    pub(crate) fn take_group(&mut self, id: u64) -> Option<Group> {
        let group = self.groups.remove(&id)?;
        for position in &group.chunks {
            self.claims.remove(position);
        }
        Some(group)
    }

    /// Forgets all groups and all that waits to be meshed; jobs that have not begun are withdrawn.
    pub(crate) fn forget_work(&mut self) {
        self.ready.clear();
        self.pending.clear();
        self.groups.clear();
        self.claims.clear();
    }
}

impl ChunkState {
    /// A chunk in `extent` (in chunks) that is to be sampled.
    pub(crate) fn new(position: [i32; 3], extent: Region, entity: Option<Entity>) -> Self {
        let missing = around(position).filter(|neighbour| extent.contains(*neighbour)).count() as u8;
        Self { entity, fill: None, missing, drawn: false, empty: true, stamps: Vec::new() }
    }

    /// Whether its samples are there.
    pub(crate) const fn is_filled(&self) -> bool {
        self.fill.is_none()
    }
}

/// The 3 × 3 × 3 chunks around `position`, itself included.
pub(crate) fn around(position: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    Region::new(position.map(|v| v - 1), position.map(|v| v + 2)).points()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::work::{Priority, WorkQueue, do_next};

    /// A volume with one group of one job for the first chunk.
    fn volume_with_group(withdrawable: bool, queue: &WorkQueue) -> TerrainVolume {
        let mut volume = TerrainVolume::default();
        let chunks = BTreeSet::from([[0, 0, 0]]);
        let id = volume.claim(&chunks);
        let group = Group {
            chunks,
            snapshot: BTreeMap::new(),
            isovalue: 0.0,
            since: None,
            withdrawable,
            tickets: vec![queue.push(Priority::FirstMesh(0), || ())],
            members: 1,
            meshed: Vec::new(),
        };
        volume.groups.insert(id, group);
        volume
    }

    #[test]
    fn an_edit_waits_for_groups_unless_they_can_give_way() {
        let edited = BTreeSet::from([[0, 0, 0], [1, 0, 0]]);
        let elsewhere = BTreeSet::from([[1, 0, 0]]);
        let queue = WorkQueue::default();
        let mut volume = volume_with_group(false, &queue);
        assert!(volume.free_for_edit(&elsewhere));
        assert!(!volume.free_for_edit(&edited), "an edit's group shows first");
        let mut volume = volume_with_group(true, &queue);
        assert!(volume.free_for_edit(&edited), "nobody works on it yet");
        assert!(volume.groups.is_empty() && volume.claims.is_empty());
        let queue = WorkQueue::default();
        let mut volume = volume_with_group(true, &queue);
        do_next(&queue);
        assert!(!volume.free_for_edit(&edited), "it has begun");
        let [id] = volume.groups.keys().copied().collect::<Vec<_>>()[..] else { panic!("one group") };
        assert!(volume.take_group(id).is_some());
        assert!(volume.free_for_edit(&edited));
    }

    #[test]
    fn sets_that_overlap_become_one() {
        let mut volume = TerrainVolume::default();
        let set = |xs: &[i32]| xs.iter().map(|&x| [x, 0, 0]).collect::<BTreeSet<_>>();
        volume.add_pending(set(&[0, 1]), None);
        volume.add_pending(set(&[4, 5]), None);
        assert_eq!(volume.pending.len(), 2);
        volume.add_pending(set(&[1, 2, 4]), None);
        let [only] = &volume.pending[..] else { panic!("one set: {:?}", volume.pending) };
        assert_eq!(only.chunks, set(&[0, 1, 2, 4, 5]));
        volume.add_pending(set(&[]), None);
        assert_eq!(volume.pending.len(), 1);
    }
}
