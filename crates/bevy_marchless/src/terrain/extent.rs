//! [`Extent`]: the chunks that a terrain has. [`Keep`]: those that are loaded even without a viewer.

use bevy_math::{IVec3, UVec3};
use bevy_reflect::prelude::*;
use core::ops::Range;
use marchless::Region;

/// The chunks that a terrain has: positions from `min` up to, but excluding, `max`, in chunks.
///
/// Outside the extent there is air. Chunks beyond the farthest addressable lattice points, about two thousand million
/// voxels from the origin, are left out; for a player, an axis that long is endless.
///
/// ```
/// use bevy_marchless::prelude::*;
///
/// // Endless to all sides, 256 voxels high.
/// let extent = Extent::ENDLESS.with_y(-2..6);
/// assert_eq!((extent.min.y, extent.max.y), (-2, 6));
/// ```
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(from = "Ends", into = "Ends"))]
pub struct Extent {
    /// The lowest chunk.
    pub min: IVec3,
    /// One past the highest chunk.
    pub max: IVec3,
}

impl Extent {
    /// An extent without borders.
    pub const ENDLESS: Self = Self { min: IVec3::MIN, max: IVec3::MAX };

    /// Creates the extent from `min` up to, but excluding, `max`, in chunks.
    pub const fn new(min: IVec3, max: IVec3) -> Self {
        Self { min, max }
    }

    /// Sets the chunks along x.
    #[must_use]
    pub const fn with_x(mut self, chunks: Range<i32>) -> Self {
        (self.min.x, self.max.x) = (chunks.start, chunks.end);
        self
    }

    /// Sets the chunks along y.
    #[must_use]
    pub const fn with_y(mut self, chunks: Range<i32>) -> Self {
        (self.min.y, self.max.y) = (chunks.start, chunks.end);
        self
    }

    /// Sets the chunks along z.
    #[must_use]
    pub const fn with_z(mut self, chunks: Range<i32>) -> Self {
        (self.min.z, self.max.z) = (chunks.start, chunks.end);
        self
    }

    /// The extent's size in chunks per axis; 0 where `max` is not above `min`.
    pub fn size(&self) -> UVec3 {
        let size = |axis: usize| i64::from(self.max[axis]) - i64::from(self.min[axis]);
        UVec3::from([0, 1, 2].map(|axis| size(axis).clamp(0, u32::MAX.into()) as u32))
    }

    /// The part of the extent that can be addressed with chunks of `chunk_cells` cells.
    pub(crate) fn region(&self, chunk_cells: u32) -> Region {
        Region::new(self.min.to_array(), self.max.to_array())
            .intersection(&marchless::Grid::<i16>::largest(chunk_cells))
    }
}

/// The default is an extent without borders.
impl Default for Extent {
    fn default() -> Self {
        Self::ENDLESS
    }
}

/// A size converts to an extent that starts at chunk 0 on each axis.
impl From<UVec3> for Extent {
    fn from(size: UVec3) -> Self {
        Self { min: IVec3::ZERO, max: size.min(UVec3::splat(i32::MAX as u32)).as_ivec3() }
    }
}

/// The serialised form of an extent: for each axis with an end, the first chunk and one past the last.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize, Default)]
#[serde(rename = "Extent", default, deny_unknown_fields)]
struct Ends {
    x: Option<(i32, i32)>,
    y: Option<(i32, i32)>,
    z: Option<(i32, i32)>,
}

#[cfg(feature = "serde")]
impl From<Ends> for Extent {
    fn from(ends: Ends) -> Self {
        let ends = [ends.x, ends.y, ends.z].map(|ends| ends.unwrap_or((i32::MIN, i32::MAX)));
        Self { min: ends.map(|(first, _)| first).into(), max: ends.map(|(_, end)| end).into() }
    }
}

#[cfg(feature = "serde")]
impl From<Extent> for Ends {
    fn from(extent: Extent) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let ends = (extent.min[axis], extent.max[axis]);
            (ends != (i32::MIN, i32::MAX)).then_some(ends)
        });
        Self { x, y, z }
    }
}

/// The chunks of a terrain that are loaded even if no [`TerrainViewer`](crate::stream::TerrainViewer) is near.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Keep {
    /// All chunks; [`Terrain::MAX_CHUNKS`](super::Terrain::MAX_CHUNKS) limits their number.
    #[default]
    Everything,
    /// No chunks.
    Nothing,
    /// These chunks, clipped to the terrain's extent.
    Chunks(Extent),
}

impl Keep {
    /// The part of `extent` that is kept loaded.
    pub(crate) fn region(&self, extent: Region, chunk_cells: u32) -> Region {
        match self {
            Self::Everything => extent,
            Self::Nothing => Region::new([0; 3], [0; 3]),
            Self::Chunks(chunks) => chunks.region(chunk_cells).intersection(&extent),
        }
    }
}
