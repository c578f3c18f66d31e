//! [`Heart`]: the state of one terrain and its transitions. It knows no system, no query and no command: systems report
//! events to it, and carry out what it returns.
//!
//! Its parts own their state, and each is tested alone: [`SampleStore`] (the samples), [`ChunkTable`] (the state of
//! each loaded chunk), [`Groups`] (chunks meshed together), [`Cover`] (wanted chunks). Events that involve several
//! parts are functions here, by topic: [`follow`](mod@follow) (chunks come and go), [`fill`](mod@fill) (samples
//! arrive), [`edit`](mod@edit) (stamps), [`mesh`](mod@mesh) (groups start and are shown), [`restyle`](mod@restyle)
//! (colours, normals, isovalue and mesher change), [`levels`](mod@levels) (levels of detail change).

mod edit;
mod fill;
mod follow;
mod groups;
mod input;
mod known_signs;
mod levels;
mod memory;
mod mesh;
mod restyle;
mod samples;
mod stamps;
mod table;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::sync::Arc;

use bevy_ecs::entity::Entity;
use bevy_platform::collections::{HashMap, HashSet};
use marchless::{Edit, Grid, GridChunk, MeshMethod, Region, Source};

pub(crate) use edit::Edits;
pub(crate) use fill::Filled;
use groups::Purpose;
pub(crate) use groups::{ChunkMesh, Group};
pub(crate) use input::{MeshInput, MeshScratch};
pub(crate) use known_signs::KnownSigns;
use levels::Levels;
pub(crate) use levels::{LevelDetail, LevelJobs};
pub(crate) use mesh::{MeshResult, PreparedGroup, Shown, Swap};
pub(crate) use restyle::{Restyle, Restyled};
pub(crate) use samples::SampleStore;
pub(crate) use table::{ChunkTable, DrawnMesh, ShowTarget};

use crate::chunk::ChunkKey;
use crate::cover::{ChunkQueue, Cover, Coverage, Leaf, LeafState, Residency, UniqueQueue, View, ViewId};
use crate::jobs::{Results, Ticket};
use groups::Groups;
use restyle::{Appearance, Transition};

/// The linear colours of all materials.
pub(crate) type Colors = Arc<[[f32; 4]; 256]>;

/// The settings that a terrain's samples depend on before any edit.
#[derive(Clone)]
pub(crate) struct SamplingSettings {
    pub(crate) source: Arc<dyn Source>,
    /// The chunks that exist.
    pub(crate) extent: Region,
    /// Cells of a chunk per axis.
    pub(crate) cells: u32,
    /// World units between two samples.
    pub(crate) spacing: f64,
}

/// One terrain's state.
pub(crate) struct Heart {
    /// `None` before the terrain's settings have been accepted.
    sampling_settings: Option<SamplingSettings>,
    samples: SampleStore,
    table: ChunkTable,
    groups: Groups,
    cover: Cover,
    /// `None` if there is one level of detail.
    levels: Option<Levels>,
    /// Whether a viewer has moved since chunks last followed.
    has_moved: bool,
    /// Chunks that may be wanted more than now, and chunks that may be wanted less.
    arriving: ChunkQueue,
    leaving: UniqueQueue,
    /// Chunks that wait to be sampled.
    to_fill: ChunkQueue,
    /// Chunks with a surface that wait to be meshed for the first time.
    to_mesh: ChunkQueue,
    /// Chunks whose samples may be dropped when nothing else is to be done.
    droppable: UniqueQueue,
    /// Unloaded chunks whose samples are wanted because they have many stamps.
    crowded: UniqueQueue,
    /// The crowded chunks that are being sampled, each with its job.
    remote: HashMap<[i32; 3], (u64, Ticket)>,
    /// The number of sampling jobs that run or are about to.
    sampling: usize,
    /// The source's bounds, by boxes of chunks.
    bounds: HashMap<[i32; 3], Option<GridChunk<i16>>>,
    /// The isovalue and the mesher as drawn. It has normals; those of meshes are the appearance's.
    method: MeshMethod,
    appearance: Appearance,
    /// Chunks whose appearance may be out of date.
    to_restyle: UniqueQueue,
    /// The running change of the isovalue or the mesher, and what comes after it.
    transition: Option<Transition>,
    next_method: Option<MeshMethod>,
    /// Whether a stamp waits for samples that had been dropped.
    holds_stamps: bool,
    /// Whether any chunk of the present source has been shown.
    has_shown: bool,
    /// The edits that late stamps have made in this update.
    late_edits: Vec<Edit>,
    /// Results of sampling jobs, and those that wait for an update with more time.
    fill_results: Results<Filled>,
    deferred_fills: VecDeque<Filled>,
    /// Results of meshing jobs, and those that wait for an update with more time.
    mesh_results: Results<MeshResult>,
    deferred_meshes: VecDeque<MeshResult>,
}

