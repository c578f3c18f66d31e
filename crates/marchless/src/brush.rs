//! Brushes: a [`QuantisedStamp`] is one application of a shape and an operation to samples, in integers throughout.
//!
//! A stamp is quantised once, when its shape and stroke are made from floating-point numbers; from then on the same
//! stamps in the same order give the same samples, bit for bit, on any machine. Each sample changes by itself, so
//! stamps may be applied to a whole [`Grid`](crate::Grid) or chunk by chunk, each chunk in its own time.
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

use crate::lattice::Region;
pub use edit::{Edit, VolumeByMaterial};
pub use shape::QuantisedShape;
use shape::{UNITS, units};

/// As far from the surface as an edit ever leaves a sample that it changes: 4 voxels, in steps of an `i16` weight.
///
/// A change of 8 voxels therefore turns any sample that an edit has touched from one side to the other.
pub const EDIT_LIMIT: i16 = 4 * UNITS as i16;

/// One application of a brush: where, what, and of which material.
///
/// Without a stroke it is a whole stamp: the union with the shape, or its subtraction, at once. With a
/// stroke, weights move by the stroke's rate while its time goes by. What is solid, and how far from the surface a sample
/// is, goes by the stamp's isovalue. Changed weights are clamped to within [`EDIT_LIMIT`] of it; a sample whose clamped
/// weight stays the same stays as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct QuantisedStamp {
    /// Where.
    pub shape: QuantisedShape,
    /// What.
    pub operation: Operation,
    /// The material of the samples that become solid, or that are painted; digging does not use it.
    pub material: u8,
    /// How far weights move, for a stamp that is a part of a timed stroke; painting does not use it.
    pub stroke: Option<QuantisedStroke>,
    /// The least weight that is not solid, in 1/256 voxel: what the surface's isovalue is, rounded up. Values beyond
    /// ±[`QuantisedStamp::MAX_ISOVALUE`] count as that.
    pub isovalue: i16,
}

/// What a stamp does to the samples of its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// Makes solid. Samples that become solid take the stamp's material.
    Add,
    /// Makes air. Samples keep their material.
    Dig,
    /// Gives the solid samples inside the shape the stamp's material; weights stay.
    Paint,
}

/// The part of a timed stroke that a stamp applies: the time from `start_us` to `end_us`, at a rate.
///
/// A sample whose own rate is `r` moves by ⌊r·end⌋ − ⌊r·start⌋, so it makes no difference into how many stamps, end
/// to start, a stroke is cut. The sample's rate is `rate` at least `falloff` deep inside the shape and falls linearly
/// to 0 at the shape's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct QuantisedStroke {
    /// The user's number for the stroke that this stamp is a part of; it has no effect on the samples.
    pub id: u64,
    /// How fast weights move where the falloff does not reach, in 1/256 voxel per second.
    pub rate: u32,
    /// The width of the rim within the shape over which the rate falls to 0, in 1/256 voxel.
    pub falloff: u32,
    /// When the part begins, in microseconds since the stroke began.
    pub start_us: u64,
    /// When it ends, likewise; nothing moves where that is not after the beginning.
    pub end_us: u64,
}

impl QuantisedStamp {
    /// The highest isovalue, either way, in 1/256 voxel: some 124 voxels, so that weights have room around it.
    pub const MAX_ISOVALUE: i16 = i16::MAX - EDIT_LIMIT;

    /// A whole stamp on the surface at isovalue 0.
    pub const fn new(shape: QuantisedShape, operation: Operation, material: u8) -> Self {
        Self { shape, operation, material, stroke: None, isovalue: 0 }
    }

    /// The same stamp on the surface at another isovalue, in voxels; rounded up to 1/256, which is solid where a mesh at
    /// that isovalue is.
    #[must_use]
    pub fn with_isovalue(self, isovalue: f32) -> Self {
        let steps = libm::ceilf(isovalue * UNITS as f32); // NaN counts as 0
        Self { isovalue: (steps as i16).clamp(-Self::MAX_ISOVALUE, Self::MAX_ISOVALUE), ..self }
    }

    /// The same stamp as a part of a timed stroke.
    #[must_use]
    pub const fn with_stroke(self, stroke: QuantisedStroke) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    /// A box around all lattice points that the stamp may change, whatever their samples are.
    pub fn region(&self) -> Region {
        self.shape.region(self.reach() / UNITS)
    }

    /// How far outside its shape the stamp changes weights, in 1/256 voxel.
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

    /// A part of stroke `id`: `rate` in voxels per second, `falloff` in voxels, times since the stroke began.
    /// Rate and falloff are rounded to 1/256, times cut to whole microseconds.
    ///
    /// # Errors
    /// [`BrushError`] where a number is NaN, negative or beyond its limit, or the end lies before the start.
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

/// Why a brush cannot be made of the numbers given.
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
