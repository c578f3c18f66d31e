//! Moves vertices from the middle of their edges to where a function is zero.
//!
//! Zeros are found by the method of Tirupathi R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding
//! the zero of a nonlinear function without using derivatives" (1997), but it starts at the zero of the secant, not in
//! the middle.
//!
//! Other methods were tried with six evaluations between the ends, on distances of spheres, sums of waves, kinks,
//! powers and exponentials, and refused:
//!
//! - Regula falsi with the Illinois step, or with that of Anderson and Björck: the worst error is a third of an edge
//!   and more. Here it is an eighth.
//! - ITP and Ridders' method: they always take all six evaluations. Here, spheres of 5 to 25 cells take 2.5. Here, too,
//!   the worst in a hundred are closer, on spheres and on waves.

use core::mem;

use crate::{bits::BitGrid, buffer::MeshBuffer, math::sqrt_f64, mesher::snapped};

/// The most evaluations per vertex, besides those at both ends of its edge.
const STEPS: usize = 6;
/// The search ends at a step below this part of the coordinate, or of 8 if that is more: positions cannot resolve less.
const TOLERANCE: f64 = 1.0 / (1 << 23) as f64;
/// The distance from a vertex, in cells, at which its gradient is sampled; a power of two, so that coordinates are
/// exact.
const REACH: f32 = 1.0 / 8.0;

/// Moves the vertices of a mesh just made of `bits`, all of them in the middle of edges, to the zeros of `distance`.
///
/// It is not generic, so that it is compiled in this crate, at this crate's optimisation level.
pub(super) fn place(bits: &BitGrid, distance: &dyn Fn([f32; 3]) -> f32, out: &mut MeshBuffer) {
    let mut normals = out.normals.iter_mut();
    for position in &mut out.positions {
        let normal = normals.next();
        let Some(edge) = CrossedEdge::at(bits, *position) else { continue };
        let Some(fraction) = edge.zero_of(distance) else { continue };
        *position = edge.at_fraction(fraction);
        if let Some(normal) = normal
            && let Some(direction) = direction_of_gradient(distance, *position)
        {
            *normal = direction;
        }
    }
    out.bounds = bounds(&out.positions);
}

/// A lattice edge with one end set and the other unset.
struct CrossedEdge {
    /// The end with the lower coordinates.
    low: [u32; 3],
    axis: usize,
    /// True if the low end is the set one.
    low_is_set: bool,
}

impl CrossedEdge {
    /// The edge with this middle; `None` if the coordinates are too large for `f32` to hold a half.
    fn at(bits: &BitGrid, middle: [f32; 3]) -> Option<Self> {
        let low = middle.map(|v| v as u32);
        let axis = (0..3).find(|&axis| low[axis] as f32 != middle[axis])?;
        Some(Self { low, axis, low_is_set: bits.get(low) })
    }

    /// The position at a fraction of the way from the low end to the high end.
    fn at_fraction(&self, fraction: f32) -> [f32; 3] {
        let mut position = self.low.map(|v| v as f32);
        position[self.axis] += fraction;
        position
    }

    /// The fraction of the edge where the function is zero, snapped; `None` if its signs at the ends are not those of
    /// the bits, or if a value is not finite.
    fn zero_of(&self, distance: &dyn Fn([f32; 3]) -> f32) -> Option<f32> {
        let value_at = |fraction: f64| {
            let value = distance(self.at_fraction(fraction as f32));
            value.is_finite().then_some(f64::from(value))
        };
        let (low, high) = ((0.0, value_at(0.0)?), (1.0, value_at(1.0)?));
        let is_like_low = |value: f64| (value < 0.0) == self.low_is_set;
        if !is_like_low(low.1) || is_like_low(high.1) {
            return None;
        }
        // The zero lies between these two points, each with its value.
        let (mut newest, mut other) = (low, high);
        let tolerance = TOLERANCE * f64::from(self.low[self.axis].max(8));
        let (mut step, mut last) = (newest.1 / (newest.1 - other.1), f64::NAN);
        for _ in 0..STEPS {
            let fraction = newest.0 + step * (other.0 - newest.0);
            if (fraction - last).abs() < tolerance {
                break;
            }
            let value = value_at(fraction)?;
            let stays = is_like_low(value) == is_like_low(newest.1);
            let older = if stays { newest } else { mem::replace(&mut other, newest) };
            newest = (fraction, value);
            (step, last) = (next_step(newest, other, older), fraction);
        }
        let fraction = newest.0 + (other.0 - newest.0) * (newest.1 / (newest.1 - other.1));
        Some(snapped(fraction as f32))
    }
}

/// The next step, as a fraction of the way from the newest point to the other end of the bracket: by inverse quadratic
/// interpolation through three points where Chandrupatla's criterion allows it, otherwise one half. Each point comes
/// with its value.
fn next_step(newest: (f64, f64), other: (f64, f64), older: (f64, f64)) -> f64 {
    let ((a, at_a), (b, at_b), (c, at_c)) = (newest, other, older);
    let (place, value) = ((a - b) / (c - b), (at_a - at_b) / (at_c - at_b));
    // False if a number is NaN.
    if value * value < place && (1.0 - value) * (1.0 - value) < 1.0 - place {
        let from_b = at_a / (at_b - at_a) * (at_c / (at_b - at_c));
        let from_c = (c - a) / (b - a) * (at_a / (at_c - at_a)) * (at_b / (at_c - at_b));
        let step = from_b + from_c;
        if (0.0..=1.0).contains(&step) {
            return step;
        }
    }
    0.5
}

/// The unit vector along the function's gradient; `None` if the gradient is zero or not finite.
fn direction_of_gradient(distance: &dyn Fn([f32; 3]) -> f32, position: [f32; 3]) -> Option<[f32; 3]> {
    let difference = |axis: usize| {
        let value = |offset: f32| {
            let mut beside = position;
            beside[axis] += offset;
            f64::from(distance(beside))
        };
        value(REACH) - value(-REACH)
    };
    // The squares neither overflow nor vanish: they are of differences of `f32` values, computed in `f64`.
    let [x, y, z] = [difference(0), difference(1), difference(2)];
    let length = sqrt_f64(x * x + y * y + z * z);
    (length > 0.0 && length < f64::INFINITY).then(|| [x, y, z].map(|v| (v / length) as f32))
}

/// The smallest box that holds all positions.
fn bounds(positions: &[[f32; 3]]) -> Option<[[f32; 3]; 2]> {
    let (&first, rest) = positions.split_first()?;
    let mut bounds = [first; 2];
    for position in rest {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(position[axis]);
            bounds[1][axis] = bounds[1][axis].max(position[axis]);
        }
    }
    Some(bounds)
}
