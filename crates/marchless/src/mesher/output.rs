//! How the passes write to the caller's mesh: items behind the ends of its vectors, and its bounds.

use alloc::vec::Vec;
use core::mem::MaybeUninit;

use crate::buffer::MeshBuffer;

/// Reserves memory for at least `count` more items and returns it. [`commit`] makes what was written there part of the
/// vector.
#[inline(always)]
pub(super) fn reserve<T>(items: &mut Vec<T>, count: usize) -> &mut [MaybeUninit<T>] {
    items.reserve(count);
    items.spare_capacity_mut()
}

/// Makes the first `count` [reserved](reserve) items part of the vector.
///
/// # Safety
/// They have been written since they were reserved.
#[expect(unsafe_code, reason = "spares filling all vectors with zeros first")]
#[inline(always)]
pub(super) unsafe fn commit<T>(items: &mut Vec<T>, count: usize) {
    debug_assert!(count <= items.capacity() - items.len());
    // SAFETY: as the caller promises; items can only be written within the capacity.
    unsafe { items.set_len(items.len() + count) }
}

/// The bounds of the vertices made so far, as the bits of their coordinates.
///
/// Coordinates are never negative, so their bits are in the same order. Vector instructions compare integers in one
/// step, since integers have no NaN.
#[derive(Clone, Copy)]
pub(super) struct VertexBounds {
    pub(super) min: [u32; 3],
    pub(super) max: [u32; 3],
}

impl VertexBounds {
    /// The bounds of no vertices.
    pub(super) const NONE: Self = Self { min: [u32::MAX; 3], max: [0; 3] };

    /// Widens the bounds to include a position.
    pub(super) fn include(&mut self, position: [f32; 3]) {
        for (axis, bits) in position.map(f32::to_bits).into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(bits);
            self.max[axis] = self.max[axis].max(bits);
        }
    }

    /// Widens a mesh's bounds to include these.
    pub(super) fn widen(self, mesh: &mut MeshBuffer) {
        if self.min[0] <= self.max[0] {
            let bounds = [self.min, self.max].map(|corner| corner.map(f32::from_bits));
            mesh.bounds = union(mesh.bounds, Some(bounds));
        }
    }
}

/// The smallest box around two boxes; `None` stands for no box.
pub(super) fn union(a: Option<[[f32; 3]; 2]>, b: Option<[[f32; 3]; 2]>) -> Option<[[f32; 3]; 2]> {
    let (Some([a_min, a_max]), Some([b_min, b_max])) = (a, b) else { return a.or(b) };
    Some([
        core::array::from_fn(|axis| a_min[axis].min(b_min[axis])),
        core::array::from_fn(|axis| a_max[axis].max(b_max[axis])),
    ])
}
