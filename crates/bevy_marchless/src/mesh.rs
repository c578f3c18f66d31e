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
mod rooms;

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};

use bevy_app::{App, Plugin, PostUpdate};
use bevy_asset::Assets;
use bevy_camera::visibility::NoAutoAabb;
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_mesh::{Mesh, Mesh3d, MeshVertexAttribute, VertexFormat};
use bevy_platform::time::Instant;
use marchless::{Chunk, Grid, MeshBuffer};

pub use handmade::{ChunkSamples, ChunkSamplesError};
pub(crate) use job::{Colors, Meshed};
use job::{mesh_chunk, mesh_now};
use rooms::MeshRooms;

use crate::chunk::{ChunkGeometry, ChunkKey, mesh_bounds, new_chunk};
use crate::schedule::{MarchlessSettings, MarchlessSystems};
use crate::stats::{MainThread, Stats};
use crate::stream::{ENTITY_TIME, StreamStats, Wanted, in_flight};
use crate::terrain::{ChunkState, Group, Pending, TerrainVolume, same_samples};
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
            .init_resource::<MeshRooms>()
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
    rooms: Res<'w, MeshRooms>,
    stats: ResMut<'w, Stats>,
    stream: ResMut<'w, StreamStats>,
}

impl Screen<'_, '_> {
    /// Gives an entity its new mesh, which may be empty. `cells`: the chunk's size, whose box bounds an empty mesh.
    fn show(&mut self, entity: Entity, meshed: Meshed, cells: [u32; 3]) {
        let bounds = mesh_bounds(&meshed.geometry, cells);
        let mut entity = self.commands.entity(entity);
        let shown = (ChunkGeometry { mesh: meshed.geometry }, bounds);
        match (&mut self.assets, meshed.mesh) {
            (Some(assets), Some(mesh)) => entity.try_insert((shown, Mesh3d(assets.add(mesh)))),
            _ => entity.try_insert(shown).try_remove::<Mesh3d>(),
        };
    }

    /// Spawns a chunk with its mesh, which is not empty.
    fn spawn(&mut self, chunk: impl Bundle, meshed: Meshed, cells: [u32; 3]) -> Entity {
        let bounds = mesh_bounds(&meshed.geometry, cells);
        let mut entity = self.commands.spawn((chunk, ChunkGeometry { mesh: meshed.geometry }, bounds));
        if let (Some(assets), Some(mesh)) = (&mut self.assets, meshed.mesh) {
            entity.insert(Mesh3d(assets.add(mesh)));
        }
        entity.id()
    }

    fn count_mesh(&mut self, time: Duration) {
        self.stats.count_mesh(time);
        self.stream.meshed += 1;
        self.stream.mesh_time += time;
    }
}

/// Shows the groups that are complete, and starts new ones.
fn mesh_terrains(
    mut volumes: Query<(Entity, &mut TerrainVolume)>,
    queue: Res<WorkQueue>,
    results: Res<MeshResults>,
    mut waiting: Local<Vec<MeshResult>>,
    settings: Res<MarchlessSettings>,
    mut main_thread: ResMut<MainThread>,
    mut screen: Screen,
) {
    let start = main_thread.start();
    let (mut bytes, mut shown, until) = (0, 0, main_thread.until(start, settings.main_thread));
    waiting.extend(results.0.take());
    for result in core::mem::take(&mut *waiting) {
        let MeshResult { terrain, group, .. } = result;
        let Ok((_, mut volume)) = volumes.get_mut(terrain) else { continue };
        let Some(unfinished) = volume.groups.get_mut(&group) else { continue };
        // New chunks may come one by one; an edit is shown as a whole.
        let now = Instant::now() + shown * ENTITY_TIME;
        if unfinished.withdrawable && (bytes > settings.upload_bytes || bytes > 0 && now > until) {
            waiting.push(result);
            continue;
        }
        let meshed = result.meshed;
        bytes += geometry_bytes(&meshed.geometry);
        screen.count_mesh(meshed.time);
        unfinished.meshed.push(meshed);
        if unfinished.meshed.len() == unfinished.members
            && let Some(group) = volume.take_group(group)
        {
            show_group(terrain, &mut volume, group, &mut screen);
            shown += 1;
        }
    }
    let until = until.checked_sub(shown * ENTITY_TIME).unwrap_or(until);
    for (terrain, mut volume) in &mut volumes {
        if !volume.ready.is_empty() || !volume.streaming.to_mesh.is_empty() || !volume.pending.is_empty() {
            let mut start = Start { terrain, queue: &queue, results: &results, screen: &mut screen, inline: 0 };
            start.inline = settings.inline_chunks;
            start.pending_chunks(&mut volume);
            start.inline = 0;
            start.ready_chunks(&mut volume, until);
            start.first_meshes(&mut volume, &settings, until);
        }
    }
    main_thread.stop(start);
}

