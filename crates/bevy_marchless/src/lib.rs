//! Smooth terrain that players can dig, as one Bevy plugin.
//!
//! ```
//! use bevy_app::prelude::*;
//! use bevy_ecs::prelude::*;
//! use bevy_marchless::prelude::*;
//! use bevy_math::Vec3;
//!
//! fn main() {
//!     let mut app = App::new();
//!     // A game adds `DefaultPlugins` instead; a server needs only these.
//!     app.add_plugins((TaskPoolPlugin::default(), bevy_transform::TransformPlugin, MarchlessPlugins));
//!     app.add_systems(Startup, setup).add_systems(Update, dig);
//!     app.update();
//! }
//!
//! /// Hills, about 40 voxels high.
//! fn setup(mut commands: Commands) {
//!     commands.spawn(Terrain::new(|[x, y, z]: [f64; 3]| y - 40.0 - 8.0 * (x * 0.05).sin() * (z * 0.04).cos()));
//! }
//!
//! fn dig(terrain: Single<Entity, With<Terrain>>, mut stamps: MessageWriter<Stamp>) {
//!     stamps.write(Stamp::dig(*terrain, BrushShape::sphere(Vec3::new(128.0, 40.0, 128.0), 6.0)));
//! }
//! ```
//!
//! # How it works
//! A [`Terrain`](terrain::Terrain) has a fixed extent or is endless. Tasks fill it chunk by chunk from its
//! [`Source`](source::Source): either all of it, or the parts near [`TerrainViewer`](stream::TerrainViewer)s.
//!
//! The samples live in one place, the [`TerrainVolume`](terrain::TerrainVolume). [`Stamp`](brush::Stamp) messages
//! change them. [`Chunk`](chunk::Chunk) entities are children of the terrain and mirror what is drawn. All chunks that
//! an edit changes are meshed from one snapshot and shown in one update. A small edit shows in the update that reads
//! its stamp. A [`TerrainQuery`](query::TerrainQuery) casts rays. Module [`choosing_a_mesher`] compares the two meshers.
//!
//! Everything runs in `PostUpdate` ([`MarchlessSystems`](schedule::MarchlessSystems)), so changes made in `Update` show
//! in the same frame. Module [`inherit`] gives chunks components of the game's own. Module [`in_your_game`] describes
//! how terrain works with the rest of Bevy.
//!
//! # What is guaranteed
//! - The same stamps in the same order give the same samples, bit for bit, on any machine. Threads and the positions of
//!   viewers make no difference. A source's own samples depend on its floating-point arithmetic.
//! - Neighbouring chunks share their borders bit for bit and never show different states of an edit.
//! - Invalid settings, stamps and rays are refused or reported, and so are sources that panic; the game keeps running.
//!
//! # What is not guaranteed
//! - There is one level of detail. Edits cannot be saved or undone. Edits of unloaded chunks stay in memory.
//! - The main thread changes the samples: a brush over 50 voxels in radius takes many milliseconds.
//! - If Bevy's `RenderAssetBytesPerFrame` is smaller than a group's meshes, they may reach the screen in different
//!   frames.
//!
//! # Features
//! On by default: `pbr` (materials), `gizmos` (bounds and states of chunks), `noise` and `png` (sources). Terrain has
//! geometry without these features and without a renderer ([`ChunkGeometry`](chunk::ChunkGeometry)).
//!
//! Off by default: `big_space` puts chunks into the cells of a `big_space` grid, for worlds of any size. `serde` makes
//! settings serialisable. `terrain_files` includes `serde`; with it, terrains follow files in `assets`, even while the
//! game runs (module `file`).

#[cfg(feature = "big_space")]
pub mod big_space;
pub mod bits;
pub mod brush;
mod budget;
/// When to choose which mesher, and what changes with it.
///
#[doc = include_str!("../docs/meshers.md")]
pub mod choosing_a_mesher {}
pub mod chunk;
mod cover;
pub mod diagnostics;
#[cfg(feature = "terrain_files")]
pub mod file;
#[cfg(feature = "gizmos")]
pub mod gizmos;
/// How terrain works with the rest of Bevy: states, parents, visibility, picking, time, pausing and more.
///
#[cfg_attr(feature = "pbr", doc = include_str!("../docs/in_your_game.md"))]
pub mod in_your_game {}
pub mod inherit;
mod jobs;
/// Levels of detail: how to set them, what is guaranteed, and what they cost.
///
#[doc = include_str!("../docs/levels.md")]
pub mod levels_of_detail {}
#[cfg(feature = "pbr")]
pub mod material;
pub mod mesh;
mod placement;
pub mod query;
pub mod schedule;
pub mod source;
pub mod stats;
pub mod stream;
pub mod terrain;
mod volume;

use bevy_app::plugin_group;

pub use marchless;

/// The types that a game with terrain usually needs. Sources are in [`source::prelude`], the answers of
/// [`TerrainBits`](bits::TerrainBits) in [`bits::prelude`].
pub mod prelude {
    pub use crate::MarchlessPlugins;
    pub use crate::brush::{BrushOperation, BrushShape, Stamp, Stroke, TerrainEdited};
    pub use crate::chunk::{Chunk, ChunkGeometry};
    #[cfg(feature = "terrain_files")]
    pub use crate::file::TerrainFile;
    #[cfg(feature = "gizmos")]
    pub use crate::gizmos::ShowChunkBounds;
    pub use crate::inherit::ChunkComponentPlugin;
    pub use crate::query::{TerrainHit, TerrainQuery};
    pub use crate::schedule::{MarchlessSettings, MarchlessSystems};
    pub use crate::stream::TerrainViewer;
    pub use crate::terrain::{DualMesher, Extent, Keep, Palette, SharpMaterials};
    pub use crate::terrain::{Terrain, TerrainLevels, TerrainMesher, TerrainVolume};
}

plugin_group! {
    /// All plugins of the terrain. Each one can be disabled or replaced.
    #[derive(Debug)]
    pub struct MarchlessPlugins {
        schedule:::SchedulePlugin,
        terrain:::TerrainPlugin,
        stream:::StreamPlugin,
        query:::QueryPlugin,
        bits:::BitsPlugin,
        brush:::BrushPlugin,
        mesh:::MeshingPlugin,
        inherit:::InheritPlugin,
        #[cfg(feature = "pbr")]
        material:::StandardTerrainMaterialPlugin,
        #[cfg(feature = "big_space")]
        big_space:::BigSpacePlugin,
        #[cfg(feature = "terrain_files")]
        file:::TerrainFilePlugin,
        diagnostics:::TerrainDiagnosticsPlugin,
        #[cfg(feature = "gizmos")]
        gizmos:::ChunkGizmosPlugin,
    }
}
