//! The fields that all meshers mesh: small, of many kinds, and reproducible.
//!
//! Values below 0 are inside. Each field is a cube of 8 to 33 samples per axis. Its outermost layer is outside, so that
//! a correct mesh is closed.

use marchless_benches::split_mix;
use noise::{NoiseFn, Perlin};

/// Samples to mesh.
pub(crate) struct Field {
    pub(crate) kind: Kind,
    /// The field's number among those of its kind.
    pub(crate) number: usize,
    /// Samples per axis.
    pub(crate) size: usize,
    /// `[size³]`, x fastest.
    pub(crate) samples: Vec<f32>,
}

/// The kind of a field's samples, except for its outermost layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Signs,
    Steps,
    Bytes,
    WhiteNoise,
    SmoothNoise,
    SmoothSteps,
    Gyroid,
    Periodic,
    Balls,
    Boxes,
    Tori,
    ZeroPatches,
    Sheets,
    Contacts,
    Tiny,
    Huge,
    AllMagnitudes,
    Infinite,
    NotANumber,
}

impl Kind {
    pub(crate) const ALL: [Self; 19] = [
        Self::Signs,
        Self::Steps,
        Self::Bytes,
        Self::WhiteNoise,
        Self::SmoothNoise,
        Self::SmoothSteps,
        Self::Gyroid,
        Self::Periodic,
        Self::Balls,
        Self::Boxes,
        Self::Tori,
        Self::ZeroPatches,
        Self::Sheets,
        Self::Contacts,
        Self::Tiny,
        Self::Huge,
        Self::AllMagnitudes,
        Self::Infinite,
        Self::NotANumber,
    ];

    /// The name in reports.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Signs => "signs",
            Self::Steps => "small integers",
            Self::Bytes => "bytes",
            Self::WhiteNoise => "white noise",
            Self::SmoothNoise => "smooth noise",
            Self::SmoothSteps => "smooth noise in steps",
            Self::Gyroid => "gyroids",
            Self::Periodic => "periodic surfaces in steps",
            Self::Balls => "balls of integers",
            Self::Boxes => "boxes of integers",
            Self::Tori => "tori of integers",
            Self::ZeroPatches => "patches of zeros",
            Self::Sheets => "thin sheets",
            Self::Contacts => "cubes that touch",
            Self::Tiny => "tiny values",
            Self::Huge => "huge values",
            Self::AllMagnitudes => "all magnitudes",
            Self::Infinite => "infinities",
            Self::NotANumber => "NaN and infinities",
        }
    }

    /// A sentence that describes the samples.
    pub(crate) const fn description(self) -> &'static str {
        match self {
            Self::Signs => "−1 or 1 at random, few or many inside",
            Self::Steps => "−2, −1, 0, 1 or 2 at random",
            Self::Bytes => "an integer from −128 to 127 at random",
            Self::WhiteNoise => "a number from −1 to 1 at random",
            Self::SmoothNoise => "Perlin noise, 4 to 16 samples long",
            Self::SmoothSteps => "the same in eighths, so that many samples are 0",
            Self::Gyroid => "gyroids of any period, phase and level",
            Self::Periodic => "Schwarz's P and D surfaces whose period is whole, in sixteenths",
            Self::Balls => "up to three balls, integers that are 0 at many samples on the surface",
            Self::Boxes => "up to three boxes whose faces lie on samples, which are 0 there",
            Self::Tori => "a torus about a sample: integers, 0 where it passes through samples",
            Self::ZeroPatches => "smooth noise that is exactly 0 within some balls",
            Self::Sheets => "a slanted sheet or two, about a sample thick, and thus torn",
            Self::Contacts => "−1 in cubes of 1 to 3 samples which touch along edges and at corners, else 1",
            Self::Tiny => "white noise times 1e-40: subnormal numbers",
            Self::Huge => "white noise times 3.4e38: differences overflow",
            Self::AllMagnitudes => "±10 to the power of −44 to 38, at random",
            Self::Infinite => "white noise, every fifth sample ±∞",
            Self::NotANumber => "white noise, every tenth sample NaN, every tenth ±∞",
        }
    }

    /// An outside value of about the same magnitude as the other samples.
    const fn outside(self) -> f32 {
        match self {
            Self::Bytes => 127.0,
            Self::Tiny => 1e-40,
            Self::Huge => 3.4e38,
            _ => 1.0,
        }
    }
}

