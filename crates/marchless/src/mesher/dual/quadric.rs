//! [`Quadric`]: the squared distances to the planes at a loop's crossings, and where in the cell their sum is least.
//!
//! All of it is sums, products, quotients and square roots of `f32` in a fixed order, so it gives the same bits
//! everywhere. [`turn`] and [`Quadric::least`] have no branch, so that loops over many quadrics run on vectors.
//!
//! The least point by eigenvectors, without the directions in which the planes say little, comes from Peter Lindstrom,
//! "Out-of-Core Simplification of Large Polygonal Models" (2000).

use crate::math::sqrt;

/// Eigenvalues of at most this part of the largest say nothing: about a crease of 20° in a cell.
const NEGLIGIBLE: f32 = 1.0 / 32.0;
/// How far the points of a cell in which a vertex may lie are from its middle, along each axis.
pub(super) const REACH: f32 = 0.5 - 1.0 / super::STEPS as f32;

/// A sum of squared distances to planes, as a function of a point. Points count from the middle of the cell, in cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quadric {
    /// The sum of `n nᵀ` over all unit normals: xx, yy, zz, xy, xz, yz.
    pub(super) matrix: [f32; 6],
    /// The sum of `n (n·p)`; `p` is a point of the plane.
    pub(super) vector: [f32; 3],
    /// The sum of `(n·p)²`.
    pub(super) constant: f32,
}

/// Where a quadric is least, so far as its planes tell.
#[derive(Clone, Copy)]
pub(super) struct Least {
    pub(super) at: [f32; 3],
    /// The number of directions that the planes tell: more than one at a crease or a tip, 0 without planes.
    pub(super) directions: f32,
    /// The eigenvalues. Those that say nothing are 0.
    pub(super) values: [f32; 3],
    /// The eigenvectors.
    pub(super) vectors: [[f32; 3]; 3],
}

impl Quadric {
    /// The sum of squared distances of `point`.
    #[inline(always)]
    pub(super) fn error(&self, point: [f32; 3]) -> f32 {
        let along = times(&self.matrix, point);
        dot(point, along) - 2.0 * dot(self.vector, point) + self.constant
    }

    /// From `start` on, the quadric is least where `matrix · step` is this.
    #[inline(always)]
    fn slope(&self, start: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = times(&self.matrix, start);
        [self.vector[0] - x, self.vector[1] - y, self.vector[2] - z]
    }

    /// The point nearest to `start` of those where the quadric is least, without negligible eigenvalues. `start` if
    /// there are no planes. `diagonal` and `vectors`: the eigenvalues and eigenvectors of its matrix.
    #[inline(always)]
    pub(super) fn least(&self, start: [f32; 3], diagonal: [f32; 3], vectors: [[f32; 3]; 3]) -> Least {
        let slope = self.slope(start);
        let [x, y, z] = diagonal;
        let largest = larger(larger(x, y), z);
        let limit = largest * NEGLIGIBLE;
        let (mut at, mut values, mut kept) = (start, [0.0; 3], 0.0);
        let mut k = 0;
        while k < 3 {
            let (value, vector) = (diagonal[k], vectors[k]);
            let is_kept = value > limit;
            let inverse = if is_kept { 1.0 / value } else { 0.0 };
            let step = dot(vector, slope) * inverse;
            at = [at[0] + vector[0] * step, at[1] + vector[1] * step, at[2] + vector[2] * step];
            values[k] = if is_kept { value } else { 0.0 };
            kept += if is_kept { 1.0 } else { 0.0 };
            k += 1;
        }
        Least { at, directions: kept, values, vectors }
    }

    /// The point of the cell where the quadric is least, if the one where it is `least` at all lies outside. `start`: as
    /// for [`Self::least`].
    pub(super) fn least_in_cell(&self, start: [f32; 3], least: &Least) -> [f32; 3] {
        let largest = larger(larger(least.values[0], least.values[1]), least.values[2]);
        // A little of the distance from `start` makes the point unique.
        let mut matrix = [[0.0; 3]; 3];
        for (k, row) in matrix.iter_mut().enumerate() {
            row[k] = largest / 1024.0;
        }
        let slope = self.slope(start);
        let mut kept = [0.0; 3];
        for (&value, vector) in least.values.iter().zip(&least.vectors) {
            let along = if value > 0.0 { dot(*vector, slope) } else { 0.0 };
            for k in 0..3 {
                kept[k] += vector[k] * along;
                for l in 0..3 {
                    matrix[k][l] += vector[k] * vector[l] * value;
                }
            }
        }
        let bounds = start.map(|v| [-REACH - v, REACH - v]);
        let step = least_in_box(&matrix, kept, bounds, [0, 1, 2].map(|k| least.at[k] - start[k]));
        [0, 1, 2].map(|k| start[k] + step[k])
    }
}

