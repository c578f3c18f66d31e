//! [`TerrainBits`]: what of a terrain is solid, as bits: collision, what hangs together, and what hangs free.

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

/// The questions about what is solid, and what answers are made of.
pub mod prelude {
    pub use super::{BitsSnapshot, Island, Phase, TerrainBits, TerrainBitsError};
    pub use marchless::Region;
    pub use marchless::bits::BitGrid;
}

/// Questions to terrains about what is solid: the lattice points whose samples are inside at the terrain's isovalue.
///
/// Everything is in the terrain's lattice: in voxels, from its lowest corner
/// ([`TerrainQuery::to_lattice`](crate::query::TerrainQuery::to_lattice) gives them). On the terrain's outermost planes and beyond, all is air.
///
/// Answers are based on the newest samples: with all stamps that the plugin has applied, which it does in `PostUpdate`, and
/// perhaps before their meshes show. Stamps written in the same update are not among them, nor are settings changed in it.
/// Where a question needs a chunk that is not filled yet, it says so.
///
/// Bits are derived from samples chunk by chunk, when a question first needs them, and kept until these samples change;
/// a chunk that is all ground or all air costs none.
///
/// # What takes how long
/// To derive the bits of a chunk of 32³ samples takes about 20 µs, once. [`is_solid`](Self::is_solid) and the questions about what
/// overlaps then take about a microsecond for each chunk they touch, and are meant for the main thread, hundreds
/// of them an update. The others gather the bits of a box: on hills, [`bits`](Self::bits) stays under a millisecond up to
/// 192³ points, [`connected`](Self::connected) and [`islands`](Self::islands) up to 128³ (measured on one server core); ground
/// full of holes takes longer. For larger boxes take a [`snapshot`](Self::snapshot), which takes microseconds, and ask it
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

/// Keeps the bits that have been asked for, as [`TerrainBits`] needs it.
#[derive(Default)]
pub struct BitsPlugin;

impl Plugin for BitsPlugin {
    fn build(&self, app: &mut App) {
        give_to_terrains::<BitsCache>(app);
    }
}

/// The medium that a path must stay inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// What is solid.
    Solid,
    /// Everything else, the air beyond the terrain included.
    Air,
}

impl TerrainBits<'_, '_> {
    /// How many words of 64 points a box may have whose bits are gathered: 2²², 32 MiB. A row along x takes
    /// whole words.
    pub const MAX_WORDS: u32 = 1 << 22;

    /// Whether all points of a box are solid; so they are of an empty one.
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

