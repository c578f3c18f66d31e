//! Edits in leaves of every level, and what the meshes of leaves are made from.

use std::collections::BTreeSet;
use std::sync::Arc;

use marchless::{LeafKey, LevelChange, Region};

use super::{Running, finest, has_filled};
use crate::chunk::ChunkKey;
use crate::jobs::new_number;
use crate::volume::input::{LaterCover, LeafInput, MeshInput};
use crate::volume::{Heart, SamplingSettings};

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

    /// Makes place for the surface that a stamp may put into empty leaves, in this update: they are split as viewers
    /// ask for, and the samples of new leaves are there at once.
    pub(in crate::volume) fn make_place(&mut self, touched: Region) {
        let Some(levels) = &mut self.levels else { return };
        let Some(extent) = self.sampling_settings.as_ref().map(|settings| settings.extent) else { return };
        if !levels.surfaces.stamp(touched) {
            return;
        }
        let reached = levels.surfaces.reached(0, touched);
        let mut cover = levels.shown.clone();
        for running in levels.running.values().filter(|running| running.is_urgent) {
            Arc::make_mut(&mut cover).apply(&running.change);
        }
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
                Err(error) => return bevy_log::warn!("an edit in an empty part of a terrain is not shown: {error}"),
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
        if !filled.is_empty() {
            levels.since.push(change.clone());
            let urgent = levels.running.iter().filter(|(_, running)| running.is_urgent);
            let after = urgent.filter(|(_, running)| running.change.overlaps(&change)).map(|(id, _)| *id).collect();
            levels.running.insert(new_number(), Running { change, after, is_urgent: true, meshing: None });
        }
        levels.is_outdated = true;
        self.leaving_around(&left);
        let near: BTreeSet<ChunkKey> =
            coming.iter().flat_map(|position| ChunkKey::finest(*position).around()).collect();
        for near in near.into_iter().filter(|near| extent.contains(near.position)) {
            self.fill_now(near);
        }
    }

    /// The coarser leaves that a stamp has changed. Changes under way mesh their leaves again.
    pub(in crate::volume) fn stamped_leaves(&mut self, touched: Region) -> Vec<ChunkKey> {
        let cells = self.samples.newest().chunk_cells();
        let Some(levels) = &mut self.levels else { return Vec::new() };
        levels.note_edit(touched, cells);
        levels.drawn_readers(touched, cells)
    }
}
