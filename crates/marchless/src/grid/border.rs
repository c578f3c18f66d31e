//! The border of a bounded grid: a box half a voxel inside its outermost planes. Meshes and rays read every sample
//! intersected with this box, so the surface is closed and its walls are flat.
//!
//! At an isovalue, a sample `k` points inside of the nearest plane (0 on it, negative beyond it) reads as at least
//! `isovalue + 0.5 − k` voxels. This is a maximum, so clipping twice or layer by layer gives the same result. The
//! stored samples are not clipped, so the border may move.

use crate::lattice::Region;
use crate::sample::{Voxel, Weight};

/// The depth, in points inside of a plane, up to which samples are clipped. The surface does not reach deeper ones.
const DEPTH: i64 = 4;

/// The box of lattice points of a bounded grid: its planes are points at `min` and at `max`, both included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Border {
    min: [i64; 3],
    max: [i64; 3],
}

impl Border {
    /// `planes`: [`crate::Grid::planes`].
    pub(crate) fn new(planes: Region) -> Self {
        Self { min: planes.min.map(i64::from), max: planes.max.map(i64::from) }
    }

    /// True if any point of `region` is clipped.
    pub(crate) fn reaches(&self, region: &Region) -> bool {
        // Two opposite corners hold the coordinates nearest to the planes.
        let ends = [region.min, region.max.map(|v| v.saturating_sub(1))];
        ends.iter().any(|end| self.depth(end.map(i64::from)) <= DEPTH)
    }

    /// True if `point` lies on an outermost plane or beyond, where no surface has it inside.
    pub(crate) fn excludes(&self, point: [i32; 3]) -> bool {
        self.depth(point.map(i64::from)) <= 0
    }

    /// The sample that a surface at `isovalue` reads at a point that no chunk of the grid owns.
    pub(super) fn beyond<W: Weight>(&self, point: [i64; 3], isovalue: f32) -> Voxel<W> {
        Voxel::new(wall(self.depth(point), isovalue), 0)
    }

    /// `weight`, intersected with the box at `point`, as a surface at `isovalue` reads it.
    pub(crate) fn clip<W: Weight>(&self, point: [i32; 3], weight: W, isovalue: f32) -> W {
        let depth = self.depth(point.map(i64::from));
        if depth > DEPTH { weight } else { larger(weight, wall(depth, isovalue)) }
    }

    /// The clipped layers of a cube of `size` samples per axis: for each, its axis, its index along that axis, and the
    /// least weight in it. `origin`: the cube's lowest lattice point.
    pub(super) fn layers<W: Weight>(
        &self,
        origin: [i64; 3],
        size: usize,
        isovalue: f32,
    ) -> impl Iterator<Item = (usize, usize, W)> {
        let border = *self;
        (0..3).flat_map(move |axis| {
            (0..size).filter_map(move |index| {
                let depth = border.depth_along(axis, origin[axis] + index as i64);
                (depth <= DEPTH).then(|| (axis, index, wall(depth, isovalue)))
            })
        })
    }

    /// True if any point of a box of points of a level is clipped. `min`: the lowest one, in points of the level.
    pub(crate) fn cuts(&self, level: u8, min: [i32; 3], size: [u32; 3]) -> bool {
        // Two opposite corners hold the coordinates nearest to the planes.
        let ends = [[0; 3], size.map(|size| size.saturating_sub(1))];
        let at = |end: [u32; 3]| [0, 1, 2].map(|axis| (i64::from(min[axis]) + i64::from(end[axis])) << level);
        ends.iter().any(|&end| self.depth(at(end)) <= DEPTH << level)
    }

