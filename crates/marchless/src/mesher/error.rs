//! [`MeshError`]: why meshing stopped.

use thiserror::Error;

use crate::{
    lattice::{Samples, Shape},
    signs::SlabLayout,
};

/// The reason why meshing stopped.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The isovalue is NaN or infinite.
    #[error("the isovalue must be finite, but it is {found}")]
    Isovalue {
        /// The isovalue that was given.
        found: f32,
    },
    /// An axis has no cell.
    #[error("meshing needs at least {least} samples per axis, but there are {shape}")]
    TooSmall {
        /// The shape that was given.
        shape: Shape,
        /// The samples per axis that one cell needs: 2, or 4 if the outermost layer is padding. The dual
        /// mesher needs 2, or the padding on both sides and one more.
        least: u32,
    },
    /// Slabs have no cells, or do not fit in memory.
    #[error("slabs need at least 2 samples along x and y and must fit in memory, but they are {} × {}", size[0], size[1])]
    SlabSize {
        /// The samples along x and y that were given.
        size: [u32; 2],
    },
    /// A slab does not have the size that the mesher was made for.
    #[error("a slab of {} × {} samples needs {expected} weights, but there are {found}", size[0], size[1])]
    SlabLength {
        /// The samples along x and y.
        size: [u32; 2],
        /// Their product.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
    /// There are no cells between the slabs.
    #[error("meshing needs at least 2 slabs, but there are {found}")]
    TooFewSlabs {
        /// The number of slabs that were pushed.
        found: usize,
    },
    /// A leaf with finer neighbours is meshed with another topology than [`Topology::Separated`](crate::Topology).
    #[error("a leaf with finer neighbours can be meshed with Topology::Separated only")]
    LeafTopology,
    /// There are more steps of smoothing than 8, or than a padded block has samples for: with smoothing, it needs as
    /// many samples per axis that are not padding as it has [layers of padding](crate::DualSettings::padding).
    #[error("at most {most} steps of smoothing are possible here, but there are {found}")]
    Smoothing {
        /// The steps that were given.
        found: u32,
        /// The most steps for these samples.
        most: u32,
    },
    /// The crease angle is not one from 0 to π.
    #[error("the crease angle must be from 0 to π, but it is {found}")]
    Crease {
        /// The angle that was given.
        found: f32,
    },
    /// `u32` indices cannot number all vertices.
    #[error("the surface has at least {found} vertices, more than 32-bit indices can name")]
    TooManyVertices {
        /// The number of vertices when meshing stopped.
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