/// The point of a box where `x·(matrix·x) − 2 slope·x` is least. `free`: where it is least at all, outside the box.
///
/// The point lies on a face that `free` is beyond: otherwise a step towards `free` would stay in the box, and lead
/// down. The same holds within the face, and for its sides.
fn least_in_box(matrix: &[[f32; 3]; 3], slope: [f32; 3], bounds: [[f32; 2]; 3], free: [f32; 3]) -> [f32; 3] {
    let within = |k: usize, value: f32| smaller(larger(value, bounds[k][0]), bounds[k][1]);
    let (mut best, mut least) = ([0, 1, 2].map(|k| within(k, free[k])), f32::INFINITY);
    let mut offer = |point: [f32; 3]| {
        let along = matrix.map(|row| dot(row, point));
        let value = dot(point, along) - 2.0 * dot(slope, point);
        if value < least {
            (best, least) = (point, value);
        }
    };
    for k in (0..3).filter(|&k| within(k, free[k]) != free[k]) {
        let (u, v) = ((k + 1) % 3, (k + 2) % 3);
        let mut point = [0.0; 3];
        point[k] = within(k, free[k]);
        let [right_u, right_v] = [u, v].map(|other| slope[other] - matrix[other][k] * point[k]);
        let determinant = matrix[u][u] * matrix[v][v] - matrix[u][v] * matrix[u][v];
        point[u] = (right_u * matrix[v][v] - right_v * matrix[u][v]) / determinant;
        point[v] = (right_v * matrix[u][u] - right_u * matrix[u][v]) / determinant;
        let beyond = [u, v].map(|axis| within(axis, point[axis]) != point[axis]);
        if beyond == [false; 2] {
            offer(point);
        }
        for (fixed, other, right, is_beyond) in [(u, v, right_v, beyond[0]), (v, u, right_u, beyond[1])] {
            if is_beyond {
                let mut corner = point;
                corner[fixed] = within(fixed, point[fixed]);
                corner[other] = within(other, (right - matrix[u][v] * corner[fixed]) / matrix[other][other]);
                offer(corner);
            }
        }
    }
    best
}

/// One rotation of Jacobi: makes the element of a symmetric matrix at `P` and `Q` zero, where `P < Q`. `vectors`: the
/// product of all rotations before. After four sweeps through the three pairs, `f32` would see no more of the elements
/// beside the diagonal.
#[inline(always)]
pub(super) fn turn<const P: usize, const Q: usize>(matrix: &mut [f32; 6], vectors: &mut [[f32; 3]; 3]) {
    // The third axis, and the elements beside the diagonal.
    let (r, beside) = (3 - P - Q, |a: usize, b: usize| 2 + a + b);
    let Turn { cosine, sine, low, high } = Turn::of(matrix[P], matrix[Q], matrix[beside(P, Q)]);
    let [low_beside, high_beside] = turned(cosine, sine, matrix[beside(P, r)], matrix[beside(Q, r)]);
    (matrix[P], matrix[Q], matrix[beside(P, Q)]) = (low, high, 0.0);
    (matrix[beside(P, r)], matrix[beside(Q, r)]) = (without_tiny(low_beside), without_tiny(high_beside));
    [vectors[P], vectors[Q]] = turned_vectors(cosine, sine, vectors[P], vectors[Q]);
}

/// An element beside the diagonal, or 0 if it is far too small to turn anything: the largest elements are about 1.
///
/// Rotations make elements smaller and smaller, and many processors are slow at products below the normal numbers of
/// `f32`.
#[inline(always)]
pub(super) const fn without_tiny(element: f32) -> f32 {
    /// 2⁻⁵⁸.
    const TINY: f32 = 1.0 / (1u64 << 58) as f32;
    if element.abs() < TINY { 0.0 } else { element }
}

/// A rotation that makes one element beside the diagonal zero, and the two elements on the diagonal afterwards.
struct Turn {
    cosine: f32,
    sine: f32,
    low: f32,
    high: f32,
}

impl Turn {
    #[inline(always)]
    fn of(low: f32, high: f32, beside: f32) -> Self {
        let (difference, twice) = (high - low, 2.0 * beside);
        let size = sqrt(difference * difference + twice * twice);
        let divisor = if difference < 0.0 { difference - size } else { difference + size };
        // Tiny elements have squares of zero.
        let tangent = if divisor != 0.0 { twice / divisor } else { 0.0 };
        let cosine = 1.0 / sqrt(1.0 + tangent * tangent);
        let change = tangent * beside;
        Self { cosine, sine: tangent * cosine, low: low - change, high: high + change }
    }
}

#[inline(always)]
fn turned(cosine: f32, sine: f32, low: f32, high: f32) -> [f32; 2] {
    [cosine * low - sine * high, sine * low + cosine * high]
}

#[inline(always)]
fn turned_vectors(cosine: f32, sine: f32, low: [f32; 3], high: [f32; 3]) -> [[f32; 3]; 2] {
    // No `map` here: compilers leave it as a call in loops that should run on vectors.
    let (x, y, z) = (
        turned(cosine, sine, low[0], high[0]),
        turned(cosine, sine, low[1], high[1]),
        turned(cosine, sine, low[2], high[2]),
    );
    [[x[0], y[0], z[0]], [x[1], y[1], z[1]]]
}

#[inline(always)]
fn times([xx, yy, zz, xy, xz, yz]: &[f32; 6], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

#[inline(always)]
pub(super) const fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
const fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

const fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
