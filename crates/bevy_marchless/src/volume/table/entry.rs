//! [`Entry`]: one loaded chunk, whose states cannot contradict each other; and [`Counts`] of them.

use std::sync::Arc;

use bevy_ecs::entity::Entity;
use marchless::MeshBuffer;

use super::map::Marks;
use crate::cover::LeafState;
use crate::jobs::Ticket;
use crate::volume::KnownSigns;

/// The numbers of chunks of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Chunks that wait for their samples.
    pub(crate) unfilled: usize,
    /// Leaves that have not been drawn.
    pub(crate) waiting: usize,
    /// Leaves without anything to draw.
    pub(crate) empty: usize,
    /// Leaves with a mesh.
    pub(crate) drawn: usize,
    /// Chunks of an earlier source that are to be filled and shown anew.
    pub(crate) outdated: usize,
}

/// One loaded chunk.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) role: Role,
    pub(super) fill: Fill,
    pub(super) signs: KnownSigns,
    pub(super) is_outdated: bool,
}

/// The reason why a chunk is loaded.
#[derive(Debug)]
pub(super) enum Role {
    /// Its samples, for the meshes of its neighbours.
    Support,
    /// It is drawn. Stale: the shown state is older than the samples, because samples around it were missing.
    Leaf { shown: Shown, is_stale: bool },
}

/// The shown state of a leaf.
#[derive(Clone, Debug)]
pub(crate) enum Shown {
    /// Nothing yet.
    Nothing,
    /// There is nothing to draw, and never was.
    Empty,
    /// A mesh on an entity; an empty mesh if everything was dug away.
    Mesh(DrawnMesh),
    /// The game has despawned its entity: it is not drawn any more.
    Despawned,
}

/// A mesh on an entity.
#[derive(Clone, Debug)]
pub(crate) struct DrawnMesh {
    pub(crate) entity: Entity,
    pub(crate) geometry: Arc<MeshBuffer>,
    /// The appearance of the mesh.
    pub(crate) appearance: u64,
}

/// The state of a chunk's samples.
#[derive(Debug)]
pub(super) enum Fill {
    /// They have not been requested.
    Unasked,
    /// They need a job, which waits for its turn.
    Queued,
    /// A job with this number samples them.
    Asked(u64, #[expect(dead_code, reason = "dropping it withdraws the job")] Ticket),
    /// They are resident.
    Resident,
    /// They were resident, and have been dropped.
    Dropped,
}

impl Role {
    pub(super) const NEW_LEAF: Self = Self::Leaf { shown: Shown::Nothing, is_stale: false };
}

impl Shown {
    pub(super) fn state(&self) -> LeafState {
        match self {
            Self::Nothing => LeafState::Waiting,
            Self::Empty | Self::Despawned => LeafState::Empty,
            Self::Mesh(drawn) if drawn.geometry.is_empty() => LeafState::Empty,
            Self::Mesh(_) => LeafState::Drawn,
        }
    }
}

impl Entry {
    pub(super) const fn marks(&self) -> Marks {
        let (is_leaf, waits) = (matches!(self.role, Role::Leaf { .. }), self.is_to_be_drawn());
        Marks { is_loaded: true, is_filled: self.is_filled(), is_current: is_leaf && !waits, waits }
    }

    pub(super) const fn is_filled(&self) -> bool {
        matches!(self.fill, Fill::Resident)
    }

    /// Whether it is a leaf that is drawn once all samples are there.
    pub(super) const fn may_be_drawn(&self) -> bool {
        matches!(&self.role, Role::Leaf { shown, .. } if !matches!(shown, Shown::Despawned))
    }

    /// Whether it is a leaf that is out of date.
    pub(super) const fn is_to_be_drawn(&self) -> bool {
        match &self.role {
            Role::Leaf { shown, is_stale } => self.may_be_drawn() && (*is_stale || matches!(shown, Shown::Nothing)),
            Role::Support => false,
        }
    }
}

impl Counts {
    pub(super) fn add(&mut self, entry: &Entry) {
        self.each(entry, |count, more| *count += more);
    }

    pub(super) fn take(&mut self, entry: &Entry) {
        self.each(entry, |count, less| *count -= less);
    }

    fn each(&mut self, entry: &Entry, change: impl Fn(&mut usize, usize)) {
        let is_unfilled = matches!(entry.fill, Fill::Unasked | Fill::Queued | Fill::Asked(..));
        change(&mut self.unfilled, is_unfilled.into());
        change(&mut self.outdated, entry.is_outdated.into());
        if let Role::Leaf { shown, .. } = &entry.role {
            let count = match shown.state() {
                LeafState::Waiting => &mut self.waiting,
                LeafState::Empty => &mut self.empty,
                LeafState::Drawn => &mut self.drawn,
            };
            change(count, 1);
        }
    }
}
