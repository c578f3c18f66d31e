//! Tunnels: joins of two sheets of the trilinear interpolant's surface in the interior of a cell, and their triangles.
//!
//! In a slice of the cell across an axis the interpolant is bilinear, and `q(t) = A(t)·C(t) − B(t)·D(t)` of the slice's
//! corners, a parabola, is zero where its saddle lies on the surface. The surface's curves in that slice are two lines
//! that cross. Two sheets are joined in the interior if and only if q has two different roots within the cell along
//! each of the three axes. (22 million random cells with several sheets, whose regions were joined slice by slice,
//! showed no exception.) The six roots are the sides of a box. Six of its corners, all but those at the ends of one
//! diagonal, lie on the surface, and so do the sides between them: they form a ring around the tunnel's waist.
//!
//! A strip of triangles lies between the ring and each of the two loops. The order of points along the axes, not their
//! distance, determines which corner of the ring belongs to which crossing. Strips of the shortest lines in the cell
//! itself cross each other in 2 to 20 % of all tunnels, strips of the least area in 14 to 58 %. (Random cells; the
//! first figure is for weights of one magnitude, the second for weights six magnitudes apart.) Strips of the shortest
//! lines in the [straightened](straightened_crossing) cell never crossed in these tests.
//!
//! Two roots may be as close as floating point allows. The ring's corners are kept apart and away from the faces. Its
//! sides run along the axes, so none is in line with a crossing on an edge, and no triangle has zero area.

#[cfg(doc)]
use crate::simd::Simd;
use crate::{cell::Edge, math::sqrt_f64, mesher::crossing::MARGIN};

/// The box around a tunnel's waist: `[low, high]` per axis, in the cell's coordinates.
pub(super) type Waist = [[f64; 2]; 3];

/// The number of corners of the ring around a waist.
pub(super) const RING: usize = 6;

/// The largest number of crossings of a cell, and so of a loop.
const MAX_CROSSINGS: usize = 12;

/// The least distance of a waist from the cell's faces. Tunnels with a closer waist are left out: floating point cannot
/// tell on which side of the crossings it lies.
const MIN_FACE_DISTANCE: f64 = 1.0 / (1u64 << 40) as f64;

/// True if a cell may have a [waist]: no parabola changes its sign from one face to the opposite one. The arguments are
/// the faces' [larger products](Simd::larger_products).
#[inline(always)]
pub(super) const fn is_possible([first_larger, second_larger]: [u8; 2]) -> bool {
    let alike = first_larger & first_larger >> 1 | second_larger & second_larger >> 1;
    alike & 0b01_01_01 == 0b01_01_01
}

/// The waist of the tunnel that joins two sheets of a cell with these corner weights, if there is one. The cell has
/// several sheets.
pub(super) fn waist(weights: &[f64; 8]) -> Option<Waist> {
    let [x, y, z] = parabolas(weights);
    // Without branches between them, since no predictor knows which fails first.
    if x.has_roots_within() & y.has_roots_within() & z.has_roots_within() {
        let waist = [x, y, z].map(|parabola| parabola.roots());
        let is_clear = |&[from, to]: &[f64; 2]| from > MIN_FACE_DISTANCE && to < 1.0 - MIN_FACE_DISTANCE;
        return waist.iter().all(is_clear).then_some(waist);
    }
    None
}

#[inline(always)]
const fn parabolas(weights: &[f64; 8]) -> [Parabola; 3] {
    let [a, b, c, d, e, f, g, h] = *weights;
    [
        Parabola::between([a, c, g, e], [b, d, h, f]),
        Parabola::between([a, e, f, b], [c, g, h, d]),
        Parabola::between([a, b, d, c], [e, f, h, g]),
    ]
}

/// The parabola `low·(1 − t)² + mixed·(1 − t)·t + high·t²`.
#[derive(Clone, Copy)]
struct Parabola {
    low: f64,
    mixed: f64,
    high: f64,
}

impl Parabola {
    /// The parabola q between two slices. Each slice is given by its corners, in order around it.
    #[inline(always)]
    const fn between(low: [f64; 4], high: [f64; 4]) -> Self {
        Self {
            low: low[0] * low[2] - low[1] * low[3],
            mixed: low[0] * high[2] - low[1] * high[3] + high[0] * low[2] - high[1] * low[3],
            high: high[0] * high[2] - high[1] * high[3],
        }
    }

    #[inline(always)]
    const fn discriminant(&self) -> f64 {
        self.mixed * self.mixed - 4.0 * self.low * self.high
    }

    /// True if there are two roots and both lie between 0 and 1. NaN makes every comparison false.
    #[inline(always)]
    const fn has_roots_within(&self) -> bool {
        let Self { low, mixed, high } = *self;
        let discriminant = self.discriminant();
        (low * high > 0.0) & (low * mixed < 0.0) & (discriminant > 0.0) & (discriminant < f64::INFINITY)
    }

