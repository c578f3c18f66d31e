//! Sharp placement: a batch's vertices where the squared distances to the planes at their crossings are least.
//!
//! The plane at a crossing needs the slope of the samples on the crossing's own side of a crease. Central differences
//! mix both sides; so do differences within the cell, if the crease runs through it. Hence each corner has the slopes
//! of the side on which the samples go straight on ([`slope`]), and a crossing has those of the end of its edge without
//! a crease. The bench `quality` tells how far off vertices lie.

use alloc::vec::Vec;
use core::ops::Range;

use super::{
    Offset, STEPS, VertexKind,
    cells::VertexList,
    place::{BATCH, Batch, CORNERS, CellSlabs, whole, within_cell},
    quadric::{Least, Quadric, REACH, dot, turn, without_tiny},
};
use crate::{
    math::sqrt,
    mesher::crossing::{crossing_fraction, interpolated, snapped},
    sample::{Weight, is_sound, private::Sealed},
    simd::{Backend, Job, Simd, dispatch},
};

/// One number for each vertex of a batch.
type Lanes = [f32; BATCH];

/// The planes of a batch: all of it is `f32`, so that it is compiled once for all types of weights.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    /// The samples around each cell; see [`corner_sample`] and [`outer_sample`].
    samples: Vec<Lanes>,
    /// The slopes along each axis at each corner: `8 · axis + corner`. From 24 on, 1 if the samples go straight on
    /// there, else 0.
    slopes: Vec<Lanes>,
    /// The parts of each vertex's [`Quadric`], in its order.
    quadrics: Vec<Lanes>,
    /// Where the planes have each vertex, from the middle of its cell; before, the mean of its crossings.
    at: Vec<Lanes>,
    /// The number of directions that the planes tell; 0 if there are none.
    directions: Vec<Lanes>,
    /// The parts of each quadric's matrix on its way to a diagonal one, in the order of [`Quadric`]; then the parts of
    /// the three eigenvectors. At last, the eigenvalues that say nothing are 0.
    eigen: Vec<Lanes>,
}

/// The number of a corner's sample among those of a cell.
const fn corner_sample(corner: usize) -> usize {
    corner
}

/// The number of the sample next to a corner along an axis, outside of the cell.
const fn outer_sample(corner: usize, axis: usize) -> usize {
    8 + 8 * axis + corner
}

impl Planes {
    /// It allocates nothing until the first sharp vertex.
    pub(super) const fn new() -> Self {
        Self {
            samples: Vec::new(),
            slopes: Vec::new(),
            quadrics: Vec::new(),
            at: Vec::new(),
            directions: Vec::new(),
            eigen: Vec::new(),
        }
    }

    fn quadric(&self, i: usize) -> Quadric {
        quadric_of(&self.quadrics, i)
    }

    /// Where the quadric is least.
    fn least(&self, i: usize) -> Least {
        let part = |number: usize| self.eigen[number][i];
        Least {
            at: [0, 1, 2].map(|axis: usize| self.at[axis][i]),
            directions: self.directions[0][i],
            values: [0, 1, 2].map(part),
            vectors: [6, 9, 12].map(|first| [part(first), part(first + 1), part(first + 2)]),
        }
    }
}

