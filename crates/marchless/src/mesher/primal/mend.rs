//! Vertices whose samples are tiny, huge or not finite, computed one by one: the plain definition of a vertex.

use crate::mesher::{
    crossing::{crossing_fraction, interpolated},
    output::VertexBounds,
    settings::MeshSettings,
};
use crate::{
    buffer::MeshBuffer,
    math::{sqrt, sqrt_f64},
    sample::{Weight, is_sound},
    signs::{EdgeSlabs, SlabLayout},
};

/// Writes the vertices at the edges `[xs, ys]` along `AXIS` behind the ends of `out`'s vectors, one by one.
#[cold]
#[inline(never)]
pub(super) fn mend<const AXIS: usize, W: Weight>(
    layout: &SlabLayout,
    edges: &EdgeSlabs<'_, W>,
    settings: &MeshSettings,
    [xs, ys]: [&[u32]; 2],
    bounds: &mut VertexBounds,
    out: &mut MeshBuffer,
) {
    let [below, low, high, above] = edges.slabs;
    let (next_to_low, next_to_high) = if AXIS == 2 { (high, low) } else { (above, below) };
    for (vertex, (&x, &y)) in xs.iter().zip(ys).enumerate() {
        let (x_high, y_high) = (x + u32::from(AXIS == 0), y + u32::from(AXIS == 1));
        let (a, b) = (low[layout.index(x, y)], high[layout.index(x_high, y_high)]);
        let fraction = crossing_fraction(a, b, settings.isovalue * W::SCALE);
        let mut position = [x as f32, y as f32, edges.z as f32];
        position[AXIS] += fraction;
        out.positions.spare_capacity_mut()[vertex].write(position);
        bounds.include(position);
        if settings.normals {
            let ends = [
                End { slabs: [below, low, next_to_low], one_sided: edges.one_sided[0], x, y },
                End { slabs: [next_to_high, high, above], one_sided: edges.one_sided[1], x: x_high, y: y_high },
            ];
            let slopes = ends.each_ref().map(|end| end.gradient(layout).map(W::to_f32));
            let gradient = [0, 1, 2].map(|axis| interpolated(slopes[0][axis], slopes[1][axis], fraction));
            let normal = unit(gradient).unwrap_or_else(|| {
                let mut fallback = [0.0; 3];
                fallback[AXIS] = if a.inside(W::threshold(settings.isovalue)) { 1.0 } else { -1.0 };
                steady_unit(ends.map(|end| end.steady_gradient(layout)), fraction, fallback)
            });
            out.normals.spare_capacity_mut()[vertex].write(normal);
        }
    }
}

/// An end of an edge, with the samples that its gradient needs.
struct End<'a, W> {
    /// The slab below, its own, and the one above.
    slabs: [&'a [W]; 3],
    /// Whether the gradient along z is one-sided.
    one_sided: bool,
    x: u32,
    y: u32,
}

impl<W: Weight> End<'_, W> {
    /// Twice the gradient.
    fn gradient(&self, layout: &SlabLayout) -> [W::Wide; 3] {
        self.differences(layout, |high, low| W::difference(high, low), W::doubled)
    }

    /// Twice the gradient, in `f64` and of finite weights: differences cannot overflow.
    fn steady_gradient(&self, layout: &SlabLayout) -> [f64; 3] {
        self.differences(layout, |high, low| high.finite() - low.finite(), |difference| difference * 2.0)
    }

    fn differences<D: Copy>(
        &self,
        layout: &SlabLayout,
        difference: impl Fn(W, W) -> D,
        doubled: impl Fn(D) -> D,
    ) -> [D; 3] {
        let [below, slab, above] = self.slabs;
        let index = layout.index(self.x, self.y);
        let ([low, high], one_sided) = neighbours(layout, index, self.x, self.y);
        let differences = [
            difference(slab[high[0]], slab[low[0]]),
            difference(slab[high[1]], slab[low[1]]),
            difference(above[index], below[index]),
        ];
        let one_sided = [one_sided[0], one_sided[1], self.one_sided];
        core::array::from_fn(|k| if one_sided[k] { doubled(differences[k]) } else { differences[k] })
    }
}

/// The indices of a sample's low and high neighbours along x and y, and whether the sample itself stands in for one of
/// them.
fn neighbours(layout: &SlabLayout, index: usize, x: u32, y: u32) -> ([[usize; 2]; 2], [bool; 2]) {
    let first = [!layout.padded && x == 0, !layout.padded && y == 0];
    let last = [!layout.padded && x as usize + 1 == layout.size[0], !layout.padded && y as usize + 1 == layout.size[1]];
    let low = [index - usize::from(!first[0]), index - if first[1] { 0 } else { layout.stride }];
    let high = [index + usize::from(!last[0]), index + if last[1] { 0 } else { layout.stride }];
    ([low, high], [first[0] | last[0], first[1] | last[1]])
}

/// The direction of `gradient`; `None` if `f32` cannot compute its length well.
fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / sqrt(squared);
    is_sound(squared).then_some([x * scale, y * scale, z * scale])
}

/// The direction of a gradient whose length is out of `f32`'s range; `fallback` if it is zero.
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
