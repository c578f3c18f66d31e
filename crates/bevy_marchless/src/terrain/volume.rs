//! [`TerrainVolume`]: a terrain's samples and the state of its chunks.

use bevy_ecs::change_detection::Tick;
use bevy_ecs::prelude::*;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;
use marchless::Grid;

use super::Terrain;
use crate::cover::{Coverage, Leaf};
use crate::volume::Heart;

/// A terrain's samples, and the part of them that is shown.
///
/// The plugin fills and changes the samples. Read them here; change them with [`Stamp`](crate::brush::Stamp) messages.
/// The volume is not cloned or written with its terrain: the copy gets its own.
#[derive(Component, Reflect, Default)]
#[reflect(Component, Default, from_reflect = false)]
#[component(clone_behavior = Ignore)]
pub struct TerrainVolume {
    /// The settings in effect.
    #[reflect(ignore)]
    settings: Option<Terrain>,
    /// Settings that change the samples; pending until the generation under way is shown.
    #[reflect(ignore)]
    next: Option<Terrain>,
    /// The number of times that settings changed the samples.
    #[reflect(ignore)]
    requests: u64,
    /// The number of times that the settings in effect changed.
    #[reflect(ignore)]
    changes: u64,
    /// The change tick of the settings last checked.
    #[reflect(ignore)]
    seen: Option<Tick>,
    /// The change tick of the named sources last checked.
    #[reflect(ignore)]
    sources: Option<Tick>,
    /// Whether a file with other settings is being read.
    #[reflect(ignore)]
    is_loading: bool,
    #[reflect(ignore)]
    heart: Heart,
}

impl TerrainVolume {
    /// The newest samples, with every edit; they may not be shown yet. Absent chunks are not filled, not loaded, or
    /// dropped.
    pub const fn grid(&self) -> &Grid<i16> {
        self.heart.samples().newest()
    }

    /// The samples of the meshes that are drawn now.
    pub const fn shown(&self) -> &Grid<i16> {
        self.heart.samples().shown()
    }

    /// The isovalue of the meshes that are drawn now, in voxels.
    pub const fn shown_isovalue(&self) -> f32 {
        self.heart.isovalue()
    }

    /// The settings in effect; `None` until the plugin has first seen the terrain, or if it refused its settings.
    ///
    /// Settings that change the samples take effect once the generation before them is shown.
    pub const fn settings(&self) -> Option<&Terrain> {
        self.settings.as_ref()
    }

    /// The entity of the chunk that is drawn at `position`, in chunks of the finest level; `None` if there is nothing to
    /// draw.
    pub fn chunk_entity(&self, position: IVec3) -> Option<Entity> {
        self.heart.entity(self.heart.drawn_leaf_at(position.to_array())?)
    }

    /// The leaf that holds `position`, in chunks of the finest level, and its state; `None` outside all load regions.
    ///
    /// All positions in the load regions form the terrain's cover: each belongs to one leaf in every update.
    pub fn leaf_at(&self, position: IVec3) -> Option<Leaf> {
        self.heart.leaf_at(position.to_array())
    }

    /// All leaves, in no order. With one level, those in range that have not been visited yet are left out.
    pub fn leaves(&self) -> impl Iterator<Item = Leaf> + '_ {
        self.heart.leaves()
    }

    /// The number of leaves in each state. The more chunks have just come into range, the longer this takes.
    pub fn coverage(&self) -> Coverage {
        self.heart.coverage()
    }

    /// Whether all chunks in range have their samples.
    pub fn is_filled(&self) -> bool {
        !self.is_loading && self.next.is_none() && self.heart.is_filled()
    }

    /// Whether all chunks in range have their samples and the newest state of everything is drawn.
    pub fn is_settled(&self) -> bool {
        !self.is_loading && self.next.is_none() && self.heart.is_settled()
    }

    /// The memory that samples take, in bytes: those drawn, the newest ones, and the bookkeeping of each chunk.
    pub fn sample_bytes(&self) -> usize {
        self.heart.sample_bytes_from([i32::MIN; 3], usize::MAX).0 + self.heart.notes_bytes()
    }

    pub(crate) const fn heart(&self) -> &Heart {
        &self.heart
    }

    pub(crate) const fn heart_mut(&mut self) -> &mut Heart {
        &mut self.heart
    }

    /// Whether a file with other settings is being read; stamps wait for those settings.
    pub(crate) const fn is_loading(&self) -> bool {
        self.is_loading
    }

    #[cfg(feature = "terrain_files")]
    pub(crate) const fn set_loading(&mut self, is_loading: bool) {
        self.is_loading = is_loading;
    }

    /// The number of times that settings changed the samples; stamps for earlier settings are discarded.
    pub(crate) const fn requests(&self) -> u64 {
        self.requests
    }

    /// The number of times that the settings in effect changed.
    pub(crate) const fn changes(&self) -> u64 {
        self.changes
    }

    /// Whether settings that change the samples are pending; stamps wait for them.
    pub(crate) const fn has_next(&self) -> bool {
        self.next.is_some()
    }

    /// Whether the named sources changed since the last call; notes their change tick.
    pub(super) fn has_other_sources(&mut self, changed: Tick) -> bool {
        self.sources.replace(changed) != Some(changed)
    }

    /// Whether settings with this change tick are still unchecked.
    pub(super) fn is_new(&self, changed: Tick) -> bool {
        self.seen != Some(changed)
    }

    /// Accepts checked settings, with their change tick. Settings that change the samples become pending.
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

    /// Notes that settings with this change tick were refused.
    pub(super) const fn refuse(&mut self, changed: Tick) {
        self.seen = Some(changed);
    }

    /// Puts the pending settings into effect once the current generation is shown. Returns them and the settings
    /// before.
    pub(super) fn take_next(&mut self) -> Option<(Terrain, Option<Terrain>)> {
        if self.settings.is_some() && !self.heart.is_generation_shown() {
            return None;
        }
        let next = self.next.take()?;
        self.changes += 1;
        let before = self.settings.replace(next.clone());
        Some((next, before))
    }

    /// Replaces the heart and returns the old one; the settings stay.
    pub(super) fn start_over(&mut self, heart: Heart) -> Heart {
        core::mem::replace(&mut self.heart, heart)
    }
}
