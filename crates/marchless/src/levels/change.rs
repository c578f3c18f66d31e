//! [`LevelChange`]: from one cover to another, a few leaves at a time.

use alloc::vec::Vec;

use super::{
    LeafKey, LevelCover,
    balance::fits,
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
    /// Leaves that stay, but whose finer neighbours change, so that they need a new mesh. None of them is empty.
    pub remeshed: Vec<LeafKey>,
    steps: Vec<Step>,
}

impl LevelChange {
    /// True if the two changes have leaves in common, or leaves that touch. Changes that do not overlap may be shown in
    /// any order.
    pub fn overlaps(&self, other: &Self) -> bool {
        if !touch(&self.region(), &other.region()) {
            return false;
        }
        let touched = |change: &Self| change.leaves().map(|leaf| leaf.region()).collect::<Vec<_>>();
        let (ours, theirs) = (touched(self), touched(other));
        ours.iter().any(|a| theirs.iter().any(|b| touch(a, b)))
    }

    /// The box around all leaves that the change mentions, in chunks of level 0.
    pub fn region(&self) -> Region {
        let regions = self.leaves().map(LeafKey::region);
        regions.reduce(|a, b| a.union(&b)).unwrap_or(Region::new([0; 3], [0; 3]))
    }

    /// All leaves that the change mentions.
    fn leaves(&self) -> impl Iterator<Item = LeafKey> + '_ {
        let added = self.added.iter().map(|(leaf, _)| *leaf);
        self.removed.iter().copied().chain(added).chain(self.remeshed.iter().copied())
    }
}

/// A change of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
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
    const fn key(self) -> LeafKey {
        match self {
            Self::AddRoot { key, .. }
            | Self::RemoveRoot { key }
            | Self::Split { key, .. }
            | Self::Merge { key, .. } => key,
        }
    }
}

/// What takes a [`Step`] back. The nodes that it made stay, unused.
enum Undo {
    State { index: u32, state: State },
    Root { position: [i32; 3], root: Option<u32> },
}

impl LevelCover {
    /// The way from this cover to another: changes to be made one after the other. After each of them, the cover keeps
    /// what a [`LevelCover`] promises. Most change a single chunk. `None` if the two have different numbers of levels.
    ///
    /// Edits may have made chunks empty, or not empty any more: such leaves are both removed and added. The extent must be
    /// the same.
    pub fn changes_to(&self, target: &Self) -> Option<Vec<LevelChange>> {
        if self.top != target.top {
            return None;
        }
        let (mut cover, mut changes) = (self.clone(), Vec::new());
        loop {
            let steps = cover.steps_to(target);
            if steps.is_empty() {
                return Some(changes);
            }
            let made = changes.len();
            changes.extend(steps.into_iter().filter_map(|step| cover.try_steps(&[step])));
            if changes.len() == made {
                // Each step alone would leave a cover that does not fit; all of them together do.
                changes.extend(cover.all_at_once(target));
                return Some(changes);
            }
        }
    }

    /// Makes a change.
    pub fn apply(&mut self, change: &LevelChange) {
        for step in &change.steps {
            self.make(*step);
        }
        self.compact();
    }

    /// The next steps towards another cover, each for itself.
    fn steps_to(&self, target: &Self) -> Vec<Step> {
        let mut steps = Vec::new();
        for (position, &root) in &target.roots {
            match self.roots.get(position) {
                Some(&own) => self.steps_below(own, target, root, &mut steps),
                None => {
                    let Node { key, state } = target.nodes[root as usize];
                    steps.push(Step::AddRoot { key, is_empty: matches!(state, State::Empty) });
                }
            }
        }
        let leaving = self.roots.iter().filter(|(position, _)| !target.roots.contains_key(*position));
        steps.extend(leaving.map(|(_, &root)| Step::RemoveRoot { key: self.nodes[root as usize].key }));
        steps
    }