/// Whether a chunk and all around it are certainly of one kind: that is asked without touching shared samples.
fn is_uniform_around(grid: &Grid<i16>, position: [i32; 3]) -> bool {
    !matches!(grid.chunk(position), Some(Chunk::Samples(_))) && grid.neighbourhood_view(position).is_uniform()
}

/// How many bytes a mesh takes, in memory and, or about so, on the graphics card.
pub(crate) fn geometry_bytes(mesh: &MeshBuffer) -> usize {
    size_of_val(&mesh.positions[..])
        + size_of_val(&mesh.normals[..])
        + size_of_val(&mesh.materials[..])
        + size_of_val(&mesh.indices[..])
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
    /// Goes through the chunks that can be meshed for the first time; those without a surface need no job.
    fn ready_chunks(&mut self, volume: &mut TerrainVolume, until: Instant) {
        let mut no_longer_drawn = BTreeSet::new();
        let (mut done, mut later) = (0, Vec::new());
        while let Some(key) = volume.ready.pop() {
            let is_ready = volume.chunks.get(&key).is_some_and(ChunkState::is_ready);
            if !is_ready || volume.pending.iter().any(|pending| pending.chunks.contains(&key)) {
                // Gone, or meshed already; or it will be, with the changed ones.
                continue;
            }
            if volume.claims.contains_key(&key) {
                later.push(key);
            } else if volume.is_without_surface(key) || is_uniform_around(&volume.grid, key.position) {
                if let Some(state) = volume.chunks.get_mut(&key).filter(|state| state.empty) {
                    (state.drawn, state.stale) = (true, false);
                    volume.streaming.may_drop_more = true;
                    if let Some(chunk) = volume.grid.chunk(key.position) {
                        volume.shown.load(key.position, chunk.clone()).expect("a chunk of the same extent");
                    }
                } else {
                    no_longer_drawn.insert(key);
                }
            } else {
                volume.streaming.add_to_mesh(key);
            }
            done += 1;
            if done % 4 == 0 && Instant::now() >= until {
                break;
            }
        }
        volume.ready.append(&mut later);
        self.group(volume, Pending { chunks: no_longer_drawn, ..Pending::default() }, Priority::Edit);
    }

    /// Starts the most urgent chunks that are to be meshed for the first time, one by one, as many as may be in flight.
    fn first_meshes(&mut self, volume: &mut TerrainVolume, settings: &MarchlessSettings, until: Instant) {
        let (limit, mut done) = (in_flight(settings), 0);
        while volume.first_meshes < limit {
            let TerrainVolume { chunks, pending, streaming, .. } = &mut *volume;
            let waits = |key: &ChunkKey| {
                chunks.get(key).is_some_and(ChunkState::is_ready)
                    && !pending.iter().any(|pending| pending.chunks.contains(key))
            };
            let Some(key) = streaming.next_to_mesh(waits) else { break };
            if volume.claims.contains_key(&key) {
                volume.ready.push(key);
                continue;
            }
            let urgency = volume.streaming.ranges().urgency(key.position);
            let pending = Pending { chunks: BTreeSet::from([key]), ..Pending::default() };
            self.group(volume, pending, Priority::FirstMesh(urgency));
            done += 1;
            if done % 2 == 0 && Instant::now() >= until {
                break;
            }
        }
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
    fn group(&mut self, volume: &mut TerrainVolume, pending: Pending, priority: Priority) {
        let Pending { chunks, look_the_same, since } = pending;
        let Some(terrain) = &volume.settings else { return };
        let settings = terrain.mesh_settings();
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
        // What is drawn changes with the others: where samples around it are missing, all wait for them.
        let mut waits = false;
        for key in &group.chunks {
            if let Some(state) = volume.chunks.get_mut(key)
                && state.wanted == Wanted::Mesh
                && (state.drawn && !state.hidden && state.missing > 0)
            {
                (state.stale, waits) = (true, true);
                volume.streaming.look_at(*key);
            }
        }
        if waits {
            volume.pending.push(Pending { chunks: group.chunks, look_the_same, since });
            return;
        }
        let is_member = |key: &ChunkKey| {
            let is_wanted = |state: &ChunkState| state.wanted == Wanted::Mesh && !state.hidden && state.missing == 0;
            volume.chunks.get(key).is_some_and(is_wanted)
        };
        let members: Vec<ChunkKey> = group.chunks.iter().copied().filter(is_member).collect();
        let mut to_mesh = Vec::new();
        for key in members {
            let samples = volume.grid.neighbourhood_view(key.position);
            let shown = volume.shown.neighbourhood_view(key.position);
            for (near, (chunk, shown)) in key.around().zip(samples.chunks().iter().zip(shown.chunks())) {
                let Some(chunk) = chunk.filter(|chunk| !shown.is_some_and(|shown| same_samples(shown, chunk))) else {
                    continue;
                };
                let is_drawn = || volume.chunks.get(&near).is_some_and(|state| state.drawn);
                if group.chunks.contains(&near) || !is_drawn() {
                    group.snapshot.entry(near.position).or_insert_with(|| chunk.clone());
                }
            }
            let is_drawn = volume.chunks.get(&key).is_some_and(|state| state.drawn && !state.stale);
            if is_drawn && look_the_same.contains(&key) {
                continue;
            }
            group.members += 1;
            if samples.is_uniform() {
                group.meshed.push(Meshed::empty(key.position));
            } else {
                to_mesh.push((key.position, samples));
            }
        }
        if group.members == 0 && group.snapshot.is_empty() {
            return;
        }
        let colors = self.screen.assets.is_some().then(|| volume.colors.clone());
        if to_mesh.len() <= self.inline {
            let meshed = mesh_now(&to_mesh, &settings, colors.as_ref(), &self.screen.rooms);
            self.screen.rooms.prepare(meshed.iter().map(|meshed| &*meshed.geometry), colors.is_some());
            for meshed in meshed {
                self.screen.count_mesh(meshed.time);
                group.meshed.push(meshed);
            }
            show_group(self.terrain, volume, group, self.screen);
            return;
        }
        let to_mesh: Vec<_> =
            to_mesh.into_iter().map(|(position, samples)| (position, samples.to_neighbourhood())).collect();
        let id = volume.claim(&group.chunks);
        volume.first_meshes += usize::from(group.withdrawable);
        for (position, samples) in to_mesh {
            let (terrain, results, colors) = (self.terrain, self.results.0.clone(), colors.clone());
            let run = move || {
                let meshed = mesh_chunk(&samples.view(), position, &settings, colors.as_ref(), None);
                results.push(MeshResult { terrain, group: id, meshed });
            };
            group.tickets.push(self.queue.push(priority, run));
        }
        volume.groups.insert(id, group);
    }
}

/// Shows all chunks of a complete group.
fn show_group(terrain: Entity, volume: &mut TerrainVolume, group: Group, screen: &mut Screen) {
    let Some(voxel_size) = volume.settings.as_ref().map(|settings| settings.voxel_size) else { return };
    let cells = volume.grid.chunk_cells();
    for meshed in group.meshed {
        let key = ChunkKey::finest(meshed.position);
        let Some(state) = volume.chunks.get_mut(&key).filter(|state| state.wanted == Wanted::Mesh) else { continue };
        let (was_empty, is_empty) = (state.empty, meshed.geometry.is_empty());
        (state.drawn, state.empty, state.stale) = (true, is_empty, false);
        match state.entity {
            Some(entity) if !(was_empty && is_empty) => screen.show(entity, meshed, [cells; 3]),
            None if !is_empty && !state.hidden => {
                state.entity = Some(screen.spawn(new_chunk(terrain, key, cells, voxel_size), meshed, [cells; 3]));
            }
            _ => {}
        }
    }
    for (position, chunk) in group.snapshot {
        let key = ChunkKey::finest(position);
        let Some(state) = volume.chunks.get(&key) else { continue };
        let is_new = || !volume.shown.chunk(position).is_some_and(|shown| same_samples(shown, &chunk));
        if (group.chunks.contains(&key) || !state.drawn) && is_new() {
            volume.forget_shown(position);
            volume.shown.load(position, chunk).expect("a chunk of the same extent");
        }
    }
    volume.shown_isovalue = group.isovalue;
    volume.streaming.may_drop_more = true;
    if let Some(since) = group.since {
        screen.stats.edit_is_visible(since);
    }
}
