//! Meshing and showing chunks: changed chunks become groups, and each complete group is shown in one update.
//!
//! A group is meshed from one snapshot of the samples, and all its chunks are swapped at once. So there is never a
//! crack between a chunk that shows an edit and one that does not yet. While a group is being meshed, its chunks are
//! claimed. Edits of claimed chunks wait, become one set, and start from the newest samples when the group is done. So
//! results arrive in order by construction, and a stroke that never pauses is shown while it goes on.
//!
//! A chunk that has never been drawn is a group of its own, and gives way to edits. With several levels of detail,
//! leaves come and go by changes of levels instead, each shown in one update.

mod job;
mod pool;
mod standalone;

use core::cell::Cell;
use core::time::Duration;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::Assets;
use bevy_camera::visibility::NoAutoAabb;
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_mesh::{Mesh, Mesh3d, MeshVertexAttribute, VertexFormat};
use bevy_platform::time::Instant;
use bevy_tasks::AsyncComputeTaskPool;
use marchless::MeshBuffer;

use job::{AssetStyle, mesh_chunk, mesh_now, recolor};
use pool::MeshPool;
pub use standalone::{ChunkSamples, ChunkSamplesError};

use crate::budget::{ENTITY_TIME, FrameBudget, Share};
use crate::chunk::{ChunkGeometry, mesh_bounds, new_chunk};
use crate::jobs::{Priority, WorkQueue};
use crate::schedule::{MakesMeshes, MarchlessSettings, UpdatePhase};
use crate::stats::TerrainStats;
use crate::terrain::TerrainVolume;
use crate::volume::{
    ChunkMesh, Colors, DrawnMesh, Heart, LevelJobs, MeshResult, PreparedGroup, Restyle, Restyled, ShowTarget, Shown,
    Swap,
};

/// The vertex attribute with a vertex's material, a `u32`, for shaders.
pub const ATTRIBUTE_MATERIAL: MeshVertexAttribute =
    MeshVertexAttribute::new("Marchless_Material", 0x4d61_7263_686c_6573, VertexFormat::Uint32);

/// Meshes the chunks of terrains, and standalone [`ChunkSamples`].
#[derive(Default)]
pub struct MeshingPlugin;

impl Plugin for MeshingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MakesMeshes>()
            .init_resource::<MeshPool>()
            .register_type::<ChunkSamples>()
            .register_type::<NoAutoAabb>()
            .add_observer(standalone::forget_removed_samples)
            .add_systems(PostUpdate, (mesh_terrains, standalone::mesh_samples).chain().in_set(UpdatePhase::Mesh));
    }
}

/// The number of chunks that one update may mesh inline for its edits, unless
/// [`MarchlessSettings::max_inline_chunks`] is higher.
const MOST_INLINE: usize = 1024;

/// The least number of changes of levels that one update begins to mesh, so that jobs do not wait for those that are
/// shown.
const MIN_CHANGES: usize = 4;

/// The system parameters that spawning and updating chunk entities need.
#[derive(SystemParam)]
struct MeshPresenter<'w, 's> {
    commands: Commands<'w, 's>,
    assets: Option<ResMut<'w, Assets<Mesh>>>,
    pool: Res<'w, MeshPool>,
    settings: Res<'w, MarchlessSettings>,
    stats: ResMut<'w, TerrainStats>,
}

impl MeshPresenter<'_, '_> {
    /// The style of mesh assets in these colours; `None` in an app without mesh assets.
    fn style(&self, colors: &Colors) -> Option<AssetStyle> {
        let usages = self.settings.mesh_usages;
        self.assets.is_some().then(|| AssetStyle { colors: colors.clone(), usages })
    }

    /// Gives an entity its new mesh, which may be empty. `cells`: the chunk's size; its box bounds an empty mesh.
    fn show(&mut self, entity: Entity, meshed: ChunkMesh, cells: [u32; 3]) {
        let bounds = mesh_bounds(&meshed.geometry, cells);
        let mut entity = self.commands.entity(entity);
        let shown = (ChunkGeometry { mesh: meshed.geometry }, bounds);
        match (&mut self.assets, meshed.mesh) {
            (Some(assets), Some(mesh)) => entity.try_insert((shown, Mesh3d(assets.add(mesh)))),
            _ => entity.try_insert(shown).try_remove::<Mesh3d>(),
        };
    }

    /// Replaces the asset of an entity's mesh, not its geometry.
    fn show_asset(&mut self, entity: Entity, mesh: Mesh) {
        if let Some(assets) = &mut self.assets {
            self.commands.entity(entity).try_insert(Mesh3d(assets.add(mesh)));
        }
    }

