//! Sources: what a terrain is made of before anybody digs.
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
//! | you have | take | chunks skipped without sampling | time to fill |
//! |---|---|---|---|
//! | nothing yet: rolling hills, ridges | [`NoiseHeights`] (feature `noise`) | all but those at the surface | once per column |
//! | a wish for caves and overhangs | [`NoiseDensity`] (feature `noise`) | above its ground | once per sample |
//! | a world of your own: ridges, terraces, caves, rules for materials | [`Landscape`] (feature `noise`) | as its parts | as its parts |
//! | real elevation, or a painted picture | [`HeightMap`] (feature `png`) | above and below its relief | once per column |
//! | geometry: asteroids, rooms, tunnels | [`Sdf`] | wherever the surface is far | once per sample and nearby shape |
//! | a formula | a closure `Fn([f64; 3]) -> f64` | none | once per sample |
//! | a formula that changes no faster than you know | [`Lipschitz`] | wherever the surface is far | once per sample |
//! | an empty space to draw in | [`Air`] | all | nothing |
//! | something else | your own [`Source`] | those that its bounds name | yours |
//!
//! All of them say how far from the surface a point is: negative inside, positive outside. Near the surface this should
//! be close to a true distance, since it decides where the mesh's vertices lie and how smooth its normals are; far away
//! only the sign matters. Positions are in world units in the terrain's own space, whose origin is the terrain's lowest
//! corner and in which y points up.
//!
//! Materials come from the source too: an [`Sdf`] has one per shape, noise and height maps take theirs from a list of [`Stratum`],
//! a landscape from one of [`MaterialRule`].
//!
//! # Composing one
//! A [`Landscape`] is made of [`LandscapeSettings`], plain data: a [`Solid`] of [`Layer`]s, [`Caves`], [`Tunnels`] and shapes,
//! and rules for materials. Bounds compose with it, and so does what is evaluated: heights once per column, kept for the
//! chunks above and below; 3-D noise nowhere above the ground.
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
//! Sources are floating point: they promise the same samples on the same machine and build, and nothing across
//! machines.
//!
#![cfg_attr(feature = "noise", doc = include_str!("../docs/sources.md"))]

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

/// Nothing but air: an empty space to draw in, or what a cleared terrain is made of.
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

/// Why settings do not make a source.
#[derive(Clone, Debug, PartialEq, Error, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
#[non_exhaustive]
pub enum SourceError {
    /// A number is not finite or out of its range.
    #[error("{name} must be {expected}, but it is {found}")]
    Setting {
        /// What the number is.
        name: &'static str,
        /// Which numbers are allowed.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// Layers or solids are nested too deeply.
    #[error("layers and solids must be nested at most {most} deep, but they are deeper")]
    Nested {
        /// How deep they may be.
        most: u32,
    },
}

/// Everything that sources are made of.
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

/// Heights, positions and lengths reach at most this far, in world units.
pub(crate) const FARTHEST: f64 = 1e9;

/// How many voxels away from the surface a region must be before a bound skips it, so that an isovalue other than zero
/// still finds samples.
pub(crate) const BOUND_MARGIN: f64 = 4.0;

/// `found`, where it is `valid`.
pub(crate) fn check(
    name: &'static str,
    expected: &'static str,
    found: f64,
    valid: impl FnOnce(f64) -> bool,
) -> Result<f64, SourceError> {
    if valid(found) { Ok(found) } else { Err(SourceError::Setting { name, expected, found }) }
}

/// A length: more than 0 and at most [`FARTHEST`].
pub(crate) fn check_length(name: &'static str, found: f64) -> Result<f64, SourceError> {
    check(name, "more than 0 and at most 1e9", found, |v| v > 0.0 && v <= FARTHEST)
}

/// A coordinate: from −[`FARTHEST`] to [`FARTHEST`].
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

/// A region's rows along x: local y and z of each, its distances and its materials.
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
