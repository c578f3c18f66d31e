//! [`TerrainLevels`]: how a terrain's detail falls off with distance.

use bevy_reflect::prelude::*;

use super::TerrainError;
use crate::volume::LevelDetail;

/// How a terrain's detail falls off with distance from its viewers; see [`levels_of_detail`](crate::levels_of_detail).
///
/// Level 0 is the finest. A chunk of level `k` is as wide as 2ᵏ chunks of level 0, and has as many cells, so it is drawn
/// with about as many triangles. Chunks of all levels form one surface without gaps: each chunk's mesh fits the meshes
/// beside it, whatever their level.
///
/// With one level, a viewer sees chunks of level 0 within its radii, and nothing beyond. With more, everything within
/// its longest radius is drawn, each part at its level; a viewer's `margin` and `sample_radius` then have no effect.
/// [`Keep`](super::Keep) keeps its chunks drawn at the coarsest level where no viewer is near.
///
/// ```
/// use bevy_marchless::prelude::*;
///
/// // Four kilometres of ground, the finest level to 192 voxels.
/// let ground = Terrain::endless(|[_, y, _]: [f64; 3]| y).with_levels(6);
/// let viewer = TerrainViewer::new(4096.0);
/// ```
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Default, Debug, PartialEq, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct TerrainLevels {
    /// The number of levels, 1 to 7. Default 1.
    pub count: u8,
    /// How slowly detail falls off: a chunk is drawn in finer ones where a viewer is nearer than this many times its
    /// width. 1.75 to 64; default 3.
    pub falloff: f32,
    /// The share by which a chunk that is drawn in finer ones must be farther away before it is drawn as one again, so
    /// that nothing flickers where a viewer goes to and fro. 0 to 1; default 0.1.
    pub hysteresis: f32,
}

impl TerrainLevels {
    pub(super) fn check(&self) -> Result<(), TerrainError> {
        if !(1..=7).contains(&self.count) {
            return Err(TerrainError::Levels { found: self.count });
        }
        if !(1.75..=64.0).contains(&self.falloff) {
            return Err(TerrainError::Falloff { found: self.falloff });
        }
        if !(0.0..=1.0).contains(&self.hysteresis) {
            return Err(TerrainError::Hysteresis { found: self.hysteresis });
        }
        Ok(())
    }

    /// The detail of a terrain with several levels.
    pub(crate) fn detail(&self) -> Option<LevelDetail> {
        let Self { count, falloff, hysteresis } = *self;
        (count > 1).then(|| LevelDetail { levels: count, falloff: falloff.into(), hysteresis: hysteresis.into() })
    }
}

/// One level.
impl Default for TerrainLevels {
    fn default() -> Self {
        Self { count: 1, falloff: 3.0, hysteresis: 0.1 }
    }
}

/// This many levels, with the default falloff.
impl From<u8> for TerrainLevels {
    fn from(count: u8) -> Self {
        Self { count, ..Self::default() }
    }
}
