//! Reads of a few samples at once, for the passes that gather them in arrays.

use crate::{sample::Weight, signs::SlabLayout};

/// Four samples along x: the one before the meshed sample at `x` with index `index`, itself, and two behind it.
///
/// # Safety
/// `x` and `index` are those of a meshed sample of a whole slab.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loops that take most of the time")]
#[inline(always)]
pub(super) unsafe fn four<W: Weight, const PADDED: bool>(
    layout: &SlabLayout,
    slab: &[W],
    index: usize,
    x: u32,
) -> (W::Left, W::Right) {
    // SAFETY: padding lies before and behind each row, and a row of it behind the last. Without padding, the row's
    // outermost samples stand in for missing ones.
    unsafe {
        if PADDED {
            debug_assert!(index >= 1 && index + 2 < slab.len());
            return W::split(slab.as_ptr().add(index - 1).cast::<[W; 4]>().read());
        }
        let behind = layout.size[0] - 1 - x as usize;
        let [first, second] = [1, 2].map(|step| index + behind.min(step));
        let before = index - usize::from(x > 0);
        W::split([at(slab, before), at(slab, index), at(slab, first), at(slab, second)])
    }
}

/// The sample of a slab at `index`.
///
/// # Safety
/// `index` is less than the slab's length.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loops that take most of the time")]
#[inline(always)]
pub(super) unsafe fn at<W: Copy>(slab: &[W], index: usize) -> W {
    debug_assert!(index < slab.len());
    // SAFETY: as the caller promises.
    unsafe { *slab.get_unchecked(index) }
}

/// Two samples along x, from the one at `index` on.
///
/// # Safety
/// `index` and the next are less than the slab's length.
#[expect(unsafe_code, reason = "a dozen reads a vertex, in the loops that take most of the time")]
#[inline(always)]
pub(super) unsafe fn two<W: Weight>(slab: &[W], index: usize) -> W::Pair {
    debug_assert!(index + 1 < slab.len());
    // SAFETY: as the caller promises.
    W::pair(unsafe { slab.as_ptr().add(index).cast::<[W; 2]>().read() })
}
