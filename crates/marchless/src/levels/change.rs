//! [`LevelChange`]: from one cover to another, a few leaves at a time.

use alloc::{collections::BTreeMap, vec, vec::Vec};

use super::{
    LeafKey, LevelCover,
    balance::too_coarse,
    neighbour,
    tree::{Node, State},
};
use crate::{lattice::Region, mesher::FinerNeighbours};

/// The most steps of a change that grows, and how many steps beside it may not fit before it stays as it is.
const MOST_STEPS: usize = 24;
const MOST_FAILURES: usize = 5;
/// The most steps that are made together because one alone would not fit; as long as nothing fits, it is doubled, up to
/// [`MOST_TOGETHER_AT_LAST`].
const MOST_TOGETHER: usize = 4;
const MOST_TOGETHER_AT_LAST: usize = 128;

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
    fn then(&self, later: &Self) -> Self {
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
    fn meshes(&self) -> usize {
        self.added.iter().filter(|(_, is_empty)| !is_empty).count() + self.remeshed.len()
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

/// Steps that have been made, and how to take them back.
struct Made {
    change: LevelChange,
    undo: Vec<Undo>,
    /// The number of nodes before.
    nodes: usize,
}

/// Why steps cannot be made.
enum Misfit {
    /// This leaf would be too coarse for what is beside it.
    TooCoarse(LeafKey),
    /// These two leaves and finer ones would alternate at the edge that they share.
    Alternate([LeafKey; 2]),
}

/// What takes a [`Step`] back.
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
        let (changes, _) = self.first_changes_to(target, usize::MAX, 0, |_| 0)?;
        Some(changes)
    }

    /// The first `most` changes of a [way](Self::changes_to) to another cover, and whether they lead all the way there.
    /// `urgency`: of splitting a chunk, or of putting it together; of the changes that may be made, the one with the
    /// lowest number comes first, and before all of them, chunks of the coarsest level come into view.
    ///
    /// Changes beside each other become one while it has at most `meshes` leaves to be meshed; so a leaf between them is
    /// meshed once. With 0, all stay apart. A change that cannot be made in parts may have more.
    pub fn first_changes_to(
        &self,
        target: &Self,
        most: usize,
        meshes: usize,
        urgency: impl Fn(LeafKey) -> u32,
    ) -> Option<(Vec<LevelChange>, bool)> {
        if self.top != target.top {
            return None;
        }
        let (mut cover, mut changes) = (self.clone(), Vec::new());
        let mut together = MOST_TOGETHER;
        loop {
            let made = changes.len();
            // What is not there at all comes first.
            let of = |step: Step| if matches!(step, Step::AddRoot { .. }) { 0 } else { urgency(step.key()) };
            let by_urgency = |step: Step| ((of(step), step.key()), step);
            let mut queue: BTreeMap<_, _> = cover.steps_to(target, None).into_iter().map(by_urgency).collect();
            if queue.is_empty() || changes.len() >= most {
                return Some((changes, queue.is_empty()));
            }
            while changes.len() < most
                && let Some(((urgent, _), step)) = queue.pop_first()
            {
                // An earlier change may have made the step already.
                if !cover.lacks(step) {
                    continue;
                }
                match cover.try_step(step, target, together) {
                    Ok(change) => {
                        let change = cover.grow(change, target, meshes, &urgency);
                        // Beside it, others may have become possible.
                        queue.extend(cover.steps_to(target, Some(&change.region())).into_iter().map(by_urgency));
                        changes.push(change);
                    }
                    Err(Some(first)) => _ = queue.insert((urgent, first.key()), first),
                    Err(None) => {}
                }
            }
            if changes.len() > made {
                together = MOST_TOGETHER;
            } else if together < MOST_TOGETHER_AT_LAST {
                together *= 2;
            } else {
                // Each step would leave a cover that does not fit; all of them together do.
                changes.extend(cover.all_at_once(target));
                return Some((changes, true));
            }
        }
    }

    /// Makes steps beside a change that has been made, as long as few leaves are to be meshed. Those of its level come
    /// first, as they have the most neighbours in common with it.
    fn grow(
        &mut self,
        mut change: LevelChange,
        target: &Self,
        meshes: usize,
        urgency: &impl Fn(LeafKey) -> u32,
    ) -> LevelChange {
        let mut tried: Vec<LeafKey> = change.steps.iter().map(|step| step.key()).collect();
        let level = tried[0].level;
        let mut failures = 0;
        while failures < MOST_FAILURES && change.meshes() < meshes && change.steps.len() < MOST_STEPS {
            let regions = change.steps.iter().map(|step| step.key().region());
            let near = regions.reduce(|a, b| a.union(&b));
            let mut steps = self.steps_to(target, near.as_ref());
            steps.retain(|step| !tried.contains(&step.key()));
            let order = |step: &Step| (step.key().level.abs_diff(level), urgency(step.key()));
            let Some(next) = steps.into_iter().min_by_key(order) else { break };
            tried.push(next.key());
            let Ok(made) = self.try_steps(&[next]) else {
                failures += 1;
                continue;
            };
            let both = change.then(&made.change);
            if both.meshes() <= meshes {
                change = both;
            } else {
                failures += 1;
                self.take_back(made);
            }
        }
        change
    }

    /// Whether a step changes anything.
    fn lacks(&self, step: Step) -> bool {
        let state = |key| self.index_over(key).map(|index| self.nodes[index as usize]).filter(|node| node.key == key);
        match step {
            Step::AddRoot { key, .. } => !self.roots.contains_key(&key.position),
            Step::RemoveRoot { key } => self.roots.contains_key(&key.position),
            Step::Split { key, .. } => state(key).is_some_and(|node| !matches!(node.state, State::Split { .. })),
            Step::Merge { key, is_empty } => match state(key).map(|node| node.state) {
                Some(State::Split { first }) => {
                    (first..first + 8).all(|child| !matches!(self.nodes[child as usize].state, State::Split { .. }))
                }
                Some(State::Leaf) => is_empty,
                Some(State::Empty) => !is_empty,
                _ => false,
            },
        }
    }

    /// Makes a change.
    pub fn apply(&mut self, change: &LevelChange) {
        for step in &change.steps {
            self.make(*step);
        }
        self.compact();
    }

    /// The next steps towards another cover, each for itself; those of chunks that touch a box.
    fn steps_to(&self, target: &Self, near: Option<&Region>) -> Vec<Step> {
        let mut steps = Vec::new();
        let mut visit = |position: [i32; 3]| match (self.roots.get(&position), target.roots.get(&position)) {
            (Some(&own), Some(&other)) => self.steps_below(own, target, other, near, &mut steps),
            (None, Some(&other)) => {
                let Node { key, state } = target.nodes[other as usize];
                steps.push(Step::AddRoot { key, is_empty: matches!(state, State::Empty) });
            }
            (Some(&own), None) => steps.push(Step::RemoveRoot { key: self.nodes[own as usize].key }),
            (None, None) => {}
        };
        match near {
            Some(near) => self.roots_near(near).points().for_each(visit),
            None => {
                target.roots.keys().for_each(|position| visit(*position));
                let leaving = self.roots.keys().filter(|position| !target.roots.contains_key(*position));
                leaving.for_each(|position| visit(*position));
            }
        }
        steps
    }

    fn steps_below(&self, own: u32, target: &Self, other: u32, near: Option<&Region>, steps: &mut Vec<Step>) {
        let (node, wanted) = (self.nodes[own as usize], target.nodes[other as usize]);
        if near.is_some_and(|near| !touch(&node.key.region(), near)) {
            return;
        }
        match (node.state, wanted.state) {
            (State::Split { first }, State::Split { first: other }) => {
                (0..8).for_each(|child| self.steps_below(first + child, target, other + child, near, steps));
            }
            (State::Split { .. }, state) => self.merges_below(own, matches!(state, State::Empty), steps),
            (_, State::Split { first }) => steps.push(target.split_step(first as usize)),
            (State::Leaf, State::Empty) => steps.push(Step::Merge { key: node.key, is_empty: true }),
            (State::Empty, State::Leaf) => steps.push(Step::Merge { key: node.key, is_empty: false }),
            _ => {}
        }
    }

    /// The step that splits a leaf as in this cover; `None` if it is not split here.
    fn split_of(&self, leaf: LeafKey) -> Option<Step> {
        let node = self.nodes[self.index_over(leaf)? as usize];
        match node.state {
            State::Split { first } if node.key == leaf => Some(self.split_step(first as usize)),
            _ => None,
        }
    }

    /// The step that makes eight children, of which the first has this index.
    fn split_step(&self, first: usize) -> Step {
        let children = &self.nodes[first..first + 8];
        let bits =
            |is: fn(State) -> bool| (0..8).filter(|&child| is(children[child].state)).map(|child| 1 << child).sum();
        let exist = bits(|state| !matches!(state, State::Nowhere));
        let empty = bits(|state| matches!(state, State::Empty));
        Step::Split { key: children[0].key.parent(), exist, empty }
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

    /// Makes steps, if the cover then fits. Otherwise the cover stays as it is, and the first misfit is returned.
    fn try_steps(&mut self, steps: &[Step]) -> Result<Made, Misfit> {
        let regions: Vec<Region> = steps.iter().map(|step| step.key().region()).collect();
        let before = self.leaves_touching(&regions);
        let finer_of = |leaf, is_empty| if is_empty { FinerNeighbours::NONE } else { self.finer_neighbours(leaf) };
        let finer: Vec<FinerNeighbours> = before.iter().map(|&(leaf, is_empty)| finer_of(leaf, is_empty)).collect();
        let nodes = self.nodes.len();
        let undo: Vec<Undo> = steps.iter().filter_map(|step| self.make(*step)).collect();
        let after = self.leaves_touching(&regions);
        let mut change = LevelChange { steps: steps.into(), ..LevelChange::default() };
        change.added = after.iter().filter(|leaf| before.binary_search(leaf).is_err()).copied().collect();
        let coarsest = change.added.iter().map(|(leaf, _)| leaf.level).max().unwrap_or(0);
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
            }
        }
        let gone = before.into_iter().filter(|leaf| after.binary_search(leaf).is_err());
        change.removed = gone.map(|(leaf, _)| leaf).collect();
        let made = Made { change, undo, nodes };
        match misfit {
            None => Ok(made),
            Some(misfit) => {
                self.take_back(made);
                Err(misfit)
            }
        }
    }

    /// Makes a step, together with those without which leaves would alternate, at most so many. Otherwise, returns the
    /// step that has to be made first, if there is one.
    fn try_step(&mut self, step: Step, target: &Self, most: usize) -> Result<LevelChange, Option<Step>> {
        let mut steps = vec![step];
        loop {
            let misfit = match self.try_steps(&steps) {
                Ok(made) => return Ok(made.change),
                Err(misfit) => misfit,
            };
            let is_new = |step: &Step| steps.iter().all(|other| other.key() != step.key());
            let next = match misfit {
                Misfit::TooCoarse(leaf) => {
                    let is_there = self.leaf_at(leaf.region().min) == Some(leaf);
                    if is_there {
                        return Err(target.split_of(leaf));
                    }
                    // The steps themselves have made it.
                    target.split_of(leaf).filter(is_new)
                }
                Misfit::Alternate(coarse) => {
                    let split = coarse.into_iter().filter_map(|leaf| target.split_of(leaf)).find(is_new);
                    split.or_else(|| self.merge_beside(coarse, target, is_new))
                }
            };
            match next {
                Some(next) if steps.len() < most => steps.push(next),
                _ => return Err(None),
            }
        }
    }

    /// A merge in one of the finer places at an edge with two coarse leaves.
    fn merge_beside(&self, coarse: [LeafKey; 2], target: &Self, is_new: impl Fn(&Step) -> bool) -> Option<Step> {
        let [leaf, across] = coarse;
        (0..3).filter(|&axis| leaf.position[axis] != across.position[axis]).find_map(|axis| {
            let mut finer = leaf;
            finer.position[axis] = across.position[axis];
            let place = finer.region();
            let is_inside = |key: LeafKey| key.level <= finer.level && place.contains(key.region().min);
            let is_merge = |step: &Step| matches!(step, Step::Merge { .. }) && is_inside(step.key()) && is_new(step);
            self.steps_to(target, Some(&place)).into_iter().find(is_merge)
        })
    }

    /// Takes the latest steps back.
    fn take_back(&mut self, made: Made) {
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

    /// All that is left on the way to another cover, as one change.
    pub(super) fn all_at_once(&mut self, target: &Self) -> Option<LevelChange> {
        let (mut cover, mut steps) = (self.clone(), Vec::new());
        loop {
            let next = cover.steps_to(target, None);
            if next.is_empty() {
                break;
            }
            next.iter().for_each(|step| _ = cover.make(*step));
            steps.extend(next);
        }
        Some(self.try_steps(&steps).ok()?.change)
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

    /// The chunks of the coarsest level that a box of chunks overlaps or touches.
    fn roots_near(&self, chunks: &Region) -> Region {
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
