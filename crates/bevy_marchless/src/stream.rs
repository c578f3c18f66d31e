//! [`TerrainViewer`]: chunks are loaded where somebody looks, and go when nobody does.
//!
//! What each viewer sees, and what a terrain keeps anyway, is its *cover*. When a viewer has moved by more than an eighth of
//! a chunk, its range moves with it, and the chunks in which the old and the new range differ are gone through, nearest
//! first and viewer by viewer in turn, within the update's time: each becomes what the cover asks of it. A chunk in range
//! is a *leaf*: drawn, known to be empty, or still to be filled. Chunks one farther away have samples only, for
//! their neighbours' meshes. What is drawn stays until it is farther away than the range and the viewer's margin, so that
//! going to and fro over a border loads nothing twice.
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

/// Loads terrains around viewers, fills them from their sources, and unloads them.
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

/// Loads the chunks of all terrains around its entity.
///
/// Chunks that some point of lies within `radii` of the entity are loaded, as if its position were rounded to an eighth of
/// a chunk. At most [`Terrain::MAX_CHUNKS`](crate::terrain::Terrain::MAX_CHUNKS) are: larger radii are scaled down, with a
/// warning. A viewer without a finite position or with radii that are not above 0 is reported once, and what it has loaded
/// stays as it is. A terrain that loads nothing by itself, and has been there for 120 updates without any viewer, is
/// reported, too.
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
    /// Those farther away are dropped, unless many stamps have changed them, and filled again when a viewer comes near or
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
