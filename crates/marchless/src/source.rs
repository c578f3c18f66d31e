//! [`Source`]: the field that a volume holds before any edit, sampled box by box.

use core::any::Any;

use alloc::{boxed::Box, sync::Arc, vec::Vec};

use crate::{
    lattice::{Shape, ShapeError},
    sample::Weight as _,
};

/// The margin, in points, that must be bounded around a region before it may stay unsampled. Brushes and isovalues
/// reach four voxels from the surface.
pub(crate) const BOUND_MARGIN: u32 = 4;

/// A box of lattice points that a [`Source`] samples or bounds.
///
/// Positions are integers, and only [`SourceRegion::position`] turns them into world units, in `f64`. So nothing is
/// lost far from the origin, and a point has the same position in every region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceRegion {
    /// The lowest point, in lattice positions of this level.
    pub min: [i32; 3],
    /// Points per axis.
    pub size: [u32; 3],
    /// The level of detail: 0 is the finest, and each further level doubles the spacing.
    pub level: u8,
    /// World units between neighbouring points of this level.
    pub spacing: f64,
}

impl SourceRegion {
    /// The world position (terrain space) of the point at `index`, which counts from the lowest point.
    #[inline]
    pub fn position(&self, index: [u32; 3]) -> [f64; 3] {
        core::array::from_fn(|axis| (f64::from(self.min[axis]) + f64::from(index[axis])) * self.spacing)
    }

    /// The number of points; saturates at `usize::MAX`.
    pub const fn len(&self) -> usize {
        let [x, y, z] = self.size;
        (x as usize).saturating_mul(y as usize).saturating_mul(z as usize)
    }

    /// True if the region has no points.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The shape of the slices that [`Source::fill`] fills.
    ///
    /// # Errors
    /// As [`Shape::new`]; never for the regions that this crate passes to a [`Source`].
    pub const fn shape(&self) -> Result<Shape, ShapeError> {
        Shape::new(self.size)
    }

    /// The region grown by `points` on all sides, saturating at the ends of the lattice.
    #[must_use]
    pub fn grown(&self, points: u32) -> Self {
        Self {
            min: self.min.map(|v| v.saturating_sub_unsigned(points)),
            size: self.size.map(|v| v.saturating_add(points.saturating_mul(2))),
            ..*self
        }
    }
}

/// The answer of a [`Source`] about a whole region that it has not sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// All points lie inside and are of one material.
    Inside {
        /// The material of all points.
        material: u8,
    },
    /// All points lie outside.
    Outside,
    /// Neither of the above is certain.
    Mixed,
}

/// A field of signed distances and materials: negative inside, zero and positive outside.
///
/// Near the surface, the distance must have the right sign, and roughly the right size. A field that grows by about one
/// voxel per voxel there gives the best normals and the most even brush strokes. Any thread may call a source, for one
/// point or for many. The answer for a point must always be the same.
///
/// Every closure from a world position to a world distance is a source:
///
/// ```
/// use marchless::Source;
///
/// let ball = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt() - 10.0;
/// let source: Box<dyn Source> = Box::new(ball);
/// ```
///
/// A `dyn Source` is an [`Any`], so it can be downcast to a known type.
///
/// # Levels of detail
/// A region of level `k` has every 2^k-th lattice point of level 0. A source may ignore the level: distances are in
/// voxels of the level in any case, and the same formula serves all levels. But waves shorter than two spacings look
/// random, and change from level to level; and the samples next to the surface, which give its vertices their
/// materials, lie up to 2^k voxels below it. So a good source does three things at levels other than 0:
/// - it leaves out waves shorter than two spacings, and fades those that are little longer;
/// - it gives samples within one spacing of the surface the material that is seen from above;
/// - it bounds a region of a level as it fills that level.
///
/// At level 0, a source gives its full detail, whatever the spacing.
pub trait Source: Any + Send + Sync {
    /// Samples every point of `region`.
    ///
    /// `distances`: `[nx·ny·nz]`, x fastest, to be filled with distances in voxels of this level (world distance
    /// divided by [`SourceRegion::spacing`]); NaN counts as outside. `materials`: the same shape, all 0 when called.
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]);

    /// The same in weights: distances in voxels of level 0, at every level, rounded as
    /// [`Weight::from_voxels`](crate::Weight::from_voxels) does. [`LeafBlock`](crate::LeafBlock) calls it. A source that
    /// has such weights at hand may answer with them.
    ///
    /// `weights`: of the shape of `materials`. `distances`: scratch memory.
    fn fill_weights(&self, region: &SourceRegion, distances: &mut Vec<f32>, weights: &mut [i16], materials: &mut [u8]) {
        let width = (1u64 << region.level.min(63)) as f32;
        distances.clear();
        distances.resize(weights.len(), 0.0);
        self.fill(region, distances, materials);
        for (weight, distance) in weights.iter_mut().zip(&*distances) {
            *weight = i16::from_voxels(distance * width);
        }
    }

    /// A quick bound of all points of `region`, at its level. Any answer but [`Bound::Mixed`] spares sampling them, so
    /// this pays off if it costs less than a few samples. A wrong answer leaves holes. The default is [`Bound::Mixed`].
    fn bound(&self, region: &SourceRegion) -> Bound {
        let _ = region;
        Bound::Mixed
    }

    /// A closer bound of all points of `region`, called just before sampling. It may cost about as much as one layer of
    /// samples.
    ///
    /// An unsampled region may lie beside a sampled one, and isovalues may differ from 0 by three voxels. So
    /// [`Bound::Outside`] here also says that all samples would be 3 or more, and [`Bound::Inside`] that they would be
    /// −3 or less. By default, this is the [`Source::bound`] of the region grown by four points.
    ///
    /// [`GridChunk::from_source`](crate::GridChunk::from_source) documents the order in which both bounds are called.
    /// Code that streams chunks calls [`Source::bound`] on the thread that must not wait, and this one in the job that
    /// samples.
    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.bound(&region.grown(BOUND_MARGIN))
    }
}

