//! Brushes: a [`QuantisedStamp`] applies a shape and an operation to samples, in integers throughout.
//!
//! A stamp is quantised once, when its shape and stroke are made from floating-point numbers. From then on, the same
//! stamps in the same order give the same samples, bit for bit, on any machine. Each sample changes independently, so
//! stamps may be applied to a whole [`Grid`](crate::Grid), or to each chunk at a different time.
//!
//! ```
//! use marchless::{Grid, Operation, QuantisedShape, QuantisedStamp};
//!
//! let mut grid = Grid::<i16>::new(32)?;
//! let ball = QuantisedStamp::new(QuantisedShape::sphere([0.0, 0.0, 0.0], 6.0)?, Operation::Add, 3);
//! let edit = grid.apply(&ball);
//! assert_eq!(edit.added.get(3), edit.added.total());
//!
//! let hole = QuantisedStamp::new(QuantisedShape::sphere([6.0, 0.0, 0.0], 3.0)?, Operation::Dig, 0);
//! assert!(grid.apply(&hole).removed.get(3) > 0);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod apply;
mod change;
mod edit;
mod shape;
#[cfg(test)]
mod tests;

use core::time::Duration;

use thiserror::Error;

use crate::{lattice::Region, sample::Voxel};
use change::Change;
pub use edit::{Edit, VolumeByMaterial};
pub use shape::QuantisedShape;
use shape::{UNITS, units};

/// The largest distance from the surface, either way, that an edit gives to a sample: 4 voxels, in steps of an `i16`
/// weight.
///
/// A change of 8 voxels therefore moves any sample that an edit has touched from one side to the other.
pub const EDIT_LIMIT: i16 = 4 * UNITS as i16;

/// One application of a brush: a shape, an operation and a material.
///
/// A stamp without a stroke is a whole stamp: it unites the samples with the shape, or subtracts the shape, at once. A
/// stamp with a stroke moves weights by the stroke's rate times its duration. The stamp's isovalue decides which
/// samples are solid and how far they are from the surface. Changed weights are clamped to within [`EDIT_LIMIT`] of it.
/// A sample does not change if its clamped weight would stay the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct QuantisedStamp {
    /// The shape that the stamp acts on.
    pub shape: QuantisedShape,
    /// The operation on the samples of the shape.
    pub operation: Operation,
    /// The material that painted samples take, and samples that become solid; digging does not use it.
    pub material: u8,
    /// The part of a timed stroke that the stamp applies; `None` for a whole stamp. Painting does not use it.
    pub stroke: Option<QuantisedStroke>,
    /// The least weight that is not solid, in 1/256 voxel: the surface's isovalue, rounded up. It is clamped to
    /// ±[`QuantisedStamp::MAX_ISOVALUE`].
    pub isovalue: i16,
}

/// What a stamp does to the samples of its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// Turns the samples solid. Samples that become solid take the stamp's material.
    Add,
    /// Turns the samples into air. Samples keep their material.
    Dig,
    /// Gives the solid samples inside the shape the stamp's material. Weights do not change.
    Paint,
}

/// The part of a timed stroke that a stamp applies: the time from `start_us` to `end_us`, at a rate.
///
/// A sample with rate `r` moves by ⌊r·end⌋ − ⌊r·start⌋, so a stroke may be cut into any number of consecutive stamps
/// without a change of the result. The sample's rate is `rate` where it is `falloff` or more deep inside the shape, and
/// falls linearly to 0 at the shape's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct QuantisedStroke {
    /// The user's id of the stroke that this stamp is a part of; it has no effect on the samples.
    pub id: u64,
    /// The speed of weights deeper inside the shape than `falloff`, in 1/256 voxel per second.
    pub rate: u32,
    /// The width of the rim within the shape over which the rate falls to 0, in 1/256 voxel.
    pub falloff: u32,
    /// The start of the part, in microseconds since the stroke began.
    pub start_us: u64,
    /// The end of the part, in microseconds since the stroke began. Nothing moves unless it is after the start.
    pub end_us: u64,
}

impl QuantisedStamp {
    /// The largest isovalue, either way, in 1/256 voxel: about 124 voxels. It leaves [`EDIT_LIMIT`] for weights around
    /// it.
    pub const MAX_ISOVALUE: i16 = i16::MAX - EDIT_LIMIT;

    /// A whole stamp on the surface at isovalue 0.
    pub const fn new(shape: QuantisedShape, operation: Operation, material: u8) -> Self {
        Self { shape, operation, material, stroke: None, isovalue: 0 }
    }