/// `per_kind` fields of each kind, with at most `largest` samples per axis; the same ones on every call.
pub(crate) fn all(per_kind: usize, largest: usize) -> Vec<Field> {
    let numbers = |kind| (0..per_kind).map(move |number| Field::new(kind, number, largest));
    Kind::ALL.into_iter().flat_map(numbers).collect()
}

impl Field {
    fn new(kind: Kind, number: usize, largest: usize) -> Self {
        let mut random = Random((kind as u64) << 32 | (number as u64) << 16);
        // Small ones more often: they have as many flaws for their size, and take less time.
        let size = 8 + random.below(largest - 7).min(random.below(largest - 7));
        let inner = |v: usize| v > 0 && v < size - 1;
        let mut sample = sampler(kind, number, size as f64, random);
        let mut samples = Vec::with_capacity(size.pow(3));
        for z in 0..size {
            for y in 0..size {
                for x in 0..size {
                    let inside = inner(x) && inner(y) && inner(z);
                    samples.push(if inside { sample([x, y, z].map(|v| v as f64)) } else { kind.outside() });
                }
            }
        }
        Self { kind, number, size, samples }
    }

    /// The sample at a lattice point; what lies beyond the field is outside.
    pub(crate) fn at(&self, point: [usize; 3]) -> f32 {
        let [x, y, z] = point.map(|v| v.min(self.size - 1));
        self.samples[(z * self.size + y) * self.size + x]
    }

    /// True if there is a surface: a sample below 0.
    pub(crate) fn has_surface(&self) -> bool {
        self.samples.iter().any(|&sample| sample < 0.0)
    }

    /// A name for files.
    pub(crate) fn file_name(&self) -> String {
        format!("{}-{:02}", self.kind.name().replace(' ', "-"), self.number)
    }
}

