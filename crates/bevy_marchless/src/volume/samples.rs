//! [`SampleStore`]: a terrain's samples, the newest and the shown ones, and the edits that stamps made.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_platform::collections::HashMap;
use marchless::{
    DEFAULT_CHUNK_CELLS, Edit, Grid, GridChunk, LeafKey, MeshMethod, NeighbourhoodView, QuantisedStamp, Region,
    SamplePool,
};

use super::stamps::{LoggedStamp, StampLog};
use crate::jobs::new_number;

/// The samples of one terrain. Undo, saving and replication need nothing else.
///
/// A chunk's samples are *resident* or not. Resident samples hold every stamp. Other samples are made again by the
/// source, and a [`Replay`] applies their stamps in order.
pub(crate) struct SampleStore {
    /// The resident chunks, with every stamp.
    newest: Grid<i16>,
    /// The samples as drawn, and those that chunks to be drawn beside drawn ones will have.
    shown: Grid<i16>,
    log: StampLog,
    /// The chunks that stamps have changed while they were resident.
    edited: HashMap<[i32; 3], KeptEdits>,
    /// The number of edited chunks that are held.
    held: usize,
    pool: SamplePool,
    /// The number of the present source; tells samples of earlier sources. 0 before the first.
    generation: u64,
}

/// The record of a chunk's edits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeptEdits {
    /// Stamps in the log: `changes` of them have changed the chunk, and the edits of those up to `reported` have been
    /// reported.
    Stamps { changes: u32, reported: u64 },
    /// The samples themselves, wherever viewers are.
    Held,
}

/// The number of stamps beyond which a chunk's samples stay instead: they take less memory then.
pub(super) const MAX_STAMPS: u32 = 64;

/// The stamps that a chunk's samples from the source still lack.
pub(crate) struct Replay {
    position: [i32; 3],
    stamps: Vec<LoggedStamp>,
    /// The number of the latest stamp of all.
    through: u64,
    reported: u64,
    /// An empty grid with the terrain's border.
    grid: Grid<i16>,
}

/// The result of a [`Replay`].
pub(crate) struct Replayed {
    through: u64,
    changes: u32,
    /// The edit made by stamps that had not been reported.
    edit: Edit,
}

/// The changes that one stamp made.
pub(crate) struct StampChanges {
    pub(crate) edit: Edit,
    /// The chunks with changed samples.
    pub(crate) chunks: Vec<[i32; 3]>,
    /// The chunks whose meshes read changed samples.
    pub(crate) affected: BTreeSet<[i32; 3]>,
    /// Chunks that are not resident and have so many stamps that their samples should become resident and stay.
    pub(crate) crowded: Vec<[i32; 3]>,
}

impl Default for SampleStore {
    fn default() -> Self {
        Self::new(Grid::new(DEFAULT_CHUNK_CELLS).expect("the default is within the limits"), 0)
    }
}

impl SampleStore {
    fn new(grid: Grid<i16>, generation: u64) -> Self {
        Self {
            shown: grid.clone(),
            newest: grid,
            log: StampLog::default(),
            edited: HashMap::default(),
            held: 0,
            pool: SamplePool::new(),
            generation,
        }
    }

    /// A store without samples. `empty`: a grid of the terrain's chunks.
    pub(super) fn of(grid: Grid<i16>) -> Self {
        Self::new(grid, new_number())
    }

    /// The newest samples.
    pub(crate) const fn newest(&self) -> &Grid<i16> {
        &self.newest
    }

    /// The samples as drawn.
    pub(crate) const fn shown(&self) -> &Grid<i16> {
        &self.shown
    }

    pub(crate) const fn generation(&self) -> u64 {
        self.generation
    }

    pub(super) fn is_resident(&self, position: [i32; 3]) -> bool {
        self.newest.chunk(position).is_some()
    }

    /// Whether the samples stay wherever viewers are.
    pub(super) fn is_held(&self, position: [i32; 3]) -> bool {
        self.edited.get(&position) == Some(&KeptEdits::Held)
    }

    /// Whether the log has stamps for a chunk that is not resident.
    pub(super) fn needs_replay(&self, position: [i32; 3]) -> bool {
        self.log.concerns(position, self.newest.chunk_region(position), 0)
    }

