//! [`LevelChange`]: a few leaves of a cover replace others.

use alloc::vec::Vec;

use super::{
    LeafKey, LevelCover,
    balance::too_coarse,
    neighbour,
    tree::{Node, State},
};
use crate::{lattice::Region, mesher::FinerNeighbours};

/// A change of a few leaves of a [`LevelCover`] that can be shown at once: nothing is then uncovered, covered twice or
/// cracked.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LevelChange {
    /// Leaves that are no longer drawn.
    pub removed: Vec<LeafKey>,
    /// Leaves that are drawn instead, and whether each is empty.
    pub added: Vec<(LeafKey, bool)>,
    /// Leaves that stay, but beside which finer leaves come or go, so that they need a new mesh. None of them is empty.
    pub remeshed: Vec<LeafKey>,
    pub(super) steps: Vec<Step>,
}

impl LevelChange {
    /// True if the two changes have leaves in common, or leaves that touch. Changes that do not overlap may be shown in
    /// any order.
    pub fn overlaps(&self, other: &Self) -> bool {
        if !touch(&self.region(), &other.region()) {
            return false;
        }
        let theirs = other.region();
        let ours = self.leaves().map(LeafKey::region).filter(|ours| touch(ours, &theirs));
        ours.into_iter().any(|ours| other.leaves().any(|theirs| touch(&ours, &theirs.region())))
    }

    /// The box around all leaves that the change mentions, in chunks of level 0.
    pub fn region(&self) -> Region {
        let regions = self.leaves().map(LeafKey::region);
        regions.reduce(|a, b| a.union(&b)).unwrap_or(Region::new([0; 3], [0; 3]))
    }

    /// This change and a later one as one.
    pub(super) fn then(&self, later: &Self) -> Self {
        let stays = |leaf: &LeafKey| !later.removed.contains(leaf);
        let is_new = |leaf: &LeafKey| self.added.iter().any(|(added, _)| added == leaf);
        let mut both = self.clone();
        both.added.retain(|(leaf, _)| stays(leaf));
        both.added.extend(&later.added);
        both.removed.extend(later.removed.iter().filter(|leaf| !is_new(leaf)));
        both.remeshed.retain(stays);
        both.remeshed.extend(later.remeshed.iter().filter(|leaf| !is_new(leaf)));
        both.added.sort_unstable();
        both.removed.sort_unstable();
        both.remeshed.sort_unstable();
        both.remeshed.dedup();
        both.steps.extend(&later.steps);
        both
    }

    /// The number of leaves that are to be meshed.
    pub(super) fn meshes(&self) -> usize {
        self.added.iter().filter(|(_, is_empty)| !is_empty).count() + self.remeshed.len()
    }

    /// All leaves that the change mentions; one that becomes empty, or gets a surface, is there twice.
    pub fn leaves(&self) -> impl Iterator<Item = LeafKey> + '_ {
        let added = self.added.iter().map(|(leaf, _)| *leaf);
        self.removed.iter().copied().chain(added).chain(self.remeshed.iter().copied())
    }
}

/// A change of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Makes a root of the cover a leaf.
    AddRoot { key: LeafKey, is_empty: bool },
    /// Takes a root with all its leaves out of the cover.
    RemoveRoot { key: LeafKey },
    /// Splits a leaf. Of its eight children, the bits of `exist` exist, and those of `empty` are empty.
    Split { key: LeafKey, exist: u8, empty: u8 },
    /// Makes a node a leaf: one whose children are leaves, or a leaf that has become empty or has got a surface.
    Merge { key: LeafKey, is_empty: bool },
}

impl Step {
    pub(super) const fn key(self) -> LeafKey {
        match self {
            Self::AddRoot { key, .. }
            | Self::RemoveRoot { key }
            | Self::Split { key, .. }
            | Self::Merge { key, .. } => key,
        }
    }
}

/// Steps that have been made, and how to take them back.
pub(super) struct Made {
    pub(super) change: LevelChange,
    undo: Vec<Undo>,
    /// The number of nodes before.
    nodes: usize,
}

