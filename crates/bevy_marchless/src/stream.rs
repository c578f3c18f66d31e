//! [`TerrainViewer`]: loads chunks around viewers and unloads the others.
//!
//! The *cover* of a terrain is all that its viewers see and all that it keeps anyway. A viewer's load region moves when
//! the viewer has moved by more than an eighth of a chunk. The chunks in which the old and the new region differ are
//! then updated within the update's time budget, nearest first, viewers in turn.
//!
//! A chunk in the region is a *leaf*: drawn, known to be empty, or still to be filled. Chunks one step outside have
//! only samples, for their neighbours' meshes. A drawn chunk stays until it is farther away than the region and the
//! viewer's margin, so moving back and forth across a border loads nothing twice.
//!
//! ```
//! use bevy_marchless::prelude::*;
//! # use bevy_ecs::prelude::*;
//! # use bevy_transform::components::Transform;
//!
//! fn setup(mut commands: Commands) {
//!     // Endless waves.
//!     commands.spawn(Terrain::endless(|[x, y, z]: [f64; 3]| y - 8.0 * (x * 0.05).sin() * (z * 0.04).cos()));
//!     // A game adds a camera here.
//!     commands.spawn((TerrainViewer::new(256.0).with_height(128.0), Transform::from_xyz(0.0, 20.0, 0.0)));
//! }
//! ```

mod fill;
mod follow;
mod view;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::prelude::*;
use bevy_math::Vec3;
use bevy_reflect::prelude::*;
use bevy_transform::components::Transform;

pub use crate::cover::{Coverage, Leaf, LeafState};
use crate::schedule::UpdatePhase;
use crate::terrain::give_to_terrains;

/// Loads chunks around viewers, fills them from the terrain's source, and unloads them.
#[derive(Default)]
pub struct StreamPlugin;

impl Plugin for StreamPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<TerrainViewer>();
        give_to_terrains::<follow::TerrainViews>(app);
        app.add_systems(PostUpdate, follow::follow_viewers.in_set(UpdatePhase::Load)).add_systems(
            PostUpdate,
            (fill::take_filled_chunks, fill::ask_for_samples).chain().in_set(UpdatePhase::Fill),
        );
    }
}

/// Loads the chunks of all terrains around this entity.
///
/// A chunk is loaded if any point of it lies within `radii` of the entity, with the entity's position rounded to an
/// eighth of a chunk. At most [`Terrain::MAX_CHUNKS`](crate::terrain::Terrain::MAX_CHUNKS) chunks are loaded: larger
/// radii are scaled down, with a warning.
///
/// A terrain with several [levels of detail](crate::levels_of_detail) is drawn as far as the longest radius reaches, and
/// loads samples of the finest level alone; `margin` and `sample_radius` do not matter to it. A radius that would make
/// too many leaves is reported, and what is drawn stays.
///
/// A viewer whose position is not finite or whose radii are not above 0 is reported once; its loaded chunks stay. A
/// terrain that loads nothing by itself is reported, too, after 120 updates without any viewer.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, PartialEq, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct TerrainViewer {
    /// The viewing distance along the terrain's axes, in voxels: the half axes of an ellipsoid. Above 0. Default 256,
    /// 128, 256.
    pub radii: Vec3,
    /// The extra distance at which chunks are unloaded, in voxels; 0 or more. Default 32.
    pub margin: f32,
    /// The distance within which samples stay in memory after they are drawn, in voxels; 0 or more. Default ∞: all
    /// samples stay.
    ///
    /// Samples farther away are dropped, unless many stamps have changed them. They are filled again when a viewer
    /// comes near or an edit needs them. Until then rays pass through, and edits there show some updates later.
    pub sample_radius: f32,
}

impl TerrainViewer {
    /// Creates a viewer that sees `radius` voxels far in all directions.
    pub const fn new(radius: f32) -> Self {
        Self { radii: Vec3::splat(radius), margin: 32.0, sample_radius: f32::INFINITY }
    }

    /// Sets the viewing distance up and down, in voxels.
    #[must_use]
    pub const fn with_height(mut self, radius: f32) -> Self {
        self.radii.y = radius;
        self
    }

    /// Sets the extra distance at which chunks are unloaded, in voxels.
    #[must_use]
    pub const fn with_margin(self, margin: f32) -> Self {
        Self { margin, ..self }
    }

    /// Sets the distance within which samples stay in memory, in voxels.
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
