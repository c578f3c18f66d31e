//! The way from one cover to another: which [`LevelChange`]s, in which order.

use alloc::{collections::BTreeMap, vec, vec::Vec};

use super::{
    LeafKey, LevelChange, LevelCover,
    change::{Misfit, Step, touch},
    tree::{Node, State},
};
use crate::lattice::Region;

/// The most steps of a change that grows, and how many steps beside it may not fit before it stays as it is.
const MOST_STEPS: usize = 24;
const MOST_FAILURES: usize = 5;
/// The most steps that are made together because one alone would not fit; as long as nothing fits, it is doubled, up to
/// [`MOST_TOGETHER_AT_LAST`].
const MOST_TOGETHER: usize = 4;
const MOST_TOGETHER_AT_LAST: usize = 128;

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
}
