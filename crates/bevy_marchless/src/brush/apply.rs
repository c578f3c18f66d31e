//! Applies stamps to volumes, chunk by chunk.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_ecs::prelude::*;
use marchless::Region;

use super::{Stamp, TerrainEdited};
use crate::stats::{Since, Stats};
use crate::terrain::TerrainVolume;

/// Stamps that have been read but not applied, in order.
#[derive(Resource, Default)]
pub(crate) struct StampQueue(Vec<Queued>);

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
pub(crate) fn apply_stamps(mut queue: ResMut<StampQueue>, mut volumes: Query<&mut TerrainVolume>) {
    let mut edited = BTreeMap::<Entity, Since>::new();
    for Queued { terrain, stamp, since } in queue.0.drain(..) {
        match volumes.get_mut(terrain) {
            Ok(mut volume) if volume.settings().is_some() => {
                apply_stamp(&mut volume, stamp);
                edited.entry(terrain).or_insert(since);
            }
            Ok(_) => bevy_log::warn!("a stamp is dropped: the settings of terrain {terrain} were refused"),
            Err(_) => bevy_log::warn!("a stamp is dropped: entity {terrain} has no terrain"),
        }
    }
    for (terrain, since) in edited {
        if let Ok(mut volume) = volumes.get_mut(terrain) {
            let dirty = volume.grid.take_dirty();
            volume.add_pending(dirty, Some(since));
        }
    }
}

/// Applies a stamp to the chunks that have their samples, and keeps it for the others.
fn apply_stamp(volume: &mut TerrainVolume, stamp: marchless::Stamp) {
    let touched = stamp.region();
    let Some(bounds) = volume.grid.bounds().filter(|_| !touched.is_empty()) else { return };
    let (low, high) = (volume.grid.chunk_of(touched.min), volume.grid.chunk_of(touched.max.map(|v| v - 1)));
    let stamp = Arc::new(stamp);
    for position in Region::new(low, high.map(|v| v + 1)).intersection(&bounds).points() {
        match volume.chunks.get_mut(&position) {
            Some(state) if !state.is_filled() => state.stamps.push(stamp.clone()),
            _ => volume.edit.merge(&volume.grid.apply_to_chunk(position, &stamp)),
        }
    }
}

/// Applies the stamps that came before a chunk's samples.
pub(crate) fn apply_waiting_stamps(volume: &mut TerrainVolume, position: [i32; 3]) {
    let Some(state) = volume.chunks.get_mut(&position) else { return };
    for stamp in core::mem::take(&mut state.stamps) {
        volume.edit.merge(&volume.grid.apply_to_chunk(position, &stamp));
    }
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
