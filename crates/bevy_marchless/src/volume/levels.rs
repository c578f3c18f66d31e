//! [`Levels`]: the leaves of a terrain with several levels of detail, and how they change.
//!
//! The *shown* cover says which leaves are drawn. When viewers have moved, a job computes the cover that they ask for
//! and a [`Plan`] of the way there. Each of its changes replaces a few leaves by others, in one update, with every
//! neighbour whose border changes. Changes that overlap wait for each other.
//!
//! An edit is shown in the leaves that are drawn. A change under way meshes what the edit touched again when it is
//! shown, and waits while an edit of its leaves is being meshed. An edit in a box that was empty splits it in the same
//! update.

mod cache;
mod plan;
mod surfaces;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_platform::collections::HashMap;
use marchless::{LeafKey, LevelChange, LevelCover, LevelSettings, LevelViewer, Region};

use super::groups::ChunkMesh;
use super::input::{LaterCover, LeafInput, MeshInput};
use super::mesh::{Shown, is_uniform_around};
use super::{ChunkTable, Heart, SamplingSettings};
use crate::chunk::ChunkKey;
use crate::cover::{Coverage, Leaf, LeafState, Residency, View, ViewId};
use crate::jobs::{Results, Ticket, new_number};
use cache::CachedSource;
use plan::Plan;
pub(crate) use plan::{PlanJob, Planned};
use surfaces::Surfaces;

/// The most changes under way.
const MAX_RUNNING: usize = 48;
/// A viewer that has moved farther than this since the last plan makes what is planned useless. [Units: chunks]
const JUMP: f64 = 4.0;

/// How detail falls off with distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LevelDetail {
    /// The number of levels, 2 to 7.
    pub(crate) levels: u8,
    pub(crate) falloff: f64,
    pub(crate) hysteresis: f64,
}

/// The leaves of a terrain with several levels of detail.
pub(super) struct Levels {
    detail: LevelDetail,
    settings: LevelSettings,
    viewers: BTreeMap<ViewId, LevelViewer>,
    shown: Arc<LevelCover>,
    /// The latest cover that viewers asked for.
    target: Option<Arc<LevelCover>>,
    plan: Plan,
    /// The job that computes another plan.
    planning: Option<(u64, Ticket)>,
    /// The changes that edits have made since that plan was requested.
    since: Vec<Arc<LevelChange>>,
    planned: Results<Planned>,
    /// The viewers for whom the plan was made.
    planned_for: BTreeMap<ViewId, LevelViewer>,
    /// Whether viewers have moved since the plan was requested.
    is_outdated: bool,
    /// Whether what is planned is useless.
    has_jumped: bool,
    /// The changes under way, in the order in which they started.
    running: BTreeMap<u64, Running>,
    /// The leaves of the finest level with a surface: those drawn (`true`), and those to be drawn.
    finest: HashMap<[i32; 3], bool>,
    surfaces: Arc<Surfaces>,
    source: Arc<CachedSource>,
    /// The settings for which there would be too many leaves, if that has been reported.
    has_too_many: bool,
}

/// A change under way.
struct Running {
    change: Arc<LevelChange>,
    /// The changes that are to be shown before it.
    after: Vec<u64>,
    /// Whether it is to be shown in this update, as far as possible.
    is_urgent: bool,
    meshing: Option<Meshing>,
}

/// The meshes of a change.
struct Meshing {
    /// Tells results of earlier attempts.
    attempt: u64,
    cover: LaterCover,
    appearance: u64,
    members: usize,
    meshed: Vec<ChunkMesh>,
    /// The members that edits have changed since.
    stale: BTreeSet<ChunkKey>,
    tickets: Vec<Ticket>,
}

/// A mesh of a change of levels.
pub(crate) struct LevelMesh {
    change: u64,
    attempt: u64,
    pub(crate) meshed: ChunkMesh,
}

