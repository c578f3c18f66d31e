//! [`Lipschitz`]: a formula with a known Lipschitz constant, which gives bounds.

use bevy_math::DVec3;
use marchless::{Bound, Source, SourceRegion};

use super::{BOUND_MARGIN, world_box};

/// A formula with a Lipschitz constant: it changes by at most `constant` per world unit.
///
/// One value in the middle of a region then bounds the values in all of it. So chunks far from the surface are neither
/// sampled nor stored. A true signed distance has the constant 1. A sum of formulas has the sum of their constants, a
/// minimum or maximum the larger one. A height field, `y - h(x, z)`, has √(1 + s²), where s is the steepest slope. A
/// constant that is too small leaves holes; one that is too large only skips fewer chunks.
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
/// For a formula that needs other bounds, implement [`Source`]. Its `bound` must hold for all samples of the region,
/// and be cheap, about as much as one sample. Its `bound_closely` may cost more, about as much as a layer of samples.
/// It must also keep a margin of three voxels on both sides of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Lipschitz<F> {
    field: F,
    constant: f64,
}

impl<F: Fn([f64; 3]) -> f64 + Send + Sync + 'static> Lipschitz<F> {
    /// A source from a formula.
    ///
    /// `field`: from a world position (terrain space) to a signed distance in world units. `constant`: its greatest
    /// change per world unit; one that is negative or NaN bounds nothing.
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
        // This bound already includes the margin of distance.
        self.bound(region)
    }
}
