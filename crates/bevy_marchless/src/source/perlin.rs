//! [`Perlin`]: the `noise` crate's Perlin noise, a row at a time and with its gradient.
//!
//! Along a row only x changes. Within one cell of the noise's lattice everything else is the same for all samples, and
//! is worked out once: what is left for a sample are two straight lines and a fade between them, without branches or
//! look-ups. The values are those of [`noise::Perlin`](::noise::Perlin), but for roundings.

use core::f64::consts::SQRT_2;

use ::noise::permutationtable::{NoiseHasher, PermutationTable};

/// The noise changes at most this fast, per unit of its lattice: in two dimensions 2.75·√2, in three 3.75·2/√3, next to
/// a corner between cells whose gradients point apart. A test finds them again; a hundredth is added.
pub(crate) const LIPSCHITZ_2D: f64 = 1.01 * 2.75 * SCALE_2D;
/// As [`LIPSCHITZ_2D`], in three dimensions.
pub(crate) const LIPSCHITZ_3D: f64 = 1.01 * 3.75 * SCALE_3D;

/// What brings the noise to −1..=1.
const SCALE_2D: f64 = SQRT_2;
const SCALE_3D: f64 = 1.154_700_538_379_251_5;

/// Gradients of lattice points, by the last four bits of their hash.
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

/// Perlin noise of one seed.
#[derive(Clone)]
pub(crate) struct Perlin {
    table: [u8; 256],
}

/// A coordinate: the lowest lattice point of its cell, the same modulo 256, and how far behind it.
#[derive(Clone, Copy)]
struct Place {
    cell: f64,
    index: usize,
    inside: f64,
}

impl Place {
    fn new(coordinate: f64) -> Self {
        if !coordinate.is_finite() {
            return Self { cell: coordinate, index: 0, inside: 0.0 };
        }
        let cell = coordinate.floor();
        let index = cell - 256.0 * (cell / 256.0).floor();
        Self { cell, index: index as usize & 255, inside: coordinate - cell }
    }
}

/// The fade from one lattice point to the next, and how fast it changes.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn fade_slope(t: f64) -> f64 {
    30.0 * t * t * (t - 1.0) * (t - 1.0)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// A straight line: its value at 0, and how fast it changes.
#[derive(Clone, Copy, Default)]
struct Line {
    start: f64,
    slope: f64,
}

impl Line {
    fn at(self, t: f64) -> f64 {
        self.start + self.slope * t
    }

    fn lerp(self, to: Self, t: f64) -> Self {
        Self { start: lerp(self.start, to.start, t), slope: lerp(self.slope, to.slope, t) }
    }

    fn minus(self, other: Self) -> Self {
        Self { start: self.start - other.start, slope: self.slope - other.slope }
    }

    fn times(self, factor: f64) -> Self {
        Self { start: self.start * factor, slope: self.slope * factor }
    }

    fn plus(self, other: Self) -> Self {
        Self { start: self.start + other.start, slope: self.slope + other.slope }
    }
}

/// Noise and its gradient at the samples of a row.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseRow {
    pub(crate) value: Vec<f64>,
    pub(crate) gradient: [Vec<f64>; 3],
}

impl NoiseRow {
    /// Zero for `len` samples.
    pub(crate) fn reset(&mut self, len: usize) {
        for values in core::iter::once(&mut self.value).chain(&mut self.gradient) {
            values.clear();
            values.resize(len, 0.0);
        }
    }
}

impl Perlin {
    pub(crate) fn new(seed: u32) -> Self {
        let table = PermutationTable::new(seed);
        Self { table: core::array::from_fn(|index| table.hash(&[index as isize]) as u8) }
    }

    /// What lattice points with this x, modulo 256, begin their hash with; y and z are added by [`Self::hash`].
    fn hash(&self, so_far: usize, next: usize) -> usize {
        usize::from(self.table[(so_far ^ next) & 255])
    }

