//! [`Ray`]: walking the lattice, and crossing triangles.

use crate::{lattice::Region, math::sqrt_f64};

/// A lattice of cubes: along each axis, cube `c` reaches from `origin + c·size` to `origin + (c + 1)·size`, in voxels.
#[derive(Clone, Copy)]
pub(super) struct Cubes {
    pub(super) size: i64,
    pub(super) origin: i64,
}

impl Cubes {
    /// Cubes with a corner at the origin.
    pub(super) const fn of(size: i64) -> Self {
        Self { size, origin: 0 }
    }

    /// The plane on the low (0) or high (1) side of a cube; bit for bit the same number in all lattices with this
    /// plane.
    const fn plane(self, cube: i32, side: i64) -> f64 {
        (self.origin + (cube as i64 + side) * self.size) as f64
    }
}

/// A ray of limited length.
#[derive(Clone, Copy)]
pub(super) struct Ray {
    origin: [f64; 3],
    /// Of unit length.
    direction: [f64; 3],
    max_distance: f64,
}

impl Ray {
    /// `None` where a number is NaN, the origin or direction is infinite, the direction is zero, or the length is
    /// negative.
    pub(super) fn new(origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<Self> {
        let is_finite = origin.iter().chain(&direction).all(|v| v.is_finite());
        let largest = direction.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
        if !is_finite || largest == 0.0 || max_distance.is_nan() || max_distance < 0.0 {
            return None;
        }
        Some(Self { origin, direction: unit(direction.map(|v| v / largest)), max_distance })
    }

    /// The point at a distance.
    pub(super) fn at(&self, distance: f64) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.origin[axis] + self.direction[axis] * distance)
    }

    /// The distances at which the ray enters and leaves `region`, if it does.
    pub(super) fn span(&self, region: Region, cubes: Cubes) -> Option<(f64, f64)> {
        let (mut start, mut end) = (0.0f64, self.max_distance);
        for axis in 0..3 {
            let [low, high] = [cubes.plane(region.min[axis], 0), cubes.plane(region.max[axis], 0)];
            if self.direction[axis] != 0.0 {
                let [a, b] = [self.reaches(axis, low), self.reaches(axis, high)];
                (start, end) = (start.max(a.min(b)), end.min(a.max(b)));
            } else if !(low..=high).contains(&self.origin[axis]) {
                return None;
            }
        }
        (start <= end && !region.is_empty()).then_some((start, end))
    }

    /// The distance at which the ray reaches a plane across `axis`; its direction along the axis is not 0.
    fn reaches(&self, axis: usize, plane: f64) -> f64 {
        (plane - self.origin[axis]) / self.direction[axis]
    }

    /// An upper bound for the number of cubes that [`walk`](Self::walk) visits.
    pub(super) fn steps(&self, region: Region, cubes: Cubes) -> f64 {
        let Some((start, end)) = self.span(region, cubes) else { return 0.0 };
        let passed = |axis: usize| {
            let along = self.direction[axis].abs();
            // Far from the origin, rounding makes the distances of many planes equal.
            let rounding = 4.0 * f64::EPSILON * (self.origin[axis].abs() + along * end);
            (along * (end - start) + rounding) / cubes.size as f64
        };
        // One more than the number of planes passed; each axis may have one more plane than its length has cube sizes.
        (0..3).map(passed).sum::<f64>() + 4.0
    }

    /// The cubes of `region` that the ray passes, in order.
    pub(super) fn walk(&self, region: Region, cubes: Cubes) -> impl Iterator<Item = [i32; 3]> {
        let span = self.span(region, cubes);
        let end = span.map_or(0.0, |(_, end)| end);
        let mut next = span.map(|(start, _)| {
            let entry = self.at(start);
            [0, 1, 2].map(|axis| {
                let cell = libm::floor((entry[axis] - cubes.origin as f64) / cubes.size as f64);
                (cell as i32).clamp(region.min[axis], region.max[axis] - 1)
            })
        });
        let exit = move |cell: [i32; 3], axis: usize| match self.direction[axis] {
            0.0 => f64::INFINITY,
            direction => self.reaches(axis, cubes.plane(cell[axis], (direction > 0.0).into())),
        };
        let mut exits = next.map_or([0.0; 3], |cell| [0, 1, 2].map(|axis| exit(cell, axis)));
        core::iter::from_fn(move || {
            let cell = next?;
            let axis = (0..3).fold(0, |first, axis| if exits[axis] < exits[first] { axis } else { first });
            let mut following = cell;
            following[axis] += if self.direction[axis] > 0.0 { 1 } else { -1 };
            let is_within = (region.min[axis]..region.max[axis]).contains(&following[axis]);
            next = (exits[axis] <= end && is_within).then_some(following);
            exits[axis] = exit(following, axis);
            Some(cell)
        })
    }

    /// Where the ray crosses a triangle, from either side. `triangle`: its corners, counted from lattice point `base`,
    /// counter-clockwise as seen from outside.
    ///
    /// Rays between two triangles that share an edge hit one of them: Sven Woop, Carsten Benthin and Ingo Wald,
    /// "Watertight Ray/Triangle Intersection" (2013).
    pub(super) fn cross(&self, triangle: [[f32; 3]; 3], base: [i32; 3]) -> Option<Crossing> {
        // Seen along the ray's main axis z, sheared so that the ray runs along it.
        let d = self.direction;
        let z = (0..3).fold(0, |main, axis| if d[axis].abs() > d[main].abs() { axis } else { main });
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let [a, b, c] = triangle.map(|corner| {
            let p = [0, 1, 2].map(|axis| f64::from(corner[axis]) + (f64::from(base[axis]) - self.origin[axis]));
            [p[x] - d[x] / d[z] * p[z], p[y] - d[y] / d[z] * p[z], p[z]]
        });
        let side = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let weights = [side(c, b), side(a, c), side(b, a)];
        if weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0) {
            return None;
        }
        let sum = weights[0] + weights[1] + weights[2];
        let distance = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum / d[z];
        // A triangle seen edge-on has sum 0, and its distance is NaN.
        if !(0.0..=self.max_distance).contains(&distance) {
            return None;
        }
        let nearest_corner = (0..3).fold(0, |best, i| if weights[i].abs() > weights[best].abs() { i } else { best });
        Some(Crossing { distance, nearest_corner, normal: normal(triangle) })
    }
}

/// Where a ray crosses a triangle.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    pub(super) distance: f64,
    /// The triangle's corner, 0–2, with the greatest barycentric weight.
    pub(super) nearest_corner: usize,
    /// Of unit length, to the outside.
    pub(super) normal: [f32; 3],
}

/// The unit normal of a triangle, to the side from which it is counter-clockwise.
fn normal(triangle: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
    let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    unit([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]).map(|v| v as f32)
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = sqrt_f64(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    v.map(|v| v / length)
}
