//! Questions to a [`ChunkTable`]; nothing here changes it.

use bevy_ecs::entity::Entity;

use super::ChunkTable;
use super::entry::{Counts, DrawnMesh, Entry, Fill, Role, Shown};
use super::map::Marks;
use crate::chunk::ChunkKey;
use crate::cover::{LeafState, Residency};

impl ChunkTable {
    pub(crate) const fn counts(&self) -> Counts {
        self.counts
    }

    pub(crate) fn len(&self) -> usize {
        self.chunks.len()
    }

    /// The memory that the table takes, in bytes.
    pub(in crate::volume) fn bytes(&self) -> usize {
        self.chunks.bytes()
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.chunks.iter().map(|(key, _)| key)
    }

    pub(crate) fn contains(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).is_loaded
    }

    /// The residency of a chunk as the cover sees it: a leaf that was never drawn counts as samples only.
    pub(in crate::volume) fn kept(&self, key: ChunkKey) -> Residency {
        match self.chunks.get(key) {
            None => Residency::Gone,
            Some(Entry { role: Role::Leaf { shown, .. }, .. }) if !matches!(shown, Shown::Nothing) => Residency::Mesh,
            Some(_) => Residency::Samples,
        }
    }

    pub(in crate::volume) fn is_leaf(&self, key: ChunkKey) -> bool {
        let Marks { is_current, waits, .. } = self.chunks.marks(key);
        is_current || waits
    }

    /// The shown state of a leaf.
    pub(in crate::volume) fn shown(&self, key: ChunkKey) -> Option<&Shown> {
        match &self.chunks.get(key)?.role {
            Role::Support => None,
            Role::Leaf { shown, .. } => Some(shown),
        }
    }

    /// The mesh of a chunk, and its entity.
    pub(crate) fn drawn(&self, key: ChunkKey) -> Option<&DrawnMesh> {
        match self.shown(key)? {
            Shown::Mesh(drawn) => Some(drawn),
            _ => None,
        }
    }

    pub(in crate::volume) fn leaf_state(&self, key: ChunkKey) -> Option<LeafState> {
        self.shown(key).map(Shown::state)
    }

    /// Whether a chunk's shown state is known, even if it is empty.
    pub(in crate::volume) fn is_shown(&self, key: ChunkKey) -> bool {
        self.shown(key).is_some_and(|shown| !matches!(shown, Shown::Nothing))
    }

    /// Whether a chunk has its samples.
    pub(in crate::volume) fn is_filled(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).is_filled
    }

    /// Whether a chunk still has to be filled.
    pub(in crate::volume) fn is_queued(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Queued))
    }

    /// Whether nothing has been done about a chunk's samples yet.
    pub(in crate::volume) fn is_unasked(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Unasked))
    }

    /// Whether a job samples a chunk.
    pub(in crate::volume) fn has_job(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Asked(..)))
    }

    pub(in crate::volume) fn is_dropped(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Dropped))
    }

    /// Whether a chunk waits for the result of this job.
    pub(in crate::volume) fn is_asked(&self, key: ChunkKey, job: u64) -> bool {
        self.chunks.get(key).is_some_and(|entry| matches!(entry.fill, Fill::Asked(number, _) if number == job))
    }

    /// Whether samples of a chunk, or of a chunk around it, are missing.
    pub(in crate::volume) fn lacks_samples(&self, key: ChunkKey) -> bool {
        self.contains(key) && !self.is_surrounded(key)
    }

    /// Whether a chunk is a leaf that can be drawn.
    pub(in crate::volume) fn can_be_drawn(&self, key: ChunkKey) -> bool {
        self.chunks.get(key).is_some_and(Entry::may_be_drawn) && self.is_surrounded(key)
    }

    /// Whether a chunk can be drawn and is out of date.
    pub(in crate::volume) fn is_ready(&self, key: ChunkKey) -> bool {
        self.makes_meshes && self.chunks.marks(key).waits && self.is_surrounded(key)
    }

    /// Whether a leaf waits for samples around it.
    pub(in crate::volume) fn waits_for_samples(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).waits && !self.is_surrounded(key)
    }

    /// Whether a chunk and all existing chunks around it have their samples. Coarser leaves need none.
    pub(super) fn is_surrounded(&self, key: ChunkKey) -> bool {
        key.level > 0 || self.chunks.is_surrounded(key, &self.extent)
    }

    /// Whether a chunk has reached everything that a residency asks for.
    pub(in crate::volume) fn has_all(&self, key: ChunkKey, wanted: Residency) -> bool {
        let Marks { is_loaded, is_current, waits, .. } = self.chunks.marks(key);
        if wanted == Residency::Mesh { is_current } else { is_loaded && !waits }
    }

    /// Whether a chunk has more than a residency asks for.
    pub(in crate::volume) fn has_more(&self, key: ChunkKey, most: Residency) -> bool {
        let Marks { is_loaded, is_current, waits, .. } = self.chunks.marks(key);
        match most {
            Residency::Gone => is_loaded,
            Residency::Samples => is_current || waits,
            Residency::Mesh => false,
        }
    }

    /// Whether a chunk is up to date, as far as can be told without looking at groups.
    pub(in crate::volume) fn is_current(&self, key: ChunkKey) -> bool {
        self.chunks.marks(key).is_current
    }

    /// Whether a chunk is known to have no surface at an isovalue.
    pub(in crate::volume) fn is_without_surface(&self, key: ChunkKey, isovalue: f32) -> bool {
        let signs = |key: ChunkKey| self.chunks.get(key).map(|entry| entry.signs.at(isovalue));
        let ChunkKey { level, position } = key;
        signs(key).is_some_and(|own| {
            own.are_without_surface(|step| {
                let position = [0, 1, 2].map(|axis| position[axis].saturating_add(step[axis]));
                signs(ChunkKey { level, position })
            })
        })
    }

    /// All entities that show something.
    pub(crate) fn entities(&self) -> impl Iterator<Item = (ChunkKey, Entity)> + '_ {
        self.chunks.iter().filter_map(|(key, entry)| match &entry.role {
            Role::Leaf { shown: Shown::Mesh(drawn), .. } => Some((key, drawn.entity)),
            _ => None,
        })
    }
}