    /// The newest samples that meshing a chunk reads.
    pub(crate) fn neighbourhood(&self, position: [i32; 3]) -> NeighbourhoodView<'_, i16> {
        self.newest.neighbourhood_view(position)
    }

    /// What edits a leaf's samples need: stamps in order, and the held chunks, whose stamps are not kept.
    pub(super) fn edits_around(&self, leaf: LeafKey) -> (Vec<QuantisedStamp>, Option<Grid<i16>>) {
        let chunks = leaf.region();
        // A leaf reads one lattice point of its level beyond its border.
        let reach = (1u32 << leaf.level) / self.newest.chunk_cells() + 1;
        let chunks = chunks.grown(reach, reach);
        let ends = [chunks.min, chunks.max].map(|end| self.newest.chunk_region(end).min);
        let stamps = self.log.concerning(chunks, Region::new(ends[0], ends[1]), 0);
        let mut known = None;
        if self.held > 0 {
            let held = self.newest.chunks_in(chunks).filter(|(position, _)| self.is_held(*position));
            for (position, chunk) in held {
                let known = known.get_or_insert_with(|| Grid::new(self.newest.chunk_cells()).expect("as the terrain"));
                known.insert_clean(position, chunk.clone()).expect("as in the terrain");
            }
        }
        (stamps.into_iter().map(|logged| *logged.stamp).collect(), known)
    }

    /// Visits the lattice points that every edit has touched.
    pub(super) fn stamped_regions(&self, mut visit: impl FnMut(Region)) {
        self.log.all().for_each(|stamp| visit(stamp.region()));
        let held = self.edited.iter().filter(|(_, edits)| **edits == KeptEdits::Held);
        held.for_each(|(position, _)| visit(self.newest.chunk_region(*position)));
    }

    /// Changes the chunks that are seen. Samples of other chunks stay until they are unloaded; held ones stay for good.
    pub(super) fn resize(&mut self, extent: Region) {
        for grid in [&mut self.newest, &mut self.shown] {
            grid.set_bounds(Some(extent)).expect("the settings have been checked");
        }
    }

    /// Sets how chunks are meshed, which decides how far an edit reaches.
    pub(super) fn set_mesh_method(&mut self, method: MeshMethod) {
        self.newest.set_mesh_method(method).expect("the settings have been checked");
    }

    /// Starts over with another source: all edits are lost. Shown samples stay.
    pub(super) fn refill(&mut self, empty: Grid<i16>) {
        self.newest = empty;
        self.edited.clear();
        self.held = 0;
        self.log.clear();
        self.generation = new_number();
    }

    /// The stamps that a chunk's samples from the source lack.
    pub(super) fn replay(&self, position: [i32; 3], empty: Grid<i16>) -> Replay {
        let reported = match self.edited.get(&position) {
            Some(KeptEdits::Stamps { reported, .. }) => *reported,
            _ => 0,
        };
        let stamps = self.log.concerning(chunk_box(position), self.newest.chunk_region(position), 0);
        Replay { position, stamps, through: self.log.last(), reported, grid: empty }
    }

    /// Takes in a chunk from the source with its replayed stamps, and applies the stamps that came since. Returns the
    /// edit that had not been reported, and the chunks whose meshes read what the late stamps changed.
    pub(super) fn load(
        &mut self,
        position: [i32; 3],
        chunk: GridChunk<i16>,
        replayed: Option<Replayed>,
    ) -> (Edit, BTreeSet<[i32; 3]>) {
        self.newest.insert_clean(position, chunk).expect("a chunk of the extent, with the grid's own number of cells");
        let Replayed { through, changes, mut edit } = replayed.unwrap_or_else(Replayed::nothing);
        let late = self.log.concerning(chunk_box(position), self.newest.chunk_region(position), through);
        self.note_changes(position, changes, through, true);
        for LoggedStamp { number, stamp, .. } in late {
            edit.merge(&self.change(position, number, &stamp));
        }
        (edit, self.newest.take_dirty())
    }

    /// Drops a chunk's samples, unless they are held.
    pub(super) fn unload(&mut self, position: [i32; 3]) {
        if !self.is_held(position) {
            self.newest.remove_clean(position);
        }
    }

    /// Drops the samples with which a chunk is drawn.
    pub(super) fn unload_shown(&mut self, position: [i32; 3]) {
        if let Some(samples) = self.shown.remove_clean(position) {
            self.pool.keep(samples);
        }
    }

    /// Makes samples the shown ones of a chunk.
    pub(super) fn show(&mut self, position: [i32; 3], chunk: GridChunk<i16>) {
        if !self.shown.chunk(position).is_some_and(|shown| shares_samples(shown, &chunk)) {
            self.unload_shown(position);
            self.shown.insert_clean(position, chunk).expect("a chunk of the same extent");
        }
    }

    /// Makes the newest samples of a chunk, if any, the shown ones.
    pub(super) fn show_newest(&mut self, position: [i32; 3]) {
        if let Some(chunk) = self.newest.chunk(position) {
            self.show(position, chunk.clone());
        }
    }

    /// Applies a stamp to all resident chunks, and logs it for the others, including those beyond the extent, which may
    /// grow. A stamp that lies wholly beyond is not logged. `before` receives the changed chunks as they were, unless
    /// it has them.
    pub(super) fn stamp(
        &mut self,
        stamp: QuantisedStamp,
        before: &mut BTreeMap<[i32; 3], GridChunk<i16>>,
    ) -> StampChanges {
        let mut changed =
            StampChanges { edit: Edit::NONE, chunks: Vec::new(), affected: BTreeSet::new(), crowded: Vec::new() };
        let touched = stamp.region();
        let Some(bounds) = self.newest.bounds().filter(|_| !touched.is_empty()) else { return changed };
        let ends = [touched.min, touched.max.map(|v| v - 1)].map(|end| self.newest.chunk_of(end));
        let region = Region::new(ends[0], ends[1].map(|v| v + 1));
        if region.intersection(&bounds).is_empty() {
            return changed;
        }
        let region = region.intersection(&Grid::<i16>::largest(self.newest.chunk_cells()));
        let (number, stamp) = (self.log.next(), Arc::new(stamp));
        for position in self.resident_in(region) {
            // Only the first change makes a clone: while a clone lives, changing the samples copies them.
            let is_first = !before.contains_key(&position);
            let was = self.newest.chunk(position).filter(|_| is_first).cloned();
            let edit = self.change(position, number, &stamp);
            if !edit.is_empty() {
                before.extend(was.map(|was| (position, was)));
                changed.chunks.push(position);
                changed.edit.merge(&edit);
            }
        }
        changed.affected = self.newest.take_dirty();
        let may_be_held = self.held > 0 && count(region) <= u64::from(MAX_STAMPS);
        let held = if may_be_held { region.points().filter(|position| self.is_held(*position)).count() } else { 0 };
        let at_node = self.log.insert(number, stamp, region, held as u32);
        if at_node > MAX_STAMPS as usize {
            let seen = region.intersection(&bounds);
            changed.crowded = seen.points().filter(|position| self.is_crowded(*position)).collect();
        }
        changed
    }

    /// Whether a chunk is not resident and has so many stamps that its samples take less memory.
    fn is_crowded(&self, position: [i32; 3]) -> bool {
        let stamps = || self.log.concerning(chunk_box(position), self.newest.chunk_region(position), 0).len();
        !self.is_resident(position) && stamps() > MAX_STAMPS as usize
    }

    /// The resident chunks in a region, in order.
    fn resident_in(&self, region: Region) -> Vec<[i32; 3]> {
        self.newest.chunks_in(region).map(|(position, _)| position).collect()
    }

    /// Applies a stamp to a resident chunk. Changes beyond the extent are not reported.
    fn change(&mut self, position: [i32; 3], number: u64, stamp: &QuantisedStamp) -> Edit {
        let edit = self.newest.apply_to_chunk(position, stamp, &mut self.pool);
        self.note_changes(position, u32::from(!edit.is_empty()), number, false);
        if is_seen(&self.newest, position) { edit } else { Edit::NONE }
    }

    /// Notes that stamps up to a number have changed a chunk a number of times; `afresh`: in all, rather than in
    /// addition.
    fn note_changes(&mut self, position: [i32; 3], changes: u32, through: u64, afresh: bool) {
        if changes == 0 {
            return;
        }
        let edited = self.edited.entry(position).or_insert(KeptEdits::Stamps { changes: 0, reported: 0 });
        if let KeptEdits::Stamps { changes: before, reported } = edited {
            *before = if afresh { changes } else { *before + changes };
            *reported = (*reported).max(through);
            if *before > MAX_STAMPS {
                *edited = KeptEdits::Held;
                self.held += 1;
                self.log.release(position, self.newest.chunk_region(position));
            }
        }
    }
}

