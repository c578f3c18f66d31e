//! [`TerrainVolume`]: where a terrain's samples live, and what is being done with each of its chunks.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_ecs::prelude::*;
use bevy_math::IVec3;
use bevy_platform::collections::{HashMap, HashSet};
use bevy_reflect::prelude::*;
use marchless::{Chunk, DEFAULT_CHUNK_CELLS, Edit, Grid, Region, SpareSamples, Stamp};

use super::{Signs, Terrain};
use crate::bits::BitsCache;
use crate::chunk::ChunkKey;
use crate::mesh::{Colors, Meshed};
use crate::stats::Since;
use crate::stream::{Coverage, Leaf, LeafState, Streaming, Wanted};
use crate::work::{Ticket, new_number};

/// A terrain's samples. The plugin fills and changes them; read them here, change them with
/// [`Stamp`](crate::brush::Stamp) messages.
#[derive(Component, Reflect)]
#[reflect(Component, Default, from_reflect = false)]
pub struct TerrainVolume {
    /// The newest samples: of loaded chunks, and of those that more stamps have changed than are kept.
    #[reflect(ignore)]
    pub(crate) grid: Grid<i16>,
    /// The samples as drawn, and those that chunks not drawn yet will have beside drawn ones.
    #[reflect(ignore)]
    pub(crate) shown: Grid<i16>,
    /// The isovalue as drawn.
    #[reflect(ignore)]
    pub(crate) shown_isovalue: f32,
    /// Every loaded chunk.
    #[reflect(ignore)]
    pub(crate) chunks: HashMap<ChunkKey, ChunkState>,
    /// The settings in effect.
    #[reflect(ignore)]
    pub(crate) settings: Option<Terrain>,
    /// The colours of the settings' palette.
    #[reflect(ignore)]
    pub(crate) colors: Colors,
    /// Which chunks are loaded, and what is being done about it.
    #[reflect(ignore)]
    pub(crate) streaming: Streaming,
    /// What has changed samples since the source gave them; it is never forgotten.
    #[reflect(ignore)]
    pub(crate) edited: HashMap<[i32; 3], Edits>,
    /// Stamps that came before a chunk's samples, in order.
    #[reflect(ignore)]
    pub(crate) stamps: HashMap<[i32; 3], Vec<Arc<Stamp>>>,
    /// Memory for samples that stamps change.
    #[reflect(ignore)]
    pub(crate) spare: SpareSamples,
    /// What stamps have changed in this update.
    #[reflect(ignore)]
    pub(crate) edit: Edit,
    /// Which filling it is, so that a chunk sampled for an earlier one is recognised; 0 before the first.
    #[reflect(ignore)]
    pub(crate) filling: u64,
    /// How many loaded chunks wait for their samples.
    #[reflect(ignore)]
    pub(crate) unfilled: usize,
    /// Chunks whose surroundings are filled, but which have not been meshed since; some twice, some no longer.
    #[reflect(ignore)]
    pub(crate) ready: Vec<ChunkKey>,
    /// How many chunks are being meshed for the first time.
    #[reflect(ignore)]
    pub(crate) first_meshes: usize,
    /// Changed chunks that wait to be meshed. No chunk is in two sets.
    #[reflect(ignore)]
    pub(crate) pending: Vec<Pending>,
    /// Groups that are being meshed, by number.
    #[reflect(ignore)]
    pub(crate) groups: BTreeMap<u64, Group>,
    /// Which group works on a chunk. No chunk is in two groups, so results can never be shown out of order.
    #[reflect(ignore)]
    pub(crate) claims: HashMap<ChunkKey, u64>,
    /// Which of the newest samples are solid.
    #[reflect(ignore)]
    pub(crate) bits: BitsCache,
}

