//! Pass 3: one vertex for each crossing, with its position, normal and material.

use core::slice;

use super::{
    Layout, MeshSettings,
    crossings::{Row, RowCrossings},
    set_bits,
};
use crate::{
    buffer::MeshBuffer,
    lattice::Samples,
    math::{sqrt, sqrt_f64},
    sample::Weight,
};

/// Crossings stay this far from the ends of their edge.
const MARGIN: f32 = 1.0 / 1024.0;

/// Fills the vertices of `out`: row by row, those on edges along x, then y, then z.
pub(super) fn place<W: Weight>(
    samples: &Samples<'_, W>,
    layout: &Layout,
    settings: &MeshSettings,
    signs: &[u64],
    rows: &[Row],
    vertex_count: usize,
    out: &mut MeshBuffer,
) {
    out.positions.resize(vertex_count, [0.0; 3]);
    out.normals.resize(if settings.normals { vertex_count } else { 0 }, [0.0; 3]);
    out.materials.resize(if samples.materials().is_some() { vertex_count } else { 0 }, 0);
    let mut pass = Vertices {
        samples,
        layout,
        isovalue: settings.isovalue * W::SCALE,
        positions: out.positions.iter_mut(),
        normals: out.normals.iter_mut(),
        materials: out.materials.iter_mut(),
    };
    for z in 0..layout.size[2] {
        for y in 0..layout.size[1] {
            if !rows[y + z * layout.size[1]].is_empty() {
                let crossings = RowCrossings::new(layout, signs, y, z);
                if samples.is_padded() {
                    pass.row::<true>(&crossings, y, z);
                } else {
                    pass.row::<false>(&crossings, y, z);
                }
            }
        }
    }
    debug_assert_eq!(pass.positions.len(), 0);
    out.bounds = bounds(&out.positions);
}

/// How far along the edge from `a` to `b` its vertex lies; `isovalue` in steps (voxels × `SCALE`).
#[inline(always)]
pub(crate) fn crossing_fraction<W: Weight>(a: W, b: W, isovalue: f32) -> f32 {
    let fraction = W::fraction(a, b, isovalue);
    // A NaN (both ends at the same limit of `f32`) fails the comparison.
    if fraction > MARGIN { fraction.min(1.0 - MARGIN) } else { MARGIN }
}

/// The pass, with what is still to be filled.
struct Vertices<'a, W> {
    samples: &'a Samples<'a, W>,
    layout: &'a Layout,
    /// In steps.
    isovalue: f32,
    positions: slice::IterMut<'a, [f32; 3]>,
    normals: slice::IterMut<'a, [f32; 3]>,
    materials: slice::IterMut<'a, u8>,
}

impl<W: Weight> Vertices<'_, W> {
    #[inline(always)]
    fn row<const PADDED: bool>(&mut self, crossings: &RowCrossings<'_>, y: usize, z: usize) {
        let low = Surroundings::<W, PADDED>::new(self.samples, self.layout, y, z);
        self.edges::<PADDED, 0>(crossings, &low, &low, y, z);
        if y + 1 < self.layout.size[1] {
            let high = Surroundings::new(self.samples, self.layout, y + 1, z);
            self.edges::<PADDED, 1>(crossings, &low, &high, y, z);
        }
        if z + 1 < self.layout.size[2] {
            let high = Surroundings::new(self.samples, self.layout, y, z + 1);
            self.edges::<PADDED, 2>(crossings, &low, &high, y, z);
        }
    }

    /// The vertices on the row's edges along `AXIS`; `low` and `high`: the rows of their ends.
    #[inline(always)]
    fn edges<const PADDED: bool, const AXIS: usize>(
        &mut self,
        crossings: &RowCrossings<'_>,
        low: &Surroundings<'_, W, PADDED>,
        high: &Surroundings<'_, W, PADDED>,
        y: usize,
        z: usize,
    ) {
        for word in 0..self.layout.words {
            let inside = crossings.signs(word);
            for bit in set_bits(crossings.word(word)[AXIS]) {
                let x = word * 64 + bit;
                let high_x = x + usize::from(AXIS == 0);
                let fraction = crossing_fraction(low.weight(x), high.weight(high_x), self.isovalue);
                let low_is_inside = inside >> bit & 1 == 1;
                if let Some(position) = self.positions.next() {
                    *position = [x as f32, y as f32, z as f32];
                    position[AXIS] += fraction;
                }
                if let Some(normal) = self.normals.next() {
                    *normal = match unit(mix(low.gradient(x), high.gradient(high_x), fraction)) {
                        Some(normal) => normal,
                        None => {
                            let mut fallback = [0.0; 3];
                            fallback[AXIS] = if low_is_inside { 1.0 } else { -1.0 };
                            steady_unit(low.steady_gradient(x), high.steady_gradient(high_x), fraction, fallback)
                        }
                    };
                }
                if let (Some(material), Some(materials)) = (self.materials.next(), self.samples.materials()) {
                    let low_index = self.layout.row_start(y, z) + x;
                    let high_index = low_index + self.layout.strides[AXIS];
                    *material = materials[if low_is_inside { low_index } else { high_index }];
                }
            }
        }
    }
}

