//! [`PreparedBody`]: a [`Body`] prepared for one region, and evaluated row by row.

use core::ops::Range;

use bevy_math::DVec3;
use marchless::SourceRegion;

use super::body::{BY_RULES, Body, Noise, NoiseKind, QueryBox};
use crate::source::Sdf;
use crate::source::detail::Detail;
use crate::source::height_field::Column;
use crate::source::octaves::Octaves;
use crate::source::perlin::NoiseRow;

/// The samples of a row.
#[derive(Clone)]
pub(super) struct Row {
    /// The signed distance of each sample. Units: world.
    pub(super) distance: Vec<f32>,
    /// The y part of the surface's normal at each sample, as materials see it: 1 on a floor, 0 at a wall, −1 under a
    /// ceiling.
    pub(super) up: Vec<f32>,
    /// The material of each sample, or [`BY_RULES`].
    pub(super) matter: Vec<u16>,
}

/// The position of a row, and the distances that matter for it.
pub(super) struct Line<'a> {
    /// Local y and z.
    pub(super) index: [u32; 2],
    /// The coordinates of its samples. Units: world.
    pub(super) xs: &'a [f64],
    pub(super) y: f64,
    pub(super) z: f64,
    /// The distance of [`QueryBox::cut_margin`].
    pub(super) cut_margin: f32,
    /// The distance of [`QueryBox::reach`].
    pub(super) reach: f32,
}

/// A [`Body`] prepared for one region, without the parts that cannot matter there.
pub(super) enum PreparedBody<'a> {
    /// The same distance everywhere: infinite, and −∞ if everything is solid.
    Constant(f32),
    Ground(&'a [Column]),
    Noise(Box<NoiseSamples<'a>>),
    Shape(Sdf),
    Union {
        parts: Vec<PreparedBody<'a>>,
        row: Row,
    },
    Cut {
        parts: Vec<PreparedBody<'a>>,
        sign: f32,
        row: Row,
    },
}

impl Row {
    pub(super) fn new(len: usize) -> Self {
        Self { distance: vec![0.0; len], up: vec![0.0; len], matter: vec![BY_RULES; len] }
    }

    /// Sets all samples in `range` to one distance and slope, with the material of the rules.
    fn fill(&mut self, range: Range<usize>, distance: f32, up: f32) {
        self.distance[range.clone()].fill(distance);
        self.up[range.clone()].fill(up);
        self.matter[range].fill(BY_RULES);
    }
}

impl<'a> PreparedBody<'a> {
    /// Prepares a body for a region. `columns`: those of each ground, by its number.
    pub(super) fn new(body: &'a Body, samples: &SourceRegion, region: &QueryBox, columns: &'a [Vec<Column>]) -> Self {
        let row = || Row::new(samples.size[0] as usize);
        match body {
            Body::Everything => Self::Constant(f32::NEG_INFINITY),
            Body::Ground(ground) => Self::Ground(&columns[ground.number]),
            Body::Noise(noise) => match noise.constant(region.detail) {
                Some(distance) => Self::Constant(distance as f32),
                None => Self::Noise(Box::new(NoiseSamples::new(noise, samples, region.detail))),
            },
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
                Self::Cut { parts, sign: *sign as f32, row: row() }
            }
        }
    }

    /// Evaluates the samples of a row that lie in `range`. Each sample depends only on its position.
    ///
    /// Loops over samples are written out, over slices of one length, so that the compiler vectorises them.
    pub(super) fn evaluate(&mut self, line: &Line, range: Range<usize>, out: &mut Row, calls: &mut u64) {
        match self {
            Self::Constant(distance) => out.fill(range, *distance, 1.0),
            Self::Ground(columns) => {
                let columns = &columns[line.xs.len() * line.index[1] as usize..][range.clone()];
                out.matter[range.clone()].fill(BY_RULES);
                let (distances, ups) = (&mut out.distance[range.clone()], &mut out.up[range]);
                for ((column, distance), up) in columns.iter().zip(distances).zip(ups) {
                    *distance = column.distance(line.y - column.height) as f32;
                    *up = column.material_up as f32;
                }
            }
            Self::Noise(samples) => samples.evaluate(line, range, out, calls),
            Self::Shape(shape) => {
                for index in range {
                    let position = DVec3::new(line.xs[index], line.y, line.z);
                    let (distance, material) = shape.sample(position);
                    out.distance[index] = distance as f32;
                    out.matter[index] = u16::from(material);
                    // As at a wall: a shape's own samples need no slope, and the parts it cuts mostly get walls.
                    out.up[index] = 0.0;
                }
            }
            Self::Union { parts, row } => {
                out.fill(range.clone(), f32::INFINITY, 1.0);
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
                    return out.fill(range, f32::INFINITY, 1.0);
                };
                first.evaluate(line, range.clone(), out, calls);
                for other in others {
                    let near = |index: &usize| out.distance[*index] < line.cut_margin;
                    let Some(start) = range.clone().find(near) else { return };
                    let end = range.clone().rev().find(near).map_or(start, |last| last + 1);
                    other.evaluate(line, start..end, row, calls);
                    let len = end - start;
                    let (cuts, cut_ups) = (&row.distance[start..end][..len], &row.up[start..end][..len]);
                    let (distances, ups) = (&mut out.distance[start..end][..len], &mut out.up[start..end][..len]);
                    for index in 0..len {
                        let (before, cut) = (distances[index], *sign * cuts[index]);
                        let is_cut = (before < line.cut_margin) & (cut > before) & (cut > -line.reach);
                        distances[index] = if is_cut { cut } else { before };
                        ups[index] = if is_cut { *sign * cut_ups[index] } else { ups[index] };
                    }
                }
            }
        }
    }
}