/// A function that returns the samples of a kind at lattice points inside the outermost layer. `size`: samples per
/// axis.
fn sampler(kind: Kind, number: usize, size: f64, mut random: Random) -> Box<dyn FnMut([f64; 3]) -> f32> {
    match kind {
        Kind::Signs => {
            let share = random.between(0.05, 0.95);
            Box::new(move |_| if random.unit() < share { -1.0 } else { 1.0 })
        }
        Kind::Steps => Box::new(move |_| random.below(5) as f32 - 2.0),
        Kind::Bytes => Box::new(move |_| random.below(256) as f32 - 128.0),
        Kind::WhiteNoise => Box::new(move |_| random.white()),
        Kind::SmoothNoise => {
            let noise = smooth_noise(number, &mut random);
            Box::new(move |p| noise(p) as f32)
        }
        Kind::SmoothSteps => {
            let noise = smooth_noise(number, &mut random);
            Box::new(move |p| (noise(p) * 8.0).round() as f32)
        }
        Kind::Gyroid => {
            let (period, phase) = (random.between(5.0, 14.0), random.point(0.0, 6.0));
            let level = random.between(-1.0, 1.0);
            Box::new(move |p| {
                let [x, y, z] = [0, 1, 2].map(|axis| p[axis] * core::f64::consts::TAU / period + phase[axis]);
                (x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos() - level) as f32
            })
        }
        Kind::Periodic => {
            let period = [4.0, 6.0, 8.0, 12.0][random.below(4)];
            let diamond = random.below(2) == 1;
            Box::new(move |p| {
                let angles = p.map(|v| v * core::f64::consts::TAU / period);
                let ([x, y, z], [u, v, w]) = (angles.map(f64::cos), angles.map(f64::sin));
                let value = if diamond { x * y * z - u * v * w } else { x + y + z };
                (value * 16.0).round() as f32 / 16.0
            })
        }
        Kind::Balls => {
            // In half samples, so that some centres lie between samples; squared, so that all is whole.
            let balls: Vec<_> = (0..=random.below(3))
                .map(|_| {
                    let centre = random.point(0.5 * size, 1.5 * size).map(f64::round);
                    // A sample from which the ball takes its radius, so that it lies on the surface.
                    let sample = random.point(1.0, size - 2.0).map(|v| v.round() * 2.0);
                    (centre, squared(sample, centre))
                })
                .collect();
            Box::new(move |p| least(&balls, |&(centre, radius)| squared(p.map(|v| 2.0 * v), centre) - radius))
        }
        Kind::Boxes => {
            let boxes: Vec<_> = (0..=random.below(3))
                .map(|_| (random.point(2.0, size - 3.0).map(f64::round), random.point(1.0, size / 3.0).map(f64::round)))
                .collect();
            Box::new(move |p| {
                least(&boxes, |(centre, half)| {
                    let distances = [0, 1, 2].map(|axis| (p[axis] - centre[axis]).abs() - half[axis]);
                    distances.into_iter().fold(f64::NEG_INFINITY, f64::max)
                })
            })
        }
        Kind::Tori => {
            let centre = [0; 3].map(|_| (size / 2.0).floor());
            let wide = random.between(2.0, size / 4.0).round();
            let thick = random.between(1.0, wide).round();
            let turn = random.below(3);
            Box::new(move |p| {
                let [x, y, z] = [0, 1, 2].map(|axis| (p[(axis + turn) % 3] - centre[axis]).powi(2));
                let ring = wide.powi(2);
                ((x + y + z + ring - thick.powi(2)).powi(2) - 4.0 * ring * (x + y)) as f32
            })
        }
        Kind::ZeroPatches => {
            let noise = smooth_noise(number, &mut random);
            let balls: Vec<_> =
                (0..6).map(|_| (random.point(0.0, size), random.between(1.0, size / 4.0).powi(2))).collect();
            Box::new(move |p| {
                let zero = balls.iter().any(|&(centre, radius)| squared(p, centre) < radius);
                if zero { 0.0 } else { noise(p) as f32 }
            })
        }
        Kind::Sheets => {
            let sheets: Vec<_> = (0..=random.below(2))
                .map(|_| {
                    let normal = random.point(-1.0, 1.0);
                    let length = squared(normal, [0.0; 3]).sqrt().max(0.1);
                    let middle = random.point(0.3 * size, 0.7 * size);
                    (normal.map(|v| v / length), middle, random.between(0.15, 0.8))
                })
                .collect();
            Box::new(move |p| {
                least(&sheets, |(normal, middle, thick)| {
                    let along: f64 = (0..3).map(|axis| normal[axis] * (p[axis] - middle[axis])).sum();
                    along.abs() - thick
                })
            })
        }
        Kind::Contacts => {
            let (side, share) = (1.0 + random.below(3) as f64, random.between(0.3, 1.0));
            let salt = random.next();
            Box::new(move |p| {
                let [x, y, z] = p.map(|v| (v / side).floor() as u64);
                let chosen = Random(salt ^ (x << 40 | y << 20 | z)).unit() < share;
                if (x + y + z) % 2 == 1 && chosen { -1.0 } else { 1.0 }
            })
        }
        Kind::Tiny => Box::new(move |_| random.white() * 1e-40),
        Kind::Huge => Box::new(move |_| random.white() * 3.4e38),
        Kind::AllMagnitudes => Box::new(move |_| {
            let magnitude = 10.0f64.powf(random.between(-44.0, 38.0)) as f32;
            if random.below(2) == 0 { -magnitude } else { magnitude }
        }),
        Kind::Infinite => Box::new(move |_| match random.below(10) {
            0 => f32::INFINITY,
            1 => f32::NEG_INFINITY,
            _ => random.white(),
        }),
        Kind::NotANumber => Box::new(move |_| match random.below(20) {
            0 => f32::INFINITY,
            1 => f32::NEG_INFINITY,
            2 | 3 => f32::NAN,
            _ => random.white(),
        }),
    }
}

/// Perlin noise, shifted by a level.
fn smooth_noise(number: usize, random: &mut Random) -> impl Fn([f64; 3]) -> f64 + use<> {
    let (noise, length) = (Perlin::new(number as u32), random.between(4.0, 16.0));
    let (origin, level) = (random.point(0.0, 100.0), random.between(-0.2, 0.2));
    move |p| noise.get([0, 1, 2].map(|axis| p[axis] / length + origin[axis])) - level
}

/// The union of parts: the least of their values.
fn least<T>(parts: &[T], value: impl Fn(&T) -> f64) -> f32 {
    parts.iter().map(value).fold(f64::INFINITY, f64::min) as f32
}

/// The square of the distance of two points.
fn squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

/// A sequence of random numbers, at its current place.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 += 1;
        split_mix(self.0)
    }

    /// A number from 0 to 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number from −1 to 1.
    fn white(&mut self) -> f32 {
        self.between(-1.0, 1.0) as f32
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    fn point(&mut self, low: f64, high: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(low, high))
    }

    fn below(&mut self, end: usize) -> usize {
        (self.unit() * end as f64) as usize
    }
}