/// A row of samples and the four rows around it, from which the gradients on it are made. All slices start with the first sample
/// that is given, padding or not, and are equally long.
struct Surroundings<'a, W, const PADDED: bool> {
    row: &'a [W],
    below: [&'a [W]; 2],
    above: [&'a [W]; 2],
    /// What makes one-sided differences comparable to central ones, which span twice the distance.
    scale: [f32; 2],
}

impl<'a, W: Weight, const PADDED: bool> Surroundings<'a, W, PADDED> {
    #[inline(always)]
    fn new(samples: &Samples<'a, W>, layout: &Layout, y: usize, z: usize) -> Self {
        let len = layout.size[0] + 2 * usize::from(PADDED);
        let start = layout.row_start(y, z) - usize::from(PADDED);
        let row = |start: usize| &samples.weights()[start..][..len];
        let mut around = Self { row: row(start), below: [row(start); 2], above: [row(start); 2], scale: [1.0; 2] };
        for (index, (axis, at)) in [(1, y), (2, z)].into_iter().enumerate() {
            let (first, last) = (!PADDED && at == 0, !PADDED && at + 1 == layout.size[axis]);
            if !first {
                around.below[index] = row(start - layout.strides[axis]);
            }
            if !last {
                around.above[index] = row(start + layout.strides[axis]);
            }
            if first || last {
                around.scale[index] = 2.0;
            }
        }
        around
    }

    /// The weight of the row's meshed sample `x`.
    #[inline(always)]
    fn weight(&self, x: usize) -> W {
        self.row[x + usize::from(PADDED)]
    }

    /// Twice the gradient at sample `x`.
    #[inline(always)]
    fn gradient(&self, x: usize) -> [f32; 3] {
        let (low, at, high) = self.span(x);
        let gradient = [
            W::difference(self.row[high], self.row[low]),
            W::difference(self.above[0][at], self.below[0][at]),
            W::difference(self.above[1][at], self.below[1][at]),
        ];
        if PADDED {
            return gradient;
        }
        let x_scale = if high - low == 1 { 2.0 } else { 1.0 };
        [gradient[0] * x_scale, gradient[1] * self.scale[0], gradient[2] * self.scale[1]]
    }

    /// The same, where differences may overflow.
    #[cold]
    fn steady_gradient(&self, x: usize) -> [f64; 3] {
        let (low, at, high) = self.span(x);
        let x_scale = if high - low == 1 { 2.0 } else { 1.0 };
        [
            (self.row[high].finite() - self.row[low].finite()) * x_scale,
            (self.above[0][at].finite() - self.below[0][at].finite()) * f64::from(self.scale[0]),
            (self.above[1][at].finite() - self.below[1][at].finite()) * f64::from(self.scale[1]),
        ]
    }

    /// Where in the slices sample `x` and its neighbours along x are; at an open border, itself.
    #[inline(always)]
    fn span(&self, x: usize) -> (usize, usize, usize) {
        if PADDED { (x, x + 1, x + 2) } else { (x.saturating_sub(1), x, (x + 1).min(self.row.len() - 1)) }
    }
}

#[inline(always)]
fn mix(a: [f32; 3], b: [f32; 3], fraction: f32) -> [f32; 3] {
    let [ax, ay, az] = a;
    let [bx, by, bz] = b;
    [ax + (bx - ax) * fraction, ay + (by - ay) * fraction, az + (bz - az) * fraction]
}

/// The direction of `gradient`, where its length can be computed well in `f32`.
#[inline(always)]
fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    if !(1e-30..1e30).contains(&squared) {
        return None;
    }
    let scale = 1.0 / sqrt(squared);
    Some([x * scale, y * scale, z * scale])
}

/// The direction of a gradient that is tiny, huge, not finite or zero; `fallback` where it has none.
#[cold]
fn steady_unit(a: [f64; 3], b: [f64; 3], fraction: f32, fallback: [f32; 3]) -> [f32; 3] {
    let gradient = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * f64::from(fraction));
    let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    if largest == 0.0 {
        return fallback;
    }
    let [x, y, z] = gradient.map(|v| v / largest);
    let length = sqrt_f64(x * x + y * y + z * z);
    [x, y, z].map(|v| (v / length) as f32)
}

fn bounds(positions: &[[f32; 3]]) -> Option<[[f32; 3]; 2]> {
    let &first = positions.first()?;
    let (mut min, mut max) = (first, first);
    for position in positions {
        for axis in 0..3 {
            min[axis] = if position[axis] < min[axis] { position[axis] } else { min[axis] };
            max[axis] = if position[axis] > max[axis] { position[axis] } else { max[axis] };
        }
    }
    Some([min, max])
}
