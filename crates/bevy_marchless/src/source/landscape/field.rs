//! [`Field`]: a [`Layer`] prepared for evaluation, and its bounds.

use bevy_math::DVec2;

use super::Layer;
use crate::source::Fractal;
use crate::source::detail::Detail;
use crate::source::interval::Interval;
use crate::source::octaves::Octaves;

/// A [`Layer`] prepared for evaluation. Functions add the number of noise evaluations to `calls`, and leave out the
/// noise that a level of detail does not show.
#[derive(Clone)]
pub(super) enum Field {
    Constant(f64),
    Noise { octaves: Octaves, amplitude: f64 },
    Sum(Vec<Field>),
    Product(Vec<Field>),
    Minimum(Vec<Field>),
    Maximum(Vec<Field>),
    Clamp { of: Box<Field>, min: f64, max: f64 },
    Terraces { of: Box<Field>, step: f64, sharpness: f64 },
    Warp { of: Box<Field>, along_x: Octaves, along_z: Octaves, reach: f64 },
    Curve { of: Box<Field>, points: Vec<DVec2> },
}

/// The points at which a field is evaluated.
pub(super) enum FieldPoints<'a> {
    /// All pairs of an x and a z; x changes fastest.
    Grid { xs: &'a [f64], zs: &'a [f64] },
    /// Each x with its z.
    Scattered { xs: &'a [f64], zs: &'a [f64] },
}

/// The difference between the seeds of a warp along x and z; more than a fractal has octaves.
const OTHER_SEED: u32 = 0x9E37;

impl Field {
    /// Prepares a valid layer.
    pub(super) fn new(layer: &Layer) -> Self {
        let all = |layers: &[Layer]| layers.iter().map(Self::new).collect::<Vec<_>>();
        let sum = |layers: &[Layer]| match layers {
            [layer] => Box::new(Self::new(layer)),
            layers => Box::new(Self::Sum(all(layers))),
        };
        match layer {
            Layer::Constant(value) => Self::Constant(*value),
            Layer::Noise { noise, amplitude } => Self::Noise { octaves: Octaves::new(noise), amplitude: *amplitude },
            Layer::Sum(layers) => Self::Sum(all(layers)),
            Layer::Product(layers) => Self::Product(all(layers)),
            Layer::Minimum(layers) => Self::Minimum(all(layers)),
            Layer::Maximum(layers) => Self::Maximum(all(layers)),
            Layer::Clamp { of, min, max } => Self::Clamp { of: sum(of), min: *min, max: *max },
            Layer::Terraces { of, step, sharpness } => {
                Self::Terraces { of: sum(of), step: *step, sharpness: *sharpness }
            }
            Layer::Warp { of, noise, reach } => {
                let other = Fractal { seed: noise.seed.wrapping_add(OTHER_SEED), ..*noise };
                let [along_x, along_z] = [noise, &other].map(Octaves::new);
                Self::Warp { of: sum(of), along_x, along_z, reach: *reach }
            }
            Layer::Curve { of, points } => Self::Curve { of: sum(of), points: points.clone() },
        }
    }