    /// Passes on the noise at each x (ascending is fastest) of a row at `z`: its index and value.
    #[inline]
    pub(crate) fn row_2d(&self, xs: &[f64], z: f64, mut take: impl FnMut(usize, f64)) {
        let z = Place::new(z);
        let fade_z = fade(z.inside);
        for_each_cell(xs, |x, run| {
            let [low, high] = [0, 1].map(|corner| {
                let along = self.hash(0, x.index + corner);
                let [near, far] = [0, 1].map(|corner_z| {
                    let hash = self.hash(along, (z.index + corner_z) & 255);
                    let [gx, gz] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]][hash & 3];
                    Line { start: gz * (z.inside - corner_z as f64), slope: gx }
                });
                near.lerp(far, fade_z).times(SCALE_2D)
            });
            for index in run {
                let t = xs[index] - x.cell;
                let [low, high] = [low.at(t), high.at(t - 1.0)];
                take(index, lerp(low, high, fade(t)).clamp(-1.0, 1.0));
            }
        });
    }

    /// Passes on the noise at each x (ascending is fastest) of a row at `y`, `z`: its index, value and gradient.
    #[inline]
    pub(crate) fn row_3d(&self, xs: &[f64], y: f64, z: f64, mut take: impl FnMut(usize, f64, [f64; 3])) {
        let [y, z] = [Place::new(y), Place::new(z)];
        let [fade_y, fade_z] = [fade(y.inside), fade(z.inside)];
        let [slope_y, slope_z] = [fade_slope(y.inside), fade_slope(z.inside)];
        for_each_cell(xs, |x, run| {
            let [low, high] = [0, 1].map(|corner| {
                let along = self.hash(0, x.index + corner);
                // The corner's noise as a function of x, and how it changes with y and z.
                let [near, far] = [0, 1].map(|corner_y| {
                    let along = self.hash(along, (y.index + corner_y) & 255);
                    let [near, far] = [0, 1].map(|corner_z| {
                        let hash = self.hash(along, (z.index + corner_z) & 255);
                        let [gx, gy, gz] = GRADIENTS_3D[hash & 15];
                        let start = gy * (y.inside - corner_y as f64) + gz * (z.inside - corner_z as f64);
                        [Line { start, slope: gx }, Line { start: gy, slope: 0.0 }, Line { start: gz, slope: 0.0 }]
                    });
                    let across = far[0].minus(near[0]).times(slope_z);
                    let [value, by_y, by_z] = [0, 1, 2].map(|which: usize| near[which].lerp(far[which], fade_z));
                    [value, by_y, by_z.plus(across)]
                });
                let up = far[0].minus(near[0]).times(slope_y);
                let [value, by_y, by_z] = [0, 1, 2].map(|which: usize| near[which].lerp(far[which], fade_y));
                [value, by_y.plus(up), by_z].map(|line| line.times(SCALE_3D))
            });
            for index in run {
                let t = xs[index] - x.cell;
                let fade_x = fade(t);
                let [value, by_y, by_z] = [0, 1, 2].map(|which: usize| [low[which].at(t), high[which].at(t - 1.0)]);
                let by_x = lerp(low[0].slope, high[0].slope, fade_x) + fade_slope(t) * (value[1] - value[0]);
                let [value, by_y, by_z] = [value, by_y, by_z].map(|[low, high]| lerp(low, high, fade_x));
                take(index, value.clamp(-1.0, 1.0), [by_x, by_y, by_z]);
            }
        });
    }
}

/// Passes on each run of coordinates that lie in one cell.
#[inline]
fn for_each_cell(xs: &[f64], mut take: impl FnMut(Place, core::ops::Range<usize>)) {
    let mut start = 0;
    while let Some(&x) = xs.get(start) {
        let place = Place::new(x);
        let beyond = place.cell + 1.0;
        let here = xs[start + 1..].iter().take_while(|x| **x >= place.cell && **x < beyond).count();
        take(place, start..start + 1 + here);
        start += 1 + here;
    }
}

#[cfg(test)]
mod tests {
    use ::noise::NoiseFn;
    use proptest::prelude::*;

    use super::*;

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
            let mut alone = Vec::new();
            perlin.row_3d(&xs, y, z, |index, value, gradient| {
                assert!((value - oracle.get([xs[index], y, z])).abs() < 1e-12);
                alone.push((index, value, gradient));
            });
            // The same bits alone as in a row.
            for (index, value, gradient) in alone {
                perlin.row_3d(&xs[index..=index], y, z, |_, v, g| assert_eq!((v, g), (value, gradient)));
            }
        }

        #[test]
        fn gradients_are_differences(seed: u32, position in [-9.0..9.0, -9.0..9.0, -9.0..9.0]) {
            let perlin = Perlin::new(seed);
            let at = |[x, y, z]: [f64; 3]| {
                let mut found = (0.0, [0.0; 3]);
                perlin.row_3d(&[x], y, z, |_, value, gradient| found = (value, gradient));
                found
            };
            let gradient = at(position).1;
            for axis in 0..3 {
                let step = 1e-5;
                let [mut low, mut high] = [position; 2];
                low[axis] -= step;
                high[axis] += step;
                let (low, high) = (at(low).0, at(high).0);
                if low.abs() < 1.0 && high.abs() < 1.0 {
                    prop_assert!(((high - low) / (2.0 * step) - gradient[axis]).abs() < 1e-4);
                }
            }
        }
    }

    /// The fastest change at a place along a direction, over all gradients that the corners of a cell may have: it is a
    /// sum over the corners, and so each may be chosen alone.
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

    /// Directions to all sides of the surface of a cube, and places all over a cell.
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
