//! [`Aabb`]: axis-aligned bounding boxes.

/// An axis-aligned bounding box; its faces belong to it.
#[derive(Clone, Copy)]
pub(super) struct Aabb {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

impl Aabb {
    /// Holds nothing, and overlaps nothing.
    pub(super) const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The smallest box around some points without NaN.
    #[inline(always)]
    pub(super) fn around(points: impl IntoIterator<Item = [f32; 3]>) -> Self {
        points.into_iter().fold(Self::EMPTY, |aabb, point| aabb.union(&Self { min: point, max: point }))
    }

    /// The smallest box around both.
    #[inline(always)]
    pub(super) fn union(&self, other: &Self) -> Self {
        // Without NaN these need one instruction; `f32::min` needs several.
        let lower = |a: f32, b: f32| if a < b { a } else { b };
        let upper = |a: f32, b: f32| if a > b { a } else { b };
        Self {
            min: [0, 1, 2].map(|axis| lower(self.min[axis], other.min[axis])),
            max: [0, 1, 2].map(|axis| upper(self.max[axis], other.max[axis])),
        }
    }

    /// Whether the boxes have a point in common.
    #[inline(always)]
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let [low, high] = [(self, other), (other, self)]
            .map(|(a, b)| (a.min[0] <= b.max[0]) & (a.min[1] <= b.max[1]) & (a.min[2] <= b.max[2]));
        low & high
    }

    /// The point in the middle. Does not overflow.
    #[inline(always)]
    pub(super) fn middle(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.min[axis] * 0.5 + self.max[axis] * 0.5)
    }

    /// The length of the longest side. Does not overflow; negative infinity for the empty box.
    #[inline(always)]
    pub(super) fn longest_side(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(self.max[axis]) - f64::from(self.min[axis]));
        let upper = |a: f64, b: f64| if a > b { a } else { b };
        upper(upper(x, y), z)
    }
}