/// Samples of 3-D noise, evaluated at each point of a region or interpolated between every n-th point.
pub(super) struct NoiseSamples<'a> {
    noise: &'a Noise,
    detail: Detail,
    /// The noise at the samples of a row.
    rows: [NoiseRow; 2],
    /// The excess of the first noise over the values that tunnels allow; negative where tunnels are possible.
    too_far: Vec<f32>,
    lattice: Option<NoiseLattice>,
}

impl<'a> NoiseSamples<'a> {
    fn new(noise: &'a Noise, region: &SourceRegion, detail: Detail) -> Self {
        let lattice = (noise.lattice > 1).then(|| NoiseLattice::new(noise.lattice, region));
        Self { noise, detail: noise.shown(detail), rows: Default::default(), too_far: Vec::new(), lattice }
    }

    fn evaluate(&mut self, line: &Line, range: Range<usize>, out: &mut Row, calls: &mut u64) {
        self.noise(0, line, range.clone(), calls);
        match &self.noise.kind {
            NoiseKind::Caves { threshold, .. } => self.caves(*threshold as f32, range, out),
            NoiseKind::Tunnels { width, .. } => self.tunnels(*width as f32, line, range, out, calls),
        }
    }

    /// Evaluates the noise `which`, 0 or 1, for a row.
    fn noise(&mut self, which: usize, line: &Line, range: Range<usize>, calls: &mut u64) {
        let octaves = match &self.noise.kind {
            NoiseKind::Caves { noise, .. } => noise,
            NoiseKind::Tunnels { noises, .. } => &noises[which],
        };
        let row = &mut self.rows[which];
        *calls += match &mut self.lattice {
            None => octaves.row_3d(self.detail, &line.xs[range], line.y, line.z, row),
            Some(lattice) => lattice.row(which, (octaves, self.detail), line.index, range, row),
        };
    }

    fn caves(&self, threshold: f32, range: Range<usize>, out: &mut Row) {
        let (flattest, len) = (self.noise.flattest as f32, range.len());
        let NoiseRow { value, gradient: [by_x, by_y, by_z], .. } = &self.rows[0];
        let (value, by_x, by_y, by_z) = (&value[..len], &by_x[..len], &by_y[..len], &by_z[..len]);
        out.matter[range.clone()].fill(BY_RULES);
        let (distances, ups) = (&mut out.distance[range.clone()][..len], &mut out.up[range][..len]);
        for index in 0..len {
            let steepness = length([by_x[index], by_y[index], by_z[index]]);
            distances[index] = (threshold - value[index]) / steepness.max(flattest);
            ups[index] = -by_y[index] / steepness.max(f32::MIN_POSITIVE);
        }
    }

    fn tunnels(&mut self, width: f32, line: &Line, range: Range<usize>, out: &mut Row, calls: &mut u64) {
        let (flattest, len) = (self.noise.flattest as f32, range.len());
        // Points far from the zeros of the first noise are far from tunnels, whatever the other noise is.
        self.too_far.clear();
        self.too_far.resize(len, 0.0);
        let NoiseRow { value, gradient: [by_x, by_y, by_z], .. } = &self.rows[0];
        let (value, by_x, by_y, by_z) = (&value[..len], &by_x[..len], &by_y[..len], &by_z[..len]);
        let too_far = &mut self.too_far[..len];
        for index in 0..len {
            let steepness = length([by_x[index], by_y[index], by_z[index]]).max(flattest);
            too_far[index] = value[index].abs() - width - FAR * line.reach * steepness;
        }
        out.fill(range.clone(), f32::INFINITY, 1.0);
        let Some(first) = self.too_far.iter().position(|far| *far < 0.0) else { return };
        let end = self.too_far.iter().rposition(|far| *far < 0.0).map_or(first, |last| last + 1);
        self.noise(1, line, range.start + first..range.start + end, calls);
        let [one, other] = &self.rows;
        for there in 0..end - first {
            let here = first + there;
            if self.too_far[here] >= 0.0 {
                continue;
            }
            let (a, b) = (one.value[here], other.value[there]);
            let both = (a * a + b * b).sqrt();
            let [x, y, z] = [0, 1, 2].map(|axis: usize| {
                let sum = a * one.gradient[axis][here] + b * other.gradient[axis][there];
                sum / both.max(f32::MIN_POSITIVE)
            });
            let steepness = length([x, y, z]);
            out.distance[range.start + here] = (both - width) / steepness.max(flattest);
            out.up[range.start + here] = y / steepness.max(f32::MIN_POSITIVE);
        }
    }
}

