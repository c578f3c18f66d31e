//! Edits in leaves of every level, and what the meshes of leaves are made from.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use marchless::{LeafKey, LevelChange, LevelCover, Region};

use super::{Levels, Running, finest, has_filled};
use crate::chunk::ChunkKey;
use crate::jobs::new_number;
use crate::volume::input::{LaterCover, LeafInput, MeshInput};
use crate::volume::{Heart, SamplingSettings};

/// The place that changes of levels make for edits.
pub(in crate::volume) struct Place {
    /// The leaves that are drawn then (`true`), and those that are not any more.
    pub(in crate::volume) leaves: BTreeMap<ChunkKey, bool>,
    /// The leaves that stay, and get another mesh.
    remeshed: BTreeSet<ChunkKey>,
    /// The cover with these changes; `None` if there is one level.
    cover: Option<LaterCover>,
}

impl Place {
    /// Whether the changes alone give a leaf another mesh.
    pub(in crate::volume) fn has_mesh(&self, leaf: ChunkKey) -> bool {
        self.leaves.contains_key(&leaf) || self.remeshed.contains(&leaf)
    }
}

impl Levels {
    /// The cover as it will be when all edits so far are shown.
    pub(super) fn cover_of_edits(&self) -> Arc<LevelCover> {
        let mut cover = self.shown.clone();
        for running in self.running.values().filter(|running| running.is_of_edit) {
            Arc::make_mut(&mut cover).apply(&running.change);
        }
        cover
    }
}

impl Heart {
    /// What a chunk's mesh is made from now.
    pub(crate) fn mesh_input(&self, key: ChunkKey) -> MeshInput {
        match &self.levels {
            Some(levels) if key.level > 0 => self.input(key, &LaterCover::new(levels.shown.clone(), Vec::new())),
            _ => MeshInput::Finest(Box::new(self.samples.neighbourhood(key.position).to_neighbourhood())),
        }
    }

    /// What a leaf's mesh is made from in a cover.
    pub(super) fn input(&self, key: ChunkKey, cover: &LaterCover) -> MeshInput {
        let levels = self.levels.as_ref().filter(|_| key.level > 0);
        let Some((levels, &SamplingSettings { cells, spacing, .. })) = levels.zip(self.sampling_settings.as_ref())
        else {
            return MeshInput::Finest(Box::new(self.samples.neighbourhood(key.position).to_neighbourhood()));
        };
        let source = levels.source.clone();
        let leaf = LeafKey::from(key);
        let (stamps, known) = self.samples.edits_around(leaf);
        let planes = self.samples.newest().planes();
        let cover = cover.clone();
        MeshInput::Coarser(Box::new(LeafInput { leaf, source, cells, spacing, planes, stamps, known, cover }))
    }

