//! [`Perlin`]: the Perlin noise of the crate `noise`, a row at a time and with its gradient.
//!
//! Along a row only x changes. What the lattice points of one x add to a row is a straight line, worked out once: what
//! is left for a sample are two such lines and a fade between them, without branches or look-ups. Places are told in
//! `f64`, and what lies within a cell of the lattice, in three dimensions, in `f32`. The values are those of
//! [`noise::Perlin`](::noise::Perlin), but for roundings.

use core::f64::consts::SQRT_2;

use ::noise::permutationtable::{NoiseHasher, PermutationTable};

/// The greatest change of the noise per unit of its lattice, in two dimensions.
///
/// It is 2.75·√2 in two dimensions and 3.75·2/√3 in three, next to a corner between cells whose gradients point apart.
/// A test derives both again. One hundredth is added.
pub(crate) const LIPSCHITZ_2D: f64 = 1.01 * 2.75 * SCALE_2D;
/// The greatest change of the noise per unit of its lattice, in three dimensions; see [`LIPSCHITZ_2D`].
pub(crate) const LIPSCHITZ_3D: f64 = 1.01 * 3.75 * SCALE_3D;

/// The factor that scales 2-D noise to −1..=1.
const SCALE_2D: f64 = SQRT_2;
/// The factor that scales 3-D noise to −1..=1.
const SCALE_3D: f64 = 1.154_700_538_379_251_5;

/// The gradients of lattice points, by the last four bits of their hash.
const GRADIENTS_3D: [[f64; 3]; 16] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, -1.0, 1.0],
    [0.0, -1.0, -1.0],
];

/// Perlin noise with one seed.
#[derive(Clone)]
pub(crate) struct Perlin {
    table: [u8; 256],
}

/// A coordinate, split into its cell and its place in it.
#[derive(Clone, Copy)]
struct LatticeCoordinate {
    /// The lowest lattice point of the cell.
    cell: f64,
    /// That point modulo 256.
    index: usize,
    /// The distance from that point, from 0 to 1.
    inside: f64,
}

impl LatticeCoordinate {
    fn new(coordinate: f64) -> Self {
        if !coordinate.is_finite() {
            return Self { cell: coordinate, index: 0, inside: 0.0 };
        }
        let cell = coordinate.floor();
        let index = cell - 256.0 * (cell / 256.0).floor();
        Self { cell, index: index as usize & 255, inside: coordinate - cell }
    }
}

