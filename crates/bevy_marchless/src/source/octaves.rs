//! [`Octaves`]: a [`Fractal`] prepared for evaluation in rows and for bounds.

use super::Fractal;
use super::detail::Detail;
use super::interval::Interval;
use super::perlin::{LIPSCHITZ_2D, LIPSCHITZ_3D, NoiseRow, NoiseScale, Perlin};

/// The greatest error of noise from rounding to `f32`.
const ROUNDING: f64 = 1e-6;

/// The mean of 1 − 2·|noise| in two and in three dimensions. A test derives both again.
const RIDGED_MEAN: [f64; 2] = [0.308, 0.491];

/// One octave of a [`Fractal`].
#[derive(Clone)]
struct Octave {
    perlin: Perlin,
    amplitude: f64,
    frequency: f64,
    offset: f64,
}

/// A [`Fractal`] prepared for evaluation. Functions that evaluate noise return the number of evaluations, one per
/// octave and point. They leave out what the level of detail does not show: octaves are replaced by their mean, in part
/// or as a whole.
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
    pub(crate) fn row_2d(&self, detail: Detail, xs: &[f64], z: f64, values: &mut [f64]) -> u64 {
        values.fill(self.left_out(detail, 2));
        let mut places = vec![0.0; xs.len()];
        let mut calls = 0;
        for (octave, amplitude) in self.shown(detail) {
            octave.places(xs, &mut places);
            octave.perlin.row_2d(&places, octave.place(z), |index, value| {
                values[index] += amplitude * if self.ridged { 1.0 - 2.0 * value.abs() } else { value };
            });
            calls += xs.len();
        }
        calls as u64
    }

    /// Writes noise, from −1 to 1, for each x with its z. Values are bit for bit those of [`row_2d`](Self::row_2d).
    pub(crate) fn points_2d(&self, detail: Detail, xs: &[f64], zs: &[f64], values: &mut [f64]) -> u64 {
        let left_out = self.left_out(detail, 2);
        let mut calls = 0;
        for ((x, z), sum) in xs.iter().zip(zs).zip(values) {
            *sum = left_out;
            for (octave, amplitude) in self.shown(detail) {
                octave.perlin.row_2d(&[octave.place(*x)], octave.place(*z), |_, value| {
                    *sum += amplitude * if self.ridged { 1.0 - 2.0 * value.abs() } else { value };
                });
                calls += 1;
            }
        }
        calls
    }

    /// Writes noise, from −1 to 1, and its gradient per world unit for each x of a row at `y`, `z`.
    pub(crate) fn row_3d(&self, detail: Detail, xs: &[f64], y: f64, z: f64, row: &mut NoiseRow) -> u64 {
        row.reset(xs.len());
        row.value.fill(self.left_out(detail, 3) as f32);
        let mut calls = 0;
        for (octave, amplitude) in self.shown(detail) {
            octave.places(xs, &mut row.places);
            let share = NoiseScale {
                value: amplitude as f32,
                gradient: (amplitude * octave.frequency) as f32,
                ridged: self.ridged,
            };
            octave.perlin.add_row_3d(octave.place(y), octave.place(z), share, row);
            calls += xs.len();
        }
        calls as u64
    }

    /// The value of the noise everywhere, if a level of detail leaves all of it out.
    pub(crate) fn constant_3d(&self, detail: Detail) -> Option<f64> {
        self.shown(detail).next().is_none().then(|| self.left_out(detail, 3))
    }

    /// The octaves that are not left out, with the amplitude of what is left of them.
    fn shown(&self, detail: Detail) -> impl Iterator<Item = (&Octave, f64)> {
        let octaves = self.octaves.iter().map(move |octave| (octave, detail.share(octave.frequency)));
        octaves.filter(|(_, share)| *share > 0.0).map(|(octave, share)| (octave, octave.amplitude * share))
    }

    /// The mean of everything that is left out. Plain noise has the mean 0.
    fn left_out(&self, detail: Detail, dimensions: usize) -> f64 {
        if !self.ridged || detail.is_finest() {
            return 0.0;
        }
        let amplitudes = self.octaves.iter().map(|octave| octave.amplitude * (1.0 - detail.share(octave.frequency)));
        RIDGED_MEAN[dimensions - 2] * amplitudes.sum::<f64>()
    }

    /// The interval of the noise within `radius` of a place, given by two or three coordinates. Evaluates the noise
    /// only at the place itself.
    pub(crate) fn around<const N: usize>(&self, detail: Detail, place: [f64; N], radius: f64) -> (Interval, u64) {
        let mut sum = Interval::exactly(self.left_out(detail, N));
        let lipschitz = if N == 2 { LIPSCHITZ_2D } else { LIPSCHITZ_3D };
        let mut calls = 0;
        for (octave, amplitude) in self.shown(detail) {
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
            sum = sum.plus(values.scaled(amplitude));
        }
        (Interval { low: sum.low - ROUNDING, high: sum.high + ROUNDING }, calls)
    }

    /// The interval of the noise over all of space, at every level of detail.
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

