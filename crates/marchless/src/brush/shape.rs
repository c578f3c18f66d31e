//! [`QuantisedShape`]: quantised shapes and their signed distances, in integers.

use super::BrushError;
use crate::{lattice::Region, math::sqrt_f64};

/// Units per voxel: shapes are quantised to 1/256 voxel, the step of an `i16` weight.
pub(super) const UNITS: u32 = 256;

/// Distances saturate here, at 4 million voxels.
const FAR: i32 = 1 << 30;

/// The limits of the constructors, in units.
const POSITION_LIMIT: i64 = 1 << 38;
const RADIUS_LIMIT: u32 = 1 << 18;
const LENGTH_LIMIT: i64 = 1 << 19;

/// A shape in lattice space that a stamp acts on. All numbers are in 1/256 voxel.
///
/// The constructors quantise voxels and check limits. In a shape that is built by hand, numbers beyond the limits are
/// clamped to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum QuantisedShape {
    /// All points less than `radius` from `center`.
    Sphere {
        /// The middle.
        center: [i64; 3],
        /// The radius.
        radius: u32,
    },
    /// A box along the axes.
    Box {
        /// The middle.
        center: [i64; 3],
        /// The distance from the middle to the faces, per axis.
        half_size: [u32; 3],
    },
    /// All points less than `radius` from the segment from `a` to `b`.
    Capsule {
        /// One end.
        a: [i64; 3],
        /// The other end; may be the same point.
        b: [i64; 3],
        /// The radius.
        radius: u32,
    },
}

impl QuantisedShape {
    /// The largest coordinate, either way, in voxels.
    pub const MAX_POSITION: f64 = (POSITION_LIMIT / UNITS as i64) as f64;
    /// The largest radius and half size, in voxels.
    pub const MAX_RADIUS: f64 = (RADIUS_LIMIT / UNITS) as f64;
    /// The farthest that a capsule's ends may lie apart along an axis, in voxels.
    pub const MAX_LENGTH: f64 = (LENGTH_LIMIT / UNITS as i64) as f64;

    /// A sphere. Numbers are in voxels, and rounded to 1/256.
    ///
    /// # Errors
    /// [`BrushError`] if a number is NaN or beyond its limit, or the radius is not above 0.
    pub fn sphere(center: [f64; 3], radius: f64) -> Result<Self, BrushError> {
        Ok(Self::Sphere { center: position(center)?, radius: size("radius", radius)? })
    }

    /// A box along the axes, from `center - half_size` to `center + half_size`. Numbers are in voxels, and rounded to
    /// 1/256.
    ///
    /// # Errors
    /// [`BrushError`] if a number is NaN or beyond its limit, or a half size is not above 0.
    pub fn cuboid(center: [f64; 3], half_size: [f64; 3]) -> Result<Self, BrushError> {
        let [x, y, z] = half_size.map(|half| size("half size", half));
        Ok(Self::Box { center: position(center)?, half_size: [x?, y?, z?] })
    }

    /// The capsule around the segment from `a` to `b`. Numbers are in voxels, and rounded to 1/256.
    ///
    /// # Errors
    /// [`BrushError`] if a number is NaN or beyond its limit, the ends are too far apart, or the radius is not above 0.
    pub fn capsule(a: [f64; 3], b: [f64; 3], radius: f64) -> Result<Self, BrushError> {
        let shape = Self::Capsule { a: position(a)?, b: position(b)?, radius: size("radius", radius)? };
        for axis in 0..3 {
            let found = (b[axis] - a[axis]).abs();
            if found > Self::MAX_LENGTH {
                return Err(BrushError::Length { found });
            }
        }
        Ok(shape)
    }

    /// The signed distance from `point` to the shape's surface, negative inside, in 1/256 voxel.
    ///
    /// Rounded down, so that its sign is exact; saturates at 2³⁰ (4 million voxels).
    pub fn distance(&self, point: [i32; 3]) -> i32 {
        self.limited().distance_within(point, i32::MIN, FAR)
    }

