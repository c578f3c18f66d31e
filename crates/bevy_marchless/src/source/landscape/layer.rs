//! [`Layer`]: a value for each column, composed of noise.

use core::ops::{Add, Mul};

use bevy_math::DVec2;
use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use super::MOST_NESTED;
use crate::source::{FARTHEST, Fractal, SourceError, check, check_length, check_position};

/// A value for each column: a height, or a part of one.
///
/// Layers are plain data and can be composed. `+` and `*` join two layers, [`min`](Self::min) and [`max`](Self::max)
/// choose between two, and the other methods change a single one. Variants with a field `of` change the sum of the
/// layers in it.
///
/// ```
/// use bevy_marchless::source::{Fractal, Layer};
///
/// let hills = Layer::noise(Fractal { zoom: 300.0, ..Fractal::default() }, 40.0);
/// let mountains = Layer::ridges(Fractal { seed: 9, zoom: 500.0, ..Fractal::default() }, 120.0);
/// let where_mountains_are = Layer::noise(Fractal { seed: 5, zoom: 2000.0, octaves: 2, ..Fractal::default() }, 2.0);
/// let heights = 60.0 + hills + mountains * where_mountains_are.clamped(0.0, 1.0);
/// # heights.validate()?;
/// # Ok::<(), bevy_marchless::source::SourceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default, no_field_bounds)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub enum Layer {
    /// The same value in all columns.
    Constant(f64),
    /// Fractal noise.
    Noise {
        /// The noise.
        noise: Fractal,
        /// The greatest value above and below 0. Limit: from −1e9 to 1e9.
        amplitude: f64,
    },
    /// The sum of all layers; 0 without any.
    Sum(Vec<Layer>),
    /// The product of all layers; 1 without any.
    Product(Vec<Layer>),
    /// The lowest of the layers. Limit: one or more.
    Minimum(Vec<Layer>),
    /// The highest of the layers. Limit: one or more.
    Maximum(Vec<Layer>),
    /// Values clamped between two ends.
    Clamp {
        /// The layers whose sum is changed.
        of: Vec<Layer>,
        /// The lower end. Limit: at most `max`.
        min: f64,
        /// The upper end.
        max: f64,
    },
    /// Terraces: flat at each multiple of `step`, and steep between.
    Terraces {
        /// The layers whose sum is changed.
        of: Vec<Layer>,
        /// The height from one terrace to the next. Limit: > 0.
        step: f64,
        /// The steepness between terraces: 0 leaves values as they are, values near 1 give cliffs. Limit: 0..=0.99.
        sharpness: f64,
    },
    /// Domain warping: two noises choose the place where the layers are evaluated, up to `reach` away along x and z.
    Warp {
        /// The layers whose sum is changed.
        of: Vec<Layer>,
        /// The noise that chooses the place along x. The noise for z differs only in its seed.
        noise: Fractal,
        /// The greatest distance along each axis. Units: world. Limit: 0..=1e9.
        reach: f64,
    },
    /// Values mapped by a curve through points (input, output), straight between them and level beyond its ends.
    Curve {
        /// The layers whose sum is changed.
        of: Vec<Layer>,
        /// The points. Limit: one or more, each farther in x than the one before.
        points: Vec<DVec2>,
    },
}

impl Default for Layer {
    /// 0 everywhere.
    fn default() -> Self {
        Self::Constant(0.0)
    }
}

impl From<f64> for Layer {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl Layer {
    /// Fractal noise with values from −`amplitude` to `amplitude`.
    pub fn noise(noise: Fractal, amplitude: f64) -> Self {
        Self::Noise { noise, amplitude }
    }

    /// Sharp ridges: folded fractal noise ([`Fractal::ridged`]) with values from −`amplitude` to `amplitude`.
    pub fn ridges(noise: Fractal, amplitude: f64) -> Self {
        Self::Noise { noise: Fractal { ridged: true, ..noise }, amplitude }
    }

    /// The lower of both layers.
    #[must_use]
    pub fn min(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Minimum(layers) => Self::Minimum(with(layers, other)),
            first => Self::Minimum(vec![first, other.into()]),
        }
    }

    /// The higher of both layers.
    #[must_use]
    pub fn max(self, other: impl Into<Self>) -> Self {
        match self {
            Self::Maximum(layers) => Self::Maximum(with(layers, other)),
            first => Self::Maximum(vec![first, other.into()]),
        }
    }