    /// Spawns a chunk with its mesh, which must not be empty.
    fn spawn(&mut self, chunk: impl Bundle, meshed: ChunkMesh, cells: [u32; 3]) -> Entity {
        let bounds = mesh_bounds(&meshed.geometry, cells);
        let mut entity = self.commands.spawn((chunk, ChunkGeometry { mesh: meshed.geometry }, bounds));
        if let (Some(assets), Some(mesh)) = (&mut self.assets, meshed.mesh) {
            entity.insert(Mesh3d(assets.add(mesh)));
        }
        entity.id()
    }
}

/// Shows complete groups, and starts new ones.
fn mesh_terrains(
    mut volumes: Query<(Entity, &mut TerrainVolume)>,
    queue: Res<WorkQueue>,
    mut budget: ResMut<FrameBudget>,
    mut presenter: MeshPresenter,
) {
    let start = Instant::now();
    let threads = AsyncComputeTaskPool::try_get().map_or(1, |pool| pool.thread_num().max(1));
    let settings = *presenter.settings;
    let mut update = MeshUpdate {
        queue: &queue,
        presenter: &mut presenter,
        until: budget.until(start, Share::Mesh),
        in_flight: settings.in_flight(threads),
        inline: settings.max_inline_chunks,
        inline_left: MOST_INLINE.max(settings.max_inline_chunks),
        max_upload_bytes: settings.max_upload_bytes,
        bytes: 0,
        edits: Duration::ZERO,
    };
    for (entity, mut volume) in &mut volumes {
        let heart = volume.heart();
        if (heart.has_meshed() || heart.has_to_mesh())
            && let Some(voxel_size) = volume.settings().map(|settings| settings.voxel_size)
        {
            update.mesh(&mut MeshedTerrain { entity, voxel_size, heart: volume.heart_mut() });
        }
    }
    let edits = update.edits;
    budget.spend(start + edits);
    budget.spend_on_edits(edits);
}

/// The size of a mesh in bytes, in memory and approximately on the graphics card.
pub(crate) fn geometry_bytes(mesh: &MeshBuffer) -> usize {
    size_of_val(&mesh.positions[..])
        + size_of_val(&mesh.normals[..])
        + size_of_val(&mesh.materials[..])
        + size_of_val(&mesh.indices[..])
}

/// The budgets and counters of one update's meshing and showing.
struct MeshUpdate<'a, 'w, 's> {
    queue: &'a WorkQueue,
    presenter: &'a mut MeshPresenter<'w, 's>,
    /// The end of the time budget; time spent on edits extends it.
    until: Instant,
    /// The most chunks of one terrain whose low-priority jobs, which give way to edits, may be in flight.
    in_flight: usize,
    /// The largest group that is meshed within the update. [Units: chunks]
    inline: usize,
    /// The chunks that may still be meshed within this update.
    inline_left: usize,
    max_upload_bytes: usize,
    /// The bytes of all meshes shown in this update.
    bytes: usize,
    /// The time spent on edits, which does not count against the budget of other work.
    edits: Duration,
}

/// A terrain that is being meshed and shown.
struct MeshedTerrain<'a> {
    entity: Entity,
    voxel_size: f32,
    heart: &'a mut Heart,
}

