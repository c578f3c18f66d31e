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
//!     // `DefaultPlugins` in a game; a server needs no more than this.
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
//! A [`Terrain`](terrain::Terrain), of a fixed extent or endless, is filled from its [`Source`](source::Source), chunk by
//! chunk, in tasks: all of it, or what [`TerrainViewer`](stream::TerrainViewer)s see. Its
//! samples live in one place, its [`TerrainVolume`](terrain::TerrainVolume), which [`Stamp`](brush::Stamp) messages change;
//! [`Chunk`](chunk::Chunk) entities, its children, mirror what is drawn. All chunks that an edit changes are
//! meshed from one snapshot and shown in one update, a small edit in the update that reads its stamp. A
//! [`TerrainQuery`](query::TerrainQuery) tells what a ray hits. Everything runs in `PostUpdate`
//! ([`MarchlessSystems`](schedule::MarchlessSystems)), so what `Update` asks for shows in the same frame. How
//! chunks get components of a game's own, module [`inherit`] tells; how terrain gets on with the rest of Bevy, module [`in_your_game`].
//!
//! # What is guaranteed
//! - The same stamps in the same order give the same samples, bit for bit, on any machine, whatever the threads do and
//!   wherever viewers are; what a source gives is up to its floating point.
//! - Neighbouring chunks share their borders bit for bit, and never show different states of an edit.
//! - Bad settings, stamps, rays and sources that panic are refused or reported; the game goes on.
//!
//! # What is not
//! - There is one level of detail. Edits are neither saved nor undone; those of chunks that are unloaded stay in memory.
//! - Samples are changed on the main thread: a brush over 50 voxels in radius takes many milliseconds.
//! - With Bevy's `RenderAssetBytesPerFrame` below what a group needs, its meshes may reach the screen frames apart.
//!
//! # Features
//! On by default: `pbr` (materials), `gizmos` (bounds and states of chunks), `noise` and `png` (sources). Without them, and without any
//! renderer, terrain has geometry all the same ([`ChunkGeometry`](chunk::ChunkGeometry)).
//!
//! Off by default: `big_space` puts chunks into the cells of a `big_space` grid, for worlds of any size. `serde` lets
//! settings be written and read. `terrain_files`, which includes it, has terrains follow files in `assets`, also while the
//! game runs (module `world`).

#[cfg(feature = "big_space")]
pub mod big_space;
pub mod bits;
pub mod brush;
mod budget;
pub mod chunk;
mod cover;
pub mod diagnostics;
#[cfg(feature = "terrain_files")]
pub mod file;
#[cfg(feature = "gizmos")]
pub mod gizmos;
/// How terrain gets on with the rest of Bevy: states, parents, visibility, picking, time, pausing and more.
///
#[cfg_attr(feature = "pbr", doc = include_str!("../docs/in_your_game.md"))]
pub mod in_your_game {}
pub mod inherit;
mod jobs;
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

/// What a game that uses terrain usually needs. Sources are in [`source::prelude`], what [`TerrainBits`](bits::TerrainBits)
/// answers with in [`bits::prelude`].
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
    pub use crate::terrain::{Extent, Keep, Palette, Terrain, TerrainVolume};
}

plugin_group! {
    /// Everything that terrain needs. Each part can be disabled or replaced.
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
