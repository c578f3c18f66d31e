//! [`TerrainBits`]: the solid points of a terrain as bits, for collision, connectivity and loose islands.

mod cache;
mod island;
mod part;
mod snapshot;

use bevy_app::{App, Plugin};
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_math::{DVec3, IVec3};
use marchless::Region;
use marchless::bits::{BitGrid, BitsError};
use thiserror::Error;

use crate::brush::TerrainEdited;
use crate::mesh::ChunkSamples;
use crate::terrain::{TerrainVolume, give_to_terrains};
use cache::BitsCache;
pub use island::Island;
use part::{ChunkPart, SolidQuery, parts, within};
pub use snapshot::BitsSnapshot;

/// [`TerrainBits`] and the types of its arguments and results.
pub mod prelude {
    pub use super::{BitsSnapshot, Island, Phase, TerrainBits, TerrainBitsError};
    pub use marchless::Region;
    pub use marchless::bits::BitGrid;
}

/// A system parameter with queries about the solid points of terrains: the lattice points whose samples are inside at
/// the terrain's isovalue.
///
/// All coordinates are in the terrain's lattice: in voxels, from the terrain's lowest corner.
/// [`TerrainQuery::to_lattice`](crate::query::TerrainQuery::to_lattice) converts from world space. The terrain's
/// outermost planes, and everything beyond them, are air.
///
/// Queries read the newest samples, with every stamp that the plugin has applied. It applies stamps in `PostUpdate`,
/// perhaps before their meshes show. Stamps that were written and settings that were changed in the same update do not
/// count yet. A query that needs a chunk that is not filled yet returns [`TerrainBitsError::NotFilled`].
///
/// A chunk's bits are derived from its samples when a query first needs them, and kept until these samples change. A
/// chunk that is all ground or all air needs no bits.
///
/// # Performance
/// Deriving the bits of a chunk of 32³ samples takes about 20 µs, once. After that, [`is_solid`](Self::is_solid),
/// [`overlaps_region`](Self::overlaps_region), [`overlaps_ball`](Self::overlaps_ball) and [`collides`](Self::collides)
/// take about a microsecond for each chunk that they touch. They are meant for the main thread, hundreds of calls per
/// update.
///
/// The others gather the bits of a box. On hills, [`bits`](Self::bits) takes less than a millisecond up to 192³ points,
/// [`connected`](Self::connected) and [`islands`](Self::islands) up to 128³ (measured on one server core). Ground full
/// of holes takes longer. For larger boxes take a [`snapshot`](Self::snapshot), which takes microseconds, and query it
/// [in a task](BitsSnapshot::in_task).
///
/// ```
/// use bevy_marchless::prelude::*;
/// use bevy_marchless::bits::prelude::*;
/// # use bevy_ecs::prelude::*;
/// # use bevy_math::Vec3;
///
/// fn bump(terrain: Single<Entity, With<Terrain>>, bits: TerrainBits) {
///     // A ball of radius 2 in the middle of the terrain, in voxels.
///     if bits.overlaps_ball(*terrain, Vec3::new(128.0, 64.0, 128.0), 2.0) == Ok(true) {
///         println!("Ouch!");
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct TerrainBits<'w, 's> {
    terrains: Query<'w, 's, (&'static TerrainVolume, &'static BitsCache)>,
}

/// Gives each terrain the cache of bits that [`TerrainBits`] needs.
#[derive(Default)]
pub struct BitsPlugin;

impl Plugin for BitsPlugin {
    fn build(&self, app: &mut App) {
        give_to_terrains::<BitsCache>(app);
    }
}

/// Solid or air: the phase that a path must stay inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The solid points.
    Solid,
    /// All other points, including the air beyond the terrain.
    Air,
}

impl TerrainBits<'_, '_> {
    /// The largest box whose bits can be gathered, in words of 64 points: 2²², or 32 MiB. Each row along x takes whole
    /// words.
    pub const MAX_WORDS: u32 = 1 << 22;

    /// True if every point of a box is solid; true for an empty box.
    ///
    /// # Errors
    /// [`TerrainBitsError::NoTerrain`], [`TerrainBitsError::NotFilled`].
    pub fn is_solid(&self, terrain: Entity, region: Region) -> Result<bool, TerrainBitsError> {
        let query = self.query(terrain)?;
        if region.is_empty() || within(query.grid, region) != region {
            return Ok(region.is_empty());
        }
        for part in parts(query, region) {
            if !part?.is_solid()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// True if any point of a box is solid.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn overlaps_region(&self, terrain: Entity, region: Region) -> Result<bool, TerrainBitsError> {
        self.any_part(terrain, region, ChunkPart::is_partly_solid)
    }

    /// True if any solid point is at most `radius` from `center`.
    ///
    /// A point on the sphere itself, within the rounding of `f32`, may count or not. An invalid ball (NaN, infinite, a
    /// negative radius) overlaps nothing.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn overlaps_ball(
        &self,
        terrain: Entity,
        center: impl Into<DVec3>,
        radius: f32,
    ) -> Result<bool, TerrainBitsError> {
        let (center, reach) = (center.into(), f64::from(radius));
        let is_ball = center.is_finite() && radius.is_finite() && radius >= 0.0;
        // Conversions saturate.
        let [low, high] = [(center - reach).floor(), (center + reach).ceil()].map(|end| end.as_ivec3().to_array());
        let region =
            if is_ball { Region::new(low, high.map(|v| v.saturating_add(1))) } else { Region::new([0; 3], [0; 3]) };
        self.any_part(terrain, region, |part| part.overlaps_ball(center, radius))
    }