    /// This layer, clamped between `min` and `max`.
    #[must_use]
    pub fn clamped(self, min: f64, max: f64) -> Self {
        Self::Clamp { of: self.into_terms(), min, max }
    }

    /// This layer in terraces, flat at each multiple of `step`. `sharpness`: from 0 (no change) to 0.99 (cliffs).
    #[must_use]
    pub fn terraced(self, step: f64, sharpness: f64) -> Self {
        Self::Terraces { of: self.into_terms(), step, sharpness }
    }

    /// This layer warped: evaluated up to `reach` away along x and z, at places that `noise` chooses. `reach`: in world
    /// units.
    #[must_use]
    pub fn warped(self, noise: Fractal, reach: f64) -> Self {
        Self::Warp { of: self.into_terms(), noise, reach }
    }

    /// This layer mapped by a curve, given by points (input, output) of ascending x.
    #[must_use]
    pub fn curved(self, points: impl IntoIterator<Item = impl Into<DVec2>>) -> Self {
        Self::Curve { of: self.into_terms(), points: points.into_iter().map(Into::into).collect() }
    }

    /// Checks the layer and all layers in it.
    ///
    /// # Errors
    /// [`SourceError`] for the first number that is out of its range, for a list that must not be empty, and for layers
    /// nested more than 32 deep.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.check(MOST_NESTED)
    }

    /// The terms whose sum is this layer.
    fn into_terms(self) -> Vec<Self> {
        match self {
            Self::Sum(layers) => layers,
            other => vec![other],
        }
    }

    /// [`validate`](Self::validate) for layers nested at most `depth` deep.
    pub(super) fn check(&self, depth: u32) -> Result<(), SourceError> {
        let depth = depth.checked_sub(1).ok_or(SourceError::Nested { most: MOST_NESTED })?;
        let not_empty = |what, found: usize| check(what, "at least 1", found as f64, |v| v >= 1.0).map(|_| ());
        let parts = match self {
            Self::Constant(value) => {
                check_position("a constant layer", *value)?;
                return Ok(());
            }
            Self::Noise { noise, amplitude } => {
                check_position("the amplitude of noise", *amplitude)?;
                return noise.validate();
            }
            Self::Sum(layers) | Self::Product(layers) => layers,
            Self::Minimum(layers) | Self::Maximum(layers) => {
                not_empty("the number of layers in a minimum or maximum", layers.len())?;
                layers
            }
            Self::Clamp { of, min, max } => {
                check_position("the lower end of a clamp", *min)?;
                check_position("the upper end of a clamp", *max)?;
                check("the lower end of a clamp", "at most its upper end", *min, |min| min <= *max)?;
                of
            }
            Self::Terraces { of, step, sharpness } => {
                check_length("the step of terraces", *step)?;
                check("the sharpness of terraces", "from 0 to 0.99", *sharpness, |v| (0.0..=0.99).contains(&v))?;
                of
            }
            Self::Warp { of, noise, reach } => {
                check("the reach of a warp", "from 0 to 1e9", *reach, |v| (0.0..=FARTHEST).contains(&v))?;
                noise.validate()?;
                of
            }
            Self::Curve { of, points } => {
                not_empty("the number of points of a curve", points.len())?;
                for point in points {
                    check_position("what goes into a curve", point.x)?;
                    check_position("what comes out of a curve", point.y)?;
                }
                for pair in points.windows(2) {
                    check("what goes into a curve", "more than at the point before", pair[1].x, |v| v > pair[0].x)?;
                }
                of
            }
        };
        parts.iter().try_for_each(|part| part.check(depth))
    }
}

fn with(mut layers: Vec<Layer>, other: impl Into<Layer>) -> Vec<Layer> {
    layers.push(other.into());
    layers
}

impl<L: Into<Layer>> Add<L> for Layer {
    type Output = Self;

    fn add(self, other: L) -> Self {
        Self::Sum(with(self.into_terms(), other))
    }
}

impl<L: Into<Layer>> Mul<L> for Layer {
    type Output = Self;

    fn mul(self, other: L) -> Self {
        match self {
            Self::Product(layers) => Self::Product(with(layers, other)),
            first => Self::Product(vec![first, other.into()]),
        }
    }
}

impl Add<Layer> for f64 {
    type Output = Layer;

    fn add(self, layer: Layer) -> Layer {
        Layer::Constant(self) + layer
    }
}

impl Mul<Layer> for f64 {
    type Output = Layer;

    fn mul(self, layer: Layer) -> Layer {
        Layer::Constant(self) * layer
    }
}
