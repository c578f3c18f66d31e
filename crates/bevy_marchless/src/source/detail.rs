//! [`Detail`]: what a level of detail shows of a source.
//!
//! A coarse level samples every 2^k-th point. Waves shorter than two of its spacings would look random there, and
//! different at each level. And its samples lie up to 2^k voxels below the surface, where another material may be. So
//! coarse levels leave out fine noise, and count depths differently. Level 0 shows everything as it is.

use marchless::SourceRegion;

/// What the samples of a level of detail show.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    /// World units between samples of the level.
    spacing: f64,
    /// World units between samples of level 0.
    voxel: f64,
    /// The number of samples of level 0 from one sample of the level to the next: 2^level.
    voxels: f64,
}

impl Detail {
    /// The detail of level 0: everything.
    #[cfg(feature = "noise")]
    pub(crate) const FINEST: Self = Self { spacing: 0.0, voxel: 0.0, voxels: 1.0 };

    pub(crate) fn of(region: &SourceRegion) -> Self {
        let voxels = 2.0_f64.powi(i32::from(region.level));
        Self { spacing: region.spacing, voxel: region.spacing / voxels, voxels }
    }

    pub(crate) fn is_finest(self) -> bool {
        self.voxels <= 1.0
    }

    /// The share, from 0 to 1, of an octave with this many cells per world unit: nothing if a cell is smaller than a
    /// spacing, everything if it is two spacings or more, and linear between. Level 0 has all octaves.
    ///
    /// Waves of Perlin noise are about two cells long, and two spacings are the shortest wave that samples can show. An
    /// octave that vanished at once would be seen to; so it fades over two levels.
    ///
    /// Measured in 2-D, with linear interpolation between samples, as a part of the octave's own size: the error is
    /// 0.76 (ridges: 1.05) if a cell is one spacing, 0.36 (0.65) if it is two, 0.10 (0.25) if it is four. Without the
    /// octave it would be 1. So cells of two to four spacings are better shown, and fading these was refused.
    #[cfg(feature = "noise")]
    pub(crate) fn share(self, frequency: f64) -> f64 {
        if self.is_finest() { 1.0 } else { (1.0 / (frequency * self.spacing) - 1.0).clamp(0.0, 1.0) }
    }

    /// True if the level can show a thing of this width: two spacings or more. Level 0 shows all.
    #[cfg(feature = "noise")]
    pub(crate) fn shows(self, width: f64) -> bool {
        self.is_finest() || width >= 2.0 * self.spacing
    }

    /// How much less deep a point counts than it lies. `depth`: below the surface. `within`: the depth of the deepest
    /// inside ends of edges, which is a spacing along the normal. Units: world.
    ///
    /// A vertex takes its material from the inside end of its edge. At level 0, this end lies 0 to 1 voxel deep, and at
    /// level `k` 0 to 2^k voxels, evenly spread in both cases. So depths within the first 2^k voxels are divided by
    /// 2^k, which gives the depths of level 0; greater ones are less by as much as the first 2^k voxels have lost. (To
    /// take 2^k − 1 voxels from all depths was refused: layers thinner than a voxel would vanish.) At level 0 this is
    /// 0.
    #[cfg(any(feature = "png", test))]
    pub(crate) fn raised(self, depth: f64, within: f64) -> f64 {
        depth.min(within) * self.raised_share()
    }

    /// The share of depths within one spacing by which [`raised`](Self::raised) is less.
    pub(crate) fn raised_share(self) -> f64 {
        1.0 - 1.0 / self.voxels
    }

    /// The most that [`raised`](Self::raised) gives: the spacing of the level less that of level 0.
    pub(crate) fn most_raised(self) -> f64 {
        self.spacing * self.raised_share()
    }

    /// The least depth that counts as `depth`: the inverse of a depth less [`raised`](Self::raised).
    #[cfg(feature = "noise")]
    pub(crate) fn deepened(self, depth: f64) -> f64 {
        if self.is_finest() {
            depth
        } else if depth <= self.voxel {
            depth * self.voxels
        } else {
            depth + self.most_raised()
        }
    }

    /// World units between samples of the level; 0 if it is not known, at level 0.
    pub(crate) fn spacing(self) -> f64 {
        self.spacing
    }

    /// World units between samples of level 0.
    pub(crate) fn voxel(self) -> f64 {
        self.voxel
    }

    /// The number of samples of level 0 from one sample of the level to the next.
    pub(crate) fn voxels(self) -> f64 {
        self.voxels
    }
}

#[cfg(all(test, feature = "noise"))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn detail(level: u8, spacing: f64) -> Detail {
        Detail::of(&SourceRegion { min: [0; 3], size: [1; 3], level, spacing })
    }

    proptest! {
        #[test]
        fn depths_of_rules_are_the_inverse_of_depths(level in 0u8..8, spacing in 0.1..40.0, depth in 0.0..200.0) {
            let detail = detail(level, spacing);
            let deeper = detail.deepened(depth);
            prop_assert!((deeper - detail.raised(deeper, spacing) - depth).abs() < 1e-9 * (1.0 + deeper));
            let raised = detail.raised(depth, spacing);
            prop_assert!(raised <= detail.most_raised() && raised <= depth);
            if level == 0 {
                prop_assert_eq!((deeper, raised, detail.most_raised()), (depth, 0.0, 0.0));
            }
        }
    }

    #[test]
    fn fine_noise_is_faded() {
        let shares = |size: f64| [0, 1, 2, 3].map(|level| detail(level, f64::from(1 << level)).share(1.0 / size));
        assert_eq!(shares(0.5), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(shares(3.0), [1.0, 0.5, 0.0, 0.0]);
        assert_eq!(shares(8.0), [1.0, 1.0, 1.0, 0.0]);
        assert_eq!(shares(12.0), [1.0, 1.0, 1.0, 0.5]);
        assert_eq!(detail(255, 1.0).share(0.1), 1.0);
        assert_eq!(Detail::FINEST.share(f64::INFINITY), 1.0);
        assert!(detail(2, 4.0).shows(8.0) && !detail(2, 4.0).shows(7.9) && detail(0, 4.0).shows(0.1));
    }
}
