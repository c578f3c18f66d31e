//! Overlap tests of a grid with boxes, balls and other grids.

use super::{BitGrid, paste::word_at, runs::span_words};
use crate::{lattice::Region, math::sqrt_f64};

impl BitGrid {
    /// True if any point of a region is set. Points outside the grid are not set.
    pub fn overlaps_region(&self, region: Region) -> bool {
        let [x, y, z] = self.clipped(region);
        rows(y, z).any(|[y, z]| self.any_set(x, y, z))
    }

    /// True if every point of a region is set; true for an empty region. Points outside the grid are not set.
    pub fn covers_region(&self, region: Region) -> bool {
        if region.is_empty() {
            return true;
        }
        let [x, y, z] = self.clipped(region);
        let inside = [x, y, z].map(|[start, end]| end.saturating_sub(start)) == region.size();
        inside && rows(y, z).all(|[y, z]| span_words(x).all(|(index, bits)| self.row(y, z)[index] & bits == bits))
    }

    /// The number of set points in a region. Points outside the grid are not set.
    pub fn count_in(&self, region: Region) -> usize {
        let [x, y, z] = self.clipped(region);
        rows(y, z)
            .map(|[y, z]| {
                let row = self.row(y, z);
                span_words(x).map(|(index, bits)| (row[index] & bits).count_ones() as usize).sum::<usize>()
            })
            .sum()
    }

    /// True if a point is set whose distance from `centre` is at most `radius`. Both are in lattice units.
    ///
    /// A negative or NaN radius overlaps nothing, and neither does a centre that is not finite; an infinite radius
    /// reaches everything. Distances are computed in `f64`. They are exact if `f64` holds their squares, as for
    /// multiples of ½ below 2²⁴. Otherwise a point that lies on the sphere, up to rounding, may count or not.
    pub fn overlaps_ball(&self, centre: [f32; 3], radius: f32) -> bool {
        if !centre.iter().all(|v| v.is_finite()) || radius.is_nan() || radius < 0.0 {
            return false;
        }
        let (centre, radius) = (centre.map(f64::from), f64::from(radius));
        let size = self.shape.size();
        // The coordinates along an axis that are at most `distance` away from the centre.
        let within = |axis: usize, distance: f64| {
            let (low, high) = (centre[axis] - distance, centre[axis] + distance);
            // Conversions saturate and round towards zero.
            let below = low as u32;
            let first = if f64::from(below) < low { below.saturating_add(1) } else { below };
            let behind = if high < 0.0 { 0 } else { (high as u32).saturating_add(1) };
            [first, behind.min(size[axis])]
        };
        let square = |axis: usize, v: u32| (f64::from(v) - centre[axis]) * (f64::from(v) - centre[axis]);
        rows(within(1, radius), within(2, radius)).any(|[y, z]| {
            let rest = radius * radius - square(1, y) - square(2, z);
            rest >= 0.0 && self.any_set(within(0, sqrt_f64(rest)), y, z)
        })
    }

    /// True if a point is set in both grids, with point `p` of `other` at `p + offset`. The grids may differ in size,
    /// and may lie apart.
    pub fn overlaps(&self, other: &Self, offset: [i32; 3]) -> bool {
        let [nx, ny, nz] = self.shape.size().map(i64::from);
        let [mx, my, mz] = other.shape.size().map(i64::from);
        let [ox, oy, oz] = offset.map(i64::from);
        let (min_x, max_x) = (ox.max(0), nx.min(mx + ox));
        if min_x >= max_x {
            return false;
        }
        let words = min_x / 64..=(max_x - 1) / 64;
        (oz.max(0)..nz.min(mz + oz)).any(|z| {
            (oy.max(0)..ny.min(my + oy)).any(|y| {
                let own = self.row(y as u32, z as u32);
                let others = other.row((y - oy) as u32, (z - oz) as u32);
                words.clone().any(|index| own[index as usize] & word_at(others, 64 * index - ox) != 0)
            })
        })
    }

    /// True if a row has a set bit in a span.
    fn any_set(&self, span: [u32; 2], y: u32, z: u32) -> bool {
        let row = self.row(y, z);
        span_words(span).any(|(index, bits)| row[index] & bits != 0)
    }

    /// The part of a region that lies in the grid: the first coordinate of each axis and the one past the last. All
    /// zeros if that part is empty.
    fn clipped(&self, region: Region) -> [[u32; 2]; 3] {
        let size = self.shape.size();
        let clipped: [[u32; 2]; 3] = core::array::from_fn(|axis| {
            let [min, max] = [region.min[axis], region.max[axis]].map(|v| v.max(0) as u32);
            [min, max.min(size[axis])]
        });
        if clipped.iter().any(|[start, end]| start >= end) { [[0; 2]; 3] } else { clipped }
    }
}

/// The rows of a box.
fn rows(y: [u32; 2], z: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    (z[0]..z[1]).flat_map(move |z| (y[0]..y[1]).map(move |y| [y, z]))
}
