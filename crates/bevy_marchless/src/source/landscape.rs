//! [`Landscape`]: a source composed of layers of noise, caves, shapes and rules for materials.

mod layer;
mod material;
mod solid;

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;
use marchless::{Bound, Source, SourceRegion};

pub use layer::Layer;
pub use material::{MaterialRule, Patches};
pub use solid::{Caves, Solid, Tunnels};

use super::SourceError;
use super::noise::default_strata;

/// How deep layers and solids may be nested.
const MOST_NESTED: u32 = 32;

/// What a [`Landscape`] is made of: plain data, to be kept in files and changed in editors.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Default)]
pub struct LandscapeSettings {
    /// What is ground. Default: hills, those of [`NoiseHeights`](super::NoiseHeights).
    pub solid: Solid,
    /// What the ground is made of; shapes have materials of their own. [Default: material 2 from 5 units of depth and
    /// where it is steeper than 1, material 1 from 1.5 units of depth, and 0 on top]
    pub materials: Vec<MaterialRule>,
}

impl Default for LandscapeSettings {
    fn default() -> Self {
        let materials = default_strata().into_iter().map(MaterialRule::from).collect();
        Self { solid: Solid::default(), materials }
    }
}

impl LandscapeSettings {
    /// Says what is wrong with the settings, if anything is.
    ///
    /// # Errors
    /// [`SourceError`] for the first number that is out of its range, and for what is nested more than 32 deep.
    pub fn validate(&self) -> Result<(), SourceError> {
        self.solid.validate()?;
        self.materials.iter().try_for_each(MaterialRule::validate)
    }
}

/// [`LandscapeSettings`], ready to be sampled.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct Landscape {
    settings: LandscapeSettings,
}

impl Landscape {
    /// The landscape of these settings.
    ///
    /// # Errors
    /// As [`LandscapeSettings::validate`].
    pub fn new(settings: LandscapeSettings) -> Result<Self, SourceError> {
        settings.validate()?;
        Ok(Self { settings })
    }

    /// What it is made of.
    pub fn settings(&self) -> &LandscapeSettings {
        &self.settings
    }
}

impl Source for Landscape {
    fn fill(&self, _region: &SourceRegion, distances: &mut [f32], _materials: &mut [u8]) {
        distances.fill(f32::MAX);
    }

    fn bound(&self, _region: &SourceRegion) -> Bound {
        Bound::Mixed
    }
}
