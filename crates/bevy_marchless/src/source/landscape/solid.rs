//! [`Solid`]: the solid part of a landscape, composed of heights, noise and shapes.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use super::{Layer, MOST_NESTED};
use crate::source::{Fractal, Sdf, SourceError, check, check_length};

/// A solid: the ground below heights, the space of caves or tunnels, a shape, or a combination of several.
///
/// [`Caves`] and [`Tunnels`] are solids like the others, but are meant to be subtracted:
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
    /// All points where 3-D noise is above a threshold.
    Caves(Caves),
    /// Winding tubes along which two 3-D noises are near 0.
    Tunnels(Tunnels),
    /// A shape, with its own materials.
    Shape(Sdf),
    /// All points in any part. Where parts overlap, the part that reaches out farthest gives the material.
    Union(Vec<Solid>),
    /// The points that lie in all parts, with the first part's material. An intersection without parts is air.
    Intersection(Vec<Solid>),
    /// The points of the first part that lie in no other part, with the first part's material.
    Subtraction(Vec<Solid>),
}

/// All points where 3-D noise is above a threshold: rooms and passages if subtracted, else islands and overhangs.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Caves {
    /// The noise; its `zoom` is about the distance between caves. Default: 3 octaves, a zoom of 40.
    pub noise: Fractal,
    /// The noise value above which points belong to caves: 1 gives no caves, 0 half of the space, −1 all of it.
    /// Limit: −1..=1. Default: 0.15.
    pub threshold: f64,
    /// The spacing of noise evaluations along each axis; samples between them are interpolated (trilinear). 1 is the
    /// finest, 2 needs an eighth of the noise, 4 a sixty-fourth. Features finer than this get lost. Units: samples.
    /// Limit: 1..=16. Default: 1.
    pub lattice: u32,
}

impl Default for Caves {
    fn default() -> Self {
        Self { noise: Fractal { octaves: 3, zoom: 40.0, ..Fractal::default() }, threshold: 0.15, lattice: 1 }
    }
}

impl Caves {
    /// Checks the settings.
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
    /// The first noise; the second differs only in its seed. Default: 2 octaves, a zoom of 90.
    pub noise: Fractal,
    /// The approximate radius of tunnels. Units: world. Limit: > 0. Default: 4.
    pub radius: f64,
    /// The spacing of noise evaluations; see [`Caves::lattice`]. Default: 1.
    pub lattice: u32,
}

impl Default for Tunnels {
    fn default() -> Self {
        let noise = Fractal { seed: 100, octaves: 2, zoom: 90.0, ..Fractal::default() };
        Self { noise, radius: 4.0, lattice: 1 }
    }
}

impl Tunnels {
    /// Checks the settings.
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
    /// The hills of the default [`NoiseHeightsSettings`](crate::source::NoiseHeightsSettings).
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
    /// The union of both solids.
    #[must_use]
    pub fn union(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Union(parts) => Self::Union(with(parts, other)),
            first => Self::Union(vec![first, other.into()]),
        }
    }

    /// The intersection of both solids, with this one's material.
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

    /// Checks the solid and all parts of it.
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