/// The meshes of a change that are to be made in jobs.
pub(crate) struct LevelJobs {
    pub(crate) change: u64,
    attempt: u64,
    pub(crate) inputs: Vec<(ChunkKey, MeshInput)>,
}

impl LevelJobs {
    /// The result of one of the jobs.
    pub(crate) const fn result(change: u64, attempt: u64, meshed: ChunkMesh) -> LevelMesh {
        LevelMesh { change, attempt, meshed }
    }

    pub(crate) const fn attempt(&self) -> u64 {
        self.attempt
    }
}

impl Running {
    /// The leaves that get a mesh.
    fn members(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        members(&self.change)
    }

    /// The new leaves of the finest level that may have a surface.
    fn finest(&self) -> impl Iterator<Item = [i32; 3]> + '_ {
        finest(&self.change)
    }

    fn is_meshed(&self) -> bool {
        self.meshing.as_ref().is_some_and(|meshing| meshing.meshed.len() == meshing.members)
    }
}

/// The leaves of a change that get a mesh.
fn members(change: &LevelChange) -> impl Iterator<Item = ChunkKey> + '_ {
    let added = change.added.iter().filter(|(_, is_empty)| !is_empty).map(|(leaf, _)| leaf);
    added.chain(&change.remeshed).map(|leaf| ChunkKey::from(*leaf))
}

/// Whether an edit has put a surface into a leaf that a change was to add without one.
fn has_filled(change: &LevelChange, surfaces: &Surfaces) -> bool {
    change.added.iter().any(|(leaf, is_empty)| *is_empty && !surfaces.is_empty(*leaf))
}

/// The new leaves of the finest level that may have a surface.
fn finest(change: &LevelChange) -> impl Iterator<Item = [i32; 3]> + '_ {
    change.added.iter().filter(|(leaf, is_empty)| leaf.level == 0 && !is_empty).map(|(leaf, _)| leaf.position)
}

impl Levels {
    /// `former`: of the same samples, before a change of the extent.
    fn new(detail: LevelDetail, sampling: &SamplingSettings, former: Option<&Self>) -> Self {
        let LevelDetail { levels, falloff, hysteresis } = detail;
        let kept = Region::new([0; 3], [0; 3]);
        let settings = LevelSettings { levels, falloff, hysteresis, extent: sampling.extent, kept };
        let planes = sampling.empty_grid().planes();
        let surfaces = match former {
            Some(former) => former.surfaces.with_planes(planes),
            None => Surfaces::new(sampling, planes),
        };
        let new_source = || Arc::new(CachedSource::new(sampling.source.clone()));
        let source = former.map_or_else(new_source, |former| former.source.clone());
        Self {
            detail,
            settings,
            viewers: BTreeMap::new(),
            shown: Arc::new(empty_cover(&settings)),
            target: None,
            plan: Plan::default(),
            planning: None,
            since: Vec::new(),
            planned: Results::default(),
            planned_for: BTreeMap::new(),
            is_outdated: false,
            has_jumped: false,
            running: BTreeMap::new(),
            finest: HashMap::default(),
            surfaces: Arc::new(surfaces),
            source,
            has_too_many: false,
        }
    }

    /// Changes a viewer, or the chunks that are kept without one.
    pub(super) fn set_view(&mut self, id: ViewId, view: Option<&View>) {
        match view {
            Some(view) if view.is_box() => self.settings.kept = view.chunks(),
            Some(view) => {
                let viewer = LevelViewer { position: view.range.middle(), distance: view.range.longest() };
                self.viewers.insert(id, viewer);
            }
            None if id.is_none() => self.settings.kept = Region::new([0; 3], [0; 3]),
            None => _ = self.viewers.remove(&id),
        }
        self.is_outdated = true;
        let is_near = |now: &LevelViewer, then: &LevelViewer| {
            let has_moved = |axis: usize| (now.position[axis] - then.position[axis]).abs() > JUMP;
            now.distance == then.distance && !(0..3).any(has_moved)
        };
        self.has_jumped |= match (self.viewers.get(&id), self.planned_for.get(&id)) {
            (Some(now), Some(then)) => !is_near(now, then),
            (now, then) => id.is_none() || now.is_some() || then.is_some(),
        };
    }