/// One loaded chunk of a volume.
pub(crate) struct ChunkState {
    /// Whether it is to be drawn, or has samples for its neighbours only.
    pub(crate) wanted: Wanted,
    /// Its entity, once there has been something to draw.
    pub(crate) entity: Option<Entity>,
    /// Whether the game has despawned its entity: then it is drawn no more.
    pub(crate) hidden: bool,
    pub(crate) fill: Fill,
    /// How many chunks of its 3 × 3 × 3 surroundings, itself included, are not filled.
    pub(crate) missing: u8,
    /// Whether it has ever been meshed; after a new filling its former mesh stays until the next.
    pub(crate) drawn: bool,
    /// Whether nothing is shown of it.
    pub(crate) empty: bool,
    pub(crate) signs: Signs,
    /// Whether what is drawn is older than the samples because some around it were missing.
    pub(crate) stale: bool,
}

/// How far the samples of a chunk are.
#[derive(Debug)]
pub(crate) enum Fill {
    /// Nobody has asked for them yet.
    Unasked,
    /// They take sampling, which waits for its turn.
    Waiting,
    /// The job that samples.
    Asked(#[expect(dead_code, reason = "dropping it withdraws the job")] Ticket),
    Done,
    /// They were there, and have been dropped.
    Dropped,
}

/// What has been done to a chunk's samples since the source gave them.
pub(crate) enum Edits {
    /// These stamps, in order, which can be applied again.
    Stamps(Vec<Arc<Stamp>>),
    /// So many that the samples stay instead, wherever viewers are.
    Samples,
}

/// So many stamps wait for a chunk, and so many are kept for it: they take less memory than its samples.
pub(crate) const MOST_STAMPS: usize = 64;

impl Edits {
    /// Notes one stamp more.
    pub(crate) fn push(&mut self, stamp: Arc<Stamp>) {
        match self {
            Self::Stamps(stamps) if stamps.len() < MOST_STAMPS => stamps.push(stamp),
            _ => *self = Self::Samples,
        }
    }
}

impl Default for Edits {
    fn default() -> Self {
        Self::Stamps(Vec::new())
    }
}

/// Changed chunks that are to be meshed from one snapshot.
#[derive(Debug, Default)]
pub(crate) struct Pending {
    pub(crate) chunks: BTreeSet<ChunkKey>,
    /// Those of them whose meshes, where they have been drawn, stay as they are.
    pub(crate) look_the_same: BTreeSet<ChunkKey>,
    /// When the first of the edits was asked for; `None` where none was (a change of settings).
    pub(crate) since: Option<Since>,
}

impl Pending {
    /// Takes in all of another set. What looks the same after one change may not after the other.
    fn merge(&mut self, other: &mut Self) {
        self.look_the_same.retain(|key| !other.chunks.contains(key) || other.look_the_same.contains(key));
        other.look_the_same.retain(|key| !self.chunks.contains(key) || self.look_the_same.contains(key));
        self.look_the_same.append(&mut other.look_the_same);
        self.chunks.append(&mut other.chunks);
        self.since = Since::earlier(self.since, other.since);
    }
}

/// Chunks that are being meshed from one snapshot, to be shown in one update.
pub(crate) struct Group {
    /// The chunks it claims: its members, and those that cannot be meshed yet.
    pub(crate) chunks: BTreeSet<ChunkKey>,
    /// The samples of its members and of the chunks around them.
    pub(crate) snapshot: BTreeMap<[i32; 3], Chunk<i16>>,
    pub(crate) isovalue: f32,
    pub(crate) since: Option<Since>,
    /// Whether it may give way to an edit before its jobs have begun: a chunk that has never been drawn.
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
            chunks: HashMap::default(),
            settings: None,
            colors: Arc::new([[1.0; 4]; 256]),
            streaming: Streaming::default(),
            edited: HashMap::default(),
            stamps: HashMap::default(),
            spare: SpareSamples::new(),
            edit: Edit::NONE,
            filling: 0,
            unfilled: 0,
            ready: Vec::new(),
            first_meshes: 0,
            pending: Vec::new(),
            groups: BTreeMap::new(),
            claims: HashMap::default(),
            bits: BitsCache::default(),
        }
    }
}

impl TerrainVolume {
    /// The newest samples, with every edit; perhaps not shown yet. Absent chunks are not filled, not loaded, or dropped.
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

    /// The entity of the chunk at `position`, in chunks; `None` where there is nothing to draw.
    pub fn chunk_entity(&self, position: IVec3) -> Option<Entity> {
        self.chunks.get(&ChunkKey::finest(position.to_array()))?.entity
    }

