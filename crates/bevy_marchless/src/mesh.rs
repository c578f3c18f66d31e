//! Changed chunks become groups, groups are meshed, and a complete group is shown in one update.
//!
//! A group is meshed from one snapshot of the samples, and all its chunks change at once: there is never a crack
//! between a chunk that shows an edit and one that does not yet. While a group is being meshed its chunks are claimed;
//! edits of claimed chunks wait, become one set, and start from the newest samples when the group is done. So results
//! come in order by construction, and a stroke that never pauses is shown all along.
//!
//! A chunk that has never been drawn is a group of its own, which an edit may withdraw as long as nobody works on it.

mod handmade;
mod job;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::Assets;
use bevy_camera::visibility::NoAutoAabb;
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_mesh::{Mesh, Mesh3d, MeshVertexAttribute, VertexFormat};
use marchless::Chunk;

pub use handmade::{ChunkSamples, ChunkSamplesError};
pub(crate) use job::{Colors, Meshed};
use job::{MeshJob, mesh_now};

use crate::chunk::{ChunkGeometry, mesh_bounds};
use crate::schedule::{MarchlessSettings, MarchlessSystems};
use crate::stats::Stats;
use crate::terrain::{Group, Pending, TerrainVolume, around, distance_to_middle};
use crate::work::{Priority, Results, WorkQueue};

/// The number of a vertex's material, a `u32`, for shaders.
pub const ATTRIBUTE_MATERIAL: MeshVertexAttribute =
    MeshVertexAttribute::new("Marchless_Material", 0x4d61_7263_686c_6573, VertexFormat::Uint32);

/// Meshes terrains and hand-made chunks.
#[derive(Default)]
pub struct MeshingPlugin;

impl Plugin for MeshingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshResults>()
            .init_resource::<handmade::HandmadeResults>()
            .register_type::<ChunkSamples>()
            .register_type::<NoAutoAabb>()
            .add_observer(handmade::forget_removed_samples)
            .add_systems(PostUpdate, (mesh_terrains, handmade::mesh_samples).chain().in_set(MarchlessSystems::Mesh));
    }
}

/// What the jobs have meshed.
#[derive(Resource, Default)]
struct MeshResults(Results<MeshResult>);

struct MeshResult {
    terrain: Entity,
    group: u64,
    meshed: Meshed,
}

/// What showing a mesh takes.
#[derive(SystemParam)]
struct Screen<'w, 's> {
    commands: Commands<'w, 's>,
    assets: Option<ResMut<'w, Assets<Mesh>>>,
    stats: ResMut<'w, Stats>,
}

impl Screen<'_, '_> {
    /// Gives an entity its new mesh, which may be empty. `cells`: the chunk's size, whose box bounds an empty mesh.
    fn show(&mut self, entity: Entity, meshed: Meshed, cells: [u32; 3]) {
        let bounds = mesh_bounds(&meshed.geometry, cells);
        let mut entity = self.commands.entity(entity);
        entity.try_insert((ChunkGeometry { mesh: meshed.geometry }, bounds));
        match (&mut self.assets, meshed.mesh) {
            (Some(assets), Some(mesh)) => entity.try_insert(Mesh3d(assets.add(mesh))),
            _ => entity.try_remove::<Mesh3d>(),
        };
    }
}

/// Shows the groups that are complete, and starts new ones.
fn mesh_terrains(
    mut volumes: Query<(Entity, &mut TerrainVolume)>,
    queue: Res<WorkQueue>,
    results: Res<MeshResults>,
    settings: Res<MarchlessSettings>,
    mut screen: Screen,
) {
    for MeshResult { terrain, group, meshed } in results.0.take() {
        screen.stats.count_mesh(meshed.time);
        let Ok((_, mut volume)) = volumes.get_mut(terrain) else { continue };
        let Some(unfinished) = volume.groups.get_mut(&group) else { continue };
        unfinished.meshed.push(meshed);
        if unfinished.meshed.len() == unfinished.members
            && let Some(group) = volume.take_group(group)
        {
            show_group(&mut volume, group, &mut screen);
        }
    }
    for (terrain, mut volume) in &mut volumes {
        if !volume.ready.is_empty() || !volume.pending.is_empty() {
            let mut start = Start { terrain, queue: &queue, results: &results, screen: &mut screen, inline: 0 };
            start.ready_chunks(&mut volume);
            start.inline = settings.inline_chunks;
            start.pending_chunks(&mut volume);
        }
    }
}

/// Starting the groups of one terrain.
struct Start<'a, 'w, 's> {
    terrain: Entity,
    queue: &'a WorkQueue,
    results: &'a MeshResults,
    screen: &'a mut Screen<'w, 's>,
    /// Groups of at most so many chunks are meshed at once.
    inline: usize,
}