impl<W: Weight> Batch<W> {
    /// Moves the gathered and placed vertices that `is_sharp` chooses by their number to where their planes have it.
    /// Appends the quadric of each vertex to `quadrics`. `planes`: with the [copied samples](Self::copy_samples).
    /// `offsets`: the places of the vertices.
    #[inline(never)]
    pub(super) fn sharpen(
        &mut self,
        backend: Backend,
        slabs: &CellSlabs<'_, W>,
        list: &VertexList,
        range: Range<usize>,
        planes: &mut Planes,
        is_sharp: impl Fn(usize) -> bool,
        quadrics: &mut Vec<Quadric>,
        offsets: &mut [Offset],
    ) {
        let count = range.len();
        let len = count.next_multiple_of(16);
        planes.at.resize(3, [0.0; BATCH]);
        for (at, offsets) in planes.at.iter_mut().zip(&self.offsets) {
            for (at, &steps) in at.iter_mut().zip(&offsets[..len.min(BATCH)]) {
                *at = steps * (1.0 / STEPS as f32) - 0.5;
            }
        }
        let [xs, ys] = [&list.x, &list.y].map(|all| &all[range.start..][..len]);
        let last = [0, 1].map(|axis| (slabs.layout.size[axis] - 2) as u32);
        let (edges, isovalue) = (&list.edges[range.start..][..len], slabs.isovalue * W::SCALE);
        let one_sided_z = slabs.edges.one_sided;
        dispatch(backend, PlanesJob { xs, ys, last, one_sided_z, edges, count, isovalue, planes });

        for i in 0..count.min(BATCH) {
            if !is_sharp(i) {
                quadrics.push(Quadric::default());
                continue;
            }
            let quadric = planes.quadric(i);
            quadrics.push(quadric);
            let mut point = [0, 1, 2].map(|axis: usize| planes.at[axis][i]);
            if point.iter().any(|v| v.abs() > REACH) {
                let mean = [0, 1, 2].map(|axis: usize| self.offsets[axis][i] * (1.0 / STEPS as f32) - 0.5);
                point = quadric.least_in_cell(mean, &planes.least(i));
            }
            let steps = point.map(rounded);
            for (of_axis, steps) in self.offsets.iter_mut().zip(steps) {
                of_axis[i] = steps;
            }
            let kind = if planes.directions[0][i] > 1.0 { VertexKind::Crease } else { VertexKind::Sharp };
            let [x, y, z] = steps.map(whole);
            offsets[i] = [x, y, z, kind as u16];
        }
    }

    /// Copies the samples of the gathered vertices, `len` of them, for their planes.
    #[inline(always)]
    pub(super) fn copy_samples(&self, planes: &mut Planes, len: usize) {
        planes.samples.resize(32, [0.0; BATCH]);
        let samples: &mut [Lanes; 32] = planes.samples.first_chunk_mut().expect("32 samples are around a cell");
        // Written out, so that all indices are constants.
        self.copy_corner::<0>(samples, len);
        self.copy_corner::<1>(samples, len);
        self.copy_corner::<2>(samples, len);
        self.copy_corner::<3>(samples, len);
        self.copy_corner::<4>(samples, len);
        self.copy_corner::<5>(samples, len);
        self.copy_corner::<6>(samples, len);
        self.copy_corner::<7>(samples, len);
    }

    #[inline(always)]
    fn copy_corner<const CORNER: usize>(&self, samples: &mut [Lanes; 32], len: usize) {
        let (x, y, z) = (CORNER & 1, CORNER >> 1 & 1, CORNER >> 2);
        let (left, right) = &self.rows[CORNER >> 1];
        let (y_side, z_side) = (&self.y_sides[2 * z + y], &self.z_sides[2 * y + z]);
        for i in 0..len.min(BATCH) {
            let row = W::joined(left[i], right[i]);
            samples[corner_sample(CORNER)][i] = W::to_f32(row[1 + x].wide());
            samples[outer_sample(CORNER, 0)][i] = W::to_f32(row[3 * x].wide());
            samples[outer_sample(CORNER, 1)][i] = W::to_f32(W::both(y_side[i])[x].wide());
            samples[outer_sample(CORNER, 2)][i] = W::to_f32(W::both(z_side[i])[x].wide());
        }
    }
}

/// What finds the quadrics of a batch, and where they are least.
struct PlanesJob<'a> {
    /// The cells of the vertices, and those at the high border.
    xs: &'a [u32],
    ys: &'a [u32],
    last: [u32; 2],
    /// Whether samples below the cells along z are missing, and those above.
    one_sided_z: [bool; 2],
    edges: &'a [u16],
    /// Items of these slices from here on are arbitrary.
    count: usize,
    /// In steps.
    isovalue: f32,
    planes: &'a mut Planes,
}