    /// Writes the values at `places`, one for each.
    pub(super) fn values(&self, detail: Detail, places: &FieldPoints, values: &mut [f64], calls: &mut u64) {
        let fold = |fields: &[Self], join: fn(f64, f64) -> f64, none: f64, values: &mut [f64], calls: &mut u64| {
            let Some((first, others)) = fields.split_first() else { return values.fill(none) };
            first.values(detail, places, values, calls);
            let mut next = vec![0.0; values.len()];
            for other in others {
                other.values(detail, places, &mut next, calls);
                for (value, next) in values.iter_mut().zip(&next) {
                    *value = join(*value, *next);
                }
            }
        };
        match self {
            Self::Constant(value) => values.fill(*value),
            Self::Noise { octaves, amplitude } => {
                places.noise(detail, octaves, values, calls);
                values.iter_mut().for_each(|value| *value *= amplitude);
            }
            Self::Sum(fields) => fold(fields, |a, b| a + b, 0.0, values, calls),
            Self::Product(fields) => fold(fields, |a, b| a * b, 1.0, values, calls),
            Self::Minimum(fields) => fold(fields, f64::min, 0.0, values, calls),
            Self::Maximum(fields) => fold(fields, f64::max, 0.0, values, calls),
            Self::Clamp { of, .. } | Self::Terraces { of, .. } | Self::Curve { of, .. } => {
                of.values(detail, places, values, calls);
                values.iter_mut().for_each(|value| *value = self.bend(*value));
            }
            Self::Warp { of, along_x, along_z, reach } => {
                let [mut xs, mut zs] = [(); 2].map(|()| vec![0.0; values.len()]);
                places.noise(detail, along_x, &mut xs, calls);
                places.noise(detail, along_z, &mut zs, calls);
                for ((x, z), [from_x, from_z]) in xs.iter_mut().zip(&mut zs).zip(places.iter()) {
                    *x = from_x + reach * *x;
                    *z = from_z + reach * *z;
                }
                of.values(detail, &FieldPoints::Scattered { xs: &xs, zs: &zs }, values, calls);
            }
        }
    }

    /// The interval of all values in a rectangle with the sides `x` and `z`. Evaluates noise only in its middle.
    pub(super) fn within(&self, detail: Detail, x: Interval, z: Interval, calls: &mut u64) -> Interval {
        self.interval(&mut |octaves, [along_x, along_z]| {
            let [x, z] = [x.plus(along_x), z.plus(along_z)];
            let (interval, more) = octaves.around(detail, [x.middle(), z.middle()], x.half().hypot(z.half()));
            *calls += more;
            interval
        })
    }

    /// The interval of all values of the field, at every level of detail.
    pub(super) fn range(&self) -> Interval {
        self.interval(&mut |octaves, _| octaves.range())
    }

    /// The interval of the field, from those of its noises. `noise`: gives the interval of a noise, from the intervals
    /// by which warps move it along x and z.
    fn interval(&self, noise: &mut dyn FnMut(&Octaves, [Interval; 2]) -> Interval) -> Interval {
        let zero = Interval::exactly(0.0);
        let mut all = |fields: &[Self], join: fn(Interval, Interval) -> Interval, none: f64| {
            let mut intervals = fields.iter().map(|field| field.interval(noise));
            let first = intervals.next().unwrap_or(Interval::exactly(none));
            intervals.fold(first, join)
        };
        match self {
            Self::Constant(value) => Interval::exactly(*value),
            Self::Noise { octaves, amplitude } => noise(octaves, [zero; 2]).scaled(*amplitude),
            Self::Sum(fields) => all(fields, Interval::plus, 0.0),
            Self::Product(fields) => all(fields, Interval::times, 1.0),
            Self::Minimum(fields) => all(fields, Interval::min, 0.0),
            Self::Maximum(fields) => all(fields, Interval::max, 0.0),
            Self::Clamp { of, .. } | Self::Terraces { of, .. } => of.interval(noise).through(|value| self.bend(value)),
            Self::Curve { of, points } => {
                let from = of.interval(noise);
                let knots = points.iter().filter(|point| point.x > from.low && point.x < from.high);
                Interval::of(knots.map(|point| point.y).chain([self.bend(from.low), self.bend(from.high)]))
            }
            Self::Warp { of, along_x, along_z, reach } => {
                let [x, z] = [along_x, along_z].map(|octaves| noise(octaves, [zero; 2]).scaled(*reach));
                of.interval(&mut |octaves, moved| noise(octaves, [moved[0].plus(x), moved[1].plus(z)]))
            }
        }
        .widened(1e-12)
    }