impl Default for Heart {
    fn default() -> Self {
        Self {
            sampling_settings: None,
            samples: SampleStore::default(),
            table: ChunkTable::new(Region::new([0; 3], [0; 3]), true),
            groups: Groups::default(),
            cover: Cover::default(),
            levels: None,
            has_moved: false,
            arriving: ChunkQueue::default(),
            leaving: UniqueQueue::default(),
            to_fill: ChunkQueue::default(),
            to_mesh: ChunkQueue::default(),
            droppable: UniqueQueue::default(),
            crowded: UniqueQueue::default(),
            remote: HashMap::default(),
            sampling: 0,
            bounds: HashMap::default(),
            method: MeshMethod::default(),
            appearance: Appearance::default(),
            to_restyle: UniqueQueue::default(),
            transition: None,
            next_method: None,
            holds_stamps: false,
            has_shown: false,
            late_edits: Vec::new(),
            fill_results: Results::default(),
            deferred_fills: VecDeque::new(),
            mesh_results: Results::default(),
            deferred_meshes: VecDeque::new(),
        }
    }
}

impl Heart {
    /// A terrain without any loaded chunk. `meshing`: whether chunks are meshed at all.
    pub(crate) fn new(
        settings: SamplingSettings,
        method: MeshMethod,
        normals: bool,
        colors: Colors,
        meshing: bool,
    ) -> Self {
        let mut heart = Self {
            samples: SampleStore::of(settings.empty_grid()),
            table: ChunkTable::new(settings.extent, meshing),
            sampling_settings: Some(settings),
            method,
            appearance: Appearance::new(normals, colors),
            ..Self::default()
        };
        heart.follow_method();
        heart
    }

    /// Replaces all samples by those of another source. Edits are lost; a drawn chunk stays until its new mesh is
    /// there. The chunks stay where they are.
    pub(crate) fn refill(&mut self, settings: SamplingSettings, method: MeshMethod) {
        self.samples.refill(settings.empty_grid());
        self.table.refill();
        self.groups.take_all();
        self.to_fill.clear();
        self.to_mesh.clear();
        self.remote.clear();
        self.crowded = UniqueQueue::default();
        self.bounds.clear();
        self.deferred_fills.clear();
        self.deferred_meshes.clear();
        (self.sampling, self.has_shown, self.method) = (0, false, method);
        (self.transition, self.next_method) = (None, None);
        self.follow_method();
        self.sampling_settings = Some(settings);
        let Self { table, arriving, cover, .. } = self;
        table.keys().for_each(|key| arriving.add(key, cover));
    }

    /// Whether the terrain has several levels of detail.
    pub(crate) const fn has_levels(&self) -> bool {
        self.levels.is_some()
    }

    /// The chunks that exist; `None` before the terrain's settings have been accepted.
    pub(crate) fn extent(&self) -> Option<Region> {
        self.sampling_settings.as_ref().map(|settings| settings.extent)
    }

    /// Whether the next source may begin: every chunk that existed when the present source began has been shown with
    /// it, and at least one chunk if there is any to show.
    pub(crate) fn is_generation_shown(&self) -> bool {
        let counts = self.table.counts();
        let may_show = self.table.makes_meshes() && counts.waiting + counts.empty + counts.drawn > 0;
        // Chunks whose entities the game has despawned count as empty, and are not shown again.
        counts.outdated == 0 && (self.has_shown || !may_show || self.is_settled())
    }

    pub(crate) const fn samples(&self) -> &SampleStore {
        &self.samples
    }

    pub(crate) const fn table(&self) -> &ChunkTable {
        &self.table
    }

    /// Takes the entities to be despawned.
    pub(crate) fn take_released(&mut self) -> Vec<Entity> {
        self.table.take_released()
    }

    /// The isovalue as drawn, in voxels.
    pub(crate) const fn isovalue(&self) -> f32 {
        self.method.isovalue()
    }

    /// The isovalue and the mesher as drawn.
    pub(crate) const fn mesh_method(&self) -> MeshMethod {
        self.method
    }

    /// The queue of results from sampling jobs.
    pub(crate) const fn fill_results(&self) -> &Results<Filled> {
        &self.fill_results
    }

    /// The queue of results from meshing jobs.
    pub(crate) const fn mesh_results(&self) -> &Results<MeshResult> {
        &self.mesh_results
    }

    /// The settings of meshes that start now.
    pub(crate) const fn mesh_settings(&self) -> MeshMethod {
        self.method.with_normals(self.appearance.normals)
    }

    /// The colours of meshes that start now.
    pub(crate) const fn colors(&self) -> &Colors {
        &self.appearance.colors
    }

    /// Notes whether a stamp waits for samples.
    pub(crate) const fn set_holds_stamps(&mut self, holds: bool) {
        self.holds_stamps = holds;
    }

    /// The leaf at a position; `None` if it is in no view.
    pub(crate) fn leaf_at(&self, position: [i32; 3]) -> Option<Leaf> {
        if let Some(levels) = &self.levels {
            return self.level_leaf_at(levels, position);
        }
        let is_coming = || self.cover.contains(position).then_some(LeafState::Waiting);
        let state = self.table.leaf_state(ChunkKey::finest(position)).or_else(is_coming)?;
        Some(Leaf { level: 0, position: position.into(), state })
    }