impl Job for PlanesJob<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { planes, .. } = &self;
        debug_assert_eq!((planes.samples.len(), planes.at.len()), (32, 3));
        self.planes.slopes.resize(48, [0.0; BATCH]);
        self.planes.directions.resize(1, [0.0; BATCH]);
        self.planes.eigen.resize(15, [0.0; BATCH]);
        self.planes.quadrics.clear();
        self.planes.quadrics.resize(10, [0.0; BATCH]);
        let mut job = self;
        // Written out: a loop would compute with the numbers of corners and edges.
        job.add_slopes::<0>();
        job.add_slopes::<1>();
        job.add_slopes::<2>();
        job.add_slopes::<3>();
        job.add_slopes::<4>();
        job.add_slopes::<5>();
        job.add_slopes::<6>();
        job.add_slopes::<7>();
        job.add_planes::<0>();
        job.add_planes::<1>();
        job.add_planes::<2>();
        job.add_planes::<3>();
        job.add_planes::<4>();
        job.add_planes::<5>();
        job.add_planes::<6>();
        job.add_planes::<7>();
        job.add_planes::<8>();
        job.add_planes::<9>();
        job.add_planes::<10>();
        job.add_planes::<11>();
        job.start_turns();
        for _ in 0..4 {
            job.turn::<0, 1>();
            job.turn::<0, 2>();
            job.turn::<1, 2>();
        }
        job.find_least();
    }
}

