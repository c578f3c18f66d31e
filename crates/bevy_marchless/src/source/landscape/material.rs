//! [`MaterialRule`]: which material the ground has, by depth, height, slope and noise.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use crate::source::{Fractal, SourceError, Stratum, check};

/// One rule of a list that gives the ground its materials: the first rule that holds wins, and where none does the
/// material is 0.
///
/// ```
/// use bevy_marchless::source::{Fractal, MaterialRule, Stratum};
///
/// const GRASS: u8 = 0;
/// const SAND: u8 = 1;
/// const ROCK: u8 = 2;
/// let rules = vec![
///     MaterialRule::from(Stratum { material: ROCK, below_depth: 5.0, ..Stratum::default() }),
///     MaterialRule::from(Stratum { material: ROCK, steeper_than: 1.0, ..Stratum::default() }),
///     MaterialRule::from(Stratum { material: SAND, ..Stratum::default() }).in_patches(Fractal::default(), 0.2),
/// ];
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default)]
pub struct MaterialRule {
    /// The material, and the depth, height and slope where it is.
    pub stratum: Stratum,
    /// Where else the rule must hold. Default: none, everywhere.
    pub patches: Option<Patches>,
}

/// Where 3-D noise is above a threshold. Put rules without patches first where they can be: noise is evaluated where a
/// rule with patches decides, and ground of unsure material is never skipped.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
pub struct Patches {
    /// The noise; its `zoom` is about the distance between patches. Default: as of [`Fractal`].
    pub noise: Fractal,
    /// At −1 the patches cover all, at 1 nothing. Limit: −1..=1. Default: 0.
    pub above: f64,
}

impl Default for Patches {
    fn default() -> Self {
        Self { noise: Fractal::default(), above: 0.0 }
    }
}

impl From<Stratum> for MaterialRule {
    fn from(stratum: Stratum) -> Self {
        Self { stratum, patches: None }
    }
}

impl MaterialRule {
    /// The same rule, only where `noise` is above `above`.
    #[must_use]
    pub fn in_patches(self, noise: Fractal, above: f64) -> Self {
        Self { patches: Some(Patches { noise, above }), ..self }
    }

    /// Says what is wrong with the rule, if anything is.
    ///
    /// # Errors
    /// [`SourceError::Setting`] for the first number that is out of its range.
    pub fn validate(&self) -> Result<(), SourceError> {
        let Some(patches) = &self.patches else { return Ok(()) };
        patches.noise.validate()?;
        check("the threshold of patches", "from -1 to 1", patches.above, |v| (-1.0..=1.0).contains(&v))?;
        Ok(())
    }
}