    /// What is shown of the chunk at a place, in chunks; `None` where it is in no range.
    ///
    /// All places in range together are the terrain's cover: each belongs to one leaf in every update.
    pub fn leaf_at(&self, position: IVec3) -> Option<Leaf> {
        let chunk = position.to_array();
        let state = match self.chunks.get(&ChunkKey::finest(chunk)) {
            Some(state) if state.wanted == Wanted::Mesh => state.leaf_state(),
            _ if self.streaming.ranges().contains(chunk) => LeafState::Waiting,
            _ => return None,
        };
        Some(Leaf { level: 0, position, state })
    }

    /// How many leaves of each state there are.
    pub fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        for state in self.chunks.values().filter(|state| state.wanted == Wanted::Mesh) {
            match state.leaf_state() {
                LeafState::Waiting => coverage.waiting += 1,
                LeafState::Empty => coverage.empty += 1,
                LeafState::Drawn => coverage.drawn += 1,
            }
        }
        let is_leaf = |key: &ChunkKey| self.chunks.get(key).is_some_and(|state| state.wanted == Wanted::Mesh);
        let on_their_way: HashSet<ChunkKey> = self.streaming.on_their_way().filter(|key| !is_leaf(key)).collect();
        let in_range = |key: &&ChunkKey| self.streaming.ranges().contains(key.position);
        coverage.waiting += on_their_way.iter().filter(in_range).count();
        coverage
    }

    /// Whether all chunks in range have their samples.
    pub fn is_filled(&self) -> bool {
        self.settings.is_some() && self.unfilled == 0 && self.streaming.is_idle()
    }

    /// Whether all chunks in range have their samples and everything is drawn as it is.
    pub fn is_settled(&self) -> bool {
        let nothing_to_mesh = self.ready.is_empty() && self.streaming.to_mesh.is_empty() && self.pending.is_empty();
        self.is_filled() && nothing_to_mesh && self.groups.is_empty()
    }

    /// How much memory the samples take, in bytes: what is drawn, what is newest, and the plugin's notes about each chunk.
    pub fn sample_bytes(&self) -> usize {
        self.sample_bytes_from([i32::MIN; 3], usize::MAX).0 + self.notes_bytes()
    }

    /// How much memory the plugin's notes about chunks take, in bytes.
    pub(crate) fn notes_bytes(&self) -> usize {
        self.chunks.len() * size_of::<(ChunkKey, ChunkState)>()
    }

    /// How much memory the samples of at most so many chunks take, in bytes, from a position on; and the position where to
    /// go on, if any are left.
    pub(crate) fn sample_bytes_from(&self, from: [i32; 3], most: usize) -> (usize, Option<[i32; 3]>) {
        let mut newest = self.grid.chunks_from(from).peekable();
        let mut shown = self.shown.chunks_from(from).peekable();
        let mut bytes = 0;
        for done in 0.. {
            let Some(next) = newest.peek().into_iter().chain(shown.peek()).map(|(position, _)| *position).min() else {
                break;
            };
            if done == most {
                return (bytes, Some(next));
            }
            let [newest, shown] =
                [&mut newest, &mut shown].map(|chunks| chunks.next_if(|(position, _)| *position == next));
            let entries = [newest, shown].into_iter().flatten();
            bytes += entries.map(|_| size_of::<([i32; 3], Chunk<i16>)>()).sum::<usize>();
            bytes += match (newest, shown) {
                (Some((_, newest)), Some((_, shown))) if !same_samples(newest, shown) => {
                    bytes_of(newest) + bytes_of(shown)
                }
                (Some((_, chunk)), _) | (None, Some((_, chunk))) => bytes_of(chunk),
                (None, None) => 0,
            };
        }
        (bytes, None)
    }

    /// How many chunks in range, or beside it, wait for their samples or their mesh.
    pub(crate) fn waiting(&self) -> usize {
        self.streaming.on_their_way().count() + self.unfilled + self.waiting_for_meshes()
    }

    /// How many chunks can be meshed, or are being meshed.
    pub(crate) fn waiting_for_meshes(&self) -> usize {
        let pending = self.pending.iter().map(|pending| pending.chunks.len());
        let in_groups = self.groups.values().map(|group| group.members - group.meshed.len());
        self.ready.len() + self.streaming.to_mesh.len() + pending.sum::<usize>() + in_groups.sum::<usize>()
    }

    /// Notes that chunks have changed; sets that overlap become one.
    pub(crate) fn add_pending(&mut self, mut new: Pending) {
        if new.chunks.is_empty() {
            return;
        }
        self.pending.retain_mut(|other| {
            let overlaps = !new.chunks.is_disjoint(&other.chunks);
            if overlaps {
                new.merge(other);
            }
            !overlaps
        });
        self.pending.push(new);
    }

    /// Notes that chunks of the finest level have changed. Those that are not to be drawn may be by the time the others are.
    pub(crate) fn add_changed(&mut self, changed: BTreeSet<[i32; 3]>, since: Option<Since>) {
        let chunks = changed.into_iter().map(ChunkKey::finest).collect();
        self.add_pending(Pending { chunks, since, ..Pending::default() });
    }

    /// Notes that a chunk has its samples, and finds which chunks can now be meshed.
    pub(crate) fn set_filled(&mut self, key: ChunkKey) {
        let Some(state) = self.chunks.get_mut(&key) else { return };
        if matches!(core::mem::replace(&mut state.fill, Fill::Done), Fill::Unasked | Fill::Waiting | Fill::Asked(_)) {
            self.unfilled -= 1;
        }
        for neighbour in key.around() {
            if let Some(state) = self.chunks.get_mut(&neighbour) {
                state.missing -= 1;
                if state.is_ready() {
                    self.ready.push(neighbour);
                }
            }
        }
    }

    /// Notes that a chunk no longer has its samples.
    pub(crate) fn set_unfilled(&mut self, key: ChunkKey) {
        for neighbour in key.around() {
            if let Some(state) = self.chunks.get_mut(&neighbour) {
                state.missing += 1;
            }
        }
    }

    /// Forgets the samples of a chunk that is not loaded, where they can be had again.
    pub(crate) fn forget_samples(&mut self, position: [i32; 3]) {
        if !matches!(self.edited.get(&position), Some(Edits::Samples)) {
            self.grid.unload(position);
            self.bits.forget(position);
        }
    }

    /// Forgets the samples with which a chunk is drawn.
    pub(crate) fn forget_shown(&mut self, position: [i32; 3]) {
        if let Some(samples) = self.shown.unload(position) {
            self.spare.keep(samples);
        }
    }

    /// How many stamps are to be applied again when a chunk's samples come from its source.
    pub(crate) fn stamps_to_repeat(&self, position: [i32; 3]) -> usize {
        match self.edited.get(&position) {
            Some(Edits::Stamps(stamps)) => stamps.len(),
            _ => 0,
        }
    }

    /// Whether a chunk is known to have no surface.
    pub(crate) fn is_without_surface(&self, key: ChunkKey) -> bool {
        let ChunkKey { level, position } = key;
        self.chunks.get(&key).is_some_and(|state| {
            state.signs.are_without_surface(|step| {
                let position = [0, 1, 2].map(|axis| position[axis].saturating_add(step[axis]));
                self.chunks.get(&ChunkKey { level, position }).map(|state| state.signs)
            })
        })
    }

    /// How many chunks around a place, itself included, have to be filled and are not.
    pub(crate) fn missing_around(&self, key: ChunkKey, extent: Region) -> u8 {
        let is_missing =
            |key: &ChunkKey| extent.contains(key.position) && !self.chunks.get(key).is_some_and(ChunkState::is_filled);
        key.around().filter(is_missing).count() as u8
    }

    /// Whether no group works on `chunks`. Groups that may give way to an edit do so where none of their jobs has begun.
    pub(crate) fn free_for_edit(&mut self, chunks: &BTreeSet<ChunkKey>) -> bool {
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
    pub(crate) fn claim(&mut self, chunks: &BTreeSet<ChunkKey>) -> u64 {
        let number = new_number();
        self.claims.extend(chunks.iter().map(|position| (*position, number)));
        number
    }

    /// Takes out a group, and frees the chunks that it claims.
    pub(crate) fn take_group(&mut self, id: u64) -> Option<Group> {
        let group = self.groups.remove(&id)?;
        for key in &group.chunks {
            self.claims.remove(key);
        }
        self.first_meshes -= usize::from(group.withdrawable);
        Some(group)
    }

    /// Forgets all groups and all that waits to be meshed; jobs that have not begun are withdrawn.
    pub(crate) fn forget_work(&mut self) {
        self.ready.clear();
        self.pending.clear();
        self.groups.clear();
        self.claims.clear();
        self.first_meshes = 0;
    }
}

