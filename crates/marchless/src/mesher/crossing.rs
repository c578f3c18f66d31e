//! Where the surface crosses an edge.

use crate::sample::Weight;

/// The least distance of a crossing from the ends of its edge, as a fraction of the edge.
pub(super) const MARGIN: f32 = 1.0 / 1024.0;

/// How far along the edge from `a` to `b` its vertex lies, from 0 to 1. `isovalue`: in steps (voxels × `SCALE`).
#[inline(always)]
pub(crate) fn crossing_fraction<W: Weight>(a: W, b: W, isovalue: f32) -> f32 {
    clamped(W::fraction(a, b, isovalue))
}

/// The fraction, moved away from the ends of the edge. NaN becomes the margin: both ends are then the same limit of
/// `f32`.
#[inline(always)]
pub(crate) fn clamped(fraction: f32) -> f32 {
    // NaN fails the first comparison.
    let fraction = if fraction > MARGIN { fraction } else { MARGIN };
    if fraction < 1.0 - MARGIN { fraction } else { 1.0 - MARGIN }
}

/// The value at `fraction` of the way from `a` to `b`.
#[inline(always)]
pub(super) fn interpolated(a: f32, b: f32, fraction: f32) -> f32 {
    a + (b - a) * fraction
}