impl Replay {
    /// Applies the stamps to the source's samples, exactly as the terrain's own samples would have taken them.
    pub(crate) fn run(mut self, chunk: GridChunk<i16>) -> (GridChunk<i16>, Replayed) {
        let mut replayed = Replayed { through: self.through, ..Replayed::nothing() };
        if self.stamps.is_empty() || self.grid.insert_clean(self.position, chunk.clone()).is_err() {
            return (chunk, replayed);
        }
        for LoggedStamp { number, stamp, .. } in &self.stamps {
            let edit = self.grid.apply_to_chunk(self.position, stamp, &mut SamplePool::new());
            replayed.changes += u32::from(!edit.is_empty());
            if *number > self.reported && is_seen(&self.grid, self.position) {
                replayed.edit.merge(&edit);
            }
        }
        (self.grid.remove_clean(self.position).unwrap_or(chunk), replayed)
    }
}

impl Replayed {
    const fn nothing() -> Self {
        Self { through: 0, changes: 0, edit: Edit::NONE }
    }
}

/// Whether a chunk lies within the bounds.
fn is_seen(grid: &Grid<i16>, position: [i32; 3]) -> bool {
    grid.bounds().is_none_or(|bounds| bounds.contains(position))
}

/// The box of one chunk.
fn chunk_box(position: [i32; 3]) -> Region {
    Region::new(position, position.map(|v| v.saturating_add(1)))
}

fn count(region: Region) -> u64 {
    region.size().into_iter().map(u64::from).fold(1, u64::saturating_mul)
}

/// Whether two chunks are known to be equal without reading their samples.
pub(crate) fn shares_samples(a: &GridChunk<i16>, b: &GridChunk<i16>) -> bool {
    match (a, b) {
        (GridChunk::Uniform(a), GridChunk::Uniform(b)) => a == b,
        (GridChunk::Samples(a), GridChunk::Samples(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}
