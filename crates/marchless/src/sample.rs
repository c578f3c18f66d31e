//! [`Voxel`]: the sample at a lattice point, a [`Weight`] (the signed distance to the surface) and a material.

use core::fmt::Debug;

/// The sample at one lattice point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Voxel<W = i16> {
    /// Signed distance to the surface; negative is inside, zero and positive are outside.
    pub weight: W,
    /// The user's number for the material; it has no effect on the shape.
    pub material: u8,
}

impl<W: Weight> Voxel<W> {
    /// Air: a voxel of weight [`Weight::OUTSIDE`] and material 0.
    pub const AIR: Self = Self { weight: W::OUTSIDE, material: 0 };

    /// A voxel of `weight` and `material`.
    pub const fn new(weight: W, material: u8) -> Self {
        Self { weight, material }
    }
}

/// A signed distance in voxels: **negative inside, zero and positive outside**.
///
/// | type | one step | range |
/// |---|---|---|
/// | `i8` | 1/32 voxel | −4 to +3.97 voxels |
/// | `i16` | 1/256 voxel | −128 to +127.996 voxels |
/// | `f32` | – | any; NaN counts as outside, infinities by their sign |
///
/// The trait is sealed, since the mesher's passes rely on these three implementations.
pub trait Weight: Copy + Debug + PartialEq + PartialOrd + Send + Sync + private::Sealed + 'static {
    /// Steps per voxel: 32, 256 or 1.
    const SCALE: f32;
    /// The weight farthest outside (`MAX`).
    const OUTSIDE: Self;
    /// The weight farthest inside (`MIN`).
    const INSIDE: Self;

    /// The weight of a distance in voxels, saturated to the type's range and rounded to the nearest step. A negative
    /// distance stays negative, however small. NaN becomes [`Weight::OUTSIDE`].
    fn from_voxels(distance: f32) -> Self;

    /// The distance in voxels; exact.
    fn to_voxels(self) -> f32;
}

/// The operations on weights that the passes use, hidden from users.
pub(crate) mod private {
    pub trait Sealed: Sized + Copy + 'static {
        /// The isovalue in this weight's own terms, so that [`Sealed::inside`] is one comparison.
        type Threshold: Copy;
        /// Weights and their differences, without loss (for `f32`: what `f32` makes of them).
        type Wide: Copy + Default;
        /// `isovalue`: in voxels, finite.
        fn threshold(isovalue: f32) -> Self::Threshold;
        /// True if the sample lies below the isovalue.
        fn inside(self, threshold: Self::Threshold) -> bool;
        fn wide(self) -> Self::Wide;
        /// `a − b` in steps, for gradients; may be infinite or NaN.
        fn difference(a: Self, b: Self) -> Self::Wide;
        /// Twice the difference, for gradients at an open border.
        fn doubled(difference: Self::Wide) -> Self::Wide;
        fn to_f32(wide: Self::Wide) -> f32;
        /// Two weights, packed so that vector instructions can split many pairs quickly.
        type Pair: Copy + Default;
        fn pair(weights: [Self; 2]) -> Self::Pair;
        fn both(pair: Self::Pair) -> [Self; 2];
        /// Four weights, packed in two parts: `Left` and `Right`.
        type Left: Copy + Default;
        type Right: Copy + Default;
        fn split(weights: [Self; 4]) -> (Self::Left, Self::Right);
        fn joined(left: Self::Left, right: Self::Right) -> [Self; 4];
        /// The fraction of the edge from `a` to `b` at which the isovalue lies, before clamping, and true if it is
        /// accurate. If it is not, call [`Sealed::fraction`]. Has no branch. `isovalue`: in steps (voxels × `SCALE`).
        fn quick_fraction(a: Self::Wide, b: Self::Wide, isovalue: f32) -> (f32, bool);
        /// The fraction of the edge from `a` to `b` at which the isovalue lies, before clamping; `a` and `b` lie on its
        /// two sides. Finite, except for a NaN if both ends are the same limit of `f32`. `isovalue`: in steps (voxels ×
        /// `SCALE`).
        fn fraction(a: Self, b: Self, isovalue: f32) -> f32;
        /// The sample as a finite number, for the rare gradients that overflow.
        fn finite(self) -> f64;
        /// Calls the function for this type of weights.
        fn call<F: PerWeight>(arguments: F::Arguments<'_, Self>) -> F::Output;
    }

