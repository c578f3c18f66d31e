//! Sources: the samples of a terrain before anybody digs.
//!
//! [noise]: ../../../../crates/bevy_marchless/docs/pictures/noise.png
//! [ridges]: ../../../../crates/bevy_marchless/docs/pictures/ridges.png
//! [terraces]: ../../../../crates/bevy_marchless/docs/pictures/terraces.png
//! [warp]: ../../../../crates/bevy_marchless/docs/pictures/warp.png
//! [product]: ../../../../crates/bevy_marchless/docs/pictures/product.png
//! [caves]: ../../../../crates/bevy_marchless/docs/pictures/caves.png
//! [tunnels]: ../../../../crates/bevy_marchless/docs/pictures/tunnels.png
//! [shapes]: ../../../../crates/bevy_marchless/docs/pictures/shapes.png
//! [materials]: ../../../../crates/bevy_marchless/docs/pictures/materials.png
//!
//! # Choosing one
//!
//! | you have | use | chunks skipped without sampling | cost of sampling |
//! |---|---|---|---|
//! | no data: hills, ridges | [`NoiseHeights`] (feature `noise`) | all that the surface misses | once per column |
//! | no data: caves and overhangs | [`NoiseDensity`] (feature `noise`) | above its ground | once per sample |
//! | a design of your own, in parts | [`Landscape`] (feature `noise`) | as its parts | as its parts |
//! | real elevation, a painted picture | [`HeightMap`] (feature `png`) | above and below its relief | once per column |
//! | geometry: asteroids, rooms, tunnels | [`Sdf`] | far from the surface | once per sample and nearby shape |
//! | a formula | a closure `Fn([f64; 3]) -> f64` | none | once per sample |
//! | a formula with a known steepest change | [`Lipschitz`] | far from the surface | once per sample |
//! | an empty space to draw in | [`Air`] | all | nothing |
//! | something else | your own [`Source`] | where its bound is certain | your own |
//!
//! Every source gives the signed distance from a point to the surface: negative inside, positive outside. Near the
//! surface it should be close to the true distance, because it decides where the mesh's vertices lie and how smooth its
//! normals are. Far away only the sign matters. Positions are in world units in the terrain's own space: the origin is
//! the terrain's lowest corner, and y points up.
//!
//! Sources give materials, too. An [`Sdf`] has one per shape. Noise and height maps use a list of [`Stratum`], a
//! landscape a list of [`MaterialRule`].
//!
//! # Composing one
//! A [`Landscape`] is made of [`LandscapeSettings`], which are plain data: a [`Solid`] of [`Layer`]s, [`Caves`],
//! [`Tunnels`] and shapes, and rules for materials. It bounds a region by the bounds of its parts. It evaluates heights
//! once per column and keeps them for the chunks above and below. It evaluates no 3-D noise above the ground.
//!
//! ```
//! # #[cfg(feature = "noise")] {
//! use bevy_marchless::source::*;
//!
//! let noise = |seed, zoom, octaves| Fractal { seed, zoom, octaves, ..Fractal::default() };
//! let hills = Layer::noise(noise(1, 180.0, 5), 30.0);
//! let mountains = Layer::ridges(noise(2, 500.0, 5), 110.0).terraced(14.0, 0.6).warped(noise(3, 150.0, 2), 40.0);
//! let where_mountains_are = Layer::noise(noise(4, 1500.0, 2), 3.0).clamped(0.0, 1.0);
//! let solid = Solid::Ground(60.0 + hills + mountains * where_mountains_are)
//!     .subtraction(Caves { noise: noise(5, 60.0, 3), threshold: 0.3, lattice: 2 })
//!     .subtraction(Tunnels { radius: 5.0, ..Tunnels::default() })
//!     .union(Sdf::cuboid([0.0, 120.0, 0.0], [6.0, 80.0, 6.0]).with_material(4));
//! let materials = vec![
//!     MaterialRule::from(Stratum { material: 2, below_depth: 5.0, ..Stratum::default() }),
//!     MaterialRule::from(Stratum { material: 2, steeper_than: 1.0, ..Stratum::default() }),
//!     MaterialRule::from(Stratum { material: 3, above_height: 130.0, ..Stratum::default() }),
//!     MaterialRule::from(Stratum { material: 1, ..Stratum::default() }).in_patches(noise(6, 40.0, 2), 0.2),
//! ];
//! let landscape = Landscape::new(LandscapeSettings { solid, materials })?;
//! # assert!(landscape.height(0.0, 0.0).is_some());
//! # }
//! # Ok::<(), bevy_marchless::source::SourceError>(())
//! ```
//!
//! # Levels of detail
//! Coarse levels sample every 2^k-th point. There, noise leaves out waves shorter than two spacings, and fades those
//! shorter than four; rules for materials count depths and heights from the surface as level 0 would, and go by the
//! slopes of level 0. So distant ground neither flickers nor changes its colours. Level 0 shows everything. The section
//! at the end of this page says more.
//!
//! Sources compute in floating point. They give the same samples on the same machine and build; they promise nothing
//! across machines.
//!
#![cfg_attr(feature = "noise", doc = include_str!("../docs/sources.md"))]

