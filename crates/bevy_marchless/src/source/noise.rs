//! [`NoiseHeights`] and [`NoiseDensity`]: hills and caves of fractal noise, the two simplest landscapes.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;
use marchless::{Bound, Source, SourceRegion};

use super::strata::Stratum;
use super::{
    Caves, FARTHEST, Fractal, Landscape, LandscapeSettings, Layer, MaterialRule, Solid, SourceError, check,
    check_position,
};

/// The settings of [`NoiseHeights`].
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct NoiseHeightsSettings {
    /// The noise; its `zoom` is about the distance between hills.
    pub noise: Fractal,
    /// The height half-way between the highest and the lowest possible. Units: world, from the terrain's lowest corner.
    /// Default: 56.
    pub base: f64,
    /// The greatest height above and below the base. Units: world. Limit: >= 0. Default: 52.
    pub amplitude: f64,
    /// The rules for the ground's materials. Default: material 2 from 3.5 units of depth and where the ground is at
    /// least as steep as 1, material 1 from 1.5 units of depth, and 0 on top.
    pub strata: Vec<Stratum>,
}

impl Default for NoiseHeightsSettings {
    fn default() -> Self {
        Self { noise: Fractal::default(), base: 56.0, amplitude: 52.0, strata: default_strata() }
    }
}

impl NoiseHeightsSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.noise.validate()?;
        check_position("the base height", self.base)?;
        check("the amplitude", "from 0 to 1e9", self.amplitude, |v| (0.0..=FARTHEST).contains(&v))?;
        Ok(())
    }
}

pub(crate) fn default_strata() -> Vec<Stratum> {
    vec![
        Stratum { material: 2, below_depth: 3.5, ..Stratum::default() },
        Stratum { material: 2, steeper_than: 1.0, ..Stratum::default() },
        Stratum { material: 1, below_depth: 1.5, ..Stratum::default() },
    ]
}

/// Hills: the height of the ground is fractal noise, evaluated once per column.
///
/// It is the [`Landscape`] whose ground is the base plus the noise. Clones share the heights that were evaluated
/// already.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct NoiseHeights {
    settings: NoiseHeightsSettings,
    landscape: Landscape,
}

impl NoiseHeightsSettings {
    /// The hills as a part of a landscape.
    fn solid(&self) -> Solid {
        Solid::Ground(self.base + Layer::noise(self.noise, self.amplitude))
    }
}

impl NoiseHeights {
    /// Hills with these settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn new(settings: NoiseHeightsSettings) -> Result<Self, SourceError> {
        settings.validate()?;
        Ok(Self::of_valid(settings))
    }

    fn of_valid(settings: NoiseHeightsSettings) -> Self {
        Self { landscape: landscape(settings.solid(), &settings.strata), settings }
    }

    /// Hills with the default settings and this seed.
    pub fn from_seed(seed: u32) -> Self {
        let noise = Fractal { seed, ..Fractal::default() };
        Self::of_valid(NoiseHeightsSettings { noise, ..NoiseHeightsSettings::default() })
    }

    /// The settings of the hills.
    pub fn settings(&self) -> &NoiseHeightsSettings {
        &self.settings
    }

    /// The height of the ground at a position. Units: world.
    pub fn height(&self, x: f64, z: f64) -> f64 {
        self.landscape.height(x, z).unwrap_or(self.settings.base)
    }

    /// The number of noise evaluations so far; see [`Landscape::noise_calls`].
    #[doc(hidden)]
    pub fn noise_calls(&self) -> u64 {
        self.landscape.noise_calls()
    }
}

fn landscape(solid: Solid, strata: &[Stratum]) -> Landscape {
    let materials = strata.iter().copied().map(MaterialRule::from).collect();
    Landscape::of_valid(LandscapeSettings { solid, materials })
}

impl Default for NoiseHeights {
    fn default() -> Self {
        Self::from_seed(0)
    }
}

impl Source for NoiseHeights {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.landscape.fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        self.landscape.bound(region)
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.landscape.bound_closely(region)
    }
}

/// The settings of [`NoiseDensity`].
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct NoiseDensitySettings {
    /// The noise; its `zoom` is about the distance between caves.
    pub noise: Fractal,
    /// The noise value below which there is ground: −1 gives no ground, 0 half of the space, 1 all of it.
    /// Default: 0.15.
    pub threshold: f64,
    /// Hills above which there is only air; their strata are not used. Default: `None`, ground in all directions.
    pub ground: Option<NoiseHeightsSettings>,
    /// The rules for the ground's materials. Depth is the estimated distance to the nearest surface, including those of
    /// caves. Default: that of [`NoiseHeightsSettings::strata`].
    pub strata: Vec<Stratum>,
}

impl Default for NoiseDensitySettings {
    fn default() -> Self {
        let noise = Fractal { octaves: 3, zoom: 40.0, ..Fractal::default() };
        Self { noise, threshold: 0.15, ground: None, strata: default_strata() }
    }
}

/// Caves and overhangs: ground where 3-D noise is below a threshold, optionally only below the surface of hills.
///
/// The noise is evaluated once per sample, but not above the hills. Distances are estimated from its gradient. It is
/// the [`Landscape`] of hills with [`Caves`] subtracted; use that for caves with a coarser lattice.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct NoiseDensity {
    settings: NoiseDensitySettings,
    landscape: Landscape,
}

impl NoiseDensity {
    /// Caves with these settings.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn new(settings: NoiseDensitySettings) -> Result<Self, SourceError> {
        let NoiseDensitySettings { noise, threshold, ground, .. } = &settings;
        Caves { noise: *noise, threshold: *threshold, ..Caves::default() }.validate()?;
        ground.as_ref().map_or(Ok(()), NoiseHeightsSettings::validate)?;
        Ok(Self::of_valid(settings))
    }

    fn of_valid(settings: NoiseDensitySettings) -> Self {
        let NoiseDensitySettings { noise, threshold, ground, strata } = &settings;
        let ground = ground.as_ref().map_or(Solid::Everything, NoiseHeightsSettings::solid);
        let caves = Caves { noise: *noise, threshold: *threshold, ..Caves::default() };
        Self { landscape: landscape(ground.subtraction(caves), strata), settings }
    }

    /// The settings of the caves.
    pub fn settings(&self) -> &NoiseDensitySettings {
        &self.settings
    }

    /// The number of noise evaluations so far; see [`Landscape::noise_calls`].
    #[doc(hidden)]
    pub fn noise_calls(&self) -> u64 {
        self.landscape.noise_calls()
    }
}

impl Default for NoiseDensity {
    fn default() -> Self {
        Self::of_valid(NoiseDensitySettings::default())
    }
}

impl Source for NoiseDensity {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.landscape.fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        self.landscape.bound(region)
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.landscape.bound_closely(region)
    }
}