    /// The residency that a chunk of the finest level needs.
    pub(super) fn wanted(&self, position: [i32; 3]) -> Residency {
        if self.finest.get(&position) == Some(&true) {
            return Residency::Mesh;
        }
        let is_near = ChunkKey::finest(position).around().any(|near| self.finest.contains_key(&near.position));
        if is_near { Residency::Samples } else { Residency::Gone }
    }

    /// Whether the leaves are those that viewers ask for.
    pub(super) fn is_idle(&self) -> bool {
        !self.is_outdated && self.planning.is_none() && self.plan.is_done() && self.running.is_empty()
    }

    /// Whether changes may start, or be shown.
    pub(super) fn has_work(&self) -> bool {
        !self.running.is_empty() || self.plan.has_ready() || !self.planned.is_empty()
    }

    /// The number of meshes of changes under way and of those to come.
    pub(super) fn waiting_for_meshes(&self) -> usize {
        self.running.values().map(|running| running.members().count()).sum::<usize>() + self.plan.left()
    }

    /// The memory of the samples of coarser leaves, in bytes.
    pub(super) fn sample_bytes(&self) -> usize {
        self.source.bytes()
    }

    fn viewers(&self) -> Vec<LevelViewer> {
        self.viewers.values().copied().collect()
    }

    #[cfg(test)]
    pub(super) fn shown_cover(&self) -> &LevelCover {
        &self.shown
    }

    /// What the cover depends on.
    #[cfg(test)]
    pub(super) fn asked(&self) -> (Vec<LevelViewer>, LevelSettings) {
        (self.viewers(), self.settings)
    }

    #[cfg(test)]
    pub(super) fn is_empty(&self, leaf: LeafKey) -> bool {
        self.surfaces.is_empty(leaf)
    }

    /// The leaves that are drawn.
    pub(super) fn leaves(&self, table: &ChunkTable) -> impl Iterator<Item = Leaf> {
        self.shown.leaves().map(|(leaf, _)| {
            let state = table.leaf_state(leaf.into()).unwrap_or(LeafState::Empty);
            Leaf { level: leaf.level, position: leaf.position.into(), state }
        })
    }

    /// Whether the meshes of this leaf read any of these lattice points.
    fn reads(&self, key: ChunkKey, points: Region, cells: u32) -> bool {
        let cells = i64::from(cells);
        (0..3).all(|axis| {
            let low = i64::from(key.position[axis]) * cells;
            let [low, high] = [low - 1, low + cells + 2].map(|v| v << key.level);
            low < points.max[axis].into() && high > points.min[axis].into()
        })
    }

    /// The coarser leaves that are drawn and read these lattice points.
    fn drawn_readers(&self, points: Region, cells: u32) -> Vec<ChunkKey> {
        let chunk = |v: i32| v.div_euclid(cells as i32);
        let chunks = Region::new(points.min.map(chunk), points.max.map(|v| chunk(v - 1) + 1));
        // A reader touches the points' chunks, or reaches one point of its own level beyond itself.
        let reach = 1 << self.settings.levels;
        let reach = (reach / cells as i32 + 1).min(1 << 7);
        let leaves = self.shown.leaves_near(chunks.grown(reach as u32, reach as u32));
        let leaves = leaves.into_iter().filter(|(leaf, is_empty)| leaf.level > 0 && !is_empty);
        leaves.map(|(leaf, _)| leaf.into()).filter(|key| self.reads(*key, points, cells)).collect()
    }

