//! [`Plan`]: the way from the shown cover to the one that viewers ask for, computed in a job.

use core::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;

use bevy_platform::collections::HashMap;
use marchless::{LeafKey, LevelChange, LevelCover, LevelError, LevelSettings, LevelViewer};

use super::Surfaces;

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

/// Changes that lead to another cover. Those that overlap keep their order; of the others, the most urgent comes first.
#[derive(Default)]
pub(crate) struct Plan {
    pub(super) target: Option<Arc<LevelCover>>,
    changes: Vec<PlannedChange>,
    /// The changes that may start: urgency and index.
    ready: BinaryHeap<Reverse<(u32, usize)>>,
    /// The changes that wait for each change under way.
    after_running: BTreeMap<u64, Vec<usize>>,
    left: usize,
}

struct PlannedChange {
    change: Arc<LevelChange>,
    /// Lower comes sooner.
    urgency: u32,
    /// The number of changes that it waits for.
    waits: usize,
    /// The changes that wait for it.
    next: Vec<usize>,
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
        // Both have the same number of levels.
        let changes = from.changes_to(&target).unwrap_or_default();
        let mut plan = Plan { left: changes.len(), target: Some(Arc::new(target)), ..Plan::default() };
        let mut near = Near::new(settings.levels);
        for (id, change) in running {
            near.add(change, Owner::Running(*id));
        }
        for change in changes {
            let (index, change) = (plan.changes.len(), Arc::new(change));
            let waits = near.overlapping(&change);
            for owner in &waits {
                match owner {
                    Owner::Running(id) => plan.after_running.entry(*id).or_default().push(index),
                    Owner::Planned(before) => plan.changes[*before].next.push(index),
                }
            }
            let urgency = urgency(viewers, &change);
            if waits.is_empty() {
                plan.ready.push(Reverse((urgency, index)));
            }
            near.add(&change, Owner::Planned(index));
            plan.changes.push(PlannedChange { change, urgency, waits: waits.len(), next: Vec::new() });
        }
        Ok(plan)
    }
}

impl Plan {
    /// The number of changes that have not started.
    pub(super) const fn left(&self) -> usize {
        self.left
    }

    /// The leaves with a surface that changes still to be started will add.
    pub(super) fn leaves_to_come(&self) -> usize {
        let started = |change: &PlannedChange| change.waits == usize::MAX;
        let to_come = self.changes.iter().filter(|change| !started(change));
        to_come.map(|planned| planned.change.added.iter().filter(|(_, is_empty)| !is_empty).count()).sum()
    }

    pub(super) fn has_ready(&self) -> bool {
        !self.ready.is_empty()
    }

    /// Takes the most urgent change that may start: the change, its urgency, and those that wait for it.
    pub(super) fn start_next(&mut self) -> Option<(Arc<LevelChange>, u32, Vec<usize>)> {
        let Reverse((urgency, index)) = self.ready.pop()?;
        self.left -= 1;
        let planned = &mut self.changes[index];
        planned.waits = usize::MAX;
        Some((planned.change.clone(), urgency, core::mem::take(&mut planned.next)))
    }

    /// The changes that wait for each change that was under way when the plan was made.
    pub(super) fn take_after_running(&mut self) -> BTreeMap<u64, Vec<usize>> {
        core::mem::take(&mut self.after_running)
    }

    /// Notes that a change is shown that others waited for.
    pub(super) fn shown(&mut self, next: Vec<usize>) {
        for index in next {
            let planned = &mut self.changes[index];
            planned.waits -= 1;
            if planned.waits == 0 {
                self.ready.push(Reverse((planned.urgency, index)));
            }
        }
    }
}

/// Large chunks that look small from far away come last.
fn urgency(viewers: &[LevelViewer], change: &LevelChange) -> u32 {
    let leaves = change.added.iter().map(|(leaf, _)| *leaf).chain(change.removed.iter().copied());
    let distance = |leaf: LeafKey| {
        let Region { min, max } = leaf.region();
        let width = f64::from(1u32 << leaf.level);
        let of = |viewer: &LevelViewer| {
            let beyond = |axis: usize| {
                let place = viewer.position[axis];
                place - place.clamp(min[axis].into(), max[axis].into())
            };
            (0..3).map(|axis| beyond(axis) * beyond(axis)).sum::<f64>()
        };
        viewers.iter().map(of).fold(f64::INFINITY, f64::min).sqrt() / width
    };
    let nearest = leaves.map(distance).fold(f64::INFINITY, f64::min);
    (nearest * 64.0) as u32
}

use marchless::Region;

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Owner {
    Running(u64),
    Planned(usize),
}

/// Changes by the chunks of the coarsest level that they lie in.
struct Near {
    shift: u8,
    changes: Vec<(Arc<LevelChange>, Owner)>,
    cells: HashMap<[i32; 3], Vec<usize>>,
}

impl Near {
    fn new(levels: u8) -> Self {
        Self { shift: levels - 1, changes: Vec::new(), cells: HashMap::default() }
    }

    /// The chunks of the coarsest level that a change lies in or touches.
    fn cells_of(&self, change: &LevelChange) -> Region {
        let Region { min, max } = change.region();
        let end = |v: i32, step: i32| v.saturating_add(step) >> self.shift;
        Region::new(min.map(|v| end(v, -1)), max.map(|v| end(v, 0).saturating_add(1)))
    }

    fn add(&mut self, change: &Arc<LevelChange>, owner: Owner) {
        let index = self.changes.len();
        self.changes.push((change.clone(), owner));
        for cell in self.cells_of(change).points() {
            self.cells.entry(cell).or_default().push(index);
        }
    }

    /// The changes that one overlaps.
    fn overlapping(&self, change: &LevelChange) -> Vec<Owner> {
        let near = self.cells_of(change).points().filter_map(|cell| self.cells.get(&cell)).flatten();
        let mut near: Vec<usize> = near.copied().collect();
        near.sort_unstable();
        near.dedup();
        let overlaps = |index: &usize| self.changes[*index].0.overlaps(change);
        near.into_iter().filter(overlaps).map(|index| self.changes[index].1).collect()
    }
}