#[inline]
fn length([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

/// The distance from the zeros of the first noise beyond which tunnels are not looked for, as a multiple of the reach.
const FAR: f32 = 1.5;

/// Noise at nodes, which are every n-th lattice point. Each row of nodes is evaluated when it is first needed.
struct NoiseLattice {
    /// The lowest node, in nodes.
    first: [i64; 3],
    /// Nodes per axis.
    size: [usize; 3],
    /// For each sample along each axis, the node below it, and its place between that node and the next, from 0 to 1.
    places: [Vec<(usize, f32)>; 3],
    /// The coordinates of nodes along x. Units: world.
    xs: Vec<f64>,
    /// World units between nodes.
    step: f64,
    /// The rows of both noises along x, for each y and z, y fastest.
    rows: [Vec<Option<NoiseRow>>; 2],
    /// The noise at the nodes of the row that is being interpolated.
    nodes: Vec<[f32; 4]>,
}

impl NoiseLattice {
    fn new(every: u32, region: &SourceRegion) -> Self {
        let every = i64::from(every);
        let first = region.min.map(|min| i64::from(min).div_euclid(every));
        let places = [0, 1, 2].map(|axis| {
            let positions = (0..region.size[axis]).map(|index| i64::from(region.min[axis]) + i64::from(index));
            let place = |position: i64| {
                let node = position.div_euclid(every) - first[axis];
                (node as usize, position.rem_euclid(every) as f32 / every as f32)
            };
            positions.map(place).collect::<Vec<_>>()
        });
        let size = [0, 1, 2].map(|axis| places[axis].last().map_or(0, |(node, _)| node + 2));
        let step = every as f64 * region.spacing;
        let xs = (0..size[0] as i64).map(|node| (first[0] + node) as f64 * step).collect();
        let rows = [(); 2].map(|()| vec![None; size[1] * size[2]]);
        Self { first, size, places, xs, step, rows, nodes: Vec::new() }
    }

    /// Interpolates the row with this local y and z, and returns the number of noise evaluations. A value depends only
    /// on its position, whatever the region.
    fn row(
        &mut self,
        which: usize,
        (octaves, detail): (&Octaves, Detail),
        line: [u32; 2],
        range: Range<usize>,
        row: &mut NoiseRow,
    ) -> u64 {
        let mut calls = 0;
        let [(y, share_y), (z, share_z)] = [self.places[1][line[0] as usize], self.places[2][line[1] as usize]];
        let places = &self.places[0][range];
        let (Some((low, _)), Some((last, _))) = (places.first(), places.last()) else { return 0 };
        self.nodes.clear();
        self.nodes.resize(last - low + 2, [0.0; 4]);
        for (step_z, share_z) in [(0, 1.0 - share_z), (1, share_z)] {
            for (step_y, share_y) in [(0, 1.0 - share_y), (1, share_y)] {
                let share = share_y * share_z;
                // Evaluate no noise for a share of zero.
                if share == 0.0 {
                    continue;
                }
                let index = y + step_y + self.size[1] * (z + step_z);
                let nodes = self.rows[which][index].get_or_insert_with(|| {
                    let at = |axis: usize, node: usize| (self.first[axis] + node as i64) as f64 * self.step;
                    let mut nodes = NoiseRow::default();
                    calls += octaves.row_3d(detail, &self.xs, at(1, y + step_y), at(2, z + step_z), &mut nodes);
                    nodes
                });
                let NoiseRow { value, gradient: [by_x, by_y, by_z], .. } = nodes;
                for (sum, node) in self.nodes.iter_mut().zip(*low..) {
                    for (sum, value) in sum.iter_mut().zip([value[node], by_x[node], by_y[node], by_z[node]]) {
                        *sum += share * value;
                    }
                }
            }
        }
        row.reset(places.len());
        let NoiseRow { value, gradient: [by_x, by_y, by_z], .. } = row;
        let out = value.iter_mut().zip(by_x).zip(by_y).zip(by_z);
        for ((((value, by_x), by_y), by_z), (node, share)) in out.zip(places) {
            let [a, b] = [self.nodes[node - low], self.nodes[node - low + 1]];
            let at: [f32; 4] = core::array::from_fn(|which| a[which] + share * (b[which] - a[which]));
            [*value, *by_x, *by_y, *by_z] = at;
        }
        calls
    }
}