    /// Takes in that chunks of the finest level are not drawn any more, or do not come with a change that was withdrawn.
    fn leave_finest(&mut self, positions: &[[i32; 3]], were_drawn: bool) {
        for position in positions {
            if !were_drawn && self.finest.get(position) == Some(&true) {
                continue;
            }
            if self.running.values().any(|running| running.finest().any(|coming| coming == *position)) {
                self.finest.insert(*position, false);
            } else {
                self.finest.remove(position);
            }
        }
    }

    /// A change under way, and those that are to be shown before it, in order.
    fn until(&self, id: u64) -> Vec<Arc<LevelChange>> {
        let mut all = BTreeMap::new();
        let mut to_visit = vec![id];
        while let Some(id) = to_visit.pop() {
            if let Some(running) = self.running.get(&id).filter(|_| !all.contains_key(&id)) {
                all.insert(id, running.change.clone());
                to_visit.extend(&running.after);
            }
        }
        all.into_values().collect()
    }

    /// Withdraws changes under way and all that would be shown after them.
    fn withdraw(&mut self, is_out_of_date: impl Fn(&Running) -> bool) -> Vec<Arc<LevelChange>> {
        let mut gone = BTreeSet::new();
        for (id, running) in &self.running {
            let is_gone = is_out_of_date(running) || running.after.iter().any(|before| gone.contains(before));
            if is_gone && !running.is_urgent {
                gone.insert(*id);
            }
        }
        gone.into_iter().filter_map(|id| self.running.remove(&id)).map(|running| running.change).collect()
    }

    /// Notes that edits have changed lattice points: meshes that were made before are out of date.
    fn note_edit(&mut self, points: Region, cells: u32) {
        let mut running = core::mem::take(&mut self.running);
        for running in running.values_mut() {
            let Running { change, meshing: Some(meshing), .. } = running else { continue };
            meshing.stale.extend(members(change).filter(|key| self.reads(*key, points, cells)));
        }
        self.running = running;
    }
}

/// A cover without leaves.
fn empty_cover(settings: &LevelSettings) -> LevelCover {
    LevelCover::new(&[], &LevelSettings { kept: Region::new([0; 3], [0; 3]), ..*settings }, None, |_| true)
        .expect("the settings have been checked")
}

impl Heart {
    /// Sets how detail falls off; `None`: there is one level. All leaves are drawn anew when that changes; edits stay.
    pub(crate) fn set_levels(&mut self, detail: Option<LevelDetail>) {
        if self.levels.as_ref().map(|levels| levels.detail) == detail {
            return;
        }
        let Some(sampling) = self.sampling_settings.clone() else { return };
        let views: Vec<(ViewId, View)> = self.cover.views().collect();
        self.drop_leaves();
        self.cover = Default::default();
        self.levels = detail.map(|detail| Levels::new(detail, &sampling, None));
        if let Some(levels) = &self.levels {
            self.samples.stamped_regions(|touched| _ = levels.surfaces.stamp(touched));
        }
        for (id, view) in views {
            self.set_view(id, Some(view));
        }
    }

    /// Begins anew after a change of the extent; edits stay.
    pub(super) fn restart_levels(&mut self) {
        let (Some(levels), Some(sampling)) = (&self.levels, &self.sampling_settings) else { return };
        let mut anew = Levels::new(levels.detail, sampling, Some(levels));
        anew.viewers.clone_from(&levels.viewers);
        (anew.settings.kept, anew.is_outdated, anew.has_jumped) = (levels.settings.kept, true, true);
        self.drop_leaves();
        self.levels = Some(anew);
    }

    /// Unloads all chunks; only their edits stay.
    fn drop_leaves(&mut self) {
        self.groups.take_all();
        if let Some(transition) = self.transition.take() {
            self.isovalue = self.next_isovalue.take().unwrap_or(transition.isovalue());
        }
        self.arriving.clear();
        self.to_fill.clear();
        self.to_mesh.clear();
        self.deferred_meshes.clear();
        let keys: Vec<ChunkKey> = self.table.keys().collect();
        for key in keys {
            self.drop_leaf(key);
            if key.level == 0 {
                self.unload(key, &mut Default::default());
            }
        }
    }