impl MeshUpdate<'_, '_, '_> {
    /// Does all meshing and showing of one terrain.
    fn mesh(&mut self, terrain: &mut MeshedTerrain) {
        self.take_results(terrain);
        terrain.heart.take_plan();
        let start = Instant::now();
        while let Some(prepared) = terrain.heart.next_changed() {
            self.start(terrain, prepared);
        }
        let edits = start.elapsed();
        (self.edits, self.until) = (self.edits + edits, self.until + edits);
        self.show_level_changes(terrain);
        self.start_level_changes(terrain);
        terrain.heart.sort_ready(self.until);
        self.first_meshes(terrain);
        self.restyle(terrain);
        self.transition(terrain);
    }

    /// Takes finished meshes from jobs, and shows the groups that are complete.
    fn take_results(&mut self, terrain: &mut MeshedTerrain) {
        loop {
            let bytes = Cell::new(self.bytes);
            let Self { until, max_upload_bytes, .. } = *self;
            let stats = &mut self.presenter.stats;
            // New chunks may come one by one; an edit is shown as a whole.
            let may_take_more = || bytes.get() == 0 || bytes.get() <= max_upload_bytes && Instant::now() < until;
            let note = |meshed: &ChunkMesh, is_shown: bool| {
                let size = if is_shown { geometry_bytes(&meshed.geometry).max(1) } else { 0 };
                bytes.set(bytes.get() + size);
                if !meshed.time.is_zero() {
                    stats.count_mesh(meshed.time);
                }
            };
            let complete = terrain.heart.take_meshed(may_take_more, note);
            self.bytes = bytes.get();
            let Some(group) = complete else { break };
            if group.gives_way() {
                // Reserve time for the commands that run later.
                self.until = self.until.checked_sub(ENTITY_TIME).unwrap_or(self.until);
            }
            let shown = terrain.heart.show(group);
            self.show(terrain, shown);
        }
    }

    /// Shows changes of levels that are meshed.
    fn show_level_changes(&mut self, terrain: &mut MeshedTerrain) {
        let mut done = 0;
        while (done == 0 || self.bytes <= self.max_upload_bytes && Instant::now() < self.until)
            && let Some((change, inputs)) = terrain.heart.next_level_change()
        {
            let (settings, style) = (terrain.heart.mesh_settings(), self.presenter.style(terrain.heart.colors()));
            let at_once = mesh_now(&inputs, &settings, style.as_ref(), &self.presenter.pool);
            at_once.iter().for_each(|meshed| self.presenter.stats.count_mesh(meshed.time));
            drop(inputs);
            let shown = terrain.heart.show_level_change(change, at_once);
            self.bytes += shown.swaps.iter().map(|swap| geometry_bytes(&swap.meshed.geometry)).sum::<usize>();
            let is_shown = |swap: &&Swap| !matches!(swap.place, ShowTarget::Nowhere);
            let shown_len = shown.swaps.iter().filter(is_shown).count();
            let entities = (shown_len + terrain.heart.table().released_len()) as u32;
            self.until = self.until.checked_sub(ENTITY_TIME * entities).unwrap_or(self.until);
            self.show(terrain, shown);
            done += 1;
        }
    }

    /// Starts changes of levels, and the meshes of those whose samples are there.
    fn start_level_changes(&mut self, terrain: &mut MeshedTerrain) {
        terrain.heart.start_level_changes();
        let mut done = 0;
        while (done < MIN_CHANGES || Instant::now() < self.until)
            && let Some(jobs) = terrain.heart.next_level_jobs(self.in_flight)
        {
            let (change, attempt) = (jobs.change, jobs.attempt());
            let settings = terrain.heart.mesh_settings();
            let style = self.presenter.style(terrain.heart.colors());
            let job = |(key, input)| {
                let (results, style) = (terrain.heart.mesh_results().clone(), style.clone());
                self.queue.push(Priority::Level(change), move || {
                    let meshed = mesh_chunk(&input, key, &settings, style.as_ref(), None);
                    results.push(MeshResult::OfLevels(LevelJobs::result(change, attempt, meshed)));
                })
            };
            let tickets = jobs.inputs.into_iter().map(job).collect();
            terrain.heart.started_level_jobs(change, tickets);
            done += 1;
        }
    }

    /// Starts the first meshes of chunks, one by one, the most urgent first.
    fn first_meshes(&mut self, terrain: &mut MeshedTerrain) {
        let mut done = 0;
        while (done % 2 != 0 || done == 0 || Instant::now() < self.until)
            && let Some((prepared, urgency)) = terrain.heart.next_first_mesh(self.in_flight)
        {
            self.start_jobs(terrain, prepared, Priority::FirstMesh(urgency));
            done += 1;
        }
    }

    /// Starts meshing or colouring chunks again after a change of normals or colours, one by one.
    fn restyle(&mut self, terrain: &mut MeshedTerrain) {
        let style = self.presenter.style(terrain.heart.colors());
        let mut done = 0;
        while (done == 0 || Instant::now() < self.until)
            && let Some(restyle) = terrain.heart.next_restyle(self.in_flight, style.is_some())
        {
            match restyle {
                Restyle::Mesh(prepared) => self.start_jobs(terrain, prepared, Priority::Restyle),
                Restyle::Recolor(key, group, geometry) => {
                    let (results, style) = (terrain.heart.mesh_results().clone(), style.clone());
                    terrain.heart.start_recolor(group, |id| {
                        self.queue.push(Priority::Restyle, move || {
                            results.push(MeshResult::OfGroup(id, recolor(key, geometry, style.as_ref())));
                        })
                    });
                }
            }
            done += 1;
        }
    }

    /// Continues the change to another isovalue, and ends it if it may end.
    fn transition(&mut self, terrain: &mut MeshedTerrain) {
        if terrain.heart.may_end_transition(self.inline) {
            self.end_transition(terrain);
        }
        let mut done = 0;
        while (done == 0 || Instant::now() < self.until)
            && let Some((key, job, settings)) = terrain.heart.next_in_transition(self.in_flight)
        {
            let input = terrain.heart.mesh_input(key);
            let style = self.presenter.style(terrain.heart.colors());
            let (results, appearance) = (terrain.heart.mesh_results().clone(), terrain.heart.appearance());
            let ticket = self.queue.push(Priority::Restyle, move || {
                let meshed = mesh_chunk(&input, key, &settings, style.as_ref(), None);
                results.push(MeshResult::Restyled(Restyled { job, meshed, appearance }));
            });
            terrain.heart.started_in_transition(key, job, ticket);
            done += 1;
        }
    }

    /// Meshes the chunks that are still missing at the new isovalue, and shows all of them.
    fn end_transition(&mut self, terrain: &mut MeshedTerrain) {
        let style = self.presenter.style(terrain.heart.colors());
        while let Some((key, _, settings)) = terrain.heart.next_in_transition(usize::MAX) {
            let input = terrain.heart.mesh_input(key);
            let meshed = mesh_now(&[(key, input)], &settings, style.as_ref(), &self.presenter.pool);
            for meshed in meshed {
                self.presenter.stats.count_mesh(meshed.time);
                terrain.heart.meshed_in_transition(meshed);
            }
        }
        if let Some(shown) = terrain.heart.end_transition() {
            self.show(terrain, shown);
        }
    }

    /// Starts a group: meshes and shows a small one within this update, or starts jobs for a larger one.
    fn start(&mut self, terrain: &mut MeshedTerrain, prepared: PreparedGroup) {
        if prepared.changed > self.inline.min(self.inline_left) {
            return self.start_jobs(terrain, prepared, Priority::Edit);
        }
        let PreparedGroup { mut group, to_mesh, changed } = prepared;
        self.inline_left -= changed;
        let settings = terrain.heart.mesh_settings();
        let style = self.presenter.style(terrain.heart.colors());
        let meshed = mesh_now(&to_mesh, &settings, style.as_ref(), &self.presenter.pool);
        // What holds samples while they are shown keeps their memory from being reused.
        drop(to_mesh);
        self.presenter.pool.prepare(meshed.iter().map(|meshed| &*meshed.geometry), style.is_some());
        for meshed in meshed {
            self.presenter.stats.count_mesh(meshed.time);
            group.push(meshed);
        }
        let shown = terrain.heart.show(group);
        self.show(terrain, shown);
    }

    /// Starts the jobs of a group; a group with nothing to mesh is shown at once.
    fn start_jobs(&mut self, terrain: &mut MeshedTerrain, prepared: PreparedGroup, priority: Priority) {
        if prepared.to_mesh.is_empty() {
            let shown = terrain.heart.show(prepared.group);
            return self.show(terrain, shown);
        }
        let (results, settings) = (terrain.heart.mesh_results().clone(), terrain.heart.mesh_settings());
        let style = self.presenter.style(terrain.heart.colors());
        terrain.heart.start(prepared, |id, key, input| {
            let (results, style) = (results.clone(), style.clone());
            self.queue.push(priority, move || {
                let meshed = mesh_chunk(&input, key, &settings, style.as_ref(), None);
                results.push(MeshResult::OfGroup(id, meshed));
            })
        });
    }

    /// Carries out a group's swaps on its chunks' entities.
    fn show(&mut self, terrain: &mut MeshedTerrain, shown: Shown) {
        let cells = [terrain.heart.samples().shown().chunk_cells(); 3];
        for swap in shown.swaps {
            match swap.place {
                ShowTarget::Nowhere => {}
                ShowTarget::On(entity) => self.presenter.show(entity, swap.meshed, cells),
                ShowTarget::Recolored(entity) => {
                    if let Some(mesh) = swap.meshed.mesh {
                        self.presenter.show_asset(entity, mesh);
                    }
                }
                ShowTarget::New => {
                    let Swap { key, appearance, meshed, .. } = swap;
                    let geometry = meshed.geometry.clone();
                    let chunk = new_chunk(terrain.entity, key, cells[0], terrain.voxel_size);
                    let entity = self.presenter.spawn(chunk, meshed, cells);
                    terrain.heart.spawned(key, DrawnMesh { entity, geometry, appearance });
                }
            }
        }
        for since in shown.since {
            self.presenter.stats.count_edit_shown(since);
        }
        // Those of leaves that others have replaced.
        for entity in terrain.heart.take_released() {
            self.presenter.commands.entity(entity).try_despawn();
        }
    }
}