    /// A box around all lattice points whose distance is less than `margin` voxels. Margins over 2²⁰ voxels count as
    /// 2²⁰.
    pub fn region(&self, margin: u32) -> Region {
        let (low, high, sizes) = match self.limited() {
            Self::Sphere { center, radius } => (center, center, [radius; 3]),
            Self::Box { center, half_size } => (center, center, half_size),
            Self::Capsule { a, b, radius } => {
                (core::array::from_fn(|i| a[i].min(b[i])), core::array::from_fn(|i| a[i].max(b[i])), [radius; 3])
            }
        };
        let margin = i64::from(margin.min(1 << 20) * UNITS);
        let reach = sizes.map(|size| i64::from(size) + margin);
        let units = i64::from(UNITS);
        // The points p with low - reach < p < high + reach; all of them fit an `i32`.
        Region {
            min: core::array::from_fn(|i| ((low[i] - reach[i]).div_euclid(units) + 1) as i32),
            max: core::array::from_fn(|i| -(-(high[i] + reach[i])).div_euclid(units) as i32),
        }
    }

    /// The shape with all numbers within the limits of the constructors.
    pub(super) fn limited(&self) -> Self {
        let position = |p: [i64; 3]| p.map(|v| v.clamp(-POSITION_LIMIT, POSITION_LIMIT));
        let size = |size: u32| size.min(RADIUS_LIMIT);
        match *self {
            Self::Sphere { center, radius } => Self::Sphere { center: position(center), radius: size(radius) },
            Self::Box { center, half_size } => Self::Box { center: position(center), half_size: half_size.map(size) },
            Self::Capsule { a, b, radius } => {
                let (a, b) = (position(a), position(b));
                let b = core::array::from_fn(|i| b[i].clamp(a[i] - LENGTH_LIMIT, a[i] + LENGTH_LIMIT));
                Self::Capsule { a, b, radius: size(radius) }
            }
        }
    }

    /// The distance from `point` to a [limited](Self::limited) shape, clamped to `low..=high`. It is found much faster
    /// where it is clamped. `high`: from 0 to [`FAR`].
    #[inline]
    pub(super) fn distance_within(&self, point: [i32; 3], low: i32, high: i32) -> i32 {
        let clamp = Clamp { low: i64::from(low), high: i64::from(high) };
        let distance = match *self {
            Self::Sphere { center, radius } => clamp.to_point(offset(point, center), radius),
            Self::Box { center, half_size } => {
                let q = offset(point, center);
                clamp.to_box(core::array::from_fn(|i| q[i].abs() - i64::from(half_size[i])))
            }
            Self::Capsule { a, b, radius } => {
                clamp.to_segment(offset(point, a), offset(point, b), core::array::from_fn(|i| b[i] - a[i]), radius)
            }
        };
        distance as i32
    }
}

