//! Smooth terrain that players can dig, as one Bevy plugin.

pub mod brush;
pub mod chunk;
pub mod debug;
#[cfg(feature = "pbr")]
pub mod material;
pub mod mesh;
pub mod query;
pub mod schedule;
pub mod source;
mod stats;
pub mod terrain;
mod work;

use bevy_app::plugin_group;

pub use marchless;

/// What a game that uses terrain usually needs.
pub mod prelude {
    pub use crate::MarchlessPlugins;
    pub use crate::brush::{BrushOperation, BrushShape, Stamp, Stroke, TerrainEdited};
    pub use crate::chunk::{Chunk, ChunkGeometry};
    pub use crate::debug::DebugPlugin;
    #[cfg(feature = "gizmos")]
    pub use crate::debug::ShowChunkBounds;
    #[cfg(feature = "pbr")]
    pub use crate::material::TerrainMaterialPlugin;
    pub use crate::mesh::ChunkSamples;
    pub use crate::query::{TerrainHit, TerrainQuery};
    pub use crate::schedule::{MarchlessSettings, MarchlessSystems};
    pub use crate::source::*;
    pub use crate::terrain::{Palette, SourceHandle, Terrain, TerrainError, TerrainVolume};
}

plugin_group! {
    /// Everything that terrain needs. Each part can be disabled or replaced.
    #[derive(Debug)]
    pub struct MarchlessPlugins {
        schedule:::SchedulePlugin,
        terrain:::TerrainPlugin,
        brush:::BrushPlugin,
        mesh:::MeshingPlugin,
        #[cfg(feature = "pbr")]
        material:::MaterialPlugin,
        debug:::DebugPlugin,
    }
}
