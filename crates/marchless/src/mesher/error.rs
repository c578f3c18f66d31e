//! [`MeshError`]: why meshing stopped.

use thiserror::Error;

use crate::{
    lattice::{Samples, Shape},
    signs::SlabLayout,
};

/// Why meshing stopped.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The isovalue is NaN or infinite.
    #[error("the isovalue must be finite, but it is {found}")]
    Isovalue {
        /// What was given.
        found: f32,
    },
    /// Some axis has no cell.
    #[error("meshing needs at least {least} samples per axis, but there are {shape}")]
    TooSmall {
        /// What was given.
        shape: Shape,
        /// 2, or 4 where the outermost layer is padding.
        least: u32,
    },
    /// Slabs have no cells, or do not fit in memory.
    #[error("slabs need at least 2 samples along x and y and must fit in memory, but they are {} × {}", size[0], size[1])]
    SlabSize {
        /// What was given: samples along x and y.
        size: [u32; 2],
    },
    /// A slab is not as large as was said.
    #[error("a slab of {} × {} samples needs {expected} weights, but there are {found}", size[0], size[1])]
    SlabLength {
        /// Samples along x and y.
        size: [u32; 2],
        /// Their product.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
    /// There are no cells between the slabs.
    #[error("meshing needs at least 2 slabs, but there are {found}")]
    TooFewSlabs {
        /// How many came.
        found: usize,
    },
    /// The vertices would not fit `u32` indices.
    #[error("the surface has at least {found} vertices, more than 32-bit indices can name")]
    TooManyVertices {
        /// How many there were when meshing stopped.
        found: u64,
    },
}

/// The layout of the samples.
///
/// # Errors
/// [`MeshError::TooSmall`] if there is no cell to mesh.
pub(super) fn checked_layout<W>(samples: &Samples<'_, W>) -> Result<SlabLayout, MeshError> {
    let (shape, least) = (samples.shape(), SlabLayout::min_size(samples.is_padded()));
    SlabLayout::of(samples).ok_or(MeshError::TooSmall { shape, least })
}