/// The nearest whole number of units to a number of voxels, which must be within the limits above.
pub(super) fn units(voxels: f64) -> i64 {
    let scaled = voxels * f64::from(UNITS);
    (if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i64
}

fn position(voxels: [f64; 3]) -> Result<[i64; 3], BrushError> {
    let limits = -QuantisedShape::MAX_POSITION..=QuantisedShape::MAX_POSITION;
    match voxels.iter().find(|v| !limits.contains(v)) {
        Some(&found) => Err(BrushError::Position { found }),
        None => Ok(voxels.map(units)),
    }
}

fn size(name: &'static str, voxels: f64) -> Result<u32, BrushError> {
    if voxels > 0.0 && voxels <= QuantisedShape::MAX_RADIUS {
        Ok((units(voxels) as u32).max(1))
    } else {
        Err(BrushError::Size { name, found: voxels })
    }
}

/// The vector from `from`, in units, to the lattice point `point`.
fn offset(point: [i32; 3], from: [i64; 3]) -> [i64; 3] {
    core::array::from_fn(|i| i64::from(point[i]) * i64::from(UNITS) - from[i])
}

fn dot(a: [i64; 3], b: [i64; 3]) -> i64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// ⌊√`square`⌋. Below 2⁵², the correctly rounded `f64` root is exact enough, and far quicker than an integer root.
#[inline]
fn root(square: u64) -> i64 {
    if square < 1 << 52 { sqrt_f64(square as f64) as i64 } else { square.isqrt() as i64 }
}

/// Computes distances clamped to `low..=high`, and takes square roots only between the limits.
#[derive(Clone, Copy)]
struct Clamp {
    low: i64,
    high: i64,
}

impl Clamp {
    /// True if an offset is so long on an axis that its square might overflow. Its distance is then beyond `high`,
    /// since shapes are far smaller.
    fn is_far(offset: [i64; 3]) -> bool {
        offset.iter().any(|v| v.abs() > 2 * i64::from(FAR))
    }

    /// The distance to a ball of `radius` whose centre is at `-offset`.
    fn to_point(self, offset: [i64; 3], radius: u32) -> i64 {
        if Self::is_far(offset) {
            return self.high;
        }
        let square: u64 = offset.iter().map(|v| v.unsigned_abs().pow(2)).sum();
        let radius = i64::from(radius);
        let limit = |distance: i64| distance.unsigned_abs().pow(2);
        let (low, high) = (radius + self.low, radius + self.high);
        if square >= limit(high) {
            self.high
        } else if low >= 0 && square <= limit(low) {
            self.low
        } else {
            (root(square) - radius).max(self.low)
        }
    }

    /// The distance to a box. `beyond`: the distance by which the point lies beyond the faces, per axis.
    fn to_box(self, beyond: [i64; 3]) -> i64 {
        let deepest = beyond[0].max(beyond[1]).max(beyond[2]);
        if deepest <= 0 || beyond.iter().filter(|v| **v > 0).count() == 1 {
            return deepest.clamp(self.low, self.high);
        }
        self.to_point(beyond.map(|v| v.max(0)), 0)
    }

    /// The distance to the tube of `radius` around the segment from `-from_a` to `-from_b`; `along`: from a to b.
    fn to_segment(self, from_a: [i64; 3], from_b: [i64; 3], along: [i64; 3], radius: u32) -> i64 {
        if Self::is_far(from_a) {
            return self.high;
        }
        if dot(from_a, along) <= 0 {
            return self.to_point(from_a, radius);
        }
        if dot(from_b, along) >= 0 {
            return self.to_point(from_b, radius);
        }
        // The distance to the line is |from_a × along| / |along|.
        let cross = |i: usize, j: usize| (from_a[i] * along[j] - from_a[j] * along[i]).unsigned_abs();
        let square = [cross(1, 2), cross(2, 0), cross(0, 1)].map(|v| u128::from(v).pow(2)).iter().sum();
        self.root_of_quotient(square, dot(along, along) as u64, radius)
    }

    /// ⌊√(`square` / `divisor`)⌋ − `radius`, clamped.
    #[inline]
    fn root_of_quotient(self, square: u128, divisor: u64, radius: u32) -> i64 {
        let radius = i64::from(radius);
        let limit = |distance: i64| (distance as u128).pow(2) * u128::from(divisor);
        let (low, high) = (radius + self.low, radius + self.high);
        if square >= limit(high) {
            self.high
        } else if low >= 0 && square <= limit(low) {
            self.low
        } else {
            (root((square / u128::from(divisor)) as u64) - radius).max(self.low)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::root;

    proptest! {
        #[test]
        fn roots_are_those_of_integers(square: u64, shift in 0u32..64, side in 0u64..1 << 31, step in 0u64..3) {
            let near_a_square = (side * side).saturating_add(step).saturating_sub(1);
            for square in [square >> shift, near_a_square, (1 << 52) - 1, 1 << 52] {
                prop_assert_eq!(root(square), square.isqrt() as i64, "{}", square);
            }
        }
    }
}
