//! Where the passes write: behind the ends of the caller's vectors, and bounds.

use alloc::vec::Vec;
use core::mem::MaybeUninit;

use crate::buffer::MeshBuffer;

/// Makes room for at least `room` more items, to be written before they are [kept](keep).
#[inline(always)]
pub(super) fn room<T>(items: &mut Vec<T>, room: usize) -> &mut [MaybeUninit<T>] {
    items.reserve(room);
    items.spare_capacity_mut()
}

/// Takes the next `count` items into the vector.
///
/// # Safety
/// They have been written since they were [given](room).
#[expect(unsafe_code, reason = "spares filling all vectors with zeros first")]
#[inline(always)]
pub(super) unsafe fn keep<T>(items: &mut Vec<T>, count: usize) {
    debug_assert!(count <= items.capacity() - items.len());
    // SAFETY: as the caller promises, and none is written without room.
    unsafe { items.set_len(items.len() + count) }
}

/// Bounds of positions that are not negative, as bits: those are in the same order, and vector instructions compare
/// integers without a thought for NaN.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub(super) min: [u32; 3],
    pub(super) max: [u32; 3],
}

impl Bounds {
    /// Of nothing.
    pub(super) const NONE: Self = Self { min: [u32::MAX; 3], max: [0; 3] };

    /// Takes in one position.
    pub(super) fn include(&mut self, position: [f32; 3]) {
        for (axis, bits) in position.map(f32::to_bits).into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(bits);
            self.max[axis] = self.max[axis].max(bits);
        }
    }

    /// Widens the bounds of `buffer` by these.
    pub(super) fn widen(self, buffer: &mut MeshBuffer) {
        if self.min[0] <= self.max[0] {
            let bounds = [self.min, self.max].map(|corner| corner.map(f32::from_bits));
            buffer.bounds = union(buffer.bounds, Some(bounds));
        }
    }
}

/// The smallest box around two boxes, where there are any.
pub(super) fn union(a: Option<[[f32; 3]; 2]>, b: Option<[[f32; 3]; 2]>) -> Option<[[f32; 3]; 2]> {
    let (Some([a_min, a_max]), Some([b_min, b_max])) = (a, b) else { return a.or(b) };
    Some([
        core::array::from_fn(|axis| a_min[axis].min(b_min[axis])),
        core::array::from_fn(|axis| a_max[axis].max(b_max[axis])),
    ])
}
