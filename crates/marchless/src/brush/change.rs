//! [`Change`]: the effect of a stamp on one sample.

use super::{EDIT_LIMIT, Operation, QuantisedShape, QuantisedStamp, QuantisedStroke, shape::UNITS};
use crate::{lattice::Region, sample::Voxel};

/// A stamp prepared to be applied sample by sample.
#[derive(Clone, Copy)]
pub(super) struct Change {
    /// The stamp's [limited](QuantisedShape::limited) shape.
    shape: QuantisedShape,
    operation: Operation,
    material: u8,
    stroke: Option<QuantisedStroke>,
    /// The least weight that is not solid.
    isovalue: i16,
    /// The range of distances that matter: beyond it, the distance counts as the nearer end.
    low: i32,
    high: i32,
}

impl Change {
    pub(super) fn new(stamp: &QuantisedStamp) -> Self {
        let QuantisedStamp { operation, material, stroke, .. } = *stamp;
        let isovalue = stamp.isovalue.clamp(-QuantisedStamp::MAX_ISOVALUE, QuantisedStamp::MAX_ISOVALUE);
        let low = match (operation, &stroke) {
            (Operation::Paint, _) => -1,
            (_, Some(stroke)) => -rim(stroke),
            (_, None) => -i32::from(EDIT_LIMIT),
        };
        Self { shape: stamp.shape.limited(), operation, material, stroke, isovalue, low, high: stamp.reach() as i32 }
    }

    /// The sample that replaces `old` at `point`.
    #[inline]
    pub(super) fn at_point(&self, old: Voxel<i16>, point: [i32; 3]) -> Voxel<i16> {
        if self.leaves(old) {
            return old;
        }
        self.at_distance(old, self.shape.distance_within(point, self.low, self.high))
    }

    /// True if `old` does not change, whatever its distance from the shape.
    #[inline]
    pub(super) fn leaves(&self, old: Voxel<i16>) -> bool {
        match self.operation {
            Operation::Add => old.weight <= self.isovalue - EDIT_LIMIT,
            Operation::Dig => old.weight >= self.isovalue + EDIT_LIMIT,
            Operation::Paint => !self.is_solid(old.weight) || old.material == self.material,
        }
    }

    /// True if a surface at the stamp's isovalue has the weight inside.
    #[inline]
    pub(super) const fn is_solid(&self, weight: i16) -> bool {
        weight < self.isovalue
    }

    /// The sample that replaces `old` at `distance` from the shape; `distance` must be clamped to `low..=high`.
    #[inline]
    pub(super) fn at_distance(&self, old: Voxel<i16>, distance: i32) -> Voxel<i16> {
        let (isovalue, limit) = (i32::from(self.isovalue), i32::from(EDIT_LIMIT));
        // Distances from the surface at the isovalue.
        let clamp = |from_surface: i32| from_surface.clamp(-limit, limit);
        let now = clamp(i32::from(old.weight) - isovalue);
        let (new, material) = match (self.operation, &self.stroke) {
            (Operation::Paint, _) if distance < 0 && self.is_solid(old.weight) => {
                return Voxel::new(old.weight, self.material);
            }
            (Operation::Paint, _) => return old,
            (Operation::Add, None) => (clamp(distance).min(now), self.material),
            (Operation::Add, Some(stroke)) => (clamp(now - moved(stroke, distance)), self.material),
            (Operation::Dig, None) => (clamp(-distance).max(now), old.material),
            (Operation::Dig, Some(stroke)) => (clamp(now + moved(stroke, distance)), old.material),
        };
        if new == now {
            return old;
        }
        let becomes_solid = !self.is_solid(old.weight) && new < 0;
        Voxel::new((isovalue + new) as i16, if becomes_solid { material } else { old.material })
    }

    /// The clamped distance of all points of `area`; `None` unless a quick test shows that it is the same for all.
    pub(super) fn distance_over(&self, area: &Region) -> Option<i32> {
        let size = area.size();
        let middle = [0, 1, 2].map(|axis| area.min[axis].saturating_add_unsigned(size[axis] / 2));
        // Distances of two points differ by at most the points' distance, and a step for rounding.
        let half = size.map(|size| u64::from(size.div_ceil(2) * UNITS));
        let reach = half.iter().map(|half| half.pow(2)).sum::<u64>().isqrt() as i32 + 2;
        let distance = self.shape.distance(middle);
        if distance.saturating_add(reach) <= self.low {
            Some(self.low)
        } else if distance - reach >= self.high {
            Some(self.high)
        } else {
            None
        }
    }
}

/// The depth inside the shape at which a stroke's full rate begins; never 0.
fn rim(stroke: &QuantisedStroke) -> i32 {
    stroke.falloff.clamp(1, i32::MAX as u32) as i32
}

/// The length by which a stroke moves a weight, at a distance from minus the rim to 0. It is capped at twice
/// [`EDIT_LIMIT`], since longer moves have the same effect.
fn moved(stroke: &QuantisedStroke, distance: i32) -> i32 {
    let rate = u128::from(stroke.rate) * u128::from(distance.unsigned_abs());
    let second = u128::from(rim(stroke).unsigned_abs()) * 1_000_000;
    // Less than 2³² · 2³¹ · 2⁶⁴.
    let until = |time: u64| rate * u128::from(time) / second;
    until(stroke.end_us).saturating_sub(until(stroke.start_us)).min(2 * EDIT_LIMIT as u128) as i32
}