/// The weight of the higher lattice point at `t` between two points.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// The derivative of [`fade`].
fn fade_slope(t: f64) -> f64 {
    30.0 * t * t * (t - 1.0) * (t - 1.0)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Noise and its gradient at the samples of a row.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseRow {
    pub(crate) value: Vec<f32>,
    pub(crate) gradient: [Vec<f32>; 3],
    /// Each sample's coordinate in the lattice of an octave.
    pub(crate) places: Vec<f64>,
    /// Each sample's distance from the lowest point of its cell.
    inside: Vec<f32>,
}

impl NoiseRow {
    /// Resets the row to `len` samples with zero noise, all at coordinate 0.
    pub(crate) fn reset(&mut self, len: usize) {
        self.places.clear();
        self.places.resize(len, 0.0);
        for values in core::iter::once(&mut self.value).chain(&mut self.gradient) {
            values.clear();
            values.resize(len, 0.0);
        }
    }
}

/// The scale at which noise is added to a row.
#[derive(Clone, Copy)]
pub(crate) struct NoiseScale {
    /// The factor of values.
    pub(crate) value: f32,
    /// The factor of gradients.
    pub(crate) gradient: f32,
    /// Whether 1 − 2·|noise| is added instead of the noise.
    pub(crate) ridged: bool,
}

impl NoiseScale {
    /// The scale that leaves noise as it is.
    const WHOLE: Self = Self { value: 1.0, gradient: 1.0, ridged: false };
}

/// The four lattice points with the same x around a row, z fastest.
struct Corners {
    /// The two y of the points, modulo 256.
    index_y: [usize; 2],
    /// The two z of the points, modulo 256.
    index_z: [usize; 2],
    /// The distance along y from each point to the row.
    y: [f64; 4],
    /// The distance along z from each point to the row.
    z: [f64; 4],
    /// The weight of each point's noise.
    weight: [f64; 4],
    /// The derivative of each weight by y.
    by_y: [f64; 4],
    /// The derivative of each weight by z.
    by_z: [f64; 4],
}

impl Corners {
    fn new(y: f64, z: f64) -> Self {
        let [y, z] = [LatticeCoordinate::new(y), LatticeCoordinate::new(z)];
        let sides = |place: LatticeCoordinate| {
            [(1.0 - fade(place.inside), place.inside), (fade(place.inside), place.inside - 1.0)]
        };
        let [[near_y, far_y], [near_z, far_z]] = [sides(y), sides(z)];
        let (slope_y, slope_z) = (fade_slope(y.inside), fade_slope(z.inside));
        Self {
            index_y: [y.index, (y.index + 1) & 255],
            index_z: [z.index, (z.index + 1) & 255],
            y: [near_y.1, near_y.1, far_y.1, far_y.1],
            z: [near_z.1, far_z.1, near_z.1, far_z.1],
            weight: [near_y.0 * near_z.0, near_y.0 * far_z.0, far_y.0 * near_z.0, far_y.0 * far_z.0],
            by_y: [-slope_y * near_z.0, -slope_y * far_z.0, slope_y * near_z.0, slope_y * far_z.0],
            by_z: [-slope_z * near_y.0, slope_z * near_y.0, -slope_z * far_y.0, slope_z * far_y.0],
        }
    }
}

/// The contribution of the lattice points of one x to a row, as straight lines along x: the value where the row passes
/// the points and its slope along x, and the derivatives by y and z with their slopes along x.
#[derive(Clone, Copy)]
struct Face {
    value: f32,
    by_x: f32,
    by_y: f32,
    by_y_by_x: f32,
    by_z: f32,
    by_z_by_x: f32,
}

impl Perlin {
    pub(crate) fn new(seed: u32) -> Self {
        let table = PermutationTable::new(seed);
        Self { table: core::array::from_fn(|index| table.hash(&[index as isize]) as u8) }
    }

    /// Adds a coordinate, modulo 256, to the hash of a lattice point. Hashes start from 0, and add x, y and z in order.
    fn hash(&self, so_far: usize, next: usize) -> usize {
        usize::from(self.table[(so_far ^ next) & 255])
    }

    /// Calls `take` with the index and the noise of each x (ascending) of a row at `z`.
    #[inline]
    pub(crate) fn row_2d(&self, xs: &[f64], z: f64, mut take: impl FnMut(usize, f64)) {
        let z = LatticeCoordinate::new(z);
        let fade_z = fade(z.inside);
        // The contribution of the two lattice points of one x: the value where the row passes them, and its slope.
        let edge = |index: usize| {
            let along = self.hash(0, index);
            let corner = |index: usize, z: f64| {
                let [gx, gz] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]][self.hash(along, index) & 3];
                (gz * z, gx)
            };
            let (near, far) = (corner(z.index, z.inside), corner(z.index + 1, z.inside - 1.0));
            (SCALE_2D * lerp(near.0, far.0, fade_z), SCALE_2D * lerp(near.1, far.1, fade_z))
        };
        for_each_cell(xs, edge, |cell, run, low, high| {
            for index in run {
                let t = xs[index] - cell;
                let value = lerp(low.0 + low.1 * t, high.0 + high.1 * (t - 1.0), fade(t));
                take(index, value.clamp(-1.0, 1.0));
            }
        });
    }

    /// Adds the noise and its gradient at each of the row's places (ascending along x), at `y` and `z`.
    pub(crate) fn add_row_3d(&self, y: f64, z: f64, share: NoiseScale, row: &mut NoiseRow) {
        let corners = Corners::new(y, z);
        let NoiseRow { value, gradient: [by_x, by_y, by_z], places, inside } = row;
        inside.resize(places.len(), 0.0);
        let xs = places.as_slice();
        for_each_cell(
            xs,
            |index| self.face(index, &corners),
            |cell, run, low, high| {
                let inside = &mut inside[run.clone()];
                for (inside, x) in inside.iter_mut().zip(&xs[run.clone()]) {
                    *inside = (x - cell) as f32;
                }
                let gradient = [&mut by_x[run.clone()], &mut by_y[run.clone()], &mut by_z[run.clone()]];
                let add = if share.ridged { add::<true> } else { add::<false> };
                add(inside, low, high, share, &mut value[run], gradient);
            },
        );
    }

    /// The noise at one place.
    pub(crate) fn value_3d(&self, x: f64, y: f64, z: f64) -> f64 {
        let (corners, place) = (Corners::new(y, z), LatticeCoordinate::new(x));
        let [low, high] = [place.index, (place.index + 1) & 255].map(|index| self.face(index, &corners));
        let (mut value, mut gradient) = ([0.0], [[0.0]; 3]);
        let gradient = gradient.each_mut().map(|value| &mut value[..]);
        add::<false>(&[place.inside as f32], &low, &high, NoiseScale::WHOLE, &mut value, gradient);
        f64::from(value[0])
    }

    /// The contribution of the lattice points of one x, modulo 256.
    #[inline]
    fn face(&self, index: usize, corners: &Corners) -> Face {
        let along = self.hash(0, index);
        let mut sums = [0.0; 6];
        for corner in 0..4 {
            let hash = self.hash(self.hash(along, corners.index_y[corner / 2]), corners.index_z[corner % 2]);
            let [gx, gy, gz] = GRADIENTS_3D[hash & 15];
            let value = gy * corners.y[corner] + gz * corners.z[corner];
            let (weight, by_y, by_z) = (corners.weight[corner], corners.by_y[corner], corners.by_z[corner]);
            sums[0] += weight * value;
            sums[1] += weight * gx;
            sums[2] += by_y * value + weight * gy;
            sums[3] += by_y * gx;
            sums[4] += by_z * value + weight * gz;
            sums[5] += by_z * gx;
        }
        let [value, by_x, by_y, by_y_by_x, by_z, by_z_by_x] = sums.map(|sum| (SCALE_3D * sum) as f32);
        Face { value, by_x, by_y, by_y_by_x, by_z, by_z_by_x }
    }
}

