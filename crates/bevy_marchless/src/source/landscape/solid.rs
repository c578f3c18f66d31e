//! [`Solid`]: what is ground and what is air, composed of heights, noise and shapes.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use super::{Layer, MOST_NESTED};
use crate::source::{Fractal, Sdf, SourceError, check, check_length};

/// A part of space that is filled: the ground below heights, the room of caves, a shape, or several of them combined.
///
/// [`Caves`] and [`Tunnels`] are solids like the others, which are there to be taken away:
///
/// ```
/// use bevy_marchless::source::{Caves, Fractal, Layer, Sdf, Solid, Tunnels};
///
/// let hills = Solid::Ground(56.0 + Layer::noise(Fractal::default(), 52.0));
/// let shaft = Sdf::capsule([0.0, 0.0, 0.0], [0.0, 100.0, 0.0], 6.0);
/// let solid = hills.subtraction(Caves::default()).subtraction(Tunnels::default()).subtraction(shaft);
/// # solid.validate()?;
/// # Ok::<(), bevy_marchless::source::SourceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default, no_field_bounds)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub enum Solid {
    /// All of space.
    Everything,
    /// Everything below heights.
    Ground(Layer),
    /// Where 3-D noise is above a threshold.
    Caves(Caves),
    /// Winding tubes along which two 3-D noises are near 0.
    Tunnels(Tunnels),
    /// A shape, of its own materials.
    Shape(Sdf),
    /// Whatever lies in any part, of the material of the one that reaches out farthest.
    Union(Vec<Solid>),
    /// Whatever lies in all parts, of the first one's material. An intersection of nothing is air.
    Intersection(Vec<Solid>),
    /// Whatever lies in the first part and in none of the others, of the first one's material.
    Subtraction(Vec<Solid>),
}

/// Where 3-D noise is above a threshold: rooms and passages when subtracted, islands and overhangs when not.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Caves {
    /// The noise; its `zoom` is about the distance between caves. Default: 3 octaves, a zoom of 40.
    pub noise: Fractal,
    /// At 1 there is nothing, at 0 half of the space, at −1 all of it. Limit: −1..=1. Default: 0.15.
    pub threshold: f64,
    /// The noise is evaluated at every n-th sample along each axis, and interpolated (trilinear) between: 1 is the
    /// finest, 2 needs an eighth of the noise, 4 a sixty-fourth, and features finer than that get lost. Units: samples.
    /// Limit: 1..=16. Default: 1.
    pub lattice: u32,
}

impl Default for Caves {
    fn default() -> Self {
        Self { noise: Fractal { octaves: 3, zoom: 40.0, ..Fractal::default() }, threshold: 0.15, lattice: 1 }
    }
}

impl Caves {
    /// Says what is wrong with the settings, if anything is.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.noise.validate()?;
        check("the threshold", "from -1 to 1", self.threshold, |v| (-1.0..=1.0).contains(&v))?;
        check_lattice(self.lattice)
    }
}

/// Winding tubes: everything near the lines along which two 3-D noises are 0.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Tunnels {
    /// One noise; the other is the same with another seed. Default: 2 octaves, a zoom of 90.
    pub noise: Fractal,
    /// About how far a tunnel reaches from its middle. Units: world. Limit: > 0. Default: 4.
    pub radius: f64,
    /// As of [`Caves::lattice`]. Default: 1.
    pub lattice: u32,
}

impl Default for Tunnels {
    fn default() -> Self {
        let noise = Fractal { seed: 100, octaves: 2, zoom: 90.0, ..Fractal::default() };
        Self { noise, radius: 4.0, lattice: 1 }
    }
}

impl Tunnels {
    /// Says what is wrong with the settings, if anything is.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.noise.validate()?;
        check_length("the radius of tunnels", self.radius)?;
        check_lattice(self.lattice)
    }
}

fn check_lattice(lattice: u32) -> Result<(), SourceError> {
    check("the lattice", "from 1 to 16", f64::from(lattice), |v| (1.0..=16.0).contains(&v)).map(|_| ())
}

impl Default for Solid {
    /// Hills as of [`NoiseHeightsSettings`](crate::source::NoiseHeightsSettings).
    fn default() -> Self {
        Self::Ground(56.0 + Layer::noise(Fractal::default(), 52.0))
    }
}

impl From<Layer> for Solid {
    fn from(heights: Layer) -> Self {
        Self::Ground(heights)
    }
}

impl From<Caves> for Solid {
    fn from(caves: Caves) -> Self {
        Self::Caves(caves)
    }
}

impl From<Tunnels> for Solid {
    fn from(tunnels: Tunnels) -> Self {
        Self::Tunnels(tunnels)
    }
}

impl From<Sdf> for Solid {
    fn from(shape: Sdf) -> Self {
        Self::Shape(shape)
    }
}

impl Solid {
    /// Both solids.
    #[must_use]
    pub fn union(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Union(parts) => Self::Union(with(parts, other)),
            first => Self::Union(vec![first, other.into()]),
        }
    }

    /// What lies in both solids.
    #[must_use]
    pub fn intersection(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Intersection(parts) => Self::Intersection(with(parts, other)),
            first => Self::Intersection(vec![first, other.into()]),
        }
    }

    /// This solid without `other`.
    #[must_use]
    pub fn subtraction(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Subtraction(parts) => Self::Subtraction(with(parts, other)),
            first => Self::Subtraction(vec![first, other.into()]),
        }
    }

    /// Says what is wrong with the solid, if anything is.
    ///
    /// # Errors
    /// [`SourceError`] for the first number that is out of its range, and for solids and layers nested more than 32
    /// deep.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.check(MOST_NESTED)
    }

    /// [`validate`](Self::validate) for solids nested at most `depth` deep.
    fn check(&self, depth: u32) -> Result<(), SourceError> {
        let depth = depth.checked_sub(1).ok_or(SourceError::Nested { most: MOST_NESTED })?;
        match self {
            Self::Everything => Ok(()),
            Self::Ground(heights) => heights.check(depth),
            Self::Caves(caves) => caves.validate(),
            Self::Tunnels(tunnels) => tunnels.validate(),
            Self::Shape(shape) => shape.check(),
            Self::Union(parts) | Self::Intersection(parts) | Self::Subtraction(parts) => {
                parts.iter().try_for_each(|part| part.check(depth))
            }
        }
    }
}

fn with(mut parts: Vec<Solid>, other: impl Into<Solid>) -> Vec<Solid> {
    parts.push(other.into());
    parts
}