impl ChunkState {
    /// A chunk that is to be sampled.
    pub(crate) const fn new(wanted: Wanted, missing: u8) -> Self {
        Self {
            wanted,
            entity: None,
            hidden: false,
            fill: Fill::Unasked,
            missing,
            drawn: false,
            empty: true,
            signs: Signs::UNKNOWN,
            stale: false,
        }
    }

    /// Whether its samples are there.
    pub(crate) const fn is_filled(&self) -> bool {
        matches!(self.fill, Fill::Done)
    }

    /// Whether it can be meshed, and what is drawn of it is not up to date.
    pub(crate) fn is_ready(&self) -> bool {
        self.wanted == Wanted::Mesh && self.missing == 0 && !self.hidden && (!self.drawn || self.stale)
    }

    const fn leaf_state(&self) -> LeafState {
        match (self.drawn, self.empty) {
            (false, _) => LeafState::Waiting,
            (true, true) => LeafState::Empty,
            (true, false) => LeafState::Drawn,
        }
    }
}

/// How much memory a chunk's samples take, in bytes.
fn bytes_of(chunk: &Chunk<i16>) -> usize {
    match chunk {
        Chunk::Uniform(_) => 0,
        Chunk::Samples(samples) => 2 * samples.weights.capacity() + samples.materials.capacity(),
    }
}

