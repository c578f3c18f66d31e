//! [`Octaves`]: a [`Fractal`] prepared for evaluation in rows and for bounds.

use super::Fractal;
use super::interval::Interval;
use super::perlin::{LIPSCHITZ_2D, LIPSCHITZ_3D, NoiseRow, NoiseScale, Perlin};

/// The greatest error of noise from rounding to `f32`.
const ROUNDING: f64 = 1e-6;

/// One octave of a [`Fractal`].
#[derive(Clone)]
struct Octave {
    perlin: Perlin,
    amplitude: f64,
    frequency: f64,
    offset: f64,
}

/// A [`Fractal`] prepared for evaluation. Functions that evaluate noise return the number of evaluations, one per
/// octave and point.
#[derive(Clone)]
pub(crate) struct Octaves {
    octaves: Vec<Octave>,
    ridged: bool,
}

impl Octaves {
    /// Prepares noise with valid settings.
    pub(crate) fn new(settings: &Fractal) -> Self {
        let amplitudes = |index: u32| settings.persistence.powi(index as i32);
        let sum: f64 = (0..settings.octaves).map(amplitudes).sum();
        let octave = |index: u32| Octave {
            perlin: Perlin::new(settings.seed.wrapping_add(index)),
            amplitude: amplitudes(index) / sum,
            frequency: settings.lacunarity.powi(index as i32) / settings.zoom,
            // Perlin noise is 0 at whole numbers; without offsets all octaves would meet there.
            offset: (f64::from(index) + 1.0) * 0.618_033_988_749_895,
        };
        Self { octaves: (0..settings.octaves).map(octave).collect(), ridged: settings.ridged }
    }

    /// Writes noise, from −1 to 1, for each x of a row at `z`. `values`: one for each x.
    pub(crate) fn row_2d(&self, xs: &[f64], z: f64, values: &mut [f64]) -> u64 {
        values.fill(0.0);
        let mut places = vec![0.0; xs.len()];
        for octave in &self.octaves {
            octave.places(xs, &mut places);
            octave.perlin.row_2d(&places, octave.place(z), |index, value| {
                values[index] += octave.amplitude * if self.ridged { 1.0 - 2.0 * value.abs() } else { value };
            });
        }
        self.calls(xs.len())
    }

    /// Writes noise, from −1 to 1, for each x with its z. Values are bit for bit those of [`row_2d`](Self::row_2d).
    pub(crate) fn points_2d(&self, xs: &[f64], zs: &[f64], values: &mut [f64]) -> u64 {
        for ((x, z), sum) in xs.iter().zip(zs).zip(values) {
            *sum = 0.0;
            for octave in &self.octaves {
                octave.perlin.row_2d(&[octave.place(*x)], octave.place(*z), |_, value| {
                    *sum += octave.amplitude * if self.ridged { 1.0 - 2.0 * value.abs() } else { value };
                });
            }
        }
        self.calls(xs.len())
    }

    /// Writes noise, from −1 to 1, and its gradient per world unit for each x of a row at `y`, `z`.
    pub(crate) fn row_3d(&self, xs: &[f64], y: f64, z: f64, row: &mut NoiseRow) -> u64 {
        row.reset(xs.len());
        for octave in &self.octaves {
            octave.places(xs, &mut row.places);
            let share = NoiseScale {
                value: octave.amplitude as f32,
                gradient: (octave.amplitude * octave.frequency) as f32,
                ridged: self.ridged,
            };
            octave.perlin.add_row_3d(octave.place(y), octave.place(z), share, row);
        }
        self.calls(xs.len())
    }

    /// The interval of the noise within `radius` of a place, given by two or three coordinates. Evaluates the noise
    /// only at the place itself.
    pub(crate) fn around<const N: usize>(&self, place: [f64; N], radius: f64) -> (Interval, u64) {
        let mut sum = Interval::exactly(0.0);
        let lipschitz = if N == 2 { LIPSCHITZ_2D } else { LIPSCHITZ_3D };
        let mut calls = 0;
        for octave in &self.octaves {
            let change = lipschitz * octave.frequency * radius;
            let all = Interval { low: -1.0, high: 1.0 };
            // Above this, an evaluation would hardly narrow the interval.
            let values = if change < 1.5 {
                calls += 1;
                let mut value = 0.0;
                match place.as_slice() {
                    [x, z] => octave.perlin.row_2d(&[octave.place(*x)], octave.place(*z), |_, v| value = v),
                    [x, y, z] => {
                        let [x, y, z] = [*x, *y, *z].map(|v| octave.place(v));
                        value = octave.perlin.value_3d(x, y, z);
                    }
                    _ => {}
                }
                Interval { low: value - change, high: value + change }.within(all)
            } else {
                all
            };
            let values = if self.ridged { values.abs().scaled(-2.0).plus(Interval::exactly(1.0)) } else { values };
            sum = sum.plus(values.scaled(octave.amplitude));
        }
        (Interval { low: sum.low - ROUNDING, high: sum.high + ROUNDING }, calls)
    }

    /// The interval of the noise over all of space.
    pub(crate) fn range(&self) -> Interval {
        Interval { low: -1.0 - ROUNDING, high: 1.0 + ROUNDING }
    }

    /// The typical change of the noise per world unit.
    pub(crate) fn typical_gradient(&self) -> f64 {
        self.octaves.iter().map(|octave| (octave.amplitude * octave.frequency).powi(2)).sum::<f64>().sqrt()
    }

    /// The greatest change of the noise per world unit, in two dimensions.
    pub(crate) fn lipschitz_2d(&self) -> f64 {
        self.steepness() * LIPSCHITZ_2D
    }

    /// The greatest change of the noise per world unit, in three dimensions.
    pub(crate) fn lipschitz_3d(&self) -> f64 {
        self.steepness() * LIPSCHITZ_3D
    }

    fn steepness(&self) -> f64 {
        let fold = if self.ridged { 2.0 } else { 1.0 };
        fold * self.octaves.iter().map(|octave| octave.amplitude * octave.frequency).sum::<f64>()
    }

    fn calls(&self, points: usize) -> u64 {
        (self.octaves.len() * points) as u64
    }
}

impl Octave {
    /// Converts a world coordinate to this octave's lattice.
    fn place(&self, coordinate: f64) -> f64 {
        coordinate * self.frequency + self.offset
    }

    fn places(&self, coordinates: &[f64], places: &mut [f64]) {
        for (place, coordinate) in places.iter_mut().zip(coordinates) {
            *place = self.place(*coordinate);
        }
    }
}
