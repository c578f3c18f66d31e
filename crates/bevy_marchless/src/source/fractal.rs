//! [`Fractal`]: noise in several octaves.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use super::{SourceError, check, check_length};

/// Noise in several octaves, each finer and weaker than the one before. Its values lie between −1 and 1, mostly between
/// −0.5 and 0.5.
///
/// Coarse levels of detail leave out octaves finer than their spacing, and fade those finer than two spacings.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Fractal {
    /// The seed; each seed gives different noise. Default: 0.
    pub seed: u32,
    /// The number of octaves. Limit: 1..=16. Default: 5.
    pub octaves: u32,
    /// The size of the largest features. Units: world. Limit: > 0. Default: 120.
    pub zoom: f64,
    /// The amplitude of each octave, as a share of the one before. Limit: > 0, <= 1. Default: 0.45.
    pub persistence: f64,
    /// The frequency of each octave, as a multiple of the one before. Limit: 1..=8. Default: 2.
    pub lacunarity: f64,
    /// Folds the noise: it has sharp ridges with the value 1 where it would pass through 0. Default: false.
    pub ridged: bool,
}

impl Default for Fractal {
    fn default() -> Self {
        Self { seed: 0, octaves: 5, zoom: 120.0, persistence: 0.45, lacunarity: 2.0, ridged: false }
    }
}

impl Fractal {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        check("the number of octaves", "from 1 to 16", f64::from(self.octaves), |v| (1.0..=16.0).contains(&v))?;
        check_length("zoom", self.zoom)?;
        check("persistence", "more than 0 and at most 1", self.persistence, |v| v > 0.0 && v <= 1.0)?;
        check("lacunarity", "from 1 to 8", self.lacunarity, |v| (1.0..=8.0).contains(&v))?;
        Ok(())
    }
}