/// Whether two chunks are known to be the same without looking at their samples.
pub(crate) fn same_samples(a: &Chunk<i16>, b: &Chunk<i16>) -> bool {
    match (a, b) {
        (Chunk::Uniform(a), Chunk::Uniform(b)) => a == b,
        (Chunk::Samples(a), Chunk::Samples(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::work::{Priority, WorkQueue, do_next};

    /// A volume with one group of one job for the first chunk.
    fn volume_with_group(withdrawable: bool, queue: &WorkQueue) -> TerrainVolume {
        let mut volume = TerrainVolume::default();
        let chunks = BTreeSet::from([ChunkKey::finest([0, 0, 0])]);
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
        volume.first_meshes += usize::from(withdrawable);
        volume.groups.insert(id, group);
        volume
    }

    #[test]
    fn an_edit_waits_for_groups_unless_they_can_give_way() {
        let edited = BTreeSet::from([[0, 0, 0], [1, 0, 0]].map(ChunkKey::finest));
        let elsewhere = BTreeSet::from([ChunkKey::finest([1, 0, 0])]);
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
        let set = |xs: &[i32]| xs.iter().map(|&x| ChunkKey::finest([x, 0, 0])).collect::<BTreeSet<_>>();
        let pending = |xs: &[i32], same: &[i32]| Pending { chunks: set(xs), look_the_same: set(same), since: None };
        volume.add_pending(pending(&[0, 1], &[0, 1]));
        volume.add_pending(pending(&[4, 5], &[4]));
        assert_eq!(volume.pending.len(), 2);
        volume.add_pending(pending(&[1, 2, 4, 6], &[4, 6]));
        let [only] = &volume.pending[..] else { panic!("one set: {:?}", volume.pending) };
        assert_eq!(only.chunks, set(&[0, 1, 2, 4, 5, 6]));
        assert_eq!(only.look_the_same, set(&[0, 4, 6]), "1 changes with the later set, 5 with the earlier");
        volume.add_pending(pending(&[], &[]));
        assert_eq!(volume.pending.len(), 1);
    }
}
