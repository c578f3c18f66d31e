//! Pass 3: one vertex for each crossing, with its position, normal and material.

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
    if settings.normals {
        out.normals.resize(vertex_count, [0.0; 3]);
    }
    if samples.materials().is_some() {
        out.materials.resize(vertex_count, 0);
    }
    let mut pass = Vertices {
        weights: samples.weights(),
        materials: samples.materials(),
        layout,
        signs,
        rows,
        isovalue: settings.isovalue * W::SCALE,
        vertex: 0,
        out,
    };
    if samples.is_padded() {
        pass.run::<true>();
    } else {
        pass.run::<false>();
    }
    debug_assert_eq!(pass.vertex, vertex_count);
    out.bounds = bounds(&out.positions);
}

/// How far along the edge from `a` to `b` its vertex lies; `isovalue` in steps (voxels × `SCALE`).
#[inline(always)]
pub(crate) fn crossing_fraction<W: Weight>(a: W, b: W, isovalue: f32) -> f32 {
    let fraction = W::fraction(a, b, isovalue);
    // A NaN (both ends at the same limit of `f32`) fails the comparison.
    if fraction > MARGIN { fraction.min(1.0 - MARGIN) } else { MARGIN }
}

struct Vertices<'a, W> {
    weights: &'a [W],
    materials: Option<&'a [u8]>,
    layout: &'a Layout,
    signs: &'a [u64],
    rows: &'a [Row],
    /// In steps.
    isovalue: f32,
    /// The next vertex.
    vertex: usize,
    out: &'a mut MeshBuffer,
}

impl<W: Weight> Vertices<'_, W> {
    fn run<const PADDED: bool>(&mut self) {
        let layout = self.layout;
        for z in 0..layout.size[2] {
            for y in 0..layout.size[1] {
                if self.rows[y + z * layout.size[1]].is_empty() {
                    continue;
                }
                let crossings = RowCrossings::new(layout, self.signs, y, z);
                self.row::<PADDED, 0>(&crossings, y, z);
                self.row::<PADDED, 1>(&crossings, y, z);
                self.row::<PADDED, 2>(&crossings, y, z);
            }
        }
    }

    #[inline(always)]
    fn row<const PADDED: bool, const AXIS: usize>(&mut self, crossings: &RowCrossings<'_>, y: usize, z: usize) {
        let layout = self.layout;
        let start = layout.row_start(y, z);
        let inside = layout.row(self.signs, y + z * layout.size[1]);
        let mut low_slopes = Slopes::new::<PADDED>(layout, y, z);
        let mut high_slopes = Slopes::new::<PADDED>(layout, y + usize::from(AXIS == 1), z + usize::from(AXIS == 2));
        for (word, &inside) in inside.iter().enumerate() {
            for bit in set_bits(crossings.word(word)[AXIS]) {
                let x = word * 64 + bit;
                let low = start + x;
                let high = low + layout.strides[AXIS];
                let fraction = crossing_fraction(self.weights[low], self.weights[high], self.isovalue);
                let mut position = [x as f32, y as f32, z as f32];
                position[AXIS] += fraction;
                self.out.positions[self.vertex] = position;
                let low_is_inside = inside >> bit & 1 == 1;
                if let Some(normal) = self.out.normals.get_mut(self.vertex) {
                    if !PADDED {
                        low_slopes.set(layout, 0, x);
                        high_slopes.set(layout, 0, x + usize::from(AXIS == 0));
                    }
                    let a = low_slopes.gradient::<PADDED, W>(self.weights, low);
                    let b = high_slopes.gradient::<PADDED, W>(self.weights, high);
                    *normal = match unit(mix(a, b, fraction)) {
                        Some(normal) => normal,
                        None => {
                            let a = low_slopes.steady_gradient(self.weights, low);
                            let b = high_slopes.steady_gradient(self.weights, high);
                            let mut fallback = [0.0; 3];
                            fallback[AXIS] = if low_is_inside { 1.0 } else { -1.0 };
                            steady_unit(a, b, fraction, fallback)
                        }
                    };
                }
                if let Some(materials) = self.materials {
                    self.out.materials[self.vertex] = materials[if low_is_inside { low } else { high }];
                }
                self.vertex += 1;
            }
        }
    }
}

/// Which neighbours of a sample its gradient reads: how far below and above it along each axis they lie in memory, and the
/// factor that makes one-sided differences comparable to central ones, which span twice the distance.
struct Slopes {
    below: [usize; 3],
    above: [usize; 3],
    scale: [f32; 3],
}

impl Slopes {
    /// For the samples of row `y`, `z`.
    #[inline(always)]
    fn new<const PADDED: bool>(layout: &Layout, y: usize, z: usize) -> Self {
        let mut slopes = Self { below: layout.strides, above: layout.strides, scale: [1.0; 3] };
        if !PADDED {
            slopes.set(layout, 1, y);
            slopes.set(layout, 2, z);
        }
        slopes
    }

    /// Reads one-sided differences along `axis` where `at` lies at the border.
    #[inline(always)]
    fn set(&mut self, layout: &Layout, axis: usize, at: usize) {
        let (first, last) = (at == 0, at + 1 >= layout.size[axis]);
        self.below[axis] = if first { 0 } else { layout.strides[axis] };
        self.above[axis] = if last { 0 } else { layout.strides[axis] };
        self.scale[axis] = if first | last { 2.0 } else { 1.0 };
    }

    /// Twice the gradient at sample `index`.
    #[inline(always)]
    fn gradient<const PADDED: bool, W: Weight>(&self, weights: &[W], index: usize) -> [f32; 3] {
        let mut gradient = [0.0; 3];
        for (axis, slope) in gradient.iter_mut().enumerate() {
            *slope = weights[index + self.above[axis]].raw() - weights[index - self.below[axis]].raw();
            if !PADDED {
                *slope *= self.scale[axis];
            }
        }
        gradient
    }

    /// The same, where differences may overflow.
    fn steady_gradient<W: Weight>(&self, weights: &[W], index: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let slope = weights[index + self.above[axis]].finite() - weights[index - self.below[axis]].finite();
            slope * f64::from(self.scale[axis])
        })
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