/// A closure from a world position (terrain space) to a signed distance in world units is a source of material 0.
impl<F: Fn([f64; 3]) -> f64 + Send + Sync + 'static> Source for F {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], _materials: &mut [u8]) {
        let [nx, ny, nz] = region.size;
        let mut distances = distances.iter_mut();
        for z in 0..nz {
            for y in 0..ny {
                for (x, distance) in (0..nx).zip(&mut distances) {
                    *distance = (self(region.position([x, y, z])) / region.spacing) as f32;
                }
            }
        }
    }
}

macro_rules! forward {
    ($pointer:ty) => {
        impl Source for $pointer {
            fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
                (**self).fill(region, distances, materials);
            }

            fn fill_weights(
                &self,
                region: &SourceRegion,
                distances: &mut Vec<f32>,
                weights: &mut [i16],
                materials: &mut [u8],
            ) {
                (**self).fill_weights(region, distances, weights, materials);
            }

            fn bound(&self, region: &SourceRegion) -> Bound {
                (**self).bound(region)
            }

            fn bound_closely(&self, region: &SourceRegion) -> Bound {
                (**self).bound_closely(region)
            }
        }
    };
}

forward!(Box<dyn Source>);
forward!(Arc<dyn Source>);

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    const REGION: SourceRegion = SourceRegion { min: [-2, 5, 0], size: [3, 2, 4], level: 1, spacing: 0.5 };

    #[test]
    fn closures_take_world_units_and_return_voxels() {
        let source = |[x, y, z]: [f64; 3]| x + 10.0 * y + 100.0 * z;
        let mut distances = vec![0.0; REGION.len()];
        let mut materials = vec![0; REGION.len()];
        source.fill(&REGION, &mut distances, &mut materials);
        let shape = REGION.shape().unwrap();
        for (x, y, z) in [(0, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 3)] {
            let expected = f64::from(x) - 2.0 + 10.0 * (f64::from(y) + 5.0) + 100.0 * f64::from(z);
            assert_eq!(distances[shape.index([x, y, z])], expected as f32);
        }
    }

    #[test]
    fn pointers_forward_the_bound_too() {
        struct Rock;
        impl Source for Rock {
            fn fill(&self, _: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
                distances.fill(-1.0);
                materials.fill(7);
            }
            fn bound(&self, _: &SourceRegion) -> Bound {
                Bound::Inside { material: 7 }
            }
        }
        let boxed: Box<dyn Source> = Box::new(Rock);
        let shared: Arc<dyn Source> = Arc::new(boxed);
        assert_eq!(shared.bound(&REGION), Bound::Inside { material: 7 });
        let (mut distances, mut materials) = ([0.0; 2], [0; 2]);
        shared.fill(&REGION, &mut distances, &mut materials);
        assert_eq!((distances, materials), ([-1.0; 2], [7; 2]));
    }

    #[test]
    fn regions_grow_and_saturate() {
        let grown = REGION.grown(2);
        assert_eq!((grown.min, grown.size), ([-4, 3, -2], [7, 6, 8]));
        let end = SourceRegion { min: [i32::MIN; 3], size: [u32::MAX; 3], ..REGION };
        assert_eq!(end.grown(u32::MAX).size, [u32::MAX; 3]);
        assert!(end.shape().is_err());
        assert!(SourceRegion { size: [4, 0, 4], ..REGION }.is_empty());
    }
}
