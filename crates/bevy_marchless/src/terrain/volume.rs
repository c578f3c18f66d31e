//! [`TerrainVolume`]: where a terrain's samples live, and what is shown of them.

use bevy_ecs::change_detection::Tick;
use bevy_ecs::prelude::*;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;
use marchless::Grid;

use super::Terrain;
use crate::chunk::ChunkKey;
use crate::cover::{Coverage, Leaf};
use crate::volume::Heart;

/// A terrain's samples, and what is shown of them. The plugin fills and changes them; read them here, change them with
/// [`Stamp`](crate::brush::Stamp) messages. It is neither cloned nor written with its terrain: that has its own.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default, from_reflect = false)]
#[component(clone_behavior = Ignore)]
pub struct TerrainVolume {
    /// The settings in effect.
    #[reflect(ignore)]
    settings: Option<Terrain>,
    /// Settings that ask for other samples, and wait until those in effect have been shown.
    #[reflect(ignore)]
    next: Option<Terrain>,
    /// How often other samples have been asked for.
    #[reflect(ignore)]
    requests: u64,
    /// How often the settings in effect have changed.
    #[reflect(ignore)]
    changes: u64,
    /// When the settings that were looked at last had been changed.
    #[reflect(ignore)]
    seen: Option<Tick>,
    /// When the sources that were looked at last had been changed.
    #[reflect(ignore)]
    sources: Option<Tick>,
    /// Whether a file with other settings is being read.
    #[reflect(ignore)]
    is_loading: bool,
    #[reflect(ignore)]
    heart: Heart,
}

impl TerrainVolume {
    /// The newest samples, with every edit; perhaps not shown yet. Absent chunks are not filled, not loaded, or
    /// dropped.
    pub const fn grid(&self) -> &Grid<i16> {
        self.heart.samples().newest()
    }

    /// The samples as they are drawn at the moment.
    pub const fn shown(&self) -> &Grid<i16> {
        self.heart.samples().shown()
    }

    /// The isovalue as it is drawn at the moment, in voxels.
    pub const fn shown_isovalue(&self) -> f32 {
        self.heart.isovalue()
    }

    /// The settings in effect; `None` before the plugin has first seen the terrain, or where it refused its settings.
    ///
    /// Settings that ask for other samples take effect once those before them have been shown.
    pub const fn settings(&self) -> Option<&Terrain> {
        self.settings.as_ref()
    }

    /// The entity of the chunk at `position`, in chunks; `None` where there is nothing to draw.
    pub fn chunk_entity(&self, position: IVec3) -> Option<Entity> {
        self.heart.entity(ChunkKey::finest(position.to_array()))
    }

    /// What is shown of the chunk at a place, in chunks; `None` where it is in no range.
    ///
    /// All places in range together are the terrain's cover: each belongs to one leaf in every update.
    pub fn leaf_at(&self, position: IVec3) -> Option<Leaf> {
        self.heart.leaf_at(position.to_array())
    }

    /// How many leaves of each state there are. Takes the longer, the more chunks have just come into range.
    pub fn coverage(&self) -> Coverage {
        self.heart.coverage()
    }

    /// Whether all chunks in range have their samples.
    pub fn is_filled(&self) -> bool {
        !self.is_loading && self.next.is_none() && self.heart.is_filled()
    }

    /// Whether all chunks in range have their samples and everything is drawn as it is.
    pub fn is_settled(&self) -> bool {
        !self.is_loading && self.next.is_none() && self.heart.is_settled()
    }

    /// How much memory the samples take, in bytes: what is drawn, what is newest, and the plugin's notes about each
    /// chunk.
    pub fn sample_bytes(&self) -> usize {
        self.heart.sample_bytes_from([i32::MIN; 3], usize::MAX).0 + self.heart.notes_bytes()
    }

    pub(crate) const fn heart(&self) -> &Heart {
        &self.heart
    }

    pub(crate) const fn heart_mut(&mut self) -> &mut Heart {
        &mut self.heart
    }

    /// Whether a file with other settings is being read: stamps are for those.
    pub(crate) const fn is_loading(&self) -> bool {
        self.is_loading
    }

    #[cfg(feature = "terrain_files")]
    pub(crate) const fn set_loading(&mut self, is_loading: bool) {
        self.is_loading = is_loading;
    }

    /// How often other samples have been asked for: stamps of earlier ones are gone.
    pub(crate) const fn requests(&self) -> u64 {
        self.requests
    }

    /// How often the settings in effect have changed.
    pub(crate) const fn changes(&self) -> u64 {
        self.changes
    }

    /// Whether settings wait that ask for other samples: stamps are for those.
    pub(crate) const fn has_next(&self) -> bool {
        self.next.is_some()
    }

    /// Whether the named sources that were changed then have not been looked at. From now on, they have.
    pub(super) fn has_other_sources(&mut self, changed: Tick) -> bool {
        self.sources.replace(changed) != Some(changed)
    }

    /// Whether settings that were changed then have not been looked at.
    pub(super) fn is_new(&self, changed: Tick) -> bool {
        self.seen != Some(changed)
    }

    /// Notes the settings that were changed then, which have been checked. Those that ask for other samples wait.
    pub(super) fn accept(&mut self, terrain: &Terrain, changed: Tick) {
        self.seen = Some(changed);
        self.changes += 1;
        let latest = self.next.as_ref().or(self.settings.as_ref());
        if !latest.is_some_and(|latest| latest.has_samples_of(terrain)) {
            self.requests += 1;
        }
        let is_back = self.settings.as_ref().is_some_and(|settings| settings.has_samples_of(terrain));
        self.next = (!is_back || self.next.is_some()).then(|| terrain.clone());
        if let Some(settings) = &mut self.settings {
            settings.take_all_but_samples(terrain);
        }
    }

    /// Notes that settings that were changed then have been refused.
    pub(super) const fn refuse(&mut self, changed: Tick) {
        self.seen = Some(changed);
    }

    /// Takes the settings that ask for other samples, once those before them have been shown, and those before them.
    pub(super) fn take_next(&mut self) -> Option<(Terrain, Option<Terrain>)> {
        if self.settings.is_some() && !self.heart.is_generation_shown() {
            return None;
        }
        let next = self.next.take()?;
        self.changes += 1;
        let before = self.settings.replace(next.clone());
        Some((next, before))
    }

    /// Replaces all that there is, but for the settings.
    pub(super) fn start_over(&mut self, heart: Heart) -> Heart {
        core::mem::replace(&mut self.heart, heart)
    }
}
