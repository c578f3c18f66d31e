//! Where the surface crosses an edge.

use crate::sample::Weight;

/// The least distance of a crossing from the ends of its edge, as a fraction of the edge.
pub(super) const MARGIN: f32 = 1.0 / 1024.0;

/// How far along the edge from `a` to `b` its vertex lies, from 0 to 1. `isovalue`: in steps (voxels × `SCALE`).
#[inline(always)]
pub(crate) fn crossing_fraction<W: Weight>(a: W, b: W, isovalue: f32) -> f32 {
    snapped(W::fraction(a, b, isovalue))
}

/// The fraction, moved away from the ends of the edge and rounded to a multiple of 2⁻¹⁴. Sums with the offset of a
/// chunk are then exact, so that two chunks place their common vertices at the same point of the world.
///
/// NaN becomes the margin: both ends are then the same limit of `f32`.
#[inline(always)]
pub(crate) fn snapped(fraction: f32) -> f32 {
    // NaN fails the first comparison.
    let fraction = if fraction > MARGIN { fraction } else { MARGIN };
    let fraction = if fraction < 1.0 - MARGIN { fraction } else { 1.0 - MARGIN };
    // From 512 to 1024 neighbouring numbers of `f32` are 2⁻¹⁴ apart.
    (fraction + 512.0) - 512.0
}

/// The value at `fraction` of the way from `a` to `b`.
#[inline(always)]
pub(super) fn interpolated(a: f32, b: f32, fraction: f32) -> f32 {
    a + (b - a) * fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn snapped_fractions_are_near_and_multiples(fraction in 0.0f32..=1.0) {
            let snapped = snapped(fraction);
            prop_assert_eq!((snapped * 16_384.0).fract(), 0.0);
            prop_assert!((MARGIN..=1.0 - MARGIN).contains(&snapped));
            prop_assert!((snapped - fraction.clamp(MARGIN, 1.0 - MARGIN)).abs() <= 0.5 / 16_384.0);
        }

        /// Two chunks place their common crossing at the same point of the world.
        #[test]
        fn sums_with_offsets_are_exact(fraction in 0.0f32..=1.0, cell in 0..62u16, chunk in -1000..1000i32, cells in 8..=62u16) {
            let local = f32::from(cell) + snapped(fraction);
            prop_assert_eq!(f64::from(local), f64::from(cell) + f64::from(snapped(fraction)));
            let (here, there) = (chunk * i32::from(cells), (chunk - 1) * i32::from(cells));
            let from_there = local + f32::from(cells);
            prop_assert_eq!(here as f32 + local, there as f32 + from_there);
        }
    }

    #[test]
    fn nothing_leaves_the_edge() {
        for fraction in [f32::NAN, f32::NEG_INFINITY, -1.0, 0.0] {
            assert_eq!(snapped(fraction), MARGIN);
        }
        for fraction in [f32::INFINITY, 2.0, 1.0] {
            assert_eq!(snapped(fraction), 1.0 - MARGIN);
        }
    }
}
