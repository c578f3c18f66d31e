//! [`TerrainError`]: why settings are refused.

use bevy_ecs::prelude::*;
use bevy_math::IVec3;
use bevy_reflect::prelude::*;
use thiserror::Error;

use super::Terrain;

/// The reason why a terrain's settings are refused. The terrain's entity has this component while they are.
#[derive(Component, Reflect, Clone, Debug, PartialEq, Error)]
#[reflect(Component, Debug, PartialEq, Clone)]
#[component(clone_behavior = Ignore)]
#[non_exhaustive]
pub enum TerrainError {
    /// The extent holds no chunk.
    #[error("a terrain's extent must hold at least one chunk that can be addressed, but it is {min} to {max}")]
    Extent {
        /// Its lowest chunk.
        min: IVec3,
        /// One past its highest chunk.
        max: IVec3,
    },
    /// More chunks are kept loaded than allowed.
    #[error(
        "a terrain must keep at most {} chunks loaded, but `keep` and `extent` ask for {found}; keep fewer and let viewers load the others",
        Terrain::MAX_CHUNKS
    )]
    Keep {
        /// The number of chunks that `keep` and `extent` ask for.
        found: u64,
    },
    /// The number of cells per axis is out of range.
    #[error("a chunk must have 8 to 62 cells per axis, but `chunk_cells` is {found}")]
    ChunkCells {
        /// The rejected number.
        found: u32,
    },
    /// The voxel size is not finite or not above 0.
    #[error("a terrain's voxel size must be finite and above 0, but it is {found}")]
    VoxelSize {
        /// The rejected size, in world units.
        found: f32,
    },
    /// The game has registered no source of this name.
    #[error("a terrain's source must be registered in `TerrainSources`, but there is none of the name '{name}'")]
    Source {
        /// Its name.
        name: String,
    },
    /// The number of levels is out of range.
    #[error("a terrain must have 1 to 7 levels of detail, but `levels.count` is {found}")]
    Levels {
        /// The rejected number.
        found: u8,
    },
    /// The falloff of detail is out of range.
    #[error("the falloff of a terrain's detail must be from 1.75 to 64, but `levels.falloff` is {found}")]
    Falloff {
        /// The rejected number.
        found: f32,
    },
    /// The hysteresis of levels is out of range.
    #[error("the hysteresis of a terrain's levels must be from 0 to 1, but `levels.hysteresis` is {found}")]
    Hysteresis {
        /// The rejected share.
        found: f32,
    },
    /// There are more steps of smoothing than the dual mesher takes for chunks of this size.
    #[error("a terrain's dual mesher must have 0 to {most} steps of smoothing, but `mesher` has {found}")]
    Smoothing {
        /// The rejected number.
        found: u32,
        /// The most steps for the terrain's `chunk_cells`.
        most: u32,
    },
    /// The dual mesher's crease angle is NaN or out of range.
    #[error("a terrain's crease angle must be from 0 to 180 degrees, but `mesher` has {found}")]
    Crease {
        /// The rejected angle.
        found: f32,
    },
    /// There are several levels of detail with the dual mesher.
    #[error("a terrain with the dual mesher must have one level of detail, but `levels.count` is {levels}")]
    DualLevels {
        /// The number of levels.
        levels: u8,
    },
    /// The isovalue is NaN or infinite.
    #[error("a terrain's isovalue must be finite, but it is {found}")]
    Isovalue {
        /// The rejected isovalue, in voxels.
        found: f32,
    },
}
