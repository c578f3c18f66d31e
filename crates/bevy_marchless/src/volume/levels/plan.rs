//! [`Plan`]: the way from the shown cover to the one that viewers ask for, computed in a job.

use core::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

use bevy_platform::collections::HashMap;
use marchless::{LeafKey, LevelChange, LevelCover, LevelError, LevelSettings, LevelViewer, Region};

use super::{Levels, Surfaces, finest, has_filled};
use crate::jobs::{Results, Ticket, new_number};
use crate::volume::Heart;

/// The most changes that are planned at once.
const MOST: usize = 96;
/// The most meshes of a change, as far as that can be; and where nothing is drawn yet, so that leaves are meshed less
/// often.
const MESHES: usize = 24;
const MESHES_AT_FIRST: usize = 96;

/// A job that computes a plan.
pub(crate) struct PlanJob {
    pub(super) number: u64,
    pub(super) viewers: Vec<LevelViewer>,
    pub(super) settings: LevelSettings,
    pub(super) shown: Arc<LevelCover>,
    /// The changes under way, in order.
    pub(super) running: Vec<(u64, Arc<LevelChange>)>,
    pub(super) former: Option<Arc<LevelCover>>,
    pub(super) surfaces: Arc<Surfaces>,
}

/// The result of a [`PlanJob`].
pub(crate) struct Planned {
    pub(super) number: u64,
    pub(super) result: Result<Plan, LevelError>,
}

/// Changes that lead to another cover. One that overlaps another is made after it; otherwise, the most urgent is made
/// first.
#[derive(Default)]
pub(crate) struct Plan {
    pub(super) target: Option<Arc<LevelCover>>,
    changes: Vec<PlannedChange>,
    /// The changes that may start: urgency and index.
    ready: BinaryHeap<Reverse<(u32, usize)>>,
    /// The number of changes that have not started.
    left: usize,
    /// Whether more changes follow once these are made.
    is_part: bool,
}

struct PlannedChange {
    change: Arc<LevelChange>,
    /// Lower comes sooner.
    urgency: u32,
    /// The changes under way that it comes after.
    after: Vec<u64>,
    /// The number of changes that have to start before.
    waits: usize,
    /// The changes that come after it.
    next: Vec<usize>,
    has_started: bool,
    is_withdrawn: bool,
}

impl PlanJob {
    /// Computes the plan, on any thread.
    pub(crate) fn run(self) -> Planned {
        Planned { number: self.number, result: self.plan() }
    }

    fn plan(&self) -> Result<Plan, LevelError> {
        let Self { viewers, settings, shown, running, former, surfaces, .. } = self;
        let mut from = LevelCover::clone(shown);
        running.iter().for_each(|(_, change)| from.apply(change));
        let target = LevelCover::new(viewers, settings, former.as_deref(), |leaf| surfaces.is_empty(leaf))?;
        let meshes = if from.leaves().next().is_none() { MESHES_AT_FIRST } else { MESHES };
        let far = 64.0 * settings.falloff;
        let of = |leaf: LeafKey| {
            let urgency = urgency(viewers, leaf);
            if target.is_split(leaf) { urgency } else { urgency_of_merge(urgency, far) }
        };
        // Both have the same number of levels.
        let first = from.first_changes_to(&target, MOST, meshes, of);
        let (changes, is_whole) = first.unwrap_or_default();
        let mut plan =
            Plan { left: changes.len(), is_part: !is_whole, target: Some(Arc::new(target)), ..Plan::default() };
        let mut near = Near::new(settings.levels);
        for (id, change) in running {
            near.add(change, Owner::Running(*id));
        }
        for change in changes {
            let (index, change) = (plan.changes.len(), Arc::new(change));
            let (mut after, mut waits) = (Vec::new(), 0);
            for owner in near.overlapping(&change) {
                match owner {
                    Owner::Running(id) => after.push(id),
                    Owner::Planned(before) => {
                        plan.changes[before].next.push(index);
                        waits += 1;
                    }
                }
            }
            let leaves = change.added.iter().map(|(leaf, _)| *leaf).chain(change.removed.iter().copied());
            let urgency = leaves.map(|leaf| urgency(viewers, leaf)).min().unwrap_or(0);
            let is_merge = change.removed.len() > change.added.len();
            let urgency = if is_merge { urgency_of_merge(urgency, far) } else { urgency };
            if waits == 0 {
                plan.ready.push(Reverse((urgency, index)));
            }
            near.add(&change, Owner::Planned(index));
            let next = Vec::new();
            let (has_started, is_withdrawn) = (false, false);
            plan.changes.push(PlannedChange { change, urgency, after, waits, next, has_started, is_withdrawn });
        }
        Ok(plan)
    }
}

