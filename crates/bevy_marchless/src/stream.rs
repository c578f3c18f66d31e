//! [`TerrainViewer`]: chunks are loaded where somebody looks, and go when nobody does.
//!
//! A terrain's volume remembers the *ranges* in which its chunks are loaded: one around each viewer, and what the terrain
//! keeps anyway. When a viewer has moved by more than an eighth of a chunk, its range moves with it, and the chunks in which
//! the old and the new range differ are gone through, nearest first, within the update's time: each becomes what the ranges
//! ask of it. A chunk in range is a *leaf*: drawn, known to be empty, or still to be filled. Chunks one farther away have
//! samples only, for the sake of their neighbours' meshes. What is loaded stays until it is farther away than the range and
//! the viewer's margin, so that going to and fro over a border loads nothing twice.
//!
//! ```
//! use bevy_marchless::prelude::*;
//! # use bevy_ecs::prelude::*;
//! # use bevy_transform::components::Transform;
//!
//! fn setup(mut commands: Commands) {
//!     // Waves without end.
//!     commands.spawn(Terrain::endless(|[x, y, z]: [f64; 3]| y - 8.0 * (x * 0.05).sin() * (z * 0.04).cos()));
//!     // A camera in a game.
//!     commands.spawn((TerrainViewer::new(256.0).with_height(128.0), Transform::from_xyz(0.0, 20.0, 0.0)));
//! }
//! ```

mod agenda;
mod follow;
mod look;
mod range;

use core::time::Duration;

use bevy_ecs::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;

pub(crate) use follow::{ENTITY_TIME, Streaming, ask_for_samples, follow_viewers, free_samples_for, in_flight};
pub(crate) use range::Wanted;

/// Loads the chunks of all terrains around its entity.
///
/// Chunks that some point of lies within `radii` of the entity are loaded, as if its position were rounded to an eighth of
/// a chunk. At most [`Terrain::MAX_CHUNKS`](crate::terrain::Terrain::MAX_CHUNKS) are: larger radii are scaled down, with a
/// warning. A viewer without a finite position or with radii that are not above 0 is reported once, and what it has loaded
/// stays as it is.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, PartialEq, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct TerrainViewer {
    /// How far it sees along the terrain's axes, in voxels: half the axes of an ellipsoid. Above 0. Default 256, 128, 256.
    pub radii: Vec3,
    /// How much farther away a chunk must be before it goes, in voxels; 0 or more. Default 32.
    pub margin: f32,
    /// Within this many voxels samples stay in memory once they are drawn; 0 or more. Default: ∞, all of them.
    ///
    /// Those farther away are dropped as long as they have never been edited, and filled again when a viewer comes near or
    /// an edit needs them. Until then rays pass through, and edits there show some updates later.
    pub sample_radius: f32,
}

impl TerrainViewer {
    /// A viewer that sees so many voxels far in all directions.
    pub const fn new(radius: f32) -> Self {
        Self { radii: Vec3::splat(radius), margin: 32.0, sample_radius: f32::INFINITY }
    }

    /// The same viewer, seeing so many voxels up and down.
    #[must_use]
    pub const fn with_height(mut self, radius: f32) -> Self {
        self.radii.y = radius;
        self
    }

    /// The same viewer, whose chunks go when they are so many voxels farther away than it sees.
    #[must_use]
    pub const fn with_margin(self, margin: f32) -> Self {
        Self { margin, ..self }
    }

    /// The same viewer, around which samples stay in memory within so many voxels.
    #[must_use]
    pub const fn with_sample_radius(self, sample_radius: f32) -> Self {
        Self { sample_radius, ..self }
    }
}

impl Default for TerrainViewer {
    fn default() -> Self {
        Self::new(256.0).with_height(128.0)
    }
}

/// What a terrain shows at one place: one piece of its cover.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub struct Leaf {
    /// The level of detail; 0 is the finest, and at present there is no other.
    pub level: u8,
    /// The chunk's place, in chunks of this level.
    pub position: IVec3,
    /// What is shown of it.
    pub state: LeafState,
}

/// What is shown of a leaf.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum LeafState {
    /// Not filled or not meshed yet.
    Waiting,
    /// Known to have no surface.
    Empty,
    /// Its mesh.
    Drawn,
}

/// How many leaves of each state a terrain has.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
pub struct Coverage {
    /// See [`LeafState::Waiting`].
    pub waiting: usize,
    /// See [`LeafState::Empty`].
    pub empty: usize,
    /// See [`LeafState::Drawn`].
    pub drawn: usize,
}

/// What has been done for all terrains since the start.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, PartialEq, Clone)]
pub struct StreamStats {
    /// Chunks that came into range, their surroundings included.
    pub loaded: u64,
    /// Chunks that went out of range.
    pub unloaded: u64,
    /// Chunks that the source's bound settled, so that they needed no job.
    pub bounded: u64,
    /// Chunks that took sampling.
    pub filled: u64,
    /// Those of them that proved empty: all of their own samples lie on one side of the surface.
    pub filled_empty: u64,
    /// Chunks that were meshed, again after edits included; not those that are known to have no surface.
    pub meshed: u64,
    /// How long jobs have sampled and bounded, in all.
    pub fill_time: Duration,
    /// How long chunks were meshed, in all.
    pub mesh_time: Duration,
    /// How long the plugin's systems have taken, in all; waiting for edits' meshes included.
    pub main_thread: Duration,
    /// The same of the latest update.
    pub main_thread_last: Duration,
}