    /// True if a shape overlaps solid ground: if any of its points is solid.
    ///
    /// The shape's point `p` lies at `p + offset` in the terrain's lattice.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn collides(&self, terrain: Entity, shape: &BitGrid, offset: IVec3) -> Result<bool, TerrainBitsError> {
        let (offset, size) = (offset.to_array(), shape.shape().size());
        let region = Region::new(offset, [0, 1, 2].map(|axis| offset[axis].saturating_add_unsigned(size[axis])));
        self.any_part(terrain, region, |part| part.overlaps(shape, offset))
    }

    /// The bits of a box; the box's lowest point is the grid's point `[0, 0, 0]`.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::Empty`], [`TerrainBitsError::TooLarge`].
    pub fn bits(&self, terrain: Entity, region: Region) -> Result<BitGrid, TerrainBitsError> {
        self.snapshot(terrain, region)?.bits()
    }

    /// True if two points of a box are connected within it; see [`BitsSnapshot::connected`].
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::TooLarge`].
    pub fn connected(
        &self,
        terrain: Entity,
        a: IVec3,
        b: IVec3,
        region: Region,
        phase: Phase,
    ) -> Result<bool, TerrainBitsError> {
        self.snapshot(terrain, region)?.connected(a, b, phase)
    }

    /// The islands of a box: the connected components of its solid points; see [`BitsSnapshot::islands`].
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::TooLarge`].
    pub fn islands(&self, terrain: Entity, region: Region) -> Result<Vec<Island>, TerrainBitsError> {
        self.snapshot(terrain, region)?.islands()
    }

    /// The loose islands near an edit: those in the edit's bounds, grown by `margin` points on each side, that do not
    /// touch the border of this box.
    ///
    /// An island is found only if it lies wholly inside the box and does not touch the border. Islands that were loose
    /// before the edit are found, too.
    ///
    /// # Errors
    /// As [`TerrainBits::islands`].
    pub fn loose_islands(&self, edited: &TerrainEdited, margin: u32) -> Result<Vec<Island>, TerrainBitsError> {
        let region = Region::new(edited.min.to_array(), edited.max.to_array()).grown(margin, margin);
        self.snapshot(edited.terrain, region)?.loose_islands()
    }

    /// The current samples of an island, without the ground around it. An entity with them looks like the island did in
    /// the terrain.
    ///
    /// Two points of air surround the island, so the lowest sample lies two points below the island's bounds on each
    /// axis. Takes milliseconds for bounds of 64³ points.
    ///
    /// # Errors
    /// [`TerrainBitsError::NoTerrain`].
    pub fn samples(&self, terrain: Entity, island: &Island) -> Result<ChunkSamples, TerrainBitsError> {
        let no_terrain = TerrainBitsError::NoTerrain { entity: terrain };
        let (volume, _) = self.terrains.get(terrain).map_err(|_| no_terrain)?;
        let settings = volume.settings().ok_or(no_terrain)?;
        Ok(island.samples(volume.grid(), settings))
    }

    /// A snapshot of a box, which can be queried [in a task](BitsSnapshot::in_task). Takes a fraction of a microsecond
    /// per chunk.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn snapshot(&self, terrain: Entity, region: Region) -> Result<BitsSnapshot, TerrainBitsError> {
        let query = self.query(terrain)?;
        let parts = parts(query, region).collect::<Result<_, _>>()?;
        Ok(BitsSnapshot { region, inside: within(query.grid, region), parts })
    }

    /// True if `test` holds for any chunk's part of a box.
    fn any_part(
        &self,
        terrain: Entity,
        region: Region,
        test: impl Fn(&ChunkPart) -> Result<bool, TerrainBitsError>,
    ) -> Result<bool, TerrainBitsError> {
        let query = self.query(terrain)?;
        for part in parts(query, region) {
            if test(&part?)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The terrain's samples, its cache and the isovalue in effect.
    fn query(&self, terrain: Entity) -> Result<SolidQuery<'_>, TerrainBitsError> {
        let no_terrain = TerrainBitsError::NoTerrain { entity: terrain };
        let (volume, cache) = self.terrains.get(terrain).map_err(|_| no_terrain)?;
        let settings = volume.settings().ok_or(no_terrain)?;
        Ok(SolidQuery { grid: volume.grid(), cache, isovalue: settings.isovalue })
    }
}

/// An error of a query about a terrain's bits.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TerrainBitsError {
    /// The entity has no terrain, or the plugin has not seen it yet or has refused its settings.
    #[error("entity {entity} has no terrain, or the plugin has not accepted its settings yet")]
    NoTerrain {
        /// The entity that was queried.
        entity: Entity,
    },
    /// The query needs samples that are not there yet.
    #[error("chunk {chunk} is not filled yet")]
    NotFilled {
        /// The chunk's position, in chunks.
        chunk: IVec3,
    },
    /// The box is empty, but a grid must have points.
    #[error("a box of bits must hold a point, but it is {:?} up to, but without, {:?}", region.min, region.max)]
    Empty {
        /// The box that was given.
        region: Region,
    },
    /// The box exceeds [`TerrainBits::MAX_WORDS`].
    #[error(
        "a box of bits must not exceed {} words of 64 points, but it is {:?} up to, but without, {:?}",
        TerrainBits::MAX_WORDS, region.min, region.max
    )]
    TooLarge {
        /// The box that was given, or the part of it inside the terrain.
        region: Region,
    },
    /// There is not enough memory.
    #[error(transparent)]
    Bits(#[from] BitsError),
}