impl PlanesJob<'_> {
    /// Writes the slopes at `CORNER` along all axes.
    #[inline(always)]
    fn add_slopes<const CORNER: usize>(&mut self) {
        let len = self.xs.len().min(BATCH);
        let (xs, ys) = (&self.xs[..len], &self.ys[..len]);
        let samples: &[Lanes; 32] = self.planes.samples.first_chunk().expect("32 samples are around a cell");
        let [last_x, last_y] = self.last;
        let slopes: &mut [[Lanes; 8]; 6] = self.planes.slopes.as_chunks_mut().0.first_chunk_mut().expect("48 parts");
        let [of_x, of_y, of_z, straight_x, straight_y, straight_z] = slopes.each_mut().map(|part| &mut part[CORNER]);
        let is_high = |axis: usize| CORNER >> axis & 1 == 1;
        for i in 0..len {
            // The differences along an axis: before, on and behind the cell's edge.
            let differences = |axis: usize, [is_first, is_last]: [bool; 2]| {
                let (low, high) = (CORNER & !(1 << axis), CORNER | 1 << axis);
                let inner = samples[high][i] - samples[low][i];
                let before = samples[low][i] - samples[outer_sample(low, axis)][i];
                let after = samples[outer_sample(high, axis)][i] - samples[high][i];
                [if is_first { inner } else { before }, inner, if is_last { inner } else { after }]
            };
            let by_x = differences(0, [xs[i] == 0, xs[i] == last_x]);
            let by_y = differences(1, [ys[i] == 0, ys[i] == last_y]);
            let by_z = differences(2, self.one_sided_z);
            let size = by_x[1].abs() + by_y[1].abs() + by_z[1].abs();
            (of_x[i], straight_x[i]) = slope(by_x, is_high(0), size);
            (of_y[i], straight_y[i]) = slope(by_y, is_high(1), size);
            (of_z[i], straight_z[i]) = slope(by_z, is_high(2), size);
        }
    }

    /// Adds the planes of the crossings on `EDGE` to the quadrics.
    #[inline(always)]
    fn add_planes<const EDGE: usize>(&mut self) {
        let (axis, [low, high]) = (EDGE / 4, CORNERS[EDGE]);
        let len = self.edges.len().min(BATCH);
        let edges = &self.edges[..len];
        let (ends_low, ends_high) = (&self.planes.samples[low][..len], &self.planes.samples[high][..len]);
        let (mut fractions, mut unsound) = ([0.0; BATCH], false);
        for i in 0..len {
            let (fraction, sound) = f32::quick_fraction(ends_low[i], ends_high[i], self.isovalue);
            unsound |= (edges[i] >> EDGE & 1 != 0) & !sound & (i < self.count);
            fractions[i] = snapped(fraction);
        }
        if unsound {
            fill_fractions(ends_low, ends_high, self.isovalue, &mut fractions);
        }
        let slopes: &[Lanes; 48] = self.planes.slopes.first_chunk().expect("six for each corner");
        let [xx, yy, zz, xy, xz, yz, x, y, z, constant] =
            self.planes.quadrics.first_chunk_mut().expect("a quadric has ten parts");
        let side = |k: usize| if low >> k & 1 == 1 { 0.5 } else { -0.5 };
        for i in 0..len {
            let ends = |part: usize| [slopes[8 * part + low][i], slopes[8 * part + high][i]];
            let inner = ends_high[i] - ends_low[i];
            let gradient = [
                if axis == 0 { inner } else { slope_between(ends(0), ends(3), fractions[i]) },
                if axis == 1 { inner } else { slope_between(ends(1), ends(4), fractions[i]) },
                if axis == 2 { inner } else { slope_between(ends(2), ends(5), fractions[i]) },
            ];
            let squared = dot(gradient, gradient);
            // A gradient that `f32` cannot compute well says nothing.
            let counts = (edges[i] >> EDGE & 1 != 0) & is_sound(squared);
            let scale = 1.0 / sqrt(squared);
            let part = |k: usize| if counts { gradient[k] * scale } else { 0.0 };
            let normal = [part(0), part(1), part(2)];
            let along = fractions[i] - 0.5;
            let point = [
                if axis == 0 { along } else { side(0) },
                if axis == 1 { along } else { side(1) },
                if axis == 2 { along } else { side(2) },
            ];
            let distance = dot(normal, point);
            xx[i] += normal[0] * normal[0];
            yy[i] += normal[1] * normal[1];
            zz[i] += normal[2] * normal[2];
            xy[i] += normal[0] * normal[1];
            xz[i] += normal[0] * normal[2];
            yz[i] += normal[1] * normal[2];
            x[i] += normal[0] * distance;
            y[i] += normal[1] * distance;
            z[i] += normal[2] * distance;
            constant[i] += distance * distance;
        }
    }

    /// Begins the search of the eigenvectors.
    #[inline(always)]
    fn start_turns(&mut self) {
        let len = self.xs.len().min(BATCH);
        let Planes { eigen, quadrics, .. } = &mut *self.planes;
        eigen[..3].copy_from_slice(&quadrics[..3]);
        for (elements, parts) in eigen[3..6].iter_mut().zip(&quadrics[3..6]) {
            for (element, &part) in elements[..len].iter_mut().zip(parts) {
                *element = without_tiny(part);
            }
        }
        for (number, lanes) in eigen[6..].iter_mut().enumerate() {
            lanes.fill(if number % 4 == 0 { 1.0 } else { 0.0 });
        }
    }

    /// Applies one rotation to all matrices.
    ///
    /// Each rotation is a loop of its own: a rotation waits long for its roots and quotients, and in one loop a vector
    /// of matrices would wait for twelve rotations before the next one starts.
    #[inline(always)]
    fn turn<const P: usize, const Q: usize>(&mut self) {
        let len = self.xs.len().min(BATCH);
        let eigen: &mut [Lanes; 15] = self.planes.eigen.first_chunk_mut().expect("15 parts");
        for i in 0..len {
            let (mut matrix, mut vectors) = eigen_of(eigen, i);
            turn::<P, Q>(&mut matrix, &mut vectors);
            let beside = 2 + P + Q;
            let (p_beside, q_beside) = (5 - Q, 5 - P);
            for part in [P, Q, beside, p_beside, q_beside] {
                eigen[part][i] = matrix[part];
            }
            for axis in [P, Q] {
                eigen[6 + 3 * axis][i] = vectors[axis][0];
                eigen[7 + 3 * axis][i] = vectors[axis][1];
                eigen[8 + 3 * axis][i] = vectors[axis][2];
            }
        }
    }

    /// Moves all vertices to where their quadrics are least.
    #[inline(always)]
    fn find_least(&mut self) {
        let len = self.xs.len().min(BATCH);
        let Planes { quadrics, at, directions, eigen, .. } = &mut *self.planes;
        let quadrics: &[Lanes; 10] = quadrics.first_chunk().expect("a quadric has ten parts");
        let eigen: &mut [Lanes; 15] = eigen.first_chunk_mut().expect("15 parts");
        let [x, y, z] = at.first_chunk_mut().expect("there are three axes");
        let directions = &mut directions[0];
        for i in 0..len {
            let (matrix, vectors) = eigen_of(eigen, i);
            let diagonal = [matrix[0], matrix[1], matrix[2]];
            let least = quadric_of(quadrics, i).least([x[i], y[i], z[i]], diagonal, vectors);
            [x[i], y[i], z[i]] = least.at;
            [eigen[0][i], eigen[1][i], eigen[2][i]] = least.values;
            directions[i] = least.directions;
        }
    }
}

