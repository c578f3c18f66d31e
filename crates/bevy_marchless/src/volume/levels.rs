//! [`Levels`]: the leaves of a terrain with several levels of detail, and how they change.
//!
//! The *shown* cover says which leaves are drawn. When viewers have moved, a job computes the cover that they ask for
//! and a [`Plan`] of the way there. Each of its changes replaces a few leaves by others, in one update, with every
//! neighbour whose border changes. Changes that overlap wait for each other.
//!
//! An edit is shown in the leaves that are drawn. A change under way meshes what the edit touched again when it is
//! shown, and waits while an edit of its leaves is being meshed. An edit in a box that was empty splits it: that change
//! belongs to the edit, is meshed with it and shown in the same update.

mod cache;
mod changes;
mod edits;
mod plan;
mod surfaces;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_platform::collections::HashMap;
#[cfg(test)]
use marchless::LeafKey;
use marchless::{LevelChange, LevelCover, LevelSettings, LevelViewer, Region};

use super::groups::ChunkMesh;
use super::input::{LaterCover, MeshInput};
use super::{ChunkTable, Heart, SamplingSettings};
use crate::chunk::ChunkKey;
use crate::cover::{Coverage, Leaf, LeafState, Residency, View, ViewId};
use crate::jobs::{Results, Ticket};
use cache::CachedSource;
use plan::{Plan, Planned};
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
    /// Whether it has been reported that there would be too many leaves.
    has_too_many: bool,
}

/// A change under way.
struct Running {
    change: Arc<LevelChange>,
    /// The changes that are to be shown before it.
    after: Vec<u64>,
    /// Whether it makes place for an edit, with which it is meshed and shown.
    is_of_edit: bool,
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

/// Whether the mesh of a leaf reads any of these lattice points.
fn reads(leaf: ChunkKey, points: Region, cells: u32) -> bool {
    let cells = i64::from(cells);
    (0..3).all(|axis| {
        let low = i64::from(leaf.position[axis]) * cells;
        let [low, high] = [low - 1, low + cells + 2].map(|v| v << leaf.level);
        low < points.max[axis].into() && high > points.min[axis].into()
    })
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

    /// The coarser leaves that read these lattice points and are drawn, or will be with earlier edits.
    fn drawn_readers(&self, points: Region, cells: u32) -> Vec<ChunkKey> {
        let chunk = |v: i32| v.div_euclid(cells as i32);
        let chunks = Region::new(points.min.map(chunk), points.max.map(|v| chunk(v - 1) + 1));
        // A reader touches the points' chunks, or reaches one point of its own level beyond itself.
        let reach = (1u32 << self.settings.levels).div_ceil(cells);
        let leaves = self.cover_of_edits().leaves_near(chunks.grown(reach, reach));
        let leaves = leaves.into_iter().filter(|(leaf, is_empty)| leaf.level > 0 && !is_empty);
        leaves.map(|(leaf, _)| leaf.into()).filter(|key| reads(*key, points, cells)).collect()
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
            if is_gone && !running.is_of_edit {
                gone.insert(*id);
            }
        }
        gone.into_iter().filter_map(|id| self.running.remove(&id)).map(|running| running.change).collect()
    }

    /// Notes that edits have changed lattice points: meshes that were made before are out of date.
    fn note_edit(&mut self, points: Region, cells: u32) {
        for running in self.running.values_mut() {
            let Running { change, meshing: Some(meshing), .. } = running else { continue };
            meshing.stale.extend(members(change).filter(|key| reads(*key, points, cells)));
        }
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
            self.method = self.next_method.take().unwrap_or(transition.method());
            self.follow_method();
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