    /// Intersects a box of samples of a level with the border's box, as a surface at `isovalue` reads them. `min`: the
    /// lowest lattice point, in points of the level. `size`: points per axis.
    pub(crate) fn clip_box<W: Weight>(
        &self,
        level: u8,
        min: [i32; 3],
        size: [u32; 3],
        isovalue: f32,
        weights: &mut [W],
        materials: &mut [u8],
    ) {
        let coordinate = |axis: usize, layer: u32| (i64::from(min[axis]) + i64::from(layer)) << level;
        let layers = || (0..3).flat_map(|axis| (0..size[axis]).map(move |layer| (axis, layer)));
        // Points that no chunk owns are the border's alone.
        for (axis, layer) in layers() {
            if !(self.min[axis]..self.max[axis]).contains(&coordinate(axis, layer)) {
                each_of_layer(axis, layer, size, |index| (weights[index], materials[index]) = (W::INSIDE, 0));
            }
        }
        for (axis, layer) in layers() {
            let depth = self.depth_along(axis, coordinate(axis, layer));
            if depth <= DEPTH << level {
                let least = wall(depth, isovalue);
                each_of_layer(axis, layer, size, |index| weights[index] = larger(weights[index], least));
            }
        }
    }

    /// The number of points that `point` lies inside of the nearest plane; 0 on it, negative beyond it.
    fn depth(&self, point: [i64; 3]) -> i64 {
        (0..3).map(|axis| self.depth_along(axis, point[axis])).fold(i64::MAX, i64::min)
    }

    fn depth_along(&self, axis: usize, coordinate: i64) -> i64 {
        (coordinate - self.min[axis]).min(self.max[axis] - coordinate)
    }
}

/// The weight of the box itself, `depth` points inside of its nearest plane.
fn wall<W: Weight>(depth: i64, isovalue: f32) -> W {
    W::from_voxels(isovalue + 0.5 - depth as f32)
}

/// The indices of layer `layer` across `axis` of a cube of `size` samples per axis.
pub(super) fn layer_indices(axis: usize, layer: usize, size: usize) -> impl Iterator<Item = usize> {
    let strides = [1, size, size * size];
    let [along, across] = [strides[(axis + 1) % 3], strides[(axis + 2) % 3]];
    (0..size).flat_map(move |j| (0..size).map(move |i| layer * strides[axis] + i * along + j * across))
}

/// Calls a function with the index of each sample of layer `layer` across `axis` of a box.
fn each_of_layer(axis: usize, layer: u32, size: [u32; 3], mut call: impl FnMut(usize)) {
    let [nx, ny, _] = size.map(|v| v as usize);
    let mut ranges = size.map(|v| 0..v as usize);
    ranges[axis] = layer as usize..layer as usize + 1;
    let [x, y, z] = ranges;
    for k in z {
        for j in y.clone() {
            x.clone().for_each(|i| call(i + nx * (j + ny * k)));
        }
    }
}

/// The larger weight; a NaN in `a`, which counts as outside, stays.
pub(super) fn larger<W: Weight>(a: W, b: W) -> W {
    if a < b { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_are_exact_in_steps() {
        for depth in 0..=DEPTH {
            for isovalue in [-2.0, 0.0, 3.0] {
                let steps = isovalue as i64 * 2 + 1 - 2 * depth; // in halves of a voxel
                assert_eq!(i64::from(wall::<i16>(depth, isovalue)), 128 * steps);
                assert_eq!(i64::from(wall::<i8>(depth, isovalue)), (16 * steps).max(-128));
            }
        }
        assert_eq!(wall::<i8>(-1, 0.0), 48);
        assert_eq!(wall::<i8>(i64::MIN / 2, 0.0), i8::MAX);
    }

    #[test]
    fn clipping_reaches_four_points_deep() {
        let border = Border::new(Region::new([0; 3], [16; 3]));
        let clipped = |x| border.clip([x, 8, 8], i16::MIN, 0.0);
        assert_eq!([clipped(0), clipped(1), clipped(4), clipped(5)], [128, -128, 128 - 4 * 256, i16::MIN]);
        assert_eq!([clipped(16), clipped(15), clipped(11)], [128, -128, i16::MIN]);
        assert_eq!(border.clip([3, 15, 8], 500i16, 0.0), 500);
        assert_eq!(border.clip([0, 8, 8], i16::MIN, 2.0), 128 + 512);
        assert!(border.excludes([0, 8, 8]) && border.excludes([8, 17, 8]) && !border.excludes([1, 15, 8]));
    }
}
