//! Applies stamps to volumes, chunk by chunk.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_ecs::prelude::*;
use marchless::{Chunk, Region};

use super::{Stamp, TerrainEdited};
use crate::chunk::ChunkKey;
use crate::stats::{MainThread, Since, Stats};
use crate::stream::free_samples_for;
use crate::terrain::{Pending, Signs, Terrain, TerrainVolume};

/// Stamps that have been read but not applied, in order.
#[derive(Resource, Default)]
pub(crate) struct StampQueue(Vec<Queued>);

impl StampQueue {
    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

struct Queued {
    terrain: Entity,
    stamp: marchless::Stamp,
    since: Since,
}

/// Quantises the update's stamps and queues them.
pub(crate) fn read_stamps(mut stamps: MessageReader<Stamp>, mut queue: ResMut<StampQueue>, stats: Res<Stats>) {
    for message in stamps.read() {
        match message.quantised() {
            Ok(stamp) => queue.0.push(Queued { terrain: message.terrain, stamp, since: stats.now() }),
            Err(error) => bevy_log::warn!("a stamp on terrain {} is dropped: {error}", message.terrain),
        }
    }
}

/// Applies the queued stamps in order; what they change together becomes one set of chunks to be meshed.
///
/// A stamp that needs samples that were dropped waits for them, and the terrain's stamps behind it wait with it.
pub(crate) fn apply_stamps(
    mut queue: ResMut<StampQueue>,
    mut volumes: Query<&mut TerrainVolume>,
    mut main_thread: ResMut<MainThread>,
) {
    if queue.0.is_empty() {
        return;
    }
    let start = main_thread.start();
    let mut edited = BTreeMap::<Entity, Applied>::new();
    let mut waiting = BTreeMap::<Entity, bool>::new();
    queue.0.retain(|Queued { terrain, stamp, since }| {
        let terrain = *terrain;
        match volumes.get_mut(terrain) {
            Ok(mut volume) if volume.settings().is_some() => {
                let waits = waiting.entry(terrain).or_default();
                *waits = *waits || !free_samples_for(&mut volume, stamp.region());
                if !*waits {
                    let applied = edited.entry(terrain).or_insert_with(|| Applied::new(*since));
                    apply_stamp(&mut volume, *stamp, applied);
                }
                return *waits;
            }
            Ok(_) => bevy_log::warn!("a stamp is dropped: the settings of terrain {terrain} were refused"),
            Err(_) => bevy_log::warn!("a stamp is dropped: entity {terrain} has no terrain"),
        }
        false
    });
    for (terrain, waits) in waiting {
        if let Ok(mut volume) = volumes.get_mut(terrain) {
            volume.streaming.holds_stamps = waits;
        }
    }
    for (terrain, applied) in edited {
        if let Ok(mut volume) = volumes.get_mut(terrain) {
            applied.note(&mut volume);
        }
    }
    main_thread.stop(start);
}

/// What an update's stamps have done to a terrain's chunks.
struct Applied {
    /// Of the first of them.
    since: Since,
    /// The chunks with changed samples, as they were.
    before: BTreeMap<[i32; 3], Chunk<i16>>,
    /// A box around the changed samples.
    changed: Region,
}

impl Applied {
    const fn new(since: Since) -> Self {
        Self { since, before: BTreeMap::new(), changed: Region::new([0; 3], [0; 3]) }
    }

    /// Notes which chunks are to be shown anew, and which of them to be meshed.
    fn note(self, volume: &mut TerrainVolume) {
        let chunks = volume.grid.take_dirty();
        let settings = volume.settings().map(Terrain::mesh_settings).unwrap_or_default();
        let redrawn = volume.grid.chunks_redrawn(&self.before, self.changed, &settings);
        let look_the_same = redrawn.map(|redrawn| chunks.difference(&redrawn).copied().map(ChunkKey::finest).collect());
        volume.add_pending(Pending {
            chunks: chunks.into_iter().map(ChunkKey::finest).collect(),
            look_the_same: look_the_same.unwrap_or_default(),
            since: Some(self.since),
        });
    }
}

/// Applies a stamp to the chunks that have their samples, and keeps it for the others, loaded or not.
fn apply_stamp(volume: &mut TerrainVolume, stamp: marchless::Stamp, applied: &mut Applied) {
    let touched = stamp.region();
    let Some(bounds) = volume.grid.bounds().filter(|_| !touched.is_empty()) else { return };
    let (low, high) = (volume.grid.chunk_of(touched.min), volume.grid.chunk_of(touched.max.map(|v| v - 1)));
    let stamp = Arc::new(stamp);
    for position in Region::new(low, high.map(|v| v + 1)).intersection(&bounds).points() {
        let has_samples = match volume.chunks.get(&ChunkKey::finest(position)) {
            Some(state) => state.is_filled(),
            None => volume.grid.chunk(position).is_some(),
        };
        if has_samples {
            // A clone lives for the first change only: while it does, the samples are copied to be changed.
            let is_first = !applied.before.contains_key(&position);
            let before = is_first.then(|| volume.grid.chunk(position).cloned().unwrap_or(Chunk::AIR));
            let changed = change(volume, position, &stamp);
            if !changed.is_empty() {
                applied.before.extend(before.map(|before| (position, before)));
                applied.changed = applied.changed.union(&changed);
            }
        } else {
            volume.stamps.entry(position).or_default().push(stamp.clone());
        }
    }
}

/// Applies the stamps that came before a chunk's samples.
pub(crate) fn apply_waiting_stamps(volume: &mut TerrainVolume, position: [i32; 3]) {
    for stamp in volume.stamps.remove(&position).unwrap_or_default() {
        change(volume, position, &stamp);
    }
}

/// Applies a stamp to a chunk's samples, and returns a box around those that changed.
fn change(volume: &mut TerrainVolume, position: [i32; 3], stamp: &Arc<marchless::Stamp>) -> Region {
    let edit = volume.grid.apply_to_chunk(position, stamp, &mut volume.spare);
    if !edit.is_empty() {
        volume.edited.entry(position).or_default().push(stamp.clone());
        if let Some(state) = volume.chunks.get_mut(&ChunkKey::finest(position)) {
            state.signs = Signs::UNKNOWN;
        }
    }
    volume.edit.merge(&edit);
    edit.region
}

/// Tells what the update has changed of each terrain.
pub(crate) fn report_edits(mut volumes: Query<(Entity, &mut TerrainVolume)>, mut edited: MessageWriter<TerrainEdited>) {
    for (terrain, mut volume) in &mut volumes {
        if volume.edit.is_empty() {
            continue;
        }
        let edit = core::mem::take(&mut volume.edit);
        edited.write(TerrainEdited {
            terrain,
            min: edit.region.min.into(),
            max: edit.region.max.into(),
            added: edit.added.iter().collect(),
            removed: edit.removed.iter().collect(),
        });
    }
}
