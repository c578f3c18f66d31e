//! The normal of one vertex, by its plain definition.

use super::crossing::interpolated;
use crate::{
    math::{sqrt, sqrt_f64},
    sample::{Weight, is_sound},
    signs::SlabLayout,
};

/// The neighbours of one end of an edge, from which its gradient is computed.
pub(super) struct EndNeighbours<W> {
    /// The neighbour below along each axis.
    pub(super) low: [W; 3],
    /// The neighbour above along each axis.
    pub(super) high: [W; 3],
    /// Whether the end itself stands in for one of the two.
    pub(super) one_sided: [bool; 3],
}

impl<W: Weight> EndNeighbours<W> {
    /// The neighbours of the sample at `x`, `y`. `slabs`: the one below it, its own, and the one above. `one_sided`:
    /// whether the gradient along z is.
    pub(super) fn of(slabs: [&[W]; 3], one_sided: bool, layout: &SlabLayout, x: u32, y: u32) -> Self {
        let [below, slab, above] = slabs;
        let index = layout.index(x, y);
        let first = [!layout.padded && x == 0, !layout.padded && y == 0];
        let last =
            [!layout.padded && x as usize + 1 == layout.size[0], !layout.padded && y as usize + 1 == layout.size[1]];
        let low = [index - usize::from(!first[0]), index - if first[1] { 0 } else { layout.stride }];
        let high = [index + usize::from(!last[0]), index + if last[1] { 0 } else { layout.stride }];
        Self {
            low: [slab[low[0]], slab[low[1]], below[index]],
            high: [slab[high[0]], slab[high[1]], above[index]],
            one_sided: [first[0] | last[0], first[1] | last[1], one_sided],
        }
    }

    /// Twice the gradient.
    pub(super) fn gradient(&self) -> [W::Wide; 3] {
        self.differences(|high, low| W::difference(high, low), W::doubled)
    }

    /// Twice the gradient, in `f64` and of finite weights: differences cannot overflow.
    pub(super) fn steady_gradient(&self) -> [f64; 3] {
        self.differences(|high, low| high.finite() - low.finite(), |difference| difference * 2.0)
    }

    fn differences<D>(&self, difference: impl Fn(W, W) -> D, doubled: impl Fn(D) -> D) -> [D; 3] {
        core::array::from_fn(|axis| {
            let difference = difference(self.high[axis], self.low[axis]);
            if self.one_sided[axis] { doubled(difference) } else { difference }
        })
    }
}

/// The unit normal at `fraction` of an edge along `axis`. `low_inside`: whether the edge's low end is inside.
pub(super) fn vertex_normal<W: Weight>(
    ends: &[EndNeighbours<W>; 2],
    axis: usize,
    fraction: f32,
    low_inside: bool,
) -> [f32; 3] {
    let slopes = ends.each_ref().map(|end| end.gradient().map(W::to_f32));
    let gradient = core::array::from_fn(|k| interpolated(slopes[0][k], slopes[1][k], fraction));
    unit(gradient).unwrap_or_else(|| {
        let mut fallback = [0.0; 3];
        fallback[axis] = if low_inside { 1.0 } else { -1.0 };
        let [a, b] = ends.each_ref().map(EndNeighbours::steady_gradient);
        steady_unit([0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * f64::from(fraction)), fallback)
    })
}

/// The direction of `gradient`; `None` if `f32` cannot compute its length well.
pub(super) fn unit(gradient: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = gradient;
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / sqrt(squared);
    is_sound(squared).then_some([x * scale, y * scale, z * scale])
}

/// The direction of a gradient whose length is out of `f32`'s range; `fallback` if it is zero.
pub(super) fn steady_unit(gradient: [f64; 3], fallback: [f32; 3]) -> [f32; 3] {
    let largest = gradient.iter().fold(0.0f64, |largest, v| largest.max(v.abs()));
    if largest == 0.0 {
        return fallback;
    }
    let [x, y, z] = gradient.map(|v| v / largest);
    let length = sqrt_f64(x * x + y * y + z * z);
    [x, y, z].map(|v| (v / length) as f32)
}
