//! [`Part`]: a [`Body`] made ready for one region, and evaluated row by row.

use core::ops::Range;

use bevy_math::DVec3;
use marchless::SourceRegion;

use super::body::{BY_RULES, Body, Noise, NoiseKind, Region};
use crate::source::Sdf;
use crate::source::height_field::Column;
use crate::source::octaves::Octaves;
use crate::source::perlin::NoiseRow;

/// The samples of a row.
#[derive(Clone)]
pub(super) struct Row {
    /// Units: world.
    pub(super) distance: Vec<f64>,
    /// How much of the way out of the surface leads up: 1 on a floor, 0 at a wall, −1 under a ceiling.
    pub(super) up: Vec<f64>,
    /// The material, or [`BY_RULES`].
    pub(super) matter: Vec<u16>,
}

/// Which row.
pub(super) struct Line<'a> {
    /// Local y and z.
    pub(super) index: [u32; 2],
    /// The coordinates of its samples. Units: world.
    pub(super) xs: &'a [f64],
    pub(super) y: f64,
    pub(super) z: f64,
    /// As of [`Region::room`].
    pub(super) room: f64,
    /// As of [`Region::reach`].
    pub(super) reach: f64,
}

/// A [`Body`] made ready for one region: what cannot matter there is left out.
pub(super) enum Part<'a> {
    Everything,
    Ground(&'a [Column]),
    Noise(Box<Samples<'a>>),
    Shape(Sdf),
    Union { parts: Vec<Part<'a>>, row: Row },
    Cut { parts: Vec<Part<'a>>, sign: f64, row: Row },
}

impl Row {
    pub(super) fn new(len: usize) -> Self {
        Self { distance: vec![0.0; len], up: vec![0.0; len], matter: vec![BY_RULES; len] }
    }

    fn set(&mut self, index: usize, distance: f64, up: f64) {
        self.distance[index] = distance;
        self.up[index] = up;
        self.matter[index] = BY_RULES;
    }
}

impl<'a> Part<'a> {
    /// `columns`: those of each ground, by its number.
    pub(super) fn new(body: &'a Body, samples: &SourceRegion, region: &Region, columns: &'a [Vec<Column>]) -> Self {
        let row = || Row::new(samples.size[0] as usize);
        match body {
            Body::Everything => Self::Everything,
            Body::Ground(ground) => Self::Ground(&columns[ground.number]),
            Body::Noise(noise) => Self::Noise(Box::new(Samples::new(noise, samples))),
            Body::Shape(shape) => {
                let (center, radius) = region.ball();
                Self::Shape(shape.pruned(center, radius + samples.spacing))
            }
            Body::Union(parts) => {
                let near = parts.iter().filter(|part| part.known(region, false, &mut 0).distance.low < region.reach);
                let parts = near.map(|part| Self::new(part, samples, region, columns)).collect();
                Self::Union { parts, row: row() }
            }
            Body::Cut { parts, sign } => {
                let cuts = |(index, part): &(usize, &Body)| {
                    let known = part.known(region, false, &mut 0).distance;
                    *index == 0 || if *sign < 0.0 { known.low < region.reach } else { known.high > -region.reach }
                };
                let parts = parts.iter().enumerate().filter(cuts);
                let parts = parts.map(|(_, part)| Self::new(part, samples, region, columns)).collect();
                Self::Cut { parts, sign: *sign, row: row() }
            }
        }
    }

    /// Evaluates the samples of a row that lie in `range`. Each depends on nothing but its position.
    pub(super) fn evaluate(&mut self, line: &Line, range: Range<usize>, out: &mut Row, calls: &mut u64) {
        match self {
            Self::Everything => range.for_each(|index| out.set(index, f64::NEG_INFINITY, 1.0)),
            Self::Ground(columns) => {
                let columns = &columns[line.xs.len() * line.index[1] as usize..];
                for index in range {
                    let column = &columns[index];
                    let up = 1.0 / (1.0 + column.slope * column.slope).sqrt();
                    out.set(index, column.distance(line.y - column.height), up);
                }
            }
            Self::Noise(samples) => samples.evaluate(line, range, out, calls),
            Self::Shape(shape) => {
                for index in range {
                    let position = DVec3::new(line.xs[index], line.y, line.z);
                    let (distance, material) = shape.sample(position);
                    out.distance[index] = distance;
                    out.matter[index] = u16::from(material);
                    // As of a wall: a shape's own samples need no slope, and what it cuts has walls most of all.
                    out.up[index] = 0.0;
                }
            }
            Self::Union { parts, row } => {
                range.clone().for_each(|index| out.set(index, f64::INFINITY, 1.0));
                for part in parts {
                    part.evaluate(line, range.clone(), row, calls);
                    for index in range.clone() {
                        let distance = row.distance[index];
                        if distance < out.distance[index] && distance < line.reach {
                            out.distance[index] = distance;
                            out.up[index] = row.up[index];
                            out.matter[index] = row.matter[index];
                        }
                    }
                }
            }
            Self::Cut { parts, sign, row } => {
                let Some((first, others)) = parts.split_first_mut() else {
                    return range.for_each(|index| out.set(index, f64::INFINITY, 1.0));
                };
                first.evaluate(line, range.clone(), out, calls);
                for other in others {
                    let near = |index: &usize| out.distance[*index] < line.room;
                    let Some(start) = range.clone().find(near) else { return };
                    let end = range.clone().rev().find(near).map_or(start, |last| last + 1);
                    other.evaluate(line, start..end, row, calls);
                    for index in start..end {
                        let distance = *sign * row.distance[index];
                        let before = out.distance[index];
                        if before < line.room && distance > before && distance > -line.reach {
                            out.distance[index] = distance;
                            out.up[index] = *sign * row.up[index];
                        }
                    }
                }
            }
        }
    }
}

/// Samples of 3-D noise, at each of a region's lattice points or interpolated between every n-th.
pub(super) struct Samples<'a> {
    noise: &'a Noise,
    /// The noise at the samples of a row.
    rows: [NoiseRow; 2],
    lattice: Option<Lattice>,
}

impl<'a> Samples<'a> {
    fn new(noise: &'a Noise, region: &SourceRegion) -> Self {
        let lattice = (noise.lattice > 1).then(|| Lattice::new(noise.lattice, region));
        Self { noise, rows: Default::default(), lattice }
    }

    fn evaluate(&mut self, line: &Line, range: Range<usize>, out: &mut Row, calls: &mut u64) {
        let Self { noise, rows: [row, other], lattice } = self;
        let mut evaluate = |which: usize, range: Range<usize>, row: &mut NoiseRow| {
            let octaves = match &noise.kind {
                NoiseKind::Caves { noise, .. } => noise,
                NoiseKind::Tunnels { noises, .. } => &noises[which],
            };
            match lattice {
                None => *calls += octaves.row_3d(&line.xs[range], line.y, line.z, row),
                Some(lattice) => lattice.row(which, octaves, line, range, row, calls),
            }
        };
        evaluate(0, range.clone(), row);
        let [by_x, by_y, by_z] = &row.gradient;
        match &noise.kind {
            NoiseKind::Caves { threshold, .. } => {
                for (local, index) in range.enumerate() {
                    let [x, y, z] = [by_x[local], by_y[local], by_z[local]];
                    let steepness = (x * x + y * y + z * z).sqrt();
                    let distance = (threshold - row.value[local]) / steepness.max(noise.flattest);
                    out.set(index, distance, -y / steepness.max(f64::MIN_POSITIVE));
                }
            }
            NoiseKind::Tunnels { width, .. } => {
                // What is far from where the first noise is 0 is far from the tunnels, whatever the other noise is.
                let far = |local: usize| {
                    let [x, y, z] = [by_x[local], by_y[local], by_z[local]];
                    let steepness = (x * x + y * y + z * z).sqrt().max(noise.flattest);
                    row.value[local].abs() - width >= FAR * line.reach * steepness
                };
                let len = range.len();
                let start = (0..len).find(|local| !far(*local)).unwrap_or(len);
                let end = (start..len).rev().find(|local| !far(*local)).map_or(start, |last| last + 1);
                if start < end {
                    evaluate(1, range.start + start..range.start + end, other);
                }
                for (local, index) in range.enumerate() {
                    if far(local) {
                        out.set(index, f64::INFINITY, 1.0);
                        continue;
                    }
                    let there = local - start;
                    let (a, b) = (row.value[local], other.value[there]);
                    let length = (a * a + b * b).sqrt();
                    let [x, y, z] = [0, 1, 2].map(|axis: usize| {
                        let sum = a * row.gradient[axis][local] + b * other.gradient[axis][there];
                        sum / length.max(f64::MIN_POSITIVE)
                    });
                    let steepness = (x * x + y * y + z * z).sqrt();
                    let distance = (length - width) / steepness.max(noise.flattest);
                    out.set(index, distance, y / steepness.max(f64::MIN_POSITIVE));
                }
            }
        }
    }
}

/// So many times their reach away, as the first of two noises tells, tunnels are not looked for.
const FAR: f64 = 1.5;

/// Noise at every n-th lattice point, each row of it evaluated when it is first needed.
struct Lattice {
    every: i64,
    /// The lowest sample's position.
    min: [i64; 3],
    /// The lowest node, in nodes.
    first: [i64; 3],
    /// Nodes per axis.
    size: [usize; 3],
    /// Coordinates of nodes along x. Units: world.
    xs: Vec<f64>,
    spacing: f64,
    /// For both noises, along x for each y and z, y first.
    rows: [Vec<Option<NoiseRow>>; 2],
    /// Noise at the nodes of the line that is being interpolated.
    nodes: Vec<[f64; 4]>,
}

impl Lattice {
    fn new(every: u32, region: &SourceRegion) -> Self {
        let every = i64::from(every);
        let min = region.min.map(i64::from);
        let first = min.map(|min| min.div_euclid(every));
        let size = [0, 1, 2].map(|axis| {
            let last = (min[axis] + i64::from(region.size[axis]) - 1).div_euclid(every) + 1;
            (last - first[axis] + 1) as usize
        });
        let xs = (0..size[0] as i64).map(|node| ((first[0] + node) * every) as f64 * region.spacing).collect();
        let rows = [(); 2].map(|()| vec![None; size[1] * size[2]]);
        Self { every, min, first, size, xs, spacing: region.spacing, rows, nodes: Vec::new() }
    }

    /// Interpolates a row. A value depends on nothing but its position, whatever the region.
    fn row(
        &mut self,
        which: usize,
        octaves: &Octaves,
        line: &Line,
        range: Range<usize>,
        row: &mut NoiseRow,
        calls: &mut u64,
    ) {
        let node = |axis: usize, index: usize| {
            let position = self.min[axis] + index as i64;
            let node = position.div_euclid(self.every);
            ((node - self.first[axis]) as usize, (position - node * self.every) as f64 / self.every as f64)
        };
        let [(y, share_y), (z, share_z)] = [node(1, line.index[0] as usize), node(2, line.index[1] as usize)];
        let (low, high) = (node(0, range.start).0, node(0, range.end - 1).0 + 1);
        let places: Vec<(usize, f64)> = range.map(|index| node(0, index)).collect();
        self.nodes.clear();
        self.nodes.resize(high - low + 1, [0.0; 4]);
        for (step_z, share_z) in [(0, 1.0 - share_z), (1, share_z)] {
            for (step_y, share_y) in [(0, 1.0 - share_y), (1, share_y)] {
                let share = share_y * share_z;
                // Also so that no noise is evaluated for a share of nothing.
                if share == 0.0 {
                    continue;
                }
                let index = y + step_y + self.size[1] * (z + step_z);
                let nodes = self.rows[which][index].get_or_insert_with(|| {
                    let at = |axis: usize, node: usize| {
                        ((self.first[axis] + node as i64) * self.every) as f64 * self.spacing
                    };
                    let mut nodes = NoiseRow::default();
                    *calls += octaves.row_3d(&self.xs, at(1, y + step_y), at(2, z + step_z), &mut nodes);
                    nodes
                });
                for (sum, node) in self.nodes.iter_mut().zip(low..) {
                    let [x, y, z] = &nodes.gradient;
                    for (sum, value) in sum.iter_mut().zip([nodes.value[node], x[node], y[node], z[node]]) {
                        *sum += share * value;
                    }
                }
            }
        }
        row.reset(places.len());
        for (index, (node, share)) in places.into_iter().enumerate() {
            let [a, b] = [self.nodes[node - low], self.nodes[node - low + 1]];
            let [value, x, y, z] = core::array::from_fn(|which| a[which] + share * (b[which] - a[which]));
            row.value[index] = value;
            for (gradient, value) in row.gradient.iter_mut().zip([x, y, z]) {
                gradient[index] = value;
            }
        }
    }
}