/// Why steps cannot be made.
pub(super) enum Misfit {
    /// This leaf would be too coarse for what is beside it.
    TooCoarse(LeafKey),
    /// These two leaves and finer ones would alternate at the edge that they share.
    Alternate([LeafKey; 2]),
}

/// What takes a [`Step`] back.
pub(super) enum Undo {
    State { index: u32, state: State },
    Root { position: [i32; 3], root: Option<u32> },
}

impl LevelCover {
    /// Makes a change.
    pub fn apply(&mut self, change: &LevelChange) {
        for step in &change.steps {
            self.make(*step);
        }
        self.compact();
    }

    /// The step that splits a leaf as in this cover; `None` if it is not split here.
    pub(super) fn split_of(&self, leaf: LeafKey) -> Option<Step> {
        let node = self.nodes[self.index_over(leaf)? as usize];
        match node.state {
            State::Split { first } if node.key == leaf => Some(self.split_step(first as usize)),
            _ => None,
        }
    }

    /// The step that makes eight children, of which the first has this index.
    pub(super) fn split_step(&self, first: usize) -> Step {
        let children = &self.nodes[first..first + 8];
        let bits =
            |is: fn(State) -> bool| (0..8).filter(|&child| is(children[child].state)).map(|child| 1 << child).sum();
        let exist = bits(|state| !matches!(state, State::Nowhere));
        let empty = bits(|state| matches!(state, State::Empty));
        Step::Split { key: children[0].key.parent(), exist, empty }
    }

    /// Makes steps, if the cover then fits. Otherwise the cover stays as it is, and the first misfit is returned.
    pub(super) fn try_steps(&mut self, steps: &[Step]) -> Result<Made, Misfit> {
        let regions: Vec<Region> = steps.iter().map(|step| step.key().region()).collect();
        let before = self.leaves_touching(&regions);
        let finer_of = |leaf, is_empty| if is_empty { FinerNeighbours::NONE } else { self.finer_neighbours(leaf) };
        let finer: Vec<FinerNeighbours> = before.iter().map(|&(leaf, is_empty)| finer_of(leaf, is_empty)).collect();
        let nodes = self.nodes.len();
        let undo: Vec<Undo> = steps.iter().filter_map(|step| self.make(*step)).collect();
        let after = self.leaves_touching(&regions);
        let mut change = LevelChange { steps: steps.into(), ..LevelChange::default() };
        change.added = after.iter().filter(|leaf| before.binary_search(leaf).is_err()).copied().collect();
        let gone = before.iter().filter(|leaf| after.binary_search(leaf).is_err());
        change.removed = gone.map(|(leaf, _)| *leaf).collect();
        let coarsest = change.added.iter().map(|(leaf, _)| leaf.level).max().unwrap_or(0);
        // Beside a leaf, those two levels finer have no surface, but it has their samples at its border.
        let changed: Vec<LeafKey> = change.leaves().collect();
        let is_beside_finest = |leaf: LeafKey| {
            let finest = changed.iter().filter(|changed| changed.level + 1 < leaf.level);
            finest.into_iter().any(|changed| touch(&changed.region(), &leaf.region()))
        };
        let mut misfit = None;
        for (leaf, _) in after.iter().filter(|(_, is_empty)| !is_empty) {
            let old = before.binary_search(&(*leaf, false)).ok();
            // What was there before fits all but what is new.
            if (old.is_none() || leaf.level + 1 < coarsest)
                && let Some(index) = too_coarse(self, *leaf)
            {
                misfit = Some(Misfit::TooCoarse(self.nodes[index as usize].key));
                break;
            }
            let now = self.finer_neighbours(*leaf);
            if old.is_none_or(|old| finer[old] != now) {
                if let Some(across) = now.alternating_edge() {
                    misfit = Some(Misfit::Alternate([*leaf, neighbour(*leaf, across).unwrap_or(*leaf)]));
                    break;
                }
                change.remeshed.extend(old.map(|_| *leaf));
            } else if is_beside_finest(*leaf) {
                change.remeshed.push(*leaf);
            }
        }
        let made = Made { change, undo, nodes };
        match misfit {
            None => Ok(made),
            Some(misfit) => {
                self.take_back(made);
                Err(misfit)
            }
        }
    }

