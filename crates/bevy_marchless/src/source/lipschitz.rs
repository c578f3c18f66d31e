//! [`Lipschitz`]: a formula that is known to change no faster than so and so, which bounds it.

use bevy_math::DVec3;
use marchless::{Bound, Source, SourceRegion};

use super::{BOUND_MARGIN, world_box};

/// A formula with a bound: wherever it is evaluated, it changes by at most `constant` per world unit.
///
/// From one value in the middle of a region it follows then that there is no surface in it, and chunks far from the
/// surface are neither sampled nor stored. True signed distances have the constant 1. Sums of formulas have the sum of
/// their constants, minima and maxima the larger one. Heights, `y - h(x, z)`, have √(1 + s²), where s is the steepest
/// slope. A constant that is too small leaves holes; one that is too large only skips less.
///
/// ```
/// use bevy_marchless::source::{Bound, Lipschitz, Source, SourceRegion};
///
/// // Waves 3 units high: 3 · 0.1 is the steepest slope along x, and along z.
/// let steepest = (1.0_f64 + 0.3 * 0.3 + 0.3 * 0.3).sqrt();
/// let waves = |[x, y, z]: [f64; 3]| y - 3.0 * ((x * 0.1).sin() + (z * 0.1).cos());
/// let source = Lipschitz::new(waves, steepest);
///
/// let region = SourceRegion { min: [0, 60, 0], size: [32; 3], level: 0, spacing: 1.0 };
/// assert_eq!(source.bound(&region), Bound::Outside);
/// ```
///
/// What a formula cannot bound in this way, an own [`Source`] can: its `bound` must be true for all samples of the region
/// and cheap, about as much as one sample. Its `bound_closely` may look closer, at a layer of samples, say; it has to
/// leave out three voxels on both sides of the surface as well.
#[derive(Clone, Copy, Debug)]
pub struct Lipschitz<F> {
    field: F,
    constant: f64,
}

impl<F: Fn([f64; 3]) -> f64 + Send + Sync + 'static> Lipschitz<F> {
    /// `field`: world position (terrain space) to signed distance in world units. `constant`: how much it changes per
    /// world unit at most; one that is negative or not a number bounds nothing.
    pub fn new(field: F, constant: f64) -> Self {
        Self { field, constant }
    }
}

impl<F: Fn([f64; 3]) -> f64 + Send + Sync + 'static> Source for Lipschitz<F> {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.field.fill(region, distances, materials);
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [x, y, z] = world_box(region);
        let [min, max] = [0, 1].map(|end| DVec3::new(x[end], y[end], z[end]));
        let value = (self.field)(((min + max) / 2.0).to_array());
        let change = self.constant * min.distance(max) / 2.0 + BOUND_MARGIN * region.spacing;
        if self.constant < 0.0 {
            Bound::Mixed
        } else if value > change {
            Bound::Outside
        } else if value < -change {
            Bound::Inside { material: 0 }
        } else {
            Bound::Mixed
        }
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        // With room around it already.
        self.bound(region)
    }
}