    /// All leaves, in no order; with one level, those that have come.
    pub(crate) fn leaves(&self) -> impl Iterator<Item = Leaf> + '_ {
        let levels = self.levels.iter().flat_map(|levels| levels.leaves(&self.table));
        let keys = self.levels.is_none().then(|| self.table.keys()).into_iter().flatten();
        let chunks = keys.filter_map(|key| {
            let state = self.table.leaf_state(key)?;
            Some(Leaf { level: 0, position: key.position.into(), state })
        });
        levels.chain(chunks)
    }

    /// The numbers of leaves in each state.
    pub(crate) fn coverage(&self) -> Coverage {
        if let Some(levels) = &self.levels {
            return self.level_coverage(levels);
        }
        let counts = self.table.counts();
        let is_coming = |key: &ChunkKey| !self.table.is_leaf(*key) && self.cover.contains(key.position);
        let mut coming: HashSet<ChunkKey> = self.arriving.iter().filter(is_coming).collect();
        self.cover.hidden_in_range(|position| coming.extend(Some(ChunkKey::finest(position)).filter(is_coming)));
        Coverage { waiting: counts.waiting + coming.len(), empty: counts.empty, drawn: counts.drawn }
    }

    /// Whether all chunks in range have their samples.
    pub(crate) fn is_filled(&self) -> bool {
        let has_levels = self.levels.as_ref().is_none_or(Levels::is_idle);
        let have_come = has_levels && self.cover.is_revealed() && self.arriving.is_empty();
        let is_idle = have_come && self.leaving.is_empty() && self.remote.is_empty();
        self.sampling_settings.is_some()
            && self.table.counts().unfilled == 0
            && is_idle
            && self.crowded.is_empty()
            && !self.holds_stamps
    }

    /// Whether all chunks in range have their samples and show their newest state.
    pub(crate) fn is_settled(&self) -> bool {
        let nothing_waits = !self.table.makes_meshes() || self.table.counts().waiting == 0;
        self.is_idle() && nothing_waits && self.to_restyle.is_empty() && self.transition.is_none()
    }

    /// Whether nothing is left to load, fill or mesh.
    fn is_idle(&self) -> bool {
        let nothing_to_mesh = self.table.ready_len() == 0 && self.to_mesh.is_empty() && self.groups.is_empty();
        self.is_filled() && nothing_to_mesh
    }

    /// The number of chunks that wait for their samples.
    pub(crate) fn waiting_for_samples(&self) -> usize {
        self.table.counts().unfilled
    }

    /// The number of chunks that can be meshed or are being meshed.
    pub(crate) fn waiting_for_meshes(&self) -> usize {
        let in_transition = self.transition.as_ref().map_or(0, Transition::waiting);
        let of_levels = self.levels.as_ref().map_or(0, Levels::waiting_for_meshes);
        self.table.ready_len()
            + self.to_mesh.len()
            + self.groups.len()
            + self.to_restyle.len()
            + in_transition
            + of_levels
    }

    /// The number of chunks in or beside the views that have not been visited yet.
    pub(crate) fn waiting_to_come(&self) -> usize {
        self.arriving.len() + self.cover.hidden()
    }

    /// Changes a viewer's view; `None` removes it.
    pub(crate) fn set_view(&mut self, id: ViewId, view: Option<View>) {
        let Self { cover, levels, table, arriving, leaving, to_fill, to_mesh, has_moved, .. } = self;
        let old = cover.view(id).copied();
        if old == view {
            return;
        }
        *has_moved = true;
        if let Some(levels) = levels {
            levels.set_view(id, view.as_ref());
            cover.set_quietly(id, view);
            return sort_again([arriving, to_fill, to_mesh], id, old, view, cover);
        }
        let keeps_samples = !cover.drops_samples() && view.is_none_or(|view| view.samples.is_none());
        cover.set(
            id,
            view,
            |position, wanted| {
                let key = ChunkKey::finest(position);
                if !(keeps_samples && table.has_all(key, wanted)) {
                    arriving.add_unsorted(key, id);
                }
            },
            |position, most| {
                let key = ChunkKey::finest(position);
                if table.has_more(key, if keeps_samples { most } else { Residency::Gone }) {
                    leaving.push(key);
                }
            },
        );
        sort_again([arriving, to_fill, to_mesh], id, old, view, cover);
    }
}

/// Notes in queues that a viewer's view has changed.
fn sort_again(queues: [&mut ChunkQueue; 3], id: ViewId, old: Option<View>, view: Option<View>, cover: &Cover) {
    for queue in queues {
        match (old, view) {
            (Some(old), Some(view)) if view.differs_in_urgency(&old) => queue.sort_again(id),
            (_, None) => queue.remove_view(id, cover),
            _ => {}
        }
    }
}

impl SamplingSettings {
    /// An empty grid for the chunks; the settings have been checked.
    pub(crate) fn empty_grid(&self) -> Grid<i16> {
        Grid::bounded(self.cells, self.extent).expect("the settings have been checked")
    }

    /// Whether two chunks share their samples, where both exist.
    pub(crate) fn has_samples_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.source, &other.source) && (self.cells, self.spacing) == (other.cells, other.spacing)
    }
}