    /// Takes the latest steps back.
    pub(super) fn take_back(&mut self, made: Made) {
        for undo in made.undo.into_iter().rev() {
            match undo {
                Undo::State { index, state } => self.nodes[index as usize].state = state,
                Undo::Root { position, root: Some(root) } => _ = self.roots.insert(position, root),
                Undo::Root { position, root: None } => _ = self.roots.remove(&position),
            }
        }
        self.nodes.truncate(made.nodes);
    }

    /// The change to a refined copy of this cover: some empty leaves have got a surface, and then leaves were split,
    /// one by one.
    pub(super) fn refined_to(&self, refined: &Self, filled: &[LeafKey]) -> Option<LevelChange> {
        let whole = filled.iter().filter(|leaf| !refined.is_split(**leaf));
        let merges = whole.map(|&key| Step::Merge { key, is_empty: false });
        let splits = (self.nodes.len()..refined.nodes.len()).step_by(8).map(|first| refined.split_step(first));
        Some(self.clone().try_steps(&merges.chain(splits).collect::<Vec<_>>()).ok()?.change)
    }

    /// Makes one step, and says how to take it back; `None` if the cover has no such node.
    pub(super) fn make(&mut self, step: Step) -> Option<Undo> {
        let leaf = |is_empty| if is_empty { State::Empty } else { State::Leaf };
        let first = self.nodes.len() as u32;
        let state = match step {
            Step::AddRoot { key, is_empty } => {
                self.nodes.push(Node { key, state: leaf(is_empty) });
                return Some(Undo::Root { position: key.position, root: self.roots.insert(key.position, first) });
            }
            Step::RemoveRoot { key } => {
                return Some(Undo::Root { position: key.position, root: self.roots.remove(&key.position) });
            }
            Step::Split { .. } => State::Split { first },
            Step::Merge { is_empty, .. } => leaf(is_empty),
        };
        let index = self.index_over(step.key())?;
        let node = self.nodes[index as usize];
        if let Step::Split { exist, empty, .. } = step {
            self.nodes.extend((0..8).map(|octant| {
                let is = |bits: u8| bits >> octant & 1 == 1;
                let state = if is(exist) { leaf(is(empty)) } else { State::Nowhere };
                Node { key: node.key.child(octant), state }
            }));
        }
        self.nodes[index as usize].state = state;
        Some(Undo::State { index, state: node.state })
    }

    /// The chunks of the coarsest level that a box of chunks overlaps or touches.
    pub(super) fn roots_near(&self, chunks: &Region) -> Region {
        let chunks = chunks.grown(1, 1);
        Region::new(chunks.min.map(|v| v >> self.top), chunks.max.map(|v| ((v - 1) >> self.top) + 1))
    }

    /// The leaves in some regions and those that touch them, in order, and whether each is empty.
    pub(super) fn leaves_touching(&self, regions: &[Region]) -> Vec<(LeafKey, bool)> {
        let mut found = Vec::new();
        for region in regions {
            let roots = self.roots_near(region);
            let are_many = roots.size().map(f64::from).iter().product::<f64>() > self.roots.len() as f64;
            let mut to_visit: Vec<u32> = if are_many {
                self.roots.values().copied().collect()
            } else {
                roots.points().filter_map(|position| self.roots.get(&position).copied()).collect()
            };
            while let Some(index) = to_visit.pop() {
                let node = self.nodes[index as usize];
                if !touch(&node.key.region(), region) {
                    continue;
                }
                match node.state {
                    State::Split { first } => to_visit.extend(first..first + 8),
                    State::Leaf => found.push((node.key, false)),
                    State::Empty => found.push((node.key, true)),
                    State::Nowhere => {}
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// Whether two boxes have a face, an edge or a corner in common, or overlap.
pub(super) fn touch(a: &Region, b: &Region) -> bool {
    (0..3).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
}