/// Adds the noise of a run of samples in the cell between two faces. `inside`: the samples' distances from the lower
/// face.
#[inline]
fn add<const RIDGED: bool>(
    inside: &[f32],
    low: &Face,
    high: &Face,
    share: NoiseScale,
    values: &mut [f32],
    [by_x, by_y, by_z]: [&mut [f32]; 3],
) {
    let len = inside.len();
    let (values, by_x, by_y, by_z) = (&mut values[..len], &mut by_x[..len], &mut by_y[..len], &mut by_z[..len]);
    // Written out, because the compiler does not vectorise a loop of closures.
    for index in 0..len {
        let t = inside[index];
        let back = t - 1.0;
        let fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let fade_slope = 30.0 * t * t * back * back;
        let below = low.value + low.by_x * t;
        let rise = high.value + high.by_x * back - below;
        let mut value = below + rise * fade;
        let by_y_below = low.by_y + low.by_y_by_x * t;
        let by_z_below = low.by_z + low.by_z_by_x * t;
        let mut slope = share.gradient;
        if RIDGED {
            slope = if value < 0.0 { 2.0 * slope } else { -2.0 * slope };
            value = 1.0 - 2.0 * value.abs();
        }
        values[index] += share.value * value.clamp(-1.0, 1.0);
        by_x[index] += slope * (low.by_x + (high.by_x - low.by_x) * fade + fade_slope * rise);
        by_y[index] += slope * (by_y_below + (high.by_y + high.by_y_by_x * back - by_y_below) * fade);
        by_z[index] += slope * (by_z_below + (high.by_z + high.by_z_by_x * back - by_z_below) * fade);
    }
}

/// Passes on each run of coordinates (ascending) that lie in one cell: the cell's lowest coordinate, the run, and what
/// `side` makes of the lattice points, modulo 256, at both ends of the cell.
#[inline]
fn for_each_cell<T: Copy>(
    xs: &[f64],
    side: impl Fn(usize) -> T,
    mut take: impl FnMut(f64, core::ops::Range<usize>, &T, &T),
) {
    let mut start = 0;
    // Coordinates are mostly evenly spaced, which gives a guess of where a cell ends.
    let per_unit = if let [first, second, ..] = xs { 1.0 / (second - first) } else { 0.0 };
    // The next cell, which starts where the last one ends.
    let mut next: Option<(f64, usize, T)> = None;
    while let Some(&x) = xs.get(start) {
        let (cell, index, low) = match next {
            Some(next) if x < next.0 + 1.0 => next,
            _ => {
                let place = LatticeCoordinate::new(x);
                (place.cell, place.index, side(place.index))
            }
        };
        let beyond = cell + 1.0;
        let mut end = (start + 1).saturating_add(((beyond - x) * per_unit) as usize).min(xs.len());
        // No branch here: it would be unpredictable.
        end -= usize::from(xs[end - 1] >= beyond && end > start + 1);
        while end > start + 1 && xs[end - 1] >= beyond {
            end -= 1;
        }
        while end < xs.len() && xs[end] < beyond {
            end += 1;
        }
        let index = (index + 1) & 255;
        let high = side(index);
        take(cell, start..end, &low, &high);
        next = Some((beyond, index, high));
        start = end;
    }
}

#[cfg(test)]
mod tests {
    use ::noise::NoiseFn;
    use proptest::prelude::*;

    use super::*;

    fn row_3d(perlin: &Perlin, xs: &[f64], y: f64, z: f64) -> NoiseRow {
        let mut row = NoiseRow::default();
        row.reset(xs.len());
        row.places.copy_from_slice(xs);
        perlin.add_row_3d(y, z, NoiseScale::WHOLE, &mut row);
        row
    }

