//! [`Window`]: a slab of samples with its neighbours, and [`EdgeSlabs`]: the slabs that edges of one axis need.

use super::layout::SlabLayout;
use crate::lattice::Samples;

/// A slab of samples with its neighbours along z: whole slabs, padding included.
///
/// At an open border the outermost slab stands in for the missing ones.
#[derive(Clone, Copy)]
pub(crate) struct Window<'a, W> {
    /// The slab two below, the slab below, the slab itself, and the slab above.
    pub(crate) slabs: [&'a [W]; 4],
    /// The materials of the slab below and of the slab itself, if samples have materials.
    pub(crate) materials: Option<[&'a [u8]; 2]>,
    /// The slab's lattice position along z.
    pub(crate) z: usize,
    /// Whether the gradient along z is one-sided on the slab below, and on the slab itself.
    pub(crate) one_sided: [bool; 2],
}

/// The samples that edges of one axis need: whole slabs, padding included.
#[derive(Clone, Copy)]
pub(crate) struct EdgeSlabs<'a, W> {
    /// The slab below the edges, the slab of their low ends, that of their high ends, and the slab above. For edges
    /// along x and y, both ends are in one slab. At an open border the outermost slab stands in for a missing one.
    pub(crate) slabs: [&'a [W]; 4],
    /// Whether the gradient along z is one-sided at the low ends, and at the high ends.
    pub(crate) one_sided: [bool; 2],
    /// The materials of the low ends' and of the high ends' slab, if samples have materials.
    pub(crate) materials: Option<[&'a [u8]; 2]>,
    /// The low ends' lattice position along z.
    pub(crate) z: usize,
}

impl<'a, W> Window<'a, W> {
    /// The window around the meshed slab `z` of a whole volume.
    #[inline(always)]
    pub(crate) fn of(samples: &Samples<'a, W>, layout: &SlabLayout, z: usize) -> Self {
        let [_, _, len] = samples.shape().strides();
        let last = samples.shape().size()[2] as usize - 1;
        let slab = z + usize::from(layout.padded);
        let start = |slab: usize| slab.min(last) * len;
        let at_border = |slab: usize| !layout.padded && (slab == 0 || slab == last);
        let numbers = [slab.saturating_sub(2), slab.saturating_sub(1), slab, slab + 1];
        Self {
            slabs: numbers.map(|slab| &samples.weights()[start(slab)..][..len]),
            materials: samples
                .materials()
                .map(|materials| [slab.saturating_sub(1), slab].map(|slab| &materials[start(slab)..][..len])),
            z,
            one_sided: [at_border(slab.saturating_sub(1)), at_border(slab)],
        }
    }

    /// The slabs of the edges along z, from the slab below to the slab itself.
    #[inline(always)]
    pub(crate) const fn edges_between(&self) -> EdgeSlabs<'a, W> {
        EdgeSlabs { slabs: self.slabs, one_sided: self.one_sided, materials: self.materials, z: self.z.wrapping_sub(1) }
    }

    /// The slabs of the edges along x and y within the slab.
    #[inline(always)]
    pub(crate) fn edges_within(&self) -> EdgeSlabs<'a, W> {
        let [_, below, slab, above] = self.slabs;
        EdgeSlabs {
            slabs: [below, slab, slab, above],
            one_sided: [self.one_sided[1]; 2],
            materials: self.materials.map(|[_, materials]| [materials; 2]),
            z: self.z,
        }
    }
}