impl Plan {
    /// The number of changes that have not started.
    pub(super) const fn left(&self) -> usize {
        self.left
    }

    /// Whether more changes are to be planned. `is_outdated`: whether viewers have moved.
    pub(super) const fn is_short(&self, is_outdated: bool) -> bool {
        (self.is_part || is_outdated) && self.left < MOST / 4
    }

    /// Whether all changes are planned and have started.
    pub(super) const fn is_done(&self) -> bool {
        !self.is_part && self.left == 0
    }

    /// Drops the changes that are not to be made any more, and those that come after them; another plan has to follow.
    pub(super) fn withdraw(&mut self, is_out_of_date: impl Fn(&LevelChange) -> bool) {
        // Those that come after a change stand behind it in the list.
        for index in 0..self.changes.len() {
            let planned = &mut self.changes[index];
            if planned.has_started || !(planned.is_withdrawn || is_out_of_date(&planned.change)) {
                continue;
            }
            (planned.has_started, planned.is_withdrawn) = (true, true);
            (self.left, self.is_part) = (self.left - 1, true);
            for next in core::mem::take(&mut planned.next) {
                self.changes[next].is_withdrawn = true;
            }
        }
        let changes = &self.changes;
        self.ready.retain(|Reverse((_, index))| !changes[*index].has_started);
    }

    /// The leaves with a surface that changes still to be started will add.
    pub(super) fn leaves_to_come(&self) -> usize {
        let to_come = self.changes.iter().filter(|planned| !planned.has_started);
        to_come.map(|planned| planned.change.added.iter().filter(|(_, is_empty)| !is_empty).count()).sum()
    }

    pub(super) fn has_ready(&self) -> bool {
        !self.ready.is_empty()
    }

    /// Starts the most urgent change that may start, under this number. Returns it, and the changes under way that it
    /// comes after; some of them may have been shown since.
    pub(super) fn start_next(&mut self, id: u64) -> Option<(Arc<LevelChange>, Vec<u64>)> {
        let Reverse((_, index)) = self.ready.pop()?;
        self.left -= 1;
        let planned = &mut self.changes[index];
        planned.has_started = true;
        let (change, after, next) =
            (planned.change.clone(), core::mem::take(&mut planned.after), core::mem::take(&mut planned.next));
        for index in next {
            let planned = &mut self.changes[index];
            planned.after.push(id);
            planned.waits -= 1;
            // It may have been withdrawn while it waited.
            if planned.waits == 0 && !planned.has_started {
                self.ready.push(Reverse((planned.urgency, index)));
            }
        }
        Some((change, after))
    }
}

impl Heart {
    /// Whether a plan is to be computed.
    pub(crate) fn has_to_plan(&self) -> bool {
        // While viewers move, what was planned is still nearly right.
        let is_due = |levels: &Levels| levels.has_jumped || levels.plan.is_short(levels.is_outdated);
        self.levels.as_ref().is_some_and(|levels| levels.planning.is_none() && is_due(levels))
    }

    /// Requests a plan. `start` starts the job, with the queue for its result.
    pub(crate) fn start_plan(&mut self, start: impl FnOnce(PlanJob, Results<Planned>) -> Ticket) {
        let Some(levels) = &mut self.levels else { return };
        if core::mem::take(&mut levels.has_jumped) {
            let gone = levels.withdraw(|running| running.meshing.is_none());
            let left: Vec<_> = gone.iter().flat_map(|change| finest(change)).collect();
            levels.leave_finest(&left, false);
            self.leaving_around(&left);
        }
        let Some(levels) = &mut self.levels else { return };
        let number = new_number();
        let job = PlanJob {
            number,
            viewers: levels.viewers(),
            settings: levels.settings,
            shown: levels.shown.clone(),
            running: levels.running.iter().map(|(id, running)| (*id, running.change.clone())).collect(),
            former: levels.target.clone(),
            surfaces: levels.surfaces.clone(),
        };
        levels.since.clear();
        levels.is_outdated = false;
        levels.planned_for.clone_from(&levels.viewers);
        // What was planned so far ends here, so that the new plan begins where it did.
        levels.plan = Plan::default();
        levels.planning = Some((number, start(job, levels.planned.clone())));
    }