    /// A function with a separate body for each type of weights.
    ///
    /// The pass that needs such a function defines it, so this module names no passes. A body that is not generic is
    /// compiled once, in this crate, at its level of optimisation. (Refused: a method of [`Sealed`] for each function,
    /// and supertraits of `Weight`. Both would name all passes here.)
    pub trait PerWeight {
        type Arguments<'a, W: Sealed>;
        type Output;
        fn of_i8(arguments: Self::Arguments<'_, i8>) -> Self::Output;
        fn of_i16(arguments: Self::Arguments<'_, i16>) -> Self::Output;
        fn of_f32(arguments: Self::Arguments<'_, f32>) -> Self::Output;
    }
}

macro_rules! integer_weight {
    ($type:ty, $scale:literal, $of:ident, $pair:ty) => {
        impl Weight for $type {
            const SCALE: f32 = $scale;
            const OUTSIDE: Self = <$type>::MAX;
            const INSIDE: Self = <$type>::MIN;

            // Without branches and saturating casts, so that a loop over many distances runs on vectors.
            #[inline]
            fn from_voxels(distance: f32) -> Self {
                /// Floats from here to its double are the integers.
                const INTEGERS: f32 = 8_388_608.0;
                let is_negative = distance < 0.0;
                let most = if is_negative { -f32::from(<$type>::MIN) } else { <$type>::MAX.into() };
                // Half a step more, then rounded down: to the nearest step.
                let size = (distance * $scale).abs() + 0.5;
                let size = if size < most { size } else { most };
                let near = (size + INTEGERS) - INTEGERS;
                let down = if near > size { near - 1.0 } else { near };
                let steps = ((down + INTEGERS).to_bits() & 0xffff) as i32;
                let steps = if is_negative { -steps.max(1) } else { steps };
                if distance.is_nan() { Self::OUTSIDE } else { steps as $type }
            }

            #[inline]
            fn to_voxels(self) -> f32 {
                f32::from(self) / $scale
            }
        }

        impl private::Sealed for $type {
            /// The smallest weight that is outside, and true if every weight is inside.
            type Threshold = ($type, bool);

            fn threshold(isovalue: f32) -> Self::Threshold {
                // w < iso over the integers is w < ⌈iso⌉; the casts saturate.
                let steps = isovalue * $scale;
                let whole = steps as i32;
                let ceiling = if steps > whole as f32 { whole.saturating_add(1) } else { whole };
                let within = ceiling.clamp(i32::from(<$type>::MIN), i32::from(<$type>::MAX));
                (within as $type, ceiling > within)
            }

            #[inline(always)]
            fn inside(self, (threshold, all): Self::Threshold) -> bool {
                (self < threshold) | all
            }

            type Wide = i32;

            #[inline(always)]
            fn wide(self) -> i32 {
                self.into()
            }

            #[inline(always)]
            fn difference(a: Self, b: Self) -> i32 {
                i32::from(a) - i32::from(b)
            }

            #[inline(always)]
            fn doubled(difference: i32) -> i32 {
                difference * 2
            }

            #[inline(always)]
            fn to_f32(wide: i32) -> f32 {
                wide as f32
            }

            type Pair = $pair;

            #[inline(always)]
            fn pair([a, b]: [Self; 2]) -> $pair {
                <$pair>::from(a.cast_unsigned()) | <$pair>::from(b.cast_unsigned()) << Self::BITS
            }

            #[inline(always)]
            fn both(pair: $pair) -> [Self; 2] {
                [pair as Self, (pair >> Self::BITS) as Self]
            }

            type Left = $pair;
            type Right = $pair;

            #[inline(always)]
            fn split([a, b, c, d]: [Self; 4]) -> ($pair, $pair) {
                (Self::pair([a, b]), Self::pair([c, d]))
            }

            #[inline(always)]
            fn joined(left: $pair, right: $pair) -> [Self; 4] {
                let ([a, b], [c, d]) = (Self::both(left), Self::both(right));
                [a, b, c, d]
            }

            #[inline(always)]
            fn quick_fraction(a: i32, b: i32, isovalue: f32) -> (f32, bool) {
                let (a, b) = (a as f32, b as f32);
                ((isovalue - a) / (b - a), true)
            }

            #[inline(always)]
            fn fraction(a: Self, b: Self, isovalue: f32) -> f32 {
                Self::quick_fraction(a.wide(), b.wide(), isovalue).0
            }

            fn finite(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn call<F: private::PerWeight>(arguments: F::Arguments<'_, Self>) -> F::Output {
                F::$of(arguments)
            }
        }
    };
}

integer_weight!(i8, 32.0, of_i8, u16);
integer_weight!(i16, 256.0, of_i16, u32);

impl Weight for f32 {
    const SCALE: f32 = 1.0;
    const OUTSIDE: Self = Self::MAX;
    const INSIDE: Self = Self::MIN;

    fn from_voxels(distance: f32) -> Self {
        if distance.is_nan() { Self::OUTSIDE } else { distance }
    }

    fn to_voxels(self) -> f32 {
        self
    }
}

impl private::Sealed for f32 {
    type Threshold = f32;

    fn threshold(isovalue: f32) -> f32 {
        isovalue
    }

    #[inline(always)]
    fn inside(self, threshold: f32) -> bool {
        self < threshold
    }

    type Wide = f32;

    #[inline(always)]
    fn wide(self) -> f32 {
        self
    }

    #[inline(always)]
    fn difference(a: Self, b: Self) -> f32 {
        a - b
    }

    #[inline(always)]
    fn doubled(difference: f32) -> f32 {
        difference * 2.0
    }

    #[inline(always)]
    fn to_f32(wide: f32) -> f32 {
        wide
    }

    type Pair = [f32; 2];

    #[inline(always)]
    fn pair(weights: [Self; 2]) -> [f32; 2] {
        weights
    }

    #[inline(always)]
    fn both(pair: [f32; 2]) -> [Self; 2] {
        pair
    }

    type Left = [f32; 4];
    type Right = ();

    #[inline(always)]
    fn split(weights: [Self; 4]) -> ([f32; 4], ()) {
        (weights, ())
    }

    #[inline(always)]
    fn joined(left: [f32; 4], (): ()) -> [Self; 4] {
        left
    }

    #[inline(always)]
    fn quick_fraction(a: f32, b: f32, isovalue: f32) -> (f32, bool) {
        let difference = b - a;
        let size = difference.abs();
        // Outside this range the difference overflowed, lost its bits, or an end is not finite.
        ((isovalue - a) / difference, is_sound(size))
    }

    #[inline(always)]
    fn fraction(a: Self, b: Self, isovalue: f32) -> f32 {
        let (fraction, sound) = Self::quick_fraction(a, b, isovalue);
        if sound {
            fraction
        } else {
            let (a, b) = (a.finite(), b.finite());
            ((f64::from(isovalue) - a) / (b - a)) as f32
        }
    }

    fn finite(self) -> f64 {
        if self.is_nan() { f64::from(Self::MAX) } else { f64::from(self.clamp(Self::MIN, Self::MAX)) }
    }

    #[inline(always)]
    fn call<F: private::PerWeight>(arguments: F::Arguments<'_, Self>) -> F::Output {
        F::of_f32(arguments)
    }
}

/// True if `f32` computes accurately with a number of this size. Has no branch.
#[inline(always)]
pub(crate) const fn is_sound(size: f32) -> bool {
    (size >= 1e-30) & (size < 1e30)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn keeps_sign<W: Weight>(distance: f32, zero: W) {
        let weight = W::from_voxels(distance);
        if distance.is_nan() {
            assert_eq!(weight, W::OUTSIDE);
        } else {
            assert_eq!(weight < zero, distance < 0.0, "{distance} became {weight:?}");
        }
    }

    proptest! {
        #[test]
        fn conversions_keep_the_sign(distance in proptest::num::f32::ANY) {
            keeps_sign::<i8>(distance, 0);
            keeps_sign::<i16>(distance, 0);
            keeps_sign::<f32>(distance, 0.0);
        }

        #[test]
        fn conversions_round_to_the_nearest_step(distance in -127.9f32..127.9) {
            let error = (i16::from_voxels(distance).to_voxels() - distance).abs();
            let allowed = if distance < 0.0 && distance > -1.0 / 256.0 { 1.0 / 256.0 } else { 0.5 / 256.0 };
            prop_assert!(error <= allowed, "{distance}: off by {error}");
        }

        #[test]
        fn thresholds_compare_as_the_real_numbers_do(weight: i16, isovalue in -140.0f32..140.0) {
            use private::Sealed as _;
            let exact = f64::from(weight) / 256.0 < f64::from(isovalue);
            prop_assert_eq!(weight.inside(i16::threshold(isovalue)), exact);
        }

        #[test]
        fn fractions_lie_between_the_ends(a in proptest::num::f32::ANY, b in proptest::num::f32::ANY) {
            use private::Sealed as _;
            prop_assume!((a < 0.0) != (b < 0.0));
            let fraction = f32::fraction(a, b, 0.0);
            prop_assert!((0.0..=1.0).contains(&fraction), "{a} to {b}: {fraction}");
        }
    }

    #[test]
    fn every_integer_weight_survives_a_round_trip() {
        for weight in i16::MIN..=i16::MAX {
            assert_eq!(i16::from_voxels(weight.to_voxels()), weight);
        }
        for weight in i8::MIN..=i8::MAX {
            assert_eq!(i8::from_voxels(weight.to_voxels()), weight);
        }
    }
}
