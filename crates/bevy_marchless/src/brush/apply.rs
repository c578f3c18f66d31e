//! Applies stamps to volumes and reports the changes.

use std::collections::BTreeMap;

use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;
use marchless::Edit;

use super::{Stamp, TerrainEdited};
use crate::budget::FrameBudget;
use crate::schedule::NewEdits;
use crate::stats::{RequestTime, TerrainStats};
use crate::terrain::TerrainVolume;
use crate::volume::Edits;

/// The stamps that are read but not yet applied, in order.
#[derive(Resource, Default)]
pub(super) struct StampQueue(Vec<Queued>);

struct Queued {
    terrain: Entity,
    stamp: marchless::QuantisedStamp,
    since: RequestTime,
    /// The terrain's request count and isovalue that the stamp is for. Set on the stamp's first turn, so that its wait
    /// makes no difference.
    request: Option<(u64, f32)>,
}

/// Quantises the update's stamps and queues them.
pub(super) fn read_stamps(
    mut stamps: MessageReader<Stamp>,
    mut queue: ResMut<StampQueue>,
    mut new_edits: ResMut<NewEdits>,
    stats: Res<TerrainStats>,
) {
    let since = stats.now();
    for message in stamps.read() {
        match message.quantised() {
            Ok(stamp) => queue.0.push(Queued { terrain: message.terrain, stamp, since, request: None }),
            Err(error) => bevy_log::warn!("a stamp on terrain {} is dropped: {error}", message.terrain),
        }
    }
    new_edits.0 = queue.0.iter().any(|queued| queued.request.is_none());
}

/// Applies the queued stamps in order and reports the changes. Stamps whose chunks overlap become one set of chunks to
/// mesh.
///
/// A stamp waits for samples that were dropped, and the terrain's later stamps wait behind it. Stamps also wait while
/// their terrain is disabled, while its source is about to change, and while its world's file is being read.
pub(super) fn apply_stamps(
    mut queue: ResMut<StampQueue>,
    mut volumes: Query<(Entity, &mut TerrainVolume)>,
    disabled: Query<(), (With<TerrainVolume>, With<Disabled>)>,
    mut reports: MessageWriter<TerrainEdited>,
    mut budget: ResMut<FrameBudget>,
) {
    let start = Instant::now();
    let mut edits = BTreeMap::<Entity, Edits>::new();
    let mut waiting = BTreeMap::<Entity, bool>::new();
    queue.0.retain_mut(|queued| {
        let terrain = queued.terrain;
        let Ok((_, mut volume)) = volumes.get_mut(terrain) else {
            let waits = disabled.contains(terrain);
            if !waits {
                bevy_log::warn!("a stamp is dropped: entity {terrain} has no terrain");
            }
            return waits;
        };
        if volume.is_loading() {
            return true;
        }
        let Some(isovalue) = volume.settings().map(|settings| settings.isovalue) else {
            bevy_log::warn!("a stamp is dropped: the settings of terrain {terrain} were refused");
            return false;
        };
        let waits = waiting.entry(terrain).or_default();
        let (request, isovalue) = *queued.request.get_or_insert((volume.requests(), isovalue));
        if request != volume.requests() {
            return false; // The stamp was for an earlier source, whose edits are discarded.
        }
        *waits = *waits || volume.has_next() || !volume.heart_mut().has_samples_for(queued.stamp.region());
        if !*waits {
            let stamp = queued.stamp.with_isovalue(isovalue);
            volume.heart_mut().stamp(stamp, queued.since, edits.entry(terrain).or_default());
        }
        *waits
    });
    for (terrain, waits) in waiting {
        if let Ok((_, mut volume)) = volumes.get_mut(terrain) {
            volume.heart_mut().set_holds_stamps(waits);
        }
    }
    for (terrain, mut volume) in &mut volumes {
        let edits = edits.remove(&terrain);
        if edits.is_none() && !volume.heart().has_late_edits() {
            continue;
        }
        let heart = volume.heart_mut();
        let late = heart.take_late_edits();
        let edits = edits.map(|edits| heart.finish_edits(edits)).unwrap_or_default();
        reports.write_batch(late.iter().chain(&edits).map(|edit| report(terrain, edit)));
    }
    budget.spend_on_edits(start.elapsed());
}

fn report(terrain: Entity, edit: &Edit) -> TerrainEdited {
    TerrainEdited {
        terrain,
        min: edit.region.min.into(),
        max: edit.region.max.into(),
        added: edit.added.iter().collect(),
        removed: edit.removed.iter().collect(),
    }
}