    proptest! {
        #[test]
        fn rows_are_the_noise_of_the_noise_crate(
            seed: u32, x in -300.0..300.0, y in -300.0..300.0, z in -300.0..300.0, step in 0.001..2.0,
        ) {
            let (perlin, oracle) = (Perlin::new(seed), ::noise::Perlin::new(seed));
            let xs: Vec<f64> = (0..40).map(|index| x + step * f64::from(index)).collect();
            perlin.row_2d(&xs, z, |index, value| {
                assert!((value - oracle.get([xs[index], z])).abs() < 1e-12);
            });
            let row = row_3d(&perlin, &xs, y, z);
            for (index, x) in xs.iter().enumerate() {
                assert!((f64::from(row.value[index]) - oracle.get([*x, y, z])).abs() < 2e-6);
                // A sample alone has the same bits as in a row.
                let alone = row_3d(&perlin, &[*x], y, z);
                assert_eq!(alone.value[0].to_bits(), row.value[index].to_bits());
                for axis in 0..3 {
                    assert_eq!(alone.gradient[axis][0].to_bits(), row.gradient[axis][index].to_bits());
                }
            }
        }

        #[test]
        fn gradients_are_differences(seed: u32, position in [-9.0..9.0, -9.0..9.0, -9.0..9.0]) {
            let (perlin, oracle) = (Perlin::new(seed), ::noise::Perlin::new(seed));
            let [x, y, z] = position;
            let gradient = row_3d(&perlin, &[x], y, z).gradient;
            for axis in 0..3 {
                let step = 1e-5;
                let [mut low, mut high] = [position; 2];
                low[axis] -= step;
                high[axis] += step;
                let (low, high) = (oracle.get(low), oracle.get(high));
                if low.abs() < 1.0 && high.abs() < 1.0 {
                    prop_assert!(((high - low) / (2.0 * step) - f64::from(gradient[axis][0])).abs() < 1e-4);
                }
            }
        }
    }

    /// The fastest change at a place along a direction, over all gradients that the corners of a cell may have. It is a
    /// sum over the corners, so each corner's gradient can be chosen separately.
    fn fastest<const N: usize>(place: [f64; N], along: [f64; N], gradients: &[[f64; N]]) -> f64 {
        let corners = 0..1usize << N;
        corners
            .map(|corner| {
                let bits: [f64; N] = core::array::from_fn(|axis| (corner >> axis & 1) as f64);
                let weight = |axis: usize| lerp(1.0 - fade(place[axis]), fade(place[axis]), bits[axis]);
                let others = |skip: usize| (0..N).filter(|axis| *axis != skip).map(weight).product::<f64>();
                let all = (0..N).map(weight).product::<f64>();
                let change: f64 = (0..N)
                    .map(|axis| along[axis] * fade_slope(place[axis]) * (2.0 * bits[axis] - 1.0) * others(axis))
                    .sum();
                let of = |gradient: &[f64; N]| -> f64 {
                    (0..N).map(|axis| gradient[axis] * (along[axis] * all + (place[axis] - bits[axis]) * change)).sum()
                };
                gradients.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
            })
            .sum()
    }

    /// Tries directions over a face of a cube, and places all over a cell.
    #[test]
    fn the_noise_changes_no_faster_than_the_constants_say() {
        let flat = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let mut most = 0.0_f64;
        for turn in 0..90 {
            let along = [f64::from(turn).to_radians().cos(), f64::from(turn).to_radians().sin()];
            for place in (0..=40).flat_map(|x| (0..=40).map(move |z| [f64::from(x) / 40.0, f64::from(z) / 40.0])) {
                most = most.max(fastest(place, along, &flat) * SCALE_2D);
            }
        }
        assert!(most <= LIPSCHITZ_2D && most > 0.98 * LIPSCHITZ_2D, "{most} and {LIPSCHITZ_2D}");
        let mut most = 0.0_f64;
        let grid = |end: i32| (0..=end).flat_map(move |a| (0..=end).map(move |b| [f64::from(a), f64::from(b)]));
        for [a, b] in grid(4) {
            let length = (1.0 + (a * a + b * b) / 16.0).sqrt();
            let along = [1.0 / length, a / 4.0 / length, b / 4.0 / length];
            for [x, y] in grid(12) {
                for z in 0..=12 {
                    let place = [x / 12.0, y / 12.0, f64::from(z) / 12.0];
                    most = most.max(fastest(place, along, &GRADIENTS_3D) * SCALE_3D);
                }
            }
        }
        assert!(most <= LIPSCHITZ_3D && most > 0.98 * LIPSCHITZ_3D, "{most} and {LIPSCHITZ_3D}");
    }
}
