//! [`Body`]: a [`Solid`] prepared for evaluation, and its bounds.

use core::ops::Range;

use bevy_math::DVec3;

use super::columns::Columns;
use super::field::Field;
use super::{Caves, Solid, Tunnels};
use crate::source::detail::Detail;
use crate::source::height_field::Column;
use crate::source::interval::Interval;
use crate::source::octaves::Octaves;
use crate::source::{Fractal, Sdf};

/// A [`Solid`] prepared for evaluation.
pub(super) enum Body {
    Everything,
    Ground(Box<Ground>),
    Noise(Box<Noise>),
    Shape(Sdf),
    Union(Vec<Body>),
    /// The first part, cut by each other part's distance times `sign`: 1 for an intersection, −1 for a subtraction.
    Cut {
        parts: Vec<Body>,
        sign: f64,
    },
}

/// Everything below a field.
pub(super) struct Ground {
    pub(super) columns: Columns,
    /// The interval of all its heights.
    pub(super) range: Interval,
    /// The steepest slope of any column. Units: rise per run.
    pub(super) steepest: f64,
    /// Its index among all grounds of the landscape.
    pub(super) number: usize,
}

/// A solid made of 3-D noise.
pub(super) struct Noise {
    pub(super) kind: NoiseKind,
    /// The spacing of noise evaluations, in samples.
    pub(super) lattice: u32,
    /// The least gradient that distances are computed with, so that they stay small where the noise is flat.
    pub(super) flattest: f64,
    /// The steepest gradient of the noise.
    pub(super) steepest: f64,
}

pub(super) enum NoiseKind {
    /// Points where the noise is above the threshold.
    Caves { noise: Octaves, threshold: f64 },
    /// Points where the length of the vector of both noises is below the width.
    Tunnels { noises: Box<[Octaves; 2]>, width: f64, radius: f64 },
}

/// The difference between the seeds of both noises of tunnels.
const OTHER_SEED: u32 = 0x51ED;

/// The mark of points whose material comes from the landscape's rules; lower values are a shape's material.
pub(super) const BY_RULES: u16 = 256;

/// A box of samples to evaluate or to bound.
pub(super) struct QueryBox<'a> {
    /// Its lowest and highest coordinates. Units: world.
    pub(super) sides: [Interval; 3],
    /// World units between samples.
    pub(super) spacing: f64,
    /// What the samples' level of detail shows.
    pub(super) detail: Detail,
    /// The distance from the surface beyond which exact distances do not matter. Units: world.
    pub(super) reach: f64,
    /// The distance that samples must have from the surface for a bound to be certain. Units: world.
    pub(super) margin: f64,
    /// Whether grounds keep the margin in the distances of their samples, instead of only along y.
    pub(super) strictly: bool,
    /// The columns of the grounds, if bounds are to use them.
    pub(super) columns: Option<ColumnWindow<'a>>,
}

/// A window into the columns of all grounds.
#[derive(Clone)]
pub(super) struct ColumnWindow<'a> {
    /// All columns of each ground, by the ground's number; x fastest.
    pub(super) columns: &'a [Vec<Column>],
    /// The number of columns along x.
    pub(super) width: usize,
    /// The columns that lie in the box, along x and z.
    pub(super) part: [Range<usize>; 2],
}

/// The bounds of a solid in a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownDistance {
    /// The interval of all distances. Units: world.
    pub(super) distance: Interval,
    /// The interval of all distances, widened by the margin on both sides. Units: world.
    pub(super) with_margin: Interval,
    /// The one material of solid samples, or [`BY_RULES`]; `None` if it is not certain.
    pub(super) matter: Option<u16>,
}

impl KnownDistance {
    fn new(distance: Interval, region: &QueryBox, matter: Option<u16>) -> Self {
        let with_margin = Interval { low: distance.low - region.margin, high: distance.high + region.margin };
        Self { distance, with_margin, matter }
    }

    /// Applies a function to both intervals.
    fn map(self, through: impl Fn(Interval) -> Interval) -> Self {
        Self { distance: through(self.distance), with_margin: through(self.with_margin), ..self }
    }
}

impl Body {
    /// Prepares a valid solid. `grounds`: the number of grounds so far.
    pub(super) fn new(solid: &Solid, grounds: &mut usize) -> Self {
        let mut all = |parts: &[Solid]| parts.iter().map(|part| Self::new(part, grounds)).collect::<Vec<_>>();
        match solid {
            Solid::Everything => Self::Everything,
            Solid::Ground(heights) => {
                let field = Field::new(heights);
                // Along both axes at once.
                let steepest = core::f64::consts::SQRT_2 * field.lipschitz();
                let number = *grounds;
                *grounds += 1;
                Self::Ground(Box::new(Ground { range: field.range(), columns: Columns::new(field), steepest, number }))
            }
            Solid::Caves(caves) => Self::Noise(Box::new(Noise::caves(caves))),
            Solid::Tunnels(tunnels) => Self::Noise(Box::new(Noise::tunnels(tunnels))),
            Solid::Shape(shape) => Self::Shape(shape.clone()),
            Solid::Union(parts) => Self::Union(all(parts)),
            Solid::Intersection(parts) => Self::Cut { parts: all(parts), sign: 1.0 },
            Solid::Subtraction(parts) => Self::Cut { parts: all(parts), sign: -1.0 },
        }
    }