#[cfg(test)]
mod tests {
    use marchless::SourceRegion;
    use proptest::prelude::*;

    use super::*;

    fn detail(level: u8, spacing: f64) -> Detail {
        Detail::of(&SourceRegion { min: [0; 3], size: [1; 3], level, spacing })
    }

    fn fractal() -> impl Strategy<Value = Fractal> {
        (any::<u32>(), 1u32..7, 0.5..200.0, 0.1..=1.0, 1.0..3.0, any::<bool>()).prop_map(
            |(seed, octaves, zoom, persistence, lacunarity, ridged)| Fractal {
                seed,
                octaves,
                zoom,
                persistence,
                lacunarity,
                ridged,
            },
        )
    }

    proptest! {
        #[test]
        fn level_0_has_all_octaves_as_they_are(
            settings in fractal(), spacing in 0.01..100.0, x in -300.0..300.0, y in -300.0..300.0, z in -300.0..300.0,
        ) {
            let octaves = Octaves::new(&settings);
            let mut sum = 0.0;
            let mut row = NoiseRow::default();
            row.reset(1);
            for octave in &octaves.octaves {
                octave.perlin.row_2d(&[octave.place(x)], octave.place(z), |_, value| {
                    sum += octave.amplitude * if settings.ridged { 1.0 - 2.0 * value.abs() } else { value };
                });
                row.places[0] = octave.place(x);
                let [value, gradient] = [octave.amplitude, octave.amplitude * octave.frequency].map(|v| v as f32);
                let scale = NoiseScale { value, gradient, ridged: settings.ridged };
                octave.perlin.add_row_3d(octave.place(y), octave.place(z), scale, &mut row);
            }
            for detail in [Detail::FINEST, detail(0, spacing)] {
                let (mut in_row, mut alone, mut in_3d) = ([0.0], [0.0], NoiseRow::default());
                let calls = octaves.row_2d(detail, &[x], z, &mut in_row);
                octaves.points_2d(detail, &[x], &[z], &mut alone);
                octaves.row_3d(detail, &[x], y, z, &mut in_3d);
                prop_assert_eq!(calls, u64::from(settings.octaves));
                prop_assert_eq!([in_row[0].to_bits(), alone[0].to_bits()], [f64::to_bits(sum); 2]);
                prop_assert_eq!(in_3d.value[0].to_bits(), row.value[0].to_bits());
                for axis in 0..3 {
                    prop_assert_eq!(in_3d.gradient[axis][0].to_bits(), row.gradient[axis][0].to_bits());
                }
            }
        }

        #[test]
        fn intervals_hold_what_a_level_shows(
            settings in fractal(), level in 0u8..8, spacing in 0.1..100.0, radius in 0.0..60.0,
            place in [-300.0..300.0, -300.0..300.0, -300.0..300.0], from in [-0.57..0.57, -0.57..0.57, -0.57..0.57],
        ) {
            let (octaves, detail) = (Octaves::new(&settings), detail(level, spacing));
            let [x, y, z] = [0, 1, 2].map(|axis| place[axis] + radius * from[axis]);
            let holds = |interval: Interval, value: f64| interval.low <= value && value <= interval.high;
            let mut flat = [0.0];
            octaves.row_2d(detail, &[x], z, &mut flat);
            prop_assert!(holds(octaves.around(detail, [place[0], place[2]], radius).0, flat[0]));
            let mut row = NoiseRow::default();
            octaves.row_3d(detail, &[x], y, z, &mut row);
            let value = f64::from(row.value[0]);
            prop_assert!(holds(octaves.around(detail, place, radius).0, value));
            prop_assert!(holds(octaves.range(), flat[0]) && holds(octaves.range(), value));
            if let Some(constant) = octaves.constant_3d(detail) {
                prop_assert!((value - constant).abs() < ROUNDING && row.gradient.iter().all(|by| by[0] == 0.0));
            }
        }
    }

    /// Over many places of several seeds.
    #[test]
    fn what_is_left_out_of_ridges_is_their_mean() {
        let mut sums = [0.0; 2];
        let mut places = 0.0;
        for seed in 0..8 {
            let perlin = Perlin::new(seed);
            for place in 0..60_000 {
                let [x, y, z] = [0.618_034, 0.414_214, 0.732_051].map(|step| f64::from(place) * step * 1.37);
                perlin.row_2d(&[x], z, |_, value| sums[0] += 1.0 - 2.0 * value.abs());
                sums[1] += 1.0 - 2.0 * perlin.value_3d(x, y, z).abs();
                places += 1.0;
            }
        }
        for (sum, mean) in sums.into_iter().zip(RIDGED_MEAN) {
            assert!((sum / places - mean).abs() < 0.005, "{} and {mean}", sum / places);
        }
    }
}