    fn steps_below(&self, own: u32, target: &Self, other: u32, steps: &mut Vec<Step>) {
        let (node, wanted) = (self.nodes[own as usize], target.nodes[other as usize]);
        match (node.state, wanted.state) {
            (State::Split { first }, State::Split { first: other }) => {
                (0..8).for_each(|child| self.steps_below(first + child, target, other + child, steps));
            }
            (State::Split { .. }, state) => self.merges_below(own, matches!(state, State::Empty), steps),
            (_, State::Split { first }) => {
                let bits = |is: fn(State) -> bool| {
                    (0..8)
                        .filter(|&child| is(target.nodes[(first + child) as usize].state))
                        .map(|child| 1u8 << child)
                        .sum()
                };
                let exist = bits(|state| !matches!(state, State::Nowhere));
                steps.push(Step::Split { key: node.key, exist, empty: bits(|state| matches!(state, State::Empty)) });
            }
            (State::Leaf, State::Empty) => steps.push(Step::Merge { key: node.key, is_empty: true }),
            (State::Empty, State::Leaf) => steps.push(Step::Merge { key: node.key, is_empty: false }),
            _ => {}
        }
    }

    /// The deepest merges that a merge of this node waits for.
    fn merges_below(&self, own: u32, is_empty: bool, steps: &mut Vec<Step>) {
        let node = self.nodes[own as usize];
        let State::Split { first } = node.state else { return };
        let before = steps.len();
        // A chunk that is split is not empty.
        (first..first + 8).for_each(|child| self.merges_below(child, false, steps));
        if steps.len() == before {
            steps.push(Step::Merge { key: node.key, is_empty });
        }
    }

    /// Makes steps, if the cover then fits, and says what they change. Otherwise the cover stays as it is.
    fn try_steps(&mut self, steps: &[Step]) -> Option<LevelChange> {
        let regions: Vec<Region> = steps.iter().map(|step| step.key().region()).collect();
        let before = self.leaves_touching(&regions);
        let finer: Vec<FinerNeighbours> = before.iter().map(|(leaf, _)| self.finer_neighbours(*leaf)).collect();
        let undo: Vec<Undo> = steps.iter().filter_map(|step| self.make(*step)).collect();
        let after = self.leaves_touching(&regions);
        if !after.iter().all(|&(leaf, is_empty)| is_empty || fits(self, leaf)) {
            undo.into_iter().rev().for_each(|undo| self.take_back(undo));
            return None;
        }
        let mut change = LevelChange { steps: steps.into(), ..LevelChange::default() };
        for ((leaf, is_empty), finer) in before.iter().zip(finer) {
            if after.binary_search(&(*leaf, *is_empty)).is_err() {
                change.removed.push(*leaf);
            } else if !is_empty && self.finer_neighbours(*leaf) != finer {
                change.remeshed.push(*leaf);
            }
        }
        change.added = after.into_iter().filter(|leaf| before.binary_search(leaf).is_err()).collect();
        Some(change)
    }

    /// All that is left on the way to another cover, as one change.
    pub(super) fn all_at_once(&mut self, target: &Self) -> Option<LevelChange> {
        let (mut cover, mut steps) = (self.clone(), Vec::new());
        loop {
            let next = cover.steps_to(target);
            if next.is_empty() {
                break;
            }
            next.iter().for_each(|step| _ = cover.make(*step));
            steps.extend(next);
        }
        self.try_steps(&steps)
    }

    /// Makes one step, and says how to take it back; `None` if the cover has no such node.
    fn make(&mut self, step: Step) -> Option<Undo> {
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

    fn take_back(&mut self, undo: Undo) {
        match undo {
            Undo::State { index, state } => self.nodes[index as usize].state = state,
            Undo::Root { position, root: Some(root) } => _ = self.roots.insert(position, root),
            Undo::Root { position, root: None } => _ = self.roots.remove(&position),
        }
    }

    /// The leaves in some regions and those that touch them, in order, and whether each is empty.
    pub(super) fn leaves_touching(&self, regions: &[Region]) -> Vec<(LeafKey, bool)> {
        let mut found = Vec::new();
        for region in regions {
            let roots = region.grown(1, 1);
            let roots = Region::new(roots.min.map(|v| v >> self.top), roots.max.map(|v| ((v - 1) >> self.top) + 1));
            let mut to_visit: Vec<u32> =
                roots.points().filter_map(|position| self.roots.get(&position).copied()).collect();
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
fn touch(a: &Region, b: &Region) -> bool {
    (0..3).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
}