    /// Stops drawing a leaf.
    fn drop_leaf(&mut self, key: ChunkKey) {
        self.hide(key);
        if key.level > 0 {
            self.table.unload(key);
        }
    }

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

    /// Starts planned changes while few are under way: the samples that they need are requested.
    pub(crate) fn start_level_changes(&mut self) {
        let Some(levels) = &mut self.levels else { return };
        let mut coming = Vec::new();
        loop {
            let id = new_number();
            if levels.running.len() >= MAX_RUNNING {
                break;
            }
            let Some((change, after)) = levels.plan.start_next(id) else { break };
            for position in finest(&change) {
                levels.finest.entry(position).or_insert(false);
                coming.push(position);
            }
            let running = Running { change, after, is_urgent: false, meshing: None };
            levels.running.insert(id, running);
        }
        self.load_around(&coming);
    }

    /// Requests the samples of chunks of the finest level and of those around them.
    fn load_around(&mut self, positions: &[[i32; 3]]) {
        let Self { table, arriving, cover, .. } = self;
        for near in positions.iter().flat_map(|position| ChunkKey::finest(*position).around()) {
            if !table.contains(near) {
                arriving.add(near, cover);
            }
        }
    }

    /// The next change that can be meshed, while at most `limit` meshes are under way: what to mesh in jobs.
    pub(crate) fn next_level_jobs(&mut self, limit: usize) -> Option<LevelJobs> {
        let makes_meshes = self.table.makes_meshes();
        loop {
            let levels = self.levels.as_ref()?;
            let under_way = |running: &Running| running.meshing.as_ref().map_or(0, |m| m.members - m.meshed.len());
            if levels.running.values().map(under_way).sum::<usize>() >= limit {
                return None;
            }
            let may_begin = |running: &Running| {
                let has_samples = || running.finest().all(|position| self.is_surrounded(position));
                running.meshing.is_none() && !running.is_urgent && has_samples()
            };
            // In the order in which they are to be shown, where that matters.
            let change = *levels.running.iter().find(|(_, running)| may_begin(running))?.0;
            let inputs = self.begin_meshing(change, makes_meshes);
            let levels = self.levels.as_ref()?;
            let running = levels.running.get(&change)?;
            let attempt = running.meshing.as_ref()?.attempt;
            if !inputs.is_empty() {
                return Some(LevelJobs { change, attempt, inputs });
            }
        }
    }

    fn is_surrounded(&self, position: [i32; 3]) -> bool {
        let key = ChunkKey::finest(position);
        self.table.contains(key) && !self.table.lacks_samples(key)
    }

    /// Whether all changes are shown that this one waits for.
    fn is_next(&self, running: &Running) -> bool {
        let levels = self.levels.as_ref();
        running.after.iter().all(|id| levels.is_none_or(|levels| !levels.running.contains_key(id)))
    }

