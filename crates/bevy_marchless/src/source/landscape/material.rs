//! [`MaterialRule`]: rules for the ground's materials, by depth, height, slope and noise.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

use super::body::BY_RULES;
use super::parts::{Line, Row};
use crate::source::detail::Detail;
use crate::source::octaves::Octaves;
use crate::source::perlin::NoiseRow;
use crate::source::{Fractal, SourceError, Stratum, check};

/// One rule of a list that gives the ground its materials.
///
/// The first rule that holds gives the material; if none holds, it is 0.
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MaterialRule {
    /// The material, and its conditions of depth, height and slope.
    pub stratum: Stratum,
    /// The patches to which the rule is limited. Default: `None`, no limit.
    pub patches: Option<Patches>,
}

/// Patches of ground: points where 3-D noise is above a threshold.
///
/// Put rules without patches first if possible. Noise is evaluated where a rule with patches decides, and a bound never
/// skips ground of uncertain material.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Patches {
    /// The noise; its `zoom` is about the distance between patches. Default: that of [`Fractal`].
    pub noise: Fractal,
    /// The threshold: at −1 the patches cover everything, at 1 nothing. Limit: −1..=1. Default: 0.
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
    /// This rule, limited to points where `noise` is above `above`.
    #[must_use]
    pub fn in_patches(self, noise: Fractal, above: f64) -> Self {
        Self { patches: Some(Patches { noise, above }), ..self }
    }

    /// Checks the rule.
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

/// A list of [`MaterialRule`], prepared for evaluation.
pub(super) struct Rules {
    rules: Vec<Rule>,
    /// The greatest depth at which materials change. Units: world.
    pub(super) deepest: f64,
    /// Whether a rule goes by the slope.
    pub(super) by_slope: bool,
}

struct Rule {
    stratum: Stratum,
    /// The noise and the threshold above which the rule holds.
    patches: Option<(Octaves, f64)>,
}

impl Rules {
    /// Prepares valid rules.
    pub(super) fn new(rules: &[MaterialRule]) -> Self {
        let depths = rules.iter().map(|rule| rule.stratum.below_depth).filter(|depth| depth.is_finite());
        let rule = |MaterialRule { stratum, patches }: &MaterialRule| Rule {
            stratum: *stratum,
            patches: patches.as_ref().map(|patches| (Octaves::new(&patches.noise), patches.above)),
        };
        let by_slope = rules.iter().any(|rule| rule.stratum.steeper_than > 0.0);
        Self { deepest: depths.fold(0.0, f64::max), by_slope, rules: rules.iter().map(rule).collect() }
    }

    /// The one material of all ground between two depths and two heights, in samples of a level of detail; `None` if it
    /// may differ.
    pub(super) fn material_within(&self, detail: Detail, depth: [f64; 2], height: [f64; 2]) -> Option<u8> {
        let mut possible = None;
        for Rule { stratum, patches } in &self.rules {
            // Written as in `RowRules::give`, so that both round alike.
            let below = detail.deepened(stratum.below_depth);
            let [lift_at_bottom, lift_at_top] = height.map(|height| stratum.above_height - height);
            let (most_steep, level) = (f64::INFINITY >= stratum.steeper_than, 0.0 >= stratum.steeper_than);
            if !(depth[1] >= below && most_steep) || lift_at_top > detail.most_raised() {
                continue;
            }
            if possible.is_some_and(|material| material != stratum.material) {
                return None;
            }
            possible = Some(stratum.material);
            let high_enough = lift_at_bottom <= -detail.most_raised();
            if patches.is_none() && depth[0] >= below && level && high_enough {
                return possible;
            }
        }
        (possible.unwrap_or(0) == 0).then_some(0)
    }

    /// The rules for rows with these coordinates along x, in samples of a level of detail. Units: world.
    pub(super) fn for_rows<'a>(&'a self, detail: Detail, xs: &'a [f64]) -> RowRules<'a> {
        RowRules { rules: &self.rules, detail, xs, chosen: vec![AIR; xs.len()], noise: NoiseRow::default() }
    }
}

/// [`Rules`] for rows with the same coordinates along x.
pub(super) struct RowRules<'a> {
    rules: &'a [Rule],
    detail: Detail,
    xs: &'a [f64],
    /// Each sample's material, [`UNDECIDED`] or [`AIR`].
    chosen: Vec<i32>,
    noise: NoiseRow,
}

/// A sample for which no rule has held yet.
const UNDECIDED: i32 = -1;

/// A sample without a material.
const AIR: i32 = -2;

impl RowRules<'_> {
    /// Gives the solid samples of a row their materials.
    pub(super) fn give(&mut self, line: &Line, row: &Row, materials: &mut [u8], calls: &mut u64) {
        // Loops over numbers of one width, without branches, so that the compiler vectorises them.
        let len = materials.len();
        let (within, share) = (self.detail.spacing() as f32, self.detail.raised_share() as f32);
        let (distances, ups, matters) = (&row.distance[..len], &row.up[..len], &row.matter[..len]);
        let chosen = &mut self.chosen[..len];
        for index in 0..len {
            let given = if matters[index] == BY_RULES { UNDECIDED } else { i32::from(matters[index]) };
            chosen[index] = if distances[index] < 0.0 { given } else { AIR };
        }
        for Rule { stratum, patches } in self.rules {
            if !chosen.contains(&UNDECIDED) {
                break;
            }
            // A sample counts as higher than it lies, by as much as it counts as less deep, along the normal.
            let (lift, most_raised) = (stratum.above_height - line.y, self.detail.most_raised());
            if lift > most_raised {
                continue;
            }
            let is_high = lift <= -most_raised || lift.is_nan();
            let lift = lift as f32;
            // The slope condition as a condition on the y part of the surface's normal.
            let steeper = stratum.steeper_than;
            let most_up = if steeper <= 0.0 { f32::INFINITY } else { (1.0 / (1.0 + steeper * steeper).sqrt()) as f32 };
            let highest = -self.detail.deepened(stratum.below_depth) as f32;
            let material = i32::from(stratum.material);
            let holds = |chosen: i32, distance: f32, up: f32| {
                let lifted = up * (-distance).min(within) * share;
                (chosen == UNDECIDED) & (distance <= highest) & (up <= most_up) & (is_high | (lifted >= lift))
            };
            if let Some((octaves, above)) = patches {
                if (0..len).any(|index| holds(chosen[index], distances[index], ups[index])) {
                    *calls += octaves.row_3d(Detail::FINEST, self.xs, line.y, line.z, &mut self.noise);
                    for (index, chosen) in chosen.iter_mut().enumerate() {
                        if holds(*chosen, distances[index], ups[index]) && f64::from(self.noise.value[index]) > *above {
                            *chosen = material;
                        }
                    }
                }
                continue;
            }
            for ((chosen, distance), up) in chosen.iter_mut().zip(distances).zip(ups) {
                *chosen = if holds(*chosen, *distance, *up) { material } else { *chosen };
            }
        }
        for (material, chosen) in materials.iter_mut().zip(chosen) {
            if *chosen != AIR {
                *material = (*chosen).max(0) as u8;
            }
        }
    }
}