    /// Takes in a plan, if one has been computed.
    pub(crate) fn take_plan(&mut self) {
        let Some(levels) = &mut self.levels else { return };
        for planned in levels.planned.take() {
            if levels.planning.as_ref().is_none_or(|(number, _)| *number != planned.number) {
                continue;
            }
            levels.planning = None;
            match planned.result {
                Ok(plan) => {
                    levels.has_too_many = false;
                    levels.target.clone_from(&plan.target);
                    levels.plan = plan;
                    let Levels { plan, since, surfaces, .. } = levels;
                    let is_past = |change: &LevelChange| since.iter().any(|made| made.overlaps(change));
                    plan.withdraw(|change| is_past(change) || has_filled(change, surfaces));
                }
                Err(error) => {
                    if !core::mem::replace(&mut levels.has_too_many, true) {
                        bevy_log::warn!("the leaves of a terrain stay as they are: {error}");
                    }
                }
            }
        }
    }
}

/// The urgency of a leaf, lower comes first: near leaves first, and large ones before small ones as near.
fn urgency(viewers: &[LevelViewer], leaf: LeafKey) -> u32 {
    let (Region { min, max }, width) = (leaf.region(), f64::from(1u32 << leaf.level));
    let distance = |viewer: &LevelViewer| {
        let beyond = |axis: usize| {
            let place = viewer.position[axis];
            place - place.clamp(min[axis].into(), max[axis].into())
        };
        (0..3).map(|axis| beyond(axis) * beyond(axis)).sum::<f64>()
    };
    let nearest = viewers.iter().map(distance).fold(f64::INFINITY, f64::min).sqrt();
    (64.0 * nearest / width) as u32
}

/// The urgency of a merge: the farther behind viewers, the longer it is due. But what is near them comes first. `far`:
/// the urgency at which leaves are split.
fn urgency_of_merge(urgency: u32, far: f64) -> u32 {
    (far * far / f64::from(urgency).max(1.0)).clamp(0.67 * far, far) as u32
}

/// A change under way, or one that is planned.
#[derive(Clone, Copy)]
enum Owner {
    Running(u64),
    Planned(usize),
}

/// Changes by the chunks of the coarsest level that they lie in.
struct Near {
    shift: u8,
    changes: Vec<(Arc<LevelChange>, Region, Owner)>,
    cells: HashMap<[i32; 3], Vec<usize>>,
}

impl Near {
    fn new(levels: u8) -> Self {
        Self { shift: levels - 1, changes: Vec::new(), cells: HashMap::default() }
    }

    /// The chunks of the coarsest level that a change lies in or touches.
    fn cells_of(&self, Region { min, max }: Region) -> Region {
        let end = |v: i32, step: i32| v.saturating_add(step) >> self.shift;
        Region::new(min.map(|v| end(v, -1)), max.map(|v| end(v, 0).saturating_add(1)))
    }

    fn add(&mut self, change: &Arc<LevelChange>, owner: Owner) {
        let (index, region) = (self.changes.len(), change.region());
        self.changes.push((change.clone(), region, owner));
        for cell in self.cells_of(region).points() {
            self.cells.entry(cell).or_default().push(index);
        }
    }

    /// The changes that one overlaps.
    fn overlapping(&self, change: &LevelChange) -> Vec<Owner> {
        let region = change.region();
        let touches = |index: &usize| {
            let other = self.changes[*index].1;
            (0..3).all(|axis| region.min[axis] <= other.max[axis] && other.min[axis] <= region.max[axis])
        };
        let near = self.cells_of(region).points().filter_map(|cell| self.cells.get(&cell)).flatten();
        let mut near: Vec<usize> = near.copied().filter(touches).collect();
        near.sort_unstable();
        near.dedup();
        let overlaps = |index: &usize| self.changes[*index].0.overlaps(change);
        near.into_iter().filter(overlaps).map(|index| self.changes[index].2).collect()
    }
}