    /// Begins to mesh a change, and returns what is to be meshed.
    fn begin_meshing(&mut self, id: u64, makes_meshes: bool) -> Vec<(ChunkKey, MeshInput)> {
        let Some(levels) = &self.levels else { return Vec::new() };
        let Some(running) = levels.running.get(&id) else { return Vec::new() };
        let cover = LaterCover::new(levels.shown.clone(), levels.until(id));
        let all: Vec<ChunkKey> = if makes_meshes { running.members().collect() } else { Vec::new() };
        let is_empty = |key: &ChunkKey| {
            key.level == 0
                && (self.table.is_without_surface(*key, self.isovalue)
                    || is_uniform_around(self.samples.newest(), key.position))
        };
        let (empty, to_mesh): (Vec<ChunkKey>, Vec<ChunkKey>) = all.iter().partition(|key| is_empty(key));
        let inputs = to_mesh.into_iter().map(|key| (key, self.input(key, &cover))).collect();
        let meshing = Meshing {
            attempt: new_number(),
            cover,
            appearance: self.appearance.number,
            members: all.len(),
            meshed: empty.into_iter().map(ChunkMesh::empty).collect(),
            stale: BTreeSet::new(),
            tickets: Vec::new(),
        };
        if let Some(running) = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&id)) {
            running.meshing = Some(meshing);
        }
        inputs
    }

    /// Notes the jobs that mesh a change.
    pub(crate) fn started_level_jobs(&mut self, change: u64, tickets: Vec<Ticket>) {
        let running = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&change));
        if let Some(meshing) = running.and_then(|running| running.meshing.as_mut()) {
            meshing.tickets = tickets;
        }
    }

    /// Takes in a mesh that a job has made.
    pub(super) fn take_level_mesh(&mut self, mesh: LevelMesh) {
        let running = self.levels.as_mut().and_then(|levels| levels.running.get_mut(&mesh.change));
        if let Some(meshing) = running.and_then(|running| running.meshing.as_mut())
            && meshing.attempt == mesh.attempt
        {
            meshing.meshed.push(mesh.meshed);
        }
    }

    /// The next change that can be shown, and what is to be meshed first. `urgent`: only those that cannot wait.
    pub(crate) fn next_level_change(&mut self, urgent: bool) -> Option<(u64, Vec<(ChunkKey, MeshInput)>)> {
        let makes_meshes = self.table.makes_meshes();
        let levels = self.levels.as_ref()?;
        let may_be_shown = |running: &Running| {
            running.is_urgent == urgent
                && (running.is_meshed() || urgent)
                && self.is_next(running)
                && self.is_free(running)
        };
        let mut all = levels.running.iter();
        let id = *all.find(|(_, running)| may_be_shown(running))?.0;
        let running = levels.running.get(&id)?;
        if running.meshing.is_none() {
            return Some((id, self.begin_meshing(id, makes_meshes)));
        }
        let Meshing { cover, stale, .. } = running.meshing.as_ref()?;
        Some((id, stale.iter().map(|key| (*key, self.input(*key, cover))).collect()))
    }

    /// Whether no edit of a change's leaves is being meshed.
    fn is_free(&self, running: &Running) -> bool {
        let is_free = |key: ChunkKey| !self.groups.is_claimed(key) && !self.groups.is_pending(key);
        let Some(levels) = self.levels.as_ref().filter(|_| running.is_urgent) else {
            let replaced = running.change.removed.iter().chain(&running.change.remeshed);
            return replaced.map(|leaf| ChunkKey::from(*leaf)).all(is_free);
        };
        // The edit that began it may be in its neighbours alone.
        levels.shown.leaves_near(running.change.region()).into_iter().all(|(leaf, _)| is_free(leaf.into()))
    }

    /// Shows a change, with meshes that were made at once.
    pub(crate) fn show_level_change(&mut self, id: u64, at_once: Vec<ChunkMesh>) -> Shown {
        let mut shown = Shown::default();
        let Some(running) = self.levels.as_mut().and_then(|levels| levels.running.remove(&id)) else { return shown };
        let Running { change, meshing: Some(meshing), .. } = running else { return shown };
        let mut left = Vec::new();
        for leaf in &change.removed {
            self.drop_leaf((*leaf).into());
            left.extend((leaf.level == 0).then_some(leaf.position));
        }
        let added: Vec<ChunkKey> =
            change.added.iter().filter(|(_, is_empty)| !is_empty).map(|(leaf, _)| (*leaf).into()).collect();
        for key in &added {
            if key.level == 0 {
                self.table.promote(*key);
            } else if self.table.makes_meshes() {
                self.table.load_coarser(*key);
            }
        }
        if let Some(levels) = &mut self.levels {
            levels.leave_finest(&left, true);
            levels.finest.extend(finest(&change).map(|position| (position, true)));
            Arc::make_mut(&mut levels.shown).apply(&change);
        }
        let remade: BTreeSet<ChunkKey> = at_once.iter().map(|meshed| meshed.key).collect();
        let Meshing { appearance, meshed, .. } = meshing;
        let kept = meshed.into_iter().filter(|meshed| !remade.contains(&meshed.key)).map(|meshed| (meshed, appearance));
        let now = self.appearance.number;
        let all: Vec<(ChunkMesh, u64)> = kept.chain(at_once.into_iter().map(|meshed| (meshed, now))).collect();
        for (meshed, appearance) in all {
            shown.swaps.push(self.swap(meshed, appearance));
        }
        for position in finest(&change) {
            for near in ChunkKey::finest(position).around() {
                if self.table.contains(near) && (added.contains(&near) || !self.table.is_shown(near)) {
                    self.samples.show_newest(near.position);
                }
            }
        }
        members(&change).for_each(|key| self.shown(key));
        self.leaving_around(&left);
        shown
    }

    /// Notes that chunks of the finest level, and those around them, may not be needed any more.
    fn leaving_around(&mut self, positions: &[[i32; 3]]) {
        for near in positions.iter().flat_map(|position| ChunkKey::finest(*position).around()) {
            if self.table.contains(near) {
                self.leaving.push(near);
            }
        }
    }

    /// What a chunk's mesh is made from now.
    pub(crate) fn mesh_input(&self, key: ChunkKey) -> MeshInput {
        match &self.levels {
            Some(levels) if key.level > 0 => self.input(key, &LaterCover::new(levels.shown.clone(), Vec::new())),
            _ => MeshInput::Finest(self.samples.neighbourhood(key.position).to_neighbourhood()),
        }
    }

    /// What a leaf's mesh is made from in a cover.
    fn input(&self, key: ChunkKey, cover: &LaterCover) -> MeshInput {
        let levels = self.levels.as_ref().filter(|_| key.level > 0);
        let Some((levels, &SamplingSettings { cells, spacing, .. })) = levels.zip(self.sampling_settings.as_ref())
        else {
            return MeshInput::Finest(self.samples.neighbourhood(key.position).to_neighbourhood());
        };
        let source = levels.source.clone();
        let leaf = LeafKey::from(key);
        let (stamps, known) = self.samples.edits_around(leaf);
        let planes = self.samples.newest().planes();
        let cover = cover.clone();
        MeshInput::Coarser(Box::new(LeafInput { leaf, source, cells, spacing, planes, stamps, known, cover }))
    }

    /// Makes place for the surface that a stamp may put into empty leaves, in this update: they are split as viewers
    /// ask for, and the samples of new leaves are there at once.
    pub(super) fn make_place(&mut self, touched: Region) {
        let Some(levels) = &mut self.levels else { return };
        let Some(extent) = self.sampling_settings.as_ref().map(|settings| settings.extent) else { return };
        if !levels.surfaces.stamp(touched) {
            return;
        }
        let reached = levels.surfaces.reached(0, touched);
        let mut cover = levels.shown.clone();
        for running in levels.running.values().filter(|running| running.is_urgent) {
            Arc::make_mut(&mut cover).apply(&running.change);
        }
        let near = cover.leaves_near(reached.intersection(&extent));
        let surfaces = levels.surfaces.clone();
        let filled: Vec<LeafKey> = near
            .into_iter()
            .filter(|(leaf, is_empty)| *is_empty && !surfaces.is_empty(*leaf))
            .map(|(leaf, _)| leaf)
            .collect();
        let viewers = levels.viewers();
        let change = match cover.fill(&filled, &viewers, &levels.settings, |leaf| surfaces.is_empty(leaf)) {
            Ok(change) => Arc::new(change),
            Err(error) => return bevy_log::warn!("an edit in an empty part of a terrain is not shown: {error}"),
        };
        // Changes to come may add leaves that were empty when they were planned.
        let is_out_of_date = |other: &LevelChange| other.overlaps(&change) || has_filled(other, &surfaces);
        let gone = levels.withdraw(|running| is_out_of_date(&running.change));
        let is_behind = |other: &LevelChange| gone.iter().any(|gone| gone.overlaps(other));
        levels.plan.withdraw(|other| is_out_of_date(other) || is_behind(other));
        let left: Vec<[i32; 3]> = gone.iter().flat_map(|change| finest(change)).collect();
        let coming: Vec<[i32; 3]> = finest(&change).collect();
        levels.since.extend(gone);
        levels.leave_finest(&left, false);
        coming.iter().for_each(|position| _ = levels.finest.entry(*position).or_insert(false));
        if !filled.is_empty() {
            levels.since.push(change.clone());
            let urgent = levels.running.iter().filter(|(_, running)| running.is_urgent);
            let after = urgent.filter(|(_, running)| running.change.overlaps(&change)).map(|(id, _)| *id).collect();
            levels.running.insert(new_number(), Running { change, after, is_urgent: true, meshing: None });
        }
        levels.is_outdated = true;
        self.leaving_around(&left);
        let near: BTreeSet<ChunkKey> =
            coming.iter().flat_map(|position| ChunkKey::finest(*position).around()).collect();
        for near in near.into_iter().filter(|near| extent.contains(near.position)) {
            self.fill_now(near);
        }
    }

    /// The coarser leaves that a stamp has changed. Changes under way mesh their leaves again.
    pub(super) fn stamped_leaves(&mut self, touched: Region) -> Vec<ChunkKey> {
        let cells = self.samples.newest().chunk_cells();
        let Some(levels) = &mut self.levels else { return Vec::new() };
        levels.note_edit(touched, cells);
        levels.drawn_readers(touched, cells)
    }

    /// Meshes changes under way again, for another isovalue.
    pub(super) fn restart_level_meshes(&mut self) {
        if let Some(levels) = &mut self.levels {
            levels.running.values_mut().for_each(|running| running.meshing = None);
        }
    }

    /// The leaf at a chunk of the finest level, in a terrain with several levels.
    pub(super) fn level_leaf_at(&self, levels: &Levels, position: [i32; 3]) -> Option<Leaf> {
        let leaf = levels.shown.leaf_at(position);
        let target = || levels.target.as_ref()?.leaf_at(position);
        let (leaf, state) = match leaf {
            Some(leaf) => (leaf, self.table.leaf_state(leaf.into()).unwrap_or(LeafState::Empty)),
            None => (target()?, LeafState::Waiting),
        };
        Some(Leaf { level: leaf.level, position: leaf.position.into(), state })
    }

    /// The numbers of leaves in each state, in a terrain with several levels.
    pub(super) fn level_coverage(&self, levels: &Levels) -> Coverage {
        let counts = self.table.counts();
        let empty = levels.shown.leaves().filter(|(_, is_empty)| *is_empty).count();
        let under_way = |running: &Running| running.change.added.iter().filter(|(_, is_empty)| !is_empty).count();
        let waiting = levels.plan.leaves_to_come() + levels.running.values().map(under_way).sum::<usize>();
        Coverage { waiting, empty: counts.empty + empty, drawn: counts.drawn }
    }

    /// A box around all leaves, in chunks of the finest level; `None` if there is one level.
    pub(crate) fn levels_region(&self) -> Option<Region> {
        self.levels.as_ref().map(|levels| levels.shown.region())
    }

    /// The leaf that is drawn at a chunk of the finest level.
    pub(crate) fn drawn_leaf_at(&self, position: [i32; 3]) -> Option<ChunkKey> {
        match &self.levels {
            Some(levels) => levels.shown.leaf_at(position).map(ChunkKey::from),
            None => Some(ChunkKey::finest(position)),
        }
    }
}
