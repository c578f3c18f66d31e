//! Vertices whose samples are tiny, huge or not finite, made one by one: what a vertex is, in plain words.

use super::{Planes, Vertices, crossing_fraction, mixed};
use crate::{
    buffer::MeshBuffer,
    math::{sqrt, sqrt_f64},
    mesher::{MeshSettings, slabs::Lattice},
    sample::{Weight, is_sound},
};

impl<W: Weight> Vertices<W> {
    /// Computes the vertices one by one, with care.
    #[cold]
    #[inline(never)]
    pub(super) fn mend<const AXIS: usize>(
        &mut self,
        lattice: &Lattice,
        planes: &Planes<'_, W>,
        settings: &MeshSettings,
        count: usize,
        out: &mut MeshBuffer,
    ) {
        let [below, low, high, above] = planes.slabs;
        let (next_to_low, next_to_high) = if AXIS == 2 { (high, low) } else { (above, below) };
        for (vertex, (&x, &y)) in self.x[..count].iter().zip(&self.y).enumerate() {
            let (x_high, y_high) = (x + u32::from(AXIS == 0), y + u32::from(AXIS == 1));
            let (a, b) = (low[lattice.index(x, y)], high[lattice.index(x_high, y_high)]);
            let fraction = crossing_fraction(a, b, settings.isovalue * W::SCALE);
            let mut position = [x as f32, y as f32, planes.z as f32];
            position[AXIS] += fraction;
            out.positions.spare_capacity_mut()[vertex].write(position);
            self.bounds.include(position);
            if settings.normals {
                let ends = [
                    End { slabs: [below, low, next_to_low], one_sided: planes.one_sided[0], x, y },
                    End { slabs: [next_to_high, high, above], one_sided: planes.one_sided[1], x: x_high, y: y_high },
                ];
                let slopes = [0, 1].map(|end| lattice.gradient(&ends[end]).map(W::to_f32));
                let gradient = [0, 1, 2].map(|axis| mixed(slopes[0][axis], slopes[1][axis], fraction));
                let normal = unit(gradient).unwrap_or_else(|| {
                    let mut fallback = [0.0; 3];
                    fallback[AXIS] = if a.inside(W::threshold(settings.isovalue)) { 1.0 } else { -1.0 };
                    steady_unit(ends.map(|end| lattice.steady_gradient(&end)), fraction, fallback)
                });
                out.normals.spare_capacity_mut()[vertex].write(normal);
            }
        }
    }
}

/// An end of an edge, and where to find what its gradient is made of.
struct End<'a, W> {
    /// The slab below, its own, and the one above.
    slabs: [&'a [W]; 3],
    /// Whether the gradient along z is one-sided.
    one_sided: bool,
    x: u32,
    y: u32,
}

impl Lattice {
    /// Twice the gradient at an end of an edge.
    fn gradient<W: Weight>(&self, end: &End<'_, W>) -> [W::Wide; 3] {
        self.differences(end, |high, low| W::difference(high, low), W::doubled)
    }

    /// The same, where differences may overflow.
    fn steady_gradient<W: Weight>(&self, end: &End<'_, W>) -> [f64; 3] {
        self.differences(end, |high, low| high.finite() - low.finite(), |difference| difference * 2.0)
    }

    fn differences<W: Copy, D: Copy>(
        &self,
        end: &End<'_, W>,
        difference: impl Fn(W, W) -> D,
        doubled: impl Fn(D) -> D,
    ) -> [D; 3] {
        let [below, slab, above] = end.slabs;
        let at = self.index(end.x, end.y);
        let ([low, high], one_sided) = self.neighbours(at, end.x, end.y);
        let differences = [
            difference(slab[high[0]], slab[low[0]]),
            difference(slab[high[1]], slab[low[1]]),
            difference(above[at], below[at]),
        ];
        let one_sided = [one_sided[0], one_sided[1], end.one_sided];
        core::array::from_fn(|k| if one_sided[k] { doubled(differences[k]) } else { differences[k] })
    }

    /// The indices of a sample's lower and higher neighbours along x and y, and whether it is one of them itself.
    fn neighbours(&self, at: usize, x: u32, y: u32) -> ([[usize; 2]; 2], [bool; 2]) {
        let first = [!self.padded && x == 0, !self.padded && y == 0];
        let last = [!self.padded && x as usize + 1 == self.size[0], !self.padded && y as usize + 1 == self.size[1]];
        let low = [at - usize::from(!first[0]), at - if first[1] { 0 } else { self.stride }];
        let high = [at + usize::from(!last[0]), at + if last[1] { 0 } else { self.stride }];
        ([low, high], [first[0] | last[0], first[1] | last[1]])
    }
}

/// The direction of `gradient`, where its length can be computed well in `f32`.
fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / sqrt(squared);
    is_sound(squared).then_some([x * scale, y * scale, z * scale])
}

/// The direction of a gradient that is tiny, huge, not finite or zero; `fallback` where it has none.
fn steady_unit([a, b]: [[f64; 3]; 2], fraction: f32, fallback: [f32; 3]) -> [f32; 3] {
    let gradient = [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * f64::from(fraction));
    let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    if largest == 0.0 {
        return fallback;
    }
    let [x, y, z] = gradient.map(|v| v / largest);
    let length = sqrt_f64(x * x + y * y + z * z);
    [x, y, z].map(|v| (v / length) as f32)
}
