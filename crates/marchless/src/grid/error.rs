//! [`GridError`]: why a grid or a chunk was refused.

use thiserror::Error;

use super::{MAX_CHUNK_CELLS, MIN_CHUNK_CELLS};
use crate::lattice::Region;

/// Why a grid or a chunk was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GridError {
    /// Chunks cannot have this size.
    #[error("a chunk has {MIN_CHUNK_CELLS} to {MAX_CHUNK_CELLS} cells per axis, not {found}")]
    ChunkCells {
        /// What was given.
        found: u32,
    },
    /// A grid cannot have these bounds.
    #[error(
        "a grid's bounds hold at least one chunk and lie within {:?} to {:?}, but {:?} to {:?} was asked for",
        limits.min, limits.max, bounds.min, bounds.max
    )]
    Bounds {
        /// What was given, in chunks.
        bounds: Region,
        /// What can be addressed, in chunks.
        limits: Region,
    },
    /// There is no place for a chunk.
    #[error("chunk {position:?} lies outside of the grid's chunks, {:?} up to, but without, {:?}", bounds.min, bounds.max)]
    OutOfBounds {
        /// The chunk's position.
        position: [i32; 3],
        /// The grid's bounds, or what can be addressed, in chunks.
        bounds: Region,
    },
    /// The samples are not those of a chunk.
    #[error(
        "a chunk of {cells} cells per axis has {expected} samples, but there are {weights} weights and {materials} materials"
    )]
    SamplesLength {
        /// Cells per axis.
        cells: u32,
        /// How many samples that makes.
        expected: usize,
        /// How many weights there are.
        weights: usize,
        /// How many materials there are.
        materials: usize,
    },
}
