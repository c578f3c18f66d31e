//! Pass 3: one vertex for each crossing, with its position, normal and material.

use super::{Layout, MeshSettings, crossings::RowCrossings, set_bits};
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
        let low_slopes = Slopes::new::<PADDED>(layout, [1, y, z]);
        let high_slopes = Slopes::new::<PADDED>(layout, [1, y + usize::from(AXIS == 1), z + usize::from(AXIS == 2)]);
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
                    let (low_slopes, high_slopes) = if PADDED {
                        (low_slopes, high_slopes)
                    } else {
                        (low_slopes.at_x(layout, x), high_slopes.at_x(layout, x + usize::from(AXIS == 0)))
                    };
                    let (a, b) = (low_slopes.gradient(self.weights, low), high_slopes.gradient(self.weights, high));
                    let gradient = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * fraction);
                    *normal = unit(gradient).unwrap_or_else(|| {
                        let (a, b) = (low_slopes.steady(self.weights, low), high_slopes.steady(self.weights, high));
                        let mut fallback = [0.0; 3];
                        fallback[AXIS] = if low_is_inside { 1.0 } else { -1.0 };
                        steady_unit(a, b, fraction, fallback)
                    });
                }
                if let Some(materials) = self.materials {
                    self.out.materials[self.vertex] = materials[if low_is_inside { low } else { high }];
                }
                self.vertex += 1;
            }
        }
    }
}

/// Which neighbours of a sample its gradient reads: how far below and above it along each axis they lie, and the factor that makes
/// one-sided differences (twice as steep for their distance) comparable.
#[derive(Clone, Copy)]
struct Slopes {
    low: [usize; 3],
    high: [usize; 3],
    scale: [f32; 3],
}

impl Slopes {
    /// For the sample at `point`, in meshed samples.
    #[inline(always)]
    fn new<const PADDED: bool>(layout: &Layout, point: [usize; 3]) -> Self {
        let mut slopes = Self { low: layout.strides, high: layout.strides, scale: [1.0; 3] };
        if !PADDED {
            for axis in 1..3 {
                slopes.border(layout, axis, point[axis]);
            }
        }
        slopes
    }

    /// The same for another x, at the border or not.
    #[inline(always)]
    fn at_x(mut self, layout: &Layout, x: usize) -> Self {
        self.border(layout, 0, x);
        self
    }

    #[inline(always)]
    fn border(&mut self, layout: &Layout, axis: usize, at: usize) {
        if at == 0 {
            self.low[axis] = 0;
            self.scale[axis] = 2.0;
        } else if at + 1 >= layout.size[axis] {
            self.high[axis] = 0;
            self.scale[axis] = 2.0;
        }
    }

    /// Twice the gradient at sample `index`.
    #[inline(always)]
    fn gradient<W: Weight>(&self, weights: &[W], index: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| {
            (weights[index + self.high[axis]].raw() - weights[index - self.low[axis]].raw()) * self.scale[axis]
        })
    }

    /// The same, for samples whose differences overflow.
    fn steady<W: Weight>(&self, weights: &[W], index: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let difference = weights[index + self.high[axis]].finite() - weights[index - self.low[axis]].finite();
            difference * f64::from(self.scale[axis])
        })
    }
}

/// The direction of `gradient`, where its length can be computed well in `f32`.
#[inline(always)]
fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    (1e-30..1e30).contains(&squared).then(|| {
        let scale = 1.0 / sqrt(squared);
        gradient.map(|v| v * scale)
    })
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
    let [min, max] = positions.iter().fold([first; 2], |[min, max], position| {
        [[0, 1, 2].map(|k| min[k].min(position[k])), [0, 1, 2].map(|k| max[k].max(position[k]))]
    });
    Some([min, max])
}