    /// All grounds, in the order of their numbers.
    pub(super) fn grounds(&self) -> Vec<&Ground> {
        match self {
            Self::Ground(ground) => vec![ground],
            Self::Everything | Self::Noise(_) | Self::Shape(_) => Vec::new(),
            Self::Union(parts) | Self::Cut { parts, .. } => parts.iter().flat_map(Self::grounds).collect(),
        }
    }

    /// The bounds of the solid in a box. `noisily`: whether to evaluate noise for them, once for each noise.
    pub(super) fn known(&self, region: &QueryBox, noisily: bool, calls: &mut u64) -> KnownDistance {
        match self {
            Self::Everything => KnownDistance::new(Interval::exactly(f64::NEG_INFINITY), region, Some(BY_RULES)),
            Self::Ground(ground) => ground.known(region, noisily, calls),
            Self::Noise(noise) => KnownDistance::new(noise.distance(region, noisily, calls), region, Some(BY_RULES)),
            Self::Shape(shape) => {
                let (center, radius) = region.ball();
                let distance = shape.sample(center).0;
                let rounding = 1e-9 * (distance.abs() + radius + center.length());
                let more = radius + if rounding.is_finite() { rounding } else { 0.0 };
                let distance = Interval { low: distance - more, high: distance + more };
                let material = if distance.low < 0.0 { shape.only_material_around(center, radius) } else { None };
                KnownDistance::new(distance, region, material.map(u16::from))
            }
            Self::Union(parts) => {
                let parts = parts.iter().map(|part| part.known(region, noisily, calls).map(|d| far(d, region.reach)));
                parts.reduce(nearer).unwrap_or(AIR)
            }
            Self::Cut { parts, sign } => {
                let Some((first, others)) = parts.split_first() else { return AIR };
                others.iter().fold(first.known(region, noisily, calls), |so_far, other| {
                    // A solid that is far from the box already need not be cut.
                    let margin = region.cut_margin();
                    if so_far.distance.low >= margin {
                        return so_far;
                    }
                    let signed = |d: Interval| if *sign < 0.0 { d.negated() } else { d };
                    let cut = other.known(region, noisily, calls).map(|d| deep(signed(d), region.reach));
                    let mut distance = so_far.distance.max(cut.distance);
                    if so_far.distance.high >= margin {
                        distance.low = distance.low.min(margin);
                    }
                    KnownDistance {
                        distance,
                        with_margin: so_far.with_margin.max(cut.with_margin),
                        matter: so_far.matter,
                    }
                })
            }
        }
    }
}

/// The bounds of an empty solid.
const AIR: KnownDistance = {
    let far = Interval { low: f64::INFINITY, high: f64::INFINITY };
    KnownDistance { distance: far, with_margin: far, matter: Some(BY_RULES) }
};

/// The bounds of the union of two solids.
fn nearer(a: KnownDistance, b: KnownDistance) -> KnownDistance {
    let matter = if b.distance.low >= 0.0 || a.distance.high < b.distance.low || a.matter == b.matter {
        a.matter
    } else if a.distance.low >= 0.0 || b.distance.high < a.distance.low {
        b.matter
    } else {
        None
    };
    KnownDistance { distance: a.distance.min(b.distance), with_margin: a.with_margin.min(b.with_margin), matter }
}

/// Replaces distances outside the solid that are out of reach by infinity.
fn far(distance: Interval, reach: f64) -> Interval {
    distance.through(|d| if d >= reach { f64::INFINITY } else { d })
}

/// Replaces distances inside the solid that are out of reach by minus infinity.
fn deep(distance: Interval, reach: f64) -> Interval {
    distance.through(|d| if d <= -reach { f64::NEG_INFINITY } else { d })
}

impl QueryBox<'_> {
    /// The distance outside a solid from which on it is not cut. Units: world.
    pub(super) fn cut_margin(&self) -> f64 {
        crate::source::BOUND_MARGIN * self.spacing
    }

    /// The smallest ball around the box.
    pub(super) fn ball(&self) -> (DVec3, f64) {
        let [center, half] = [Interval::middle, Interval::half].map(|of| DVec3::from(self.sides.map(of)));
        (center, half.length())
    }
}