    /// Makes place for the surface that a stamp may put into empty leaves: a change splits them as viewers ask for, and
    /// is shown with the edit. Returns its number, if there is one. The samples of new leaves are there at once.
    pub(in crate::volume) fn make_place(&mut self, touched: Region) -> Option<u64> {
        let levels = self.levels.as_mut()?;
        let extent = self.sampling_settings.as_ref()?.extent;
        if !levels.surfaces.stamp(touched) {
            return None;
        }
        let reached = levels.surfaces.reached(0, touched);
        let cover = levels.cover_of_edits();
        let near = cover.leaves_near(reached.intersection(&extent));
        let surfaces = levels.surfaces.clone();
        let filled: Vec<LeafKey> = near
            .into_iter()
            .filter(|(leaf, is_empty)| *is_empty && !surfaces.is_empty(*leaf))
            .map(|(leaf, _)| leaf)
            .collect();
        let mut change = LevelChange::default();
        if !filled.is_empty() {
            let viewers = levels.viewers();
            match cover.fill(&filled, &viewers, &levels.settings, |leaf| surfaces.is_empty(leaf)) {
                Ok(filling) => change = filling,
                Err(error) => {
                    bevy_log::warn!("an edit in an empty part of a terrain is not shown: {error}");
                    return None;
                }
            }
        }
        let change = Arc::new(change);
        // Changes to come may add leaves that were empty when they were planned.
        let is_out_of_date = |other: &LevelChange| other.overlaps(&change) || has_filled(other, &surfaces);
        let gone = levels.withdraw(|running| is_out_of_date(&running.change));
        let is_behind = |other: &LevelChange| gone.iter().any(|gone| gone.overlaps(other));
        levels.plan.withdraw(|other| is_out_of_date(other) || is_behind(other));
        let left: Vec<[i32; 3]> = gone.iter().flat_map(|change| finest(change)).collect();
        let coming: Vec<[i32; 3]> = finest(&change).collect();
        levels.since.extend(gone);
        levels.leave_finest(&left, false);
        coming.iter().for_each(|position| _ = levels.finest.entry(*position).or_insert(false));
        let id = (!filled.is_empty()).then(new_number);
        if let Some(id) = id {
            levels.since.push(change.clone());
            let of_edits = levels.running.iter().filter(|(_, running)| running.is_of_edit);
            let after = of_edits.filter(|(_, running)| running.change.overlaps(&change)).map(|(id, _)| *id).collect();
            levels.running.insert(id, Running { change, after, is_of_edit: true, meshing: None });
        }
        levels.is_outdated = true;
        self.leaving_around(&left);
        let near: BTreeSet<ChunkKey> =
            coming.iter().flat_map(|position| ChunkKey::finest(*position).around()).collect();
        for near in near.into_iter().filter(|near| extent.contains(near.position)) {
            self.fill_now(near);
        }
        id
    }

    /// The leaves of a change that makes place, and of those that it comes after. A set of chunks with them is shown
    /// after all sets that have any of them, and apart from changes of levels there.
    pub(in crate::volume) fn leaves_of_place(&self, id: u64) -> Vec<ChunkKey> {
        let Some(levels) = &self.levels else { return Vec::new() };
        let Some(running) = levels.running.get(&id) else { return Vec::new() };
        let before = running.after.iter().filter_map(|id| levels.running.get(id));
        let leaves = before.chain([running]).flat_map(|running| running.change.leaves());
        leaves.map(ChunkKey::from).collect()
    }

    /// What some changes that make place come to.
    pub(in crate::volume) fn place(&self, ids: &BTreeSet<u64>) -> Place {
        let (mut leaves, mut remeshed, mut changes) = (BTreeMap::new(), BTreeSet::new(), Vec::new());
        let running = |id: &u64| self.levels.as_ref()?.running.get(id);
        for Running { change, .. } in ids.iter().filter_map(running) {
            leaves.extend(change.removed.iter().map(|leaf| (ChunkKey::from(*leaf), false)));
            leaves.extend(change.added.iter().map(|(leaf, is_empty)| (ChunkKey::from(*leaf), !is_empty)));
            remeshed.extend(change.remeshed.iter().map(|leaf| ChunkKey::from(*leaf)));
            changes.push(change.clone());
        }
        let cover = self.levels.as_ref().map(|levels| LaterCover::new(levels.shown.clone(), changes));
        Place { leaves, remeshed, cover }
    }

    /// What a chunk's mesh is made from now, with the place made.
    pub(in crate::volume) fn input_in(&self, place: &Place, key: ChunkKey) -> MeshInput {
        place.cover.as_ref().map_or_else(|| self.mesh_input(key), |cover| self.input(key, cover))
    }

    /// The coarser leaves that a stamp has changed. Changes under way mesh their leaves again.
    pub(in crate::volume) fn stamped_leaves(&mut self, touched: Region) -> Vec<ChunkKey> {
        let cells = self.samples.newest().chunk_cells();
        let Some(levels) = &mut self.levels else { return Vec::new() };
        levels.note_edit(touched, cells);
        levels.drawn_readers(touched, cells)
    }
}