#[cfg(any(feature = "noise", feature = "png"))]
mod detail;
#[cfg(feature = "noise")]
mod fractal;
#[cfg(any(feature = "noise", feature = "png"))]
mod height_field;
#[cfg(feature = "png")]
mod height_map;
#[cfg(feature = "noise")]
mod interval;
#[cfg(feature = "noise")]
mod landscape;
mod lipschitz;
#[cfg(feature = "noise")]
mod noise;
#[cfg(feature = "noise")]
mod octaves;
#[cfg(feature = "noise")]
mod perlin;
mod sdf;
#[cfg(any(feature = "noise", feature = "png"))]
mod strata;

use bevy_app::App;
use bevy_reflect::Reflect;
use thiserror::Error;

#[cfg(feature = "noise")]
pub use fractal::Fractal;
#[cfg(feature = "png")]
pub use height_map::{HeightMap, HeightMapError, HeightMapSettings};
#[cfg(feature = "noise")]
pub use landscape::{Caves, Landscape, LandscapeSettings, Layer, MaterialRule, Patches, Solid, Tunnels};
pub use lipschitz::Lipschitz;
pub use marchless::{Bound, Source, SourceRegion};
#[cfg(feature = "noise")]
pub use noise::{NoiseDensity, NoiseDensitySettings, NoiseHeights, NoiseHeightsSettings};
pub use sdf::Sdf;
#[cfg(any(feature = "noise", feature = "png"))]
pub use strata::Stratum;

/// A source of air alone: an empty space to draw in, or a cleared terrain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct Air;

impl Source for Air {
    fn fill(&self, _region: &SourceRegion, distances: &mut [f32], _materials: &mut [u8]) {
        distances.fill(f32::MAX);
    }

    fn bound(&self, _region: &SourceRegion) -> Bound {
        Bound::Outside
    }
}

/// An error in the settings of a source.
#[derive(Clone, Debug, PartialEq, Error, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
#[non_exhaustive]
pub enum SourceError {
    /// A number is not finite or out of its range.
    #[error("{name} must be {expected}, but it is {found}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// The allowed range, in words.
        expected: &'static str,
        /// The number that was given.
        found: f64,
    },
    /// Layers or solids are nested too deeply.
    #[error("layers and solids must be nested at most {most} deep, but they are deeper")]
    Nested {
        /// The greatest depth allowed.
        most: u32,
    },
}

