//! Fills chunks from the terrain's source, in jobs.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bevy_ecs::prelude::*;
use marchless::Chunk;

use super::{Terrain, TerrainVolume};
use crate::brush::apply_waiting_stamps;
use crate::work::{Priority, Results, Ticket, WorkQueue};

/// What the jobs have sampled.
#[derive(Resource, Default)]
pub(crate) struct FillResults(Results<Filled>);

struct Filled {
    terrain: Entity,
    filling: u64,
    position: [i32; 3],
    /// `None` where the source panicked.
    chunk: Option<Chunk<i16>>,
}

/// Asks for the samples of a chunk; those nearest to the terrain's middle come first.
pub(crate) fn fill_chunk(
    entity: Entity,
    terrain: &Terrain,
    filling: u64,
    position: [i32; 3],
    queue: &WorkQueue,
    results: &FillResults,
) -> Ticket {
    let (source, results) = (terrain.source.get().clone(), results.0.clone());
    let (cells, spacing) = (terrain.chunk_cells, f64::from(terrain.voxel_size));
    queue.push(Priority::Fill(distance_to_middle(terrain, position)), move || {
        let sample = || Chunk::from_source(source.as_ref(), position, cells, spacing);
        let chunk = catch_unwind(AssertUnwindSafe(sample)).ok();
        results.push(Filled { terrain: entity, filling, position, chunk });
    })
}

/// The squared distance from a chunk to the middle of the terrain, in half chunks.
pub(crate) fn distance_to_middle(terrain: &Terrain, position: [i32; 3]) -> u32 {
    let kept = terrain.kept_region();
    (0..3).map(|axis| (2 * position[axis] + 1).abs_diff(kept.min[axis] + kept.max[axis]).pow(2)).sum()
}

/// Takes sampled chunks into their volumes, with the stamps that came before them.
pub(crate) fn take_filled_chunks(results: Res<FillResults>, mut volumes: Query<&mut TerrainVolume>) {
    for Filled { terrain, filling, position, chunk } in results.0.take() {
        let Ok(mut volume) = volumes.get_mut(terrain) else { continue };
        if volume.filling != filling {
            continue;
        }
        let chunk = chunk.unwrap_or_else(|| {
            bevy_log::error_once!("a terrain's source panicked; chunk {position:?} of terrain {terrain} stays air");
            Chunk::AIR
        });
        let volume = &mut *volume;
        let Some(state) = volume.chunks.get_mut(&position).filter(|state| !state.is_filled()) else { continue };
        state.fill = None;
        volume.grid.insert(position, chunk).expect("a chunk of the extent, with the grid's own number of cells");
        apply_waiting_stamps(volume, position);
        volume.set_filled(position);
        // Nothing that reads these samples has been drawn: chunks are meshed once all around them are filled.
        volume.grid.take_dirty();
    }
}