    /// This stamp on the surface at another isovalue, in voxels. The isovalue is rounded up to 1/256 voxel, so that the
    /// same samples are solid as in a mesh at that isovalue. NaN counts as 0.
    #[must_use]
    pub fn with_isovalue(self, isovalue: f32) -> Self {
        let steps = libm::ceilf(isovalue * UNITS as f32); // NaN counts as 0
        Self { isovalue: (steps as i16).clamp(-Self::MAX_ISOVALUE, Self::MAX_ISOVALUE), ..self }
    }

    /// This stamp as a part of a timed stroke.
    #[must_use]
    pub const fn with_stroke(self, stroke: QuantisedStroke) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    /// A box around all lattice points that the stamp may change. It does not depend on their samples.
    pub fn region(&self) -> Region {
        self.shape.region(self.reach() / UNITS)
    }

    /// The sample that replaces `old` at a lattice point.
    pub(crate) fn at_point(&self, old: Voxel<i16>, point: [i32; 3]) -> Voxel<i16> {
        Change::new(self).at_point(old, point)
    }

    /// The distance outside its shape up to which the stamp changes weights, in 1/256 voxel.
    const fn reach(&self) -> u32 {
        match (self.operation, self.stroke) {
            (Operation::Add | Operation::Dig, None) => EDIT_LIMIT as u32,
            _ => 0,
        }
    }
}

impl QuantisedStroke {
    /// The highest rate that [`QuantisedStroke::new`] takes, in voxels per second.
    pub const MAX_RATE: f64 = 65_536.0;
    /// The widest falloff that [`QuantisedStroke::new`] takes, in voxels.
    pub const MAX_FALLOFF: f64 = QuantisedShape::MAX_RADIUS;

    /// A part of stroke `id`. `rate` is in voxels per second, `falloff` in voxels, and times count from the start of
    /// the stroke. Rate and falloff are rounded to 1/256 voxel, and times are truncated to microseconds.
    ///
    /// # Errors
    /// [`BrushError`] if a number is NaN, negative or beyond its limit, or if the end lies before the start.
    pub fn new(id: u64, rate: f64, falloff: f64, start: Duration, end: Duration) -> Result<Self, BrushError> {
        if !(0.0..=Self::MAX_RATE).contains(&rate) {
            return Err(BrushError::Rate { found: rate });
        }
        if !(0.0..=Self::MAX_FALLOFF).contains(&falloff) {
            return Err(BrushError::Falloff { found: falloff });
        }
        if end < start {
            return Err(BrushError::Time { start, end });
        }
        let microseconds = |time: Duration| u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        Ok(Self {
            id,
            rate: units(rate) as u32,
            falloff: units(falloff) as u32,
            start_us: microseconds(start),
            end_us: microseconds(end),
        })
    }
}

/// The reason why a shape or a stroke was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BrushError {
    /// A coordinate is NaN, infinite or too far out.
    #[error(
        "a brush's coordinates must lie within ±{} voxels of the origin, but one is {found}",
        QuantisedShape::MAX_POSITION
    )]
    Position {
        /// What was given, in voxels.
        found: f64,
    },
    /// A radius or half size is NaN, not above 0, or too large.
    #[error("a brush's {name} must be above 0 and at most {} voxels, but it is {found}", QuantisedShape::MAX_RADIUS)]
    Size {
        /// Which size it is.
        name: &'static str,
        /// What was given, in voxels.
        found: f64,
    },
    /// A capsule's ends are too far apart.
    #[error(
        "a capsule's ends must be at most {} voxels apart along each axis, but they are {found} apart",
        QuantisedShape::MAX_LENGTH
    )]
    Length {
        /// The distance along the axis where it is too large, in voxels.
        found: f64,
    },
    /// A stroke's rate is NaN, negative or too high.
    #[error("a stroke's rate must be from 0 to {} voxels per second, but it is {found}", QuantisedStroke::MAX_RATE)]
    Rate {
        /// What was given, in voxels per second.
        found: f64,
    },
    /// A stroke's falloff is NaN, negative or too wide.
    #[error("a stroke's falloff must be from 0 to {} voxels, but it is {found}", QuantisedStroke::MAX_FALLOFF)]
    Falloff {
        /// What was given, in voxels.
        found: f64,
    },
    /// A part of a stroke ends before it starts.
    #[error("a part of a stroke must not end before it starts, but it runs from {start:?} to {end:?}")]
    Time {
        /// The start given.
        start: Duration,
        /// The end given.
        end: Duration,
    },
}