    /// The roots, the lower first.
    fn roots(&self) -> [f64; 2] {
        // The roots of the quotient t / (1 − t) come first.
        let larger = -0.5 * (self.mixed + sqrt_f64(self.discriminant()).copysign(self.mixed));
        let [first, second] = [self.low / larger, larger / self.high].map(|quotient| quotient / (1.0 + quotient));
        [first.min(second), first.max(second)]
    }
}

/// The waist, with its ends moved apart from each other and away from the faces of the cell.
pub(super) fn spaced(waist: Waist) -> Waist {
    let least = f64::from(MARGIN);
    waist.map(|[from, to]| {
        let middle = (0.5 * (from + to)).clamp(2.0 * least, 1.0 - 2.0 * least);
        [from.clamp(least, middle - least), to.clamp(middle + least, 1.0 - least)]
    })
}

/// The ring's corners in order, as corners of the box. `end`: a corner at an end of the diagonal that the ring
/// surrounds.
pub(super) const fn ring(end: usize) -> [usize; RING] {
    [end ^ 1, end ^ 3, end ^ 2, end ^ 6, end ^ 4, end ^ 5]
}

/// The place of a corner of the box in the straightened cell, which is 3 long and has the waist in its middle third.
///
/// Which points are to be joined depends only on their order along the axes. The straightened cell keeps that order and
/// shows it clearly, however thin the waist is.
pub(super) fn straightened_corner(corner: usize) -> [f64; 3] {
    core::array::from_fn(|axis| 1.0 + (corner >> axis & 1) as f64)
}

/// The place of the crossing on an edge in the straightened cell. `at`: its coordinate along the edge.
pub(super) fn straightened_crossing(edge: Edge, at: f64, waist: &Waist) -> [f64; 3] {
    let [from, to] = waist[edge.axis()];
    let (third, [start, end]) = if at < from {
        (0.0, [0.0, from])
    } else if at <= to {
        (1.0, [from, to])
    } else {
        (2.0, [to, 1.0])
    };
    let mut point = edge.corners()[0].offset().map(|v| 3.0 * f64::from(v));
    point[edge.axis()] = third + (at - start) / (end - start);
    point
}

/// Joins a loop of crossings to the ring by a strip of triangles; both are given in the same sense of rotation.
///
/// The strip joins the first crossing to the nearest corner of the ring. Among such strips it has the least sum of
/// squared lengths of the lines between loop and ring. The names number the corners of its triangles. `None` if the
/// whole ring would hang on one crossing, which would use a line twice.
pub(super) fn strip(
    (around, ring): (&[[f64; 3]], &[[f64; 3]; RING]),
    (around_names, ring_names): (&[u8], &[u8; RING]),
) -> Option<Strip> {
    let len = around.len();
    let mut distances = [[0.0; RING]; MAX_CROSSINGS];
    for (distances, &from) in distances.iter_mut().zip(around) {
        *distances = ring.map(|to| squared_distance(from, to));
    }
    let start = (0..RING).min_by(|&a, &b| distances[0][a].total_cmp(&distances[0][b]))?;
    // The least sum up to corner `i` of the loop and corner `j` of the ring, and whether the last step was along the
    // loop.
    let (mut sums, mut along) = ([f64::INFINITY; RING + 1], [[false; RING + 1]; MAX_CROSSINGS + 1]);
    for i in 0..=len {
        let mut after_ring = f64::INFINITY;
        let distances = &distances[if i < len { i } else { 0 }];
        for j in 0..=RING {
            let after_loop = sums[j];
            let by_loop = after_loop <= after_ring;
            along[i][j] = j == 0 || i > 0 && by_loop;
            let before = if i + j == 0 {
                0.0
            } else if by_loop {
                after_loop
            } else {
                after_ring
            };
            after_ring = before + distances[(start + j) % RING];
            sums[j] = after_ring;
        }
    }
    let mut strip = Strip { triangles: [[0; 3]; MAX_CROSSINGS + RING], count: 0 };
    // The crossings that the ring hangs on, a bit each.
    let mut held_by = 0u16;
    let (mut i, mut j) = (len, RING);
    while i + j > 0 {
        let (outer, inner) = (around_names[i % len], ring_names[(start + j) % RING]);
        if along[i][j] {
            i -= 1;
            strip.push([around_names[i], outer, inner]);
        } else {
            j -= 1;
            held_by |= 1 << (i % len);
            strip.push([inner, ring_names[(start + j) % RING], outer]);
        }
    }
    (held_by.count_ones() > 1).then_some(strip)
}

/// The triangles between a loop and a ring.
#[derive(Clone, Copy)]
pub(super) struct Strip {
    triangles: [[u8; 3]; MAX_CROSSINGS + RING],
    count: usize,
}

impl Strip {
    fn push(&mut self, triangle: [u8; 3]) {
        self.triangles[self.count] = triangle;
        self.count += 1;
    }

    pub(super) fn triangles(&self) -> &[[u8; 3]] {
        &self.triangles[..self.count]
    }
}

fn squared_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = core::array::from_fn(|axis| a[axis] - b[axis]);
    x * x + y * y + z * z
}