/// All sources, their settings and the [`Source`] trait.
pub mod prelude {
    #[cfg(any(feature = "noise", feature = "png"))]
    pub use super::Stratum;
    pub use super::{Air, Bound, Lipschitz, Sdf, Source, SourceError, SourceRegion};
    #[cfg(feature = "noise")]
    pub use super::{
        Caves, Fractal, Landscape, LandscapeSettings, Layer, MaterialRule, NoiseDensity, NoiseDensitySettings,
        NoiseHeights, NoiseHeightsSettings, Patches, Solid, Tunnels,
    };
    #[cfg(feature = "png")]
    pub use super::{HeightMap, HeightMapError, HeightMapSettings};
}

/// The greatest height, coordinate or length that settings may have. [Units: world]
pub(crate) const FARTHEST: f64 = 1e9;

/// A margin in distance values: a bound skips a region only if the surface is farther from all of it than this, so that
/// an isovalue other than zero still finds samples. [Units: voxels]
///
/// It adds to the core's margin, which is in lattice points: the core grows the region by four points on each side
/// before it calls [`Source::bound`].
pub(crate) const BOUND_MARGIN: f64 = 4.0;

/// Returns `found` if it is `valid`, else the error that names it.
pub(crate) fn check(
    name: &'static str,
    expected: &'static str,
    found: f64,
    valid: impl FnOnce(f64) -> bool,
) -> Result<f64, SourceError> {
    if valid(found) { Ok(found) } else { Err(SourceError::Setting { name, expected, found }) }
}

/// Checks a length: more than 0 and at most [`FARTHEST`].
pub(crate) fn check_length(name: &'static str, found: f64) -> Result<f64, SourceError> {
    check(name, "more than 0 and at most 1e9", found, |v| v > 0.0 && v <= FARTHEST)
}

/// Checks a coordinate: from −[`FARTHEST`] to [`FARTHEST`].
pub(crate) fn check_position(name: &'static str, found: f64) -> Result<f64, SourceError> {
    check(name, "from -1e9 to 1e9", found, |v| v.abs() <= FARTHEST)
}

/// The lowest and highest coordinate per axis of a region's samples, in world units.
pub(crate) fn world_box(region: &SourceRegion) -> [[f64; 2]; 3] {
    core::array::from_fn(|axis| {
        let min = f64::from(region.min[axis]);
        let ends = [min, min + f64::from(region.size[axis].saturating_sub(1))];
        ends.map(|point| point * region.spacing)
    })
}

/// Iterates over a region's rows along x: each row's local y and z, its distances and its materials.
pub(crate) fn rows<'a>(
    region: &SourceRegion,
    distances: &'a mut [f32],
    materials: &'a mut [u8],
) -> impl Iterator<Item = ([u32; 2], &'a mut [f32], &'a mut [u8])> {
    let [nx, ny, _] = region.size.map(|points| points.max(1));
    let rows = distances.chunks_exact_mut(nx as usize).zip(materials.chunks_exact_mut(nx as usize));
    rows.zip(0u32..).map(move |((distances, materials), row)| ([row % ny, row / ny], distances, materials))
}

/// Registers the sources and their settings for reflection.
pub(crate) fn register_types(app: &mut App) {
    app.register_type::<Air>().register_type::<Sdf>().register_type::<SourceError>();
    #[cfg(any(feature = "noise", feature = "png"))]
    app.register_type::<Stratum>();
    #[cfg(feature = "noise")]
    app.register_type::<Fractal>()
        .register_type::<NoiseHeights>()
        .register_type::<NoiseHeightsSettings>()
        .register_type::<NoiseDensity>()
        .register_type::<NoiseDensitySettings>()
        .register_type::<Layer>()
        .register_type::<Solid>()
        .register_type::<Caves>()
        .register_type::<Tunnels>()
        .register_type::<MaterialRule>()
        .register_type::<Patches>()
        .register_type::<LandscapeSettings>()
        .register_type::<Landscape>();
    #[cfg(feature = "png")]
    app.register_type::<HeightMap>().register_type::<HeightMapSettings>();
}