impl Ground {
    fn known(&self, region: &QueryBox, noisily: bool, calls: &mut u64) -> KnownDistance {
        let [x, y, z] = region.sides;
        let Some(window) = &region.columns else {
            let heights = if noisily {
                self.columns.field().within(region.detail, x, z, calls).within(self.range)
            } else {
                self.range
            };
            let above = y.plus(heights.negated());
            let flat = 1.0 / (1.0 + self.steepest * self.steepest).sqrt();
            // On a slope, distances are smaller than heights above it; their sign is the same.
            let low = if above.low > 0.0 { above.low * flat } else { above.low };
            let high = if above.high < 0.0 { above.high * flat } else { above.high };
            let known = KnownDistance::new(Interval { low, high }, region, Some(BY_RULES));
            // Far from the ground, heights give better bounds than the steepest possible slope.
            let with_margin = Interval { low: above.low - region.margin, high: above.high + region.margin };
            return if region.strictly { known } else { KnownDistance { with_margin, ..known } };
        };
        let mut distance = Interval::NOTHING;
        for row in window.part[1].clone() {
            let columns = &window.columns[self.number][window.width * row..];
            for column in &columns[window.part[0].clone()] {
                let [low, high] = [y.low, y.high].map(|y| column.distance(y - column.height));
                distance = Interval { low: distance.low.min(low), high: distance.high.max(high) };
            }
        }
        KnownDistance::new(distance, region, Some(BY_RULES))
    }
}

impl Noise {
    fn caves(caves: &Caves) -> Self {
        let noise = Octaves::new(&caves.noise);
        let (flattest, steepest) = (noise.typical_gradient() / 4.0, noise.lipschitz_3d());
        let kind = NoiseKind::Caves { noise, threshold: caves.threshold };
        Self { kind, lattice: caves.lattice, flattest, steepest }
    }

    fn tunnels(tunnels: &Tunnels) -> Self {
        let other = Fractal { seed: tunnels.noise.seed.wrapping_add(OTHER_SEED), ..tunnels.noise };
        let noises = [&tunnels.noise, &other].map(Octaves::new);
        let typical = noises[0].typical_gradient();
        let steepest = core::f64::consts::SQRT_2 * noises[0].lipschitz_3d();
        let radius = tunnels.radius;
        let kind = NoiseKind::Tunnels { noises: Box::new(noises), width: radius * typical, radius };
        Self { kind, lattice: tunnels.lattice, flattest: typical / 4.0, steepest }
    }

    /// The distance of all points, if the samples of a level of detail show none of the noise.
    ///
    /// Caves are then everywhere or nowhere, and tunnels of less than two spacings are nowhere: what is left of a thin
    /// tunnel would be a row of bubbles. The noise of other tunnels is left as it is, since their walls follow its
    /// zeros, and is hardly ever finer than they are wide.
    pub(super) fn constant(&self, detail: Detail) -> Option<f64> {
        match &self.kind {
            NoiseKind::Caves { noise, threshold } => {
                let value = noise.constant_3d(detail)?;
                Some(if value > *threshold { f64::NEG_INFINITY } else { f64::INFINITY })
            }
            NoiseKind::Tunnels { radius, .. } => (!detail.shows(2.0 * radius)).then_some(f64::INFINITY),
        }
    }

    /// What a level of detail shows of the noise.
    pub(super) fn shown(&self, detail: Detail) -> Detail {
        match &self.kind {
            NoiseKind::Caves { .. } => detail,
            NoiseKind::Tunnels { .. } => Detail::FINEST,
        }
    }

    /// The interval of all distances in a box.
    fn distance(&self, region: &QueryBox, noisily: bool, calls: &mut u64) -> Interval {
        if let Some(distance) = self.constant(region.detail) {
            return Interval::exactly(distance);
        }
        let detail = self.shown(region.detail);
        let (center, radius) = region.ball();
        // Interpolated noise depends on noise up to a cell of the lattice away.
        let more = if self.lattice > 1 { f64::from(self.lattice) * region.spacing * 3.0_f64.sqrt() } else { 0.0 };
        let mut around = |octaves: &Octaves| {
            if !noisily {
                return octaves.range();
            }
            let (interval, more) = octaves.around(detail, center.to_array(), radius + more);
            *calls += more;
            interval
        };
        let above = match &self.kind {
            NoiseKind::Caves { noise, threshold } => Interval::exactly(*threshold).plus(around(noise).negated()),
            NoiseKind::Tunnels { noises, width, .. } => {
                let [a, b] = [&noises[0], &noises[1]].map(|noise| around(noise).abs());
                let length = Interval { low: a.low.hypot(b.low), high: f64::INFINITY };
                length.plus(Interval::exactly(-width))
            }
        };
        let [low, high] = [(above.low, above.low < 0.0), (above.high, above.high > 0.0)]
            .map(|(above, outer)| above / if outer { self.flattest } else { self.steepest });
        Interval { low, high }
    }
}