#[inline(always)]
const fn eigen_of(parts: &[Lanes; 15], i: usize) -> ([f32; 6], [[f32; 3]; 3]) {
    let [xx, yy, zz, xy, xz, yz, a, b, c, d, e, f, g, h, k] = parts;
    ([xx[i], yy[i], zz[i], xy[i], xz[i], yz[i]], [[a[i], b[i], c[i]], [d[i], e[i], f[i]], [g[i], h[i], k[i]]])
}

/// The fractions of an edge from samples of any size.
#[cold]
#[inline(never)]
fn fill_fractions(low: &[f32], high: &[f32], isovalue: f32, fractions: &mut Lanes) {
    for (fraction, (&low, &high)) in fractions.iter_mut().zip(low.iter().zip(high)) {
        *fraction = crossing_fraction(low, high, isovalue);
    }
}

/// The slope at an end of an edge, from the differences before, on and behind the edge. `size`: that of the gradient.
///
/// If the samples bend little at this end, it is the mean of both sides. Otherwise there is a crease: behind this end
/// if the differences on the edge and at its other end are alike, else on the edge. The slope is then that of the side
/// without the crease. The second number is 1 in the first case, and 0 in the others.
#[inline(always)]
fn slope([before, inner, after]: [f32; 3], is_high: bool, size: f32) -> (f32, f32) {
    let (outer, far) = if is_high { (after, before) } else { (before, after) };
    let bend = (inner - outer).abs();
    let is_straight = bend <= size * 0.25;
    let goes_on = (far - inner).abs() < bend * 0.125;
    let one_sided = if goes_on { inner } else { outer };
    if is_straight { ((outer + inner) * 0.5, 1.0) } else { (one_sided, 0.0) }
}

/// The slope at a crossing across its edge, from those at the ends of the edge: that of the end without a crease, if there
/// is one such end. `straight`: 1 at ends without one.
#[inline(always)]
fn slope_between([low, high]: [f32; 2], straight: [f32; 2], fraction: f32) -> f32 {
    let between = interpolated(low, high, fraction);
    let between = if straight[0] > straight[1] { low } else { between };
    if straight[1] > straight[0] { high } else { between }
}

#[inline(always)]
fn quadric_of(parts: &[Lanes], i: usize) -> Quadric {
    let part = |number: usize| parts[number][i];
    Quadric {
        matrix: [part(0), part(1), part(2), part(3), part(4), part(5)],
        vector: [part(6), part(7), part(8)],
        constant: part(9),
    }
}

/// The nearest step of a place that counts from the middle of its cell.
#[inline(always)]
fn rounded(place: f32) -> f32 {
    // Beyond 2²³ numbers of `f32` are whole.
    within_cell((place * STEPS as f32 + (STEPS / 2) as f32 + 8_388_608.0) - 8_388_608.0)
}