    /// The greatest change of the field per world unit, at every level of detail; infinite if it is not known.
    pub(super) fn lipschitz(&self) -> f64 {
        let most = |fields: &[Self]| fields.iter().map(Self::lipschitz).fold(0.0, f64::max);
        match self {
            Self::Constant(_) => 0.0,
            Self::Noise { octaves, amplitude } => amplitude.abs() * octaves.lipschitz_2d(),
            Self::Sum(fields) => fields.iter().map(Self::lipschitz).sum(),
            Self::Product(fields) => {
                let sizes: Vec<f64> = fields.iter().map(|field| field.range().abs().high).collect();
                let part = |skip: usize| -> f64 {
                    let others = sizes.iter().enumerate().filter(|(index, _)| *index != skip).map(|(_, size)| size);
                    fields[skip].lipschitz() * others.product::<f64>()
                };
                (0..fields.len()).map(part).sum()
            }
            Self::Minimum(fields) | Self::Maximum(fields) => most(fields),
            Self::Clamp { of, .. } => of.lipschitz(),
            // Between terraces is a ramp of slope 1/(1 − sharpness). Easing makes it up to 1 + sharpness/2 times
            // steeper.
            Self::Terraces { of, sharpness, .. } => of.lipschitz() * (1.0 + 0.5 * sharpness) / (1.0 - sharpness),
            Self::Warp { of, along_x, along_z, reach } => {
                let bent = along_x.lipschitz_2d().hypot(along_z.lipschitz_2d());
                of.lipschitz() * (1.0 + reach * bent)
            }
            Self::Curve { of, points } => {
                let steepest = points.windows(2).map(|pair| ((pair[1].y - pair[0].y) / (pair[1].x - pair[0].x)).abs());
                of.lipschitz() * steepest.fold(0.0, f64::max)
            }
        }
    }

    /// Applies the field's clamp, terraces or curve to a value.
    fn bend(&self, value: f64) -> f64 {
        match self {
            Self::Clamp { min, max, .. } => value.max(*min).min(*max),
            Self::Terraces { step, sharpness, .. } => {
                let steps = value / step;
                let below = steps.floor();
                // Half-way between two terraces is half-way up.
                let ramp = ((steps - below - 0.5) / (1.0 - sharpness) + 0.5).clamp(0.0, 1.0);
                let eased = ramp * ramp * (3.0 - 2.0 * ramp);
                step * (below + ramp + sharpness * (eased - ramp))
            }
            Self::Curve { points, .. } => along_curve(points, value),
            _ => value,
        }
    }
}

/// The y of a curve at `x`: straight between its points, level beyond its ends.
fn along_curve(points: &[DVec2], x: f64) -> f64 {
    let after = points.partition_point(|point| point.x <= x);
    match (after.checked_sub(1).and_then(|before| points.get(before)), points.get(after)) {
        (Some(a), Some(b)) => {
            let share = (x - a.x) / (b.x - a.x);
            // Rounding must not take the value beyond both ends.
            let y = a.y + (b.y - a.y) * share;
            y.clamp(a.y.min(b.y), a.y.max(b.y))
        }
        (Some(end), None) | (None, Some(end)) => end.y,
        (None, None) => x,
    }
}

impl FieldPoints<'_> {
    fn iter(&self) -> Box<dyn Iterator<Item = [f64; 2]> + '_> {
        match *self {
            Self::Grid { xs, zs } => Box::new(zs.iter().flat_map(move |z| xs.iter().map(move |x| [*x, *z]))),
            Self::Scattered { xs, zs } => Box::new(xs.iter().zip(zs).map(|(x, z)| [*x, *z])),
        }
    }

    fn noise(&self, detail: Detail, octaves: &Octaves, values: &mut [f64], calls: &mut u64) {
        match *self {
            Self::Grid { xs, zs } => {
                for (z, values) in zs.iter().zip(values.chunks_exact_mut(xs.len().max(1))) {
                    *calls += octaves.row_2d(detail, xs, *z, values);
                }
            }
            Self::Scattered { xs, zs } => *calls += octaves.points_2d(detail, xs, zs, values),
        }
    }
}
