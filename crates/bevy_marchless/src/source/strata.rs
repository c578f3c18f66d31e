//! [`Stratum`]: rules for the ground's materials, by depth, height and slope.

use bevy_reflect::Reflect;
use bevy_reflect::std_traits::ReflectDefault;

/// One rule of a list that gives the ground its materials.
///
/// A rule holds if all of its conditions hold. The first rule that holds gives the material; if none holds, it is 0.
///
/// At coarse levels of detail, depths and heights are counted from the surface as samples of level 0 would lie, and
/// slopes are those of level 0.
///
/// ```
/// use bevy_marchless::source::Stratum;
///
/// const GRASS: u8 = 0;
/// const ROCK: u8 = 1;
/// const SNOW: u8 = 2;
/// let strata = vec![
///     Stratum { material: ROCK, below_depth: 6.0, ..Default::default() },
///     Stratum { material: ROCK, steeper_than: 1.2, ..Default::default() },
///     Stratum { material: SNOW, above_height: 90.0, ..Default::default() },
///     Stratum { material: GRASS, ..Default::default() },
/// ];
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Stratum {
    /// The material of the ground where the rule holds. Default: 0.
    pub material: u8,
    /// The smallest depth below the surface. Units: world. Default: 0, everywhere.
    pub below_depth: f64,
    /// The lowest height. Units: world, from the terrain's lowest corner. Default: −∞, everywhere.
    pub above_height: f64,
    /// The smallest slope of the surface above. Units: rise per run; 1 is 45°, and a ceiling has ∞.
    /// Default: 0, everywhere.
    pub steeper_than: f64,
}

impl Default for Stratum {
    fn default() -> Self {
        Self { material: 0, below_depth: 0.0, above_height: f64::NEG_INFINITY, steeper_than: 0.0 }
    }
}

#[cfg(any(feature = "png", test))]
impl Stratum {
    pub(crate) fn holds(&self, depth: f64, height: f64, slope: f64) -> bool {
        depth >= self.below_depth && height >= self.above_height && slope >= self.steeper_than
    }
}

#[cfg(any(feature = "png", test))]
/// The material of solid ground at a depth, a height and under a slope.
pub(crate) fn material_at(strata: &[Stratum], depth: f64, height: f64, slope: f64) -> u8 {
    strata.iter().find(|stratum| stratum.holds(depth, height, slope)).map_or(0, |stratum| stratum.material)
}

#[cfg(any(feature = "png", test))]
/// The one material of all ground between two depths and two heights, under any slope; `None` if it may differ.
pub(crate) fn material_within(strata: &[Stratum], depth: [f64; 2], height: [f64; 2]) -> Option<u8> {
    let mut possible = None;
    for stratum in strata.iter().filter(|stratum| stratum.holds(depth[1], height[1], f64::INFINITY)) {
        if possible.is_some_and(|material| material != stratum.material) {
            return None;
        }
        possible = Some(stratum.material);
        if stratum.holds(depth[0], height[0], 0.0) {
            return possible;
        }
    }
    (possible.unwrap_or(0) == 0).then_some(0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_first_rule_that_holds_wins() {
        let strata = [
            Stratum { material: 1, below_depth: 6.0, ..Stratum::default() },
            Stratum { material: 2, above_height: 90.0, ..Stratum::default() },
            Stratum { material: 3, steeper_than: 1.0, ..Stratum::default() },
        ];
        assert_eq!(material_at(&strata, 7.0, 95.0, 2.0), 1);
        assert_eq!(material_at(&strata, 5.0, 95.0, 2.0), 2);
        assert_eq!(material_at(&strata, 5.0, 50.0, 2.0), 3);
        assert_eq!(material_at(&strata, 5.0, 50.0, 0.5), 0);
        assert_eq!(material_within(&strata, [6.0, 9.0], [0.0, 99.0]), Some(1));
        assert_eq!(material_within(&strata, [5.0, 9.0], [0.0, 99.0]), None);
        assert_eq!(material_within(&strata, [1.0, 5.0], [0.0, 50.0]), None, "steep ground is of another material");
        assert_eq!(material_within(&strata[..2], [1.0, 5.0], [0.0, 50.0]), Some(0));
    }

    fn stratum() -> impl Strategy<Value = Stratum> {
        let or_any = |range: core::ops::Range<i32>, any: f64| prop_oneof![range.prop_map(f64::from), Just(any)];
        (0u8..3, or_any(0..5, 0.0), or_any(-4..4, f64::NEG_INFINITY), or_any(0..3, 0.0)).prop_map(
            |(material, below_depth, above_height, steeper_than)| Stratum {
                material,
                below_depth,
                above_height,
                steeper_than,
            },
        )
    }

    proptest! {
        #[test]
        fn a_certain_material_is_true(
            strata in prop::collection::vec(stratum(), 0..5),
            depth in (0i32..6, 0i32..3),
            height in (-5i32..5, 0i32..4),
        ) {
            let ends = |(low, more): (i32, i32)| [f64::from(low), f64::from(low + more)];
            if let Some(material) = material_within(&strata, ends(depth), ends(height)) {
                for d in depth.0..=depth.0 + depth.1 {
                    for h in height.0..=height.0 + height.1 {
                        for slope in 0..4 {
                            let here = material_at(&strata, f64::from(d), f64::from(h), f64::from(slope));
                            prop_assert_eq!(here, material, "at depth {}, height {}, slope {}", d, h, slope);
                        }
                    }
                }
            }
        }
    }
}