    /// Whether some point of a box is solid.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn overlaps_region(&self, terrain: Entity, region: Region) -> Result<bool, TerrainBitsError> {
        self.any_part(terrain, region, ChunkPart::is_partly_solid)
    }

    /// Whether some solid point is at most `radius` from `center`. What lies on the sphere but for the rounding of `f32` may
    /// count or not. A ball that is none (NaN, infinite, a negative radius) overlaps nothing.
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

    /// Whether a shape touches solid ground: whether some point is solid and also a point of the shape, whose point `p` lies
    /// at `p + offset`.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn collides(&self, terrain: Entity, shape: &BitGrid, offset: IVec3) -> Result<bool, TerrainBitsError> {
        let (offset, size) = (offset.to_array(), shape.shape().size());
        let region = Region::new(offset, [0, 1, 2].map(|axis| offset[axis].saturating_add_unsigned(size[axis])));
        self.any_part(terrain, region, |part| part.overlaps(shape, offset))
    }

    /// The bits of a box: its lowest point is the grid's point `[0, 0, 0]`.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::Empty`], [`TerrainBitsError::TooLarge`].
    pub fn bits(&self, terrain: Entity, region: Region) -> Result<BitGrid, TerrainBitsError> {
        self.snapshot(terrain, region)?.bits()
    }

    /// Whether two points of a box are connected within it: see [`BitsSnapshot::connected`].
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::TooLarge`].
    pub fn connected(
        &self,
        terrain: Entity,
        a: IVec3,
        b: IVec3,
        region: Region,
        medium: Phase,
    ) -> Result<bool, TerrainBitsError> {
        self.snapshot(terrain, region)?.connected(a, b, medium)
    }

    /// The islands that what is solid in a box falls into: see [`BitsSnapshot::islands`].
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`]; [`TerrainBitsError::TooLarge`].
    pub fn islands(&self, terrain: Entity, region: Region) -> Result<Vec<Island>, TerrainBitsError> {
        self.snapshot(terrain, region)?.islands()
    }

    /// The islands that hang free near an edit, in a box that reaches `margin` points beyond what it has changed.
    ///
    /// A island is found only if all of it lies within that box, and not at its border; what hung free there before the
    /// edit is found, too.
    ///
    /// # Errors
    /// As [`TerrainBits::islands`].
    pub fn loose_islands(&self, edited: &TerrainEdited, margin: u32) -> Result<Vec<Island>, TerrainBitsError> {
        let region = Region::new(edited.min.to_array(), edited.max.to_array()).grown(margin, margin);
        self.snapshot(edited.terrain, region)?.loose_islands()
    }

    /// The samples of a island alone, as they are now: put them on an entity, and it looks as it did in the terrain. The lowest
    /// sample lies at two points below the island's bounds, since there is air all around. Takes milliseconds for
    /// bounds of 64³ points.
    ///
    /// # Errors
    /// [`TerrainBitsError::NoTerrain`].
    pub fn samples(&self, terrain: Entity, island: &Island) -> Result<ChunkSamples, TerrainBitsError> {
        let no_terrain = TerrainBitsError::NoTerrain { entity: terrain };
        let (volume, _) = self.terrains.get(terrain).map_err(|_| no_terrain)?;
        let settings = volume.settings().ok_or(no_terrain)?;
        Ok(island.samples(volume.grid(), settings))
    }

    /// A box as it is now, to be asked [in a task](BitsSnapshot::in_task). Takes a fraction of a microsecond a chunk.
    ///
    /// # Errors
    /// As [`TerrainBits::is_solid`].
    pub fn snapshot(&self, terrain: Entity, region: Region) -> Result<BitsSnapshot, TerrainBitsError> {
        let query = self.query(terrain)?;
        let parts = parts(query, region).collect::<Result<_, _>>()?;
        Ok(BitsSnapshot { region, inside: within(query.grid, region), parts })
    }

    fn any_part(
        &self,
        terrain: Entity,
        region: Region,
        question: impl Fn(&ChunkPart) -> Result<bool, TerrainBitsError>,
    ) -> Result<bool, TerrainBitsError> {
        let query = self.query(terrain)?;
        for part in parts(query, region) {
            if question(&part?)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The terrain's samples, and the isovalue in effect.
    fn query(&self, terrain: Entity) -> Result<SolidQuery<'_>, TerrainBitsError> {
        let no_terrain = TerrainBitsError::NoTerrain { entity: terrain };
        let (volume, cache) = self.terrains.get(terrain).map_err(|_| no_terrain)?;
        let settings = volume.settings().ok_or(no_terrain)?;
        Ok(SolidQuery { grid: volume.grid(), cache, isovalue: settings.isovalue })
    }
}

/// Why a question about a terrain's bits has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TerrainBitsError {
    /// No terrain, or one that the plugin has not seen yet or whose settings it refused.
    #[error("entity {entity} has no terrain, or the plugin has not accepted its settings yet")]
    NoTerrain {
        /// What was asked.
        entity: Entity,
    },
    /// The answer needs samples that are not there yet.
    #[error("chunk {chunk} is not filled yet")]
    NotFilled {
        /// The chunk's position, in chunks.
        chunk: IVec3,
    },
    /// There is no grid without points.
    #[error("a box of bits must hold a point, but it is {:?} up to, but without, {:?}", region.min, region.max)]
    Empty {
        /// What was asked for.
        region: Region,
    },
    /// So many bits are not gathered.
    #[error(
        "a box of bits must not exceed {} words of 64 points, but it is {:?} up to, but without, {:?}",
        TerrainBits::MAX_WORDS, region.min, region.max
    )]
    TooLarge {
        /// What was asked for, or what of it the terrain reaches.
        region: Region,
    },
    /// Memory does not suffice.
    #[error(transparent)]
    Bits(#[from] BitsError),
}
