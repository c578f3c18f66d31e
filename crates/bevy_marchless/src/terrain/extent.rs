//! [`Extent`] and [`Keep`]: which chunks a terrain has, and which of them are loaded whoever looks.

use bevy_math::{IVec3, UVec3};
use bevy_reflect::prelude::*;
use core::ops::Range;
use marchless::Region;

/// Which chunks a terrain has: positions from `min` up to, but without, `max`, in chunks.
///
/// Outside of it there is air. What lies beyond the farthest lattice points that there can be, some two thousand
/// million voxels from the origin, is left out: an axis that reaches so far is endless for all that a player can tell.
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
    /// Without any border.
    pub const ENDLESS: Self = Self { min: IVec3::MIN, max: IVec3::MAX };

    /// From `min` up to, but without, `max`, in chunks.
    pub const fn new(min: IVec3, max: IVec3) -> Self {
        Self { min, max }
    }

    /// The same extent with these chunks along x.
    #[must_use]
    pub const fn with_x(mut self, chunks: Range<i32>) -> Self {
        (self.min.x, self.max.x) = (chunks.start, chunks.end);
        self
    }

    /// The same extent with these chunks along y.
    #[must_use]
    pub const fn with_y(mut self, chunks: Range<i32>) -> Self {
        (self.min.y, self.max.y) = (chunks.start, chunks.end);
        self
    }

    /// The same extent with these chunks along z.
    #[must_use]
    pub const fn with_z(mut self, chunks: Range<i32>) -> Self {
        (self.min.z, self.max.z) = (chunks.start, chunks.end);
        self
    }

    /// How large it is, in chunks per axis; 0 where `max` is not above `min`.
    pub fn size(&self) -> UVec3 {
        let size = |axis: usize| i64::from(self.max[axis]) - i64::from(self.min[axis]);
        UVec3::from([0, 1, 2].map(|axis| size(axis).clamp(0, u32::MAX.into()) as u32))
    }

    /// What of it there can be with chunks of so many cells.
    pub(crate) fn region(&self, chunk_cells: u32) -> Region {
        Region::new(self.min.to_array(), self.max.to_array())
            .intersection(&marchless::Grid::<i16>::largest(chunk_cells))
    }
}

/// Without any border.
impl Default for Extent {
    fn default() -> Self {
        Self::ENDLESS
    }
}

/// From chunk 0 of each axis on, so many chunks.
impl From<UVec3> for Extent {
    fn from(size: UVec3) -> Self {
        Self { min: IVec3::ZERO, max: size.min(UVec3::splat(i32::MAX as u32)).as_ivec3() }
    }
}

/// An extent as files have it: the first chunk and one past the last, for the axes along which it ends.
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

/// Which chunks of a terrain are loaded whether a [`TerrainViewer`](crate::stream::TerrainViewer) is near or not.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, PartialEq, Hash, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Keep {
    /// All of them; their number is limited by [`Terrain::MAX_CHUNKS`](super::Terrain::MAX_CHUNKS).
    #[default]
    Everything,
    /// None.
    Nothing,
    /// These, as far as the terrain has them.
    Chunks(Extent),
}

impl Keep {
    /// What is kept of a terrain's chunks.
    pub(crate) fn region(&self, extent: Region, chunk_cells: u32) -> Region {
        match self {
            Self::Everything => extent,
            Self::Nothing => Region::new([0; 3], [0; 3]),
            Self::Chunks(chunks) => chunks.region(chunk_cells).intersection(&extent),
        }
    }
}
