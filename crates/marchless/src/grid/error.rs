//! [`GridError`]: why a grid or a chunk was refused.

use thiserror::Error;

use super::{MAX_CHUNK_CELLS, MIN_CHUNK_CELLS};
use crate::lattice::Region;

/// Why a grid or a chunk was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GridError {
    /// The chunk size is out of range.
    #[error("a chunk has {MIN_CHUNK_CELLS} to {MAX_CHUNK_CELLS} cells per axis, not {found}")]
    ChunkCells {
        /// The number of cells per axis that was given.
        found: u32,
    },
    /// The bounds are empty or too large.
    #[error(
        "a grid's bounds hold at least one chunk and lie within {:?} to {:?}, but {:?} to {:?} was asked for",
        limits.min, limits.max, bounds.min, bounds.max
    )]
    Bounds {
        /// The bounds that were given, in chunk positions.
        bounds: Region,
        /// The addressable chunk positions.
        limits: Region,
    },
    /// The chunk position is outside of the grid.
    #[error("chunk {position:?} lies outside of the grid's chunks, {:?} up to, but without, {:?}", bounds.min, bounds.max)]
    OutOfBounds {
        /// The chunk's position.
        position: [i32; 3],
        /// The grid's bounds, or all addressable chunk positions in a grid without bounds.
        bounds: Region,
    },
    /// The number of samples is not that of a chunk.
    #[error(
        "a chunk of {cells} cells per axis has {expected} samples, but there are {weights} weights and {materials} materials"
    )]
    SamplesLength {
        /// Cells per axis.
        cells: u32,
        /// The number of samples of such a chunk.
        expected: usize,
        /// The number of weights that was given.
        weights: usize,
        /// The number of materials that was given.
        materials: usize,
    },
}
