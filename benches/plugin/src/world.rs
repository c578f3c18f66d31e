//! [`World`]: the endless worlds of the benches.

use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;

/// An endless world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum World {
    /// The default hills.
    Hills,
    /// The same hills, with caves in three dimensions.
    Caves,
}

impl World {
    /// Both worlds.
    pub const ALL: [Self; 2] = [Self::Hills, Self::Caves];

    /// The name that reports show.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hills => "hills",
            Self::Caves => "caves",
        }
    }

    /// The world's terrain, with the default settings.
    pub fn terrain(self) -> Terrain {
        match self {
            Self::Hills => Terrain::endless(NoiseHeights::default()),
            Self::Caves => {
                let ground = Some(NoiseHeightsSettings::default());
                let settings = NoiseDensitySettings { ground, ..NoiseDensitySettings::default() };
                Terrain::endless(NoiseDensity::new(settings).expect("the defaults are in range"))
            }
        }
    }
}