impl Start<'_, '_, '_> {
    /// Starts the chunks that can be meshed for the first time, one by one; those without a surface need no job.
    fn ready_chunks(&mut self, volume: &mut TerrainVolume) {
        let mut uniform = BTreeSet::new();
        for position in core::mem::take(&mut volume.ready) {
            if volume.pending.iter().any(|pending| pending.chunks.contains(&position)) {
                // It will be meshed with them.
            } else if volume.claims.contains_key(&position) {
                volume.ready.insert(position);
            } else if volume.grid.neighbourhood(position).is_uniform() {
                uniform.insert(position);
            } else {
                let distance = volume.settings.as_ref().map_or(0, |terrain| distance_to_middle(terrain, position));
                let pending = Pending { chunks: BTreeSet::from([position]), since: None };
                self.group(volume, pending, Priority::FirstMesh(distance));
            }
        }
        self.group(volume, Pending { chunks: uniform, since: None }, Priority::Edit);
    }

    /// Starts the changed chunks that no group is working on.
    fn pending_chunks(&mut self, volume: &mut TerrainVolume) {
        for pending in core::mem::take(&mut volume.pending) {
            if volume.free_for_edit(&pending.chunks) {
                self.group(volume, pending, Priority::Edit);
            } else {
                volume.pending.push(pending);
            }
        }
    }

    /// Starts a group: shows it at once, where that is quick, or asks for its meshes.
    fn group(&mut self, volume: &mut TerrainVolume, Pending { chunks, since }: Pending, priority: Priority) {
        let Some(terrain) = &volume.settings else { return };
        let (settings, colors) = (terrain.mesh_settings(), volume.colors.clone());
        let mut group = Group {
            chunks,
            snapshot: BTreeMap::new(),
            isovalue: settings.isovalue,
            since,
            withdrawable: matches!(priority, Priority::FirstMesh(_)),
            tickets: Vec::new(),
            members: 0,
            meshed: Vec::new(),
        };
        let mut jobs = Vec::new();
        for &position in &group.chunks {
            if volume.chunks.get(&position).is_none_or(|state| state.missing > 0 || state.entity.is_none()) {
                continue;
            }
            group.members += 1;
            for neighbour in around(position) {
                if let Some(chunk) = volume.grid.chunk(neighbour) {
                    group.snapshot.entry(neighbour).or_insert_with(|| chunk.clone());
                }
            }
            let samples = volume.grid.neighbourhood(position);
            if samples.is_uniform() {
                group.meshed.push(Meshed::empty(position));
            } else {
                let colors = self.screen.assets.is_some().then(|| colors.clone());
                jobs.push(MeshJob { position, samples, settings, colors });
            }
        }
        if group.members == 0 {
            return;
        }
        if jobs.len() <= self.inline {
            for meshed in mesh_now(jobs) {
                self.screen.stats.count_mesh(meshed.time);
                group.meshed.push(meshed);
            }
            show_group(volume, group, self.screen);
            return;
        }
        let id = volume.claim(&group.chunks);
        for job in jobs {
            let (terrain, results) = (self.terrain, self.results.0.clone());
            let run = move || results.push(MeshResult { terrain, group: id, meshed: job.run() });
            group.tickets.push(self.queue.push(priority, run));
        }
        volume.groups.insert(id, group);
    }
}

/// Shows all chunks of a complete group.
fn show_group(volume: &mut TerrainVolume, group: Group, screen: &mut Screen) {
    let cells = [volume.grid.chunk_cells(); 3];
    for meshed in group.meshed {
        let Some(state) = volume.chunks.get_mut(&meshed.position) else { continue };
        let (was_empty, is_empty) = (state.empty, meshed.geometry.is_empty());
        (state.drawn, state.empty) = (true, is_empty);
        if let Some(entity) = state.entity
            && !(was_empty && is_empty)
        {
            screen.show(entity, meshed, cells);
        }
    }
    for (position, chunk) in group.snapshot {
        let is_drawn = volume.chunks.get(&position).is_some_and(|state| state.drawn);
        let is_new = || !volume.shown.chunk(position).is_some_and(|shown| same_samples(shown, &chunk));
        if (group.chunks.contains(&position) || !is_drawn) && is_new() {
            volume.shown.insert(position, chunk).expect("a chunk of the same extent");
        }
    }
    volume.shown.take_dirty();
    volume.shown_isovalue = group.isovalue;
    if let Some(since) = group.since {
        screen.stats.edit_is_visible(since);
    }
}

/// Whether two chunks are known to be the same without looking at their samples.
fn same_samples(a: &Chunk<i16>, b: &Chunk<i16>) -> bool {
    match (a, b) {
        (Chunk::Uniform(a), Chunk::Uniform(b)) => a == b,
        (Chunk::Samples(a), Chunk::Samples(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}
