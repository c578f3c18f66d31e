//! [`Words`]: words aligned to cache lines, for vectors of 64 bytes.
#![expect(unsafe_code, reason = "a view of whole lines as single words")]

use alloc::{collections::TryReserveError, vec, vec::Vec};
use core::{
    ops::{Deref, DerefMut},
    slice,
};

/// Words that start at a cache line. Dilation takes 1.7 times as long if vectors of 64 bytes straddle two lines.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Words {
    /// The lines that hold the words. Unused words of the last line are zero.
    lines: Vec<Line>,
    len: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(C, align(64))]
struct Line([u64; 8]);

impl Words {
    /// `len` zeros.
    pub(crate) fn zeros(len: usize) -> Self {
        Self { lines: vec![Line([0; 8]); len.div_ceil(8)], len }
    }

    /// `len` zeros.
    ///
    /// # Errors
    /// An error if memory does not suffice.
    pub(crate) fn try_zeros(len: usize) -> Result<Self, TryReserveError> {
        let mut lines = Vec::new();
        lines.try_reserve_exact(len.div_ceil(8))?;
        lines.resize(len.div_ceil(8), Line([0; 8]));
        Ok(Self { lines, len })
    }
}

impl Deref for Words {
    type Target = [u64];

    #[inline]
    fn deref(&self) -> &[u64] {
        debug_assert!(self.len <= 8 * self.lines.len());
        // SAFETY: each line is eight words without padding, and there are enough lines.
        unsafe { slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

impl DerefMut for Words {
    #[inline]
    fn deref_mut(&mut self) -> &mut [u64] {
        debug_assert!(self.len <= 8 * self.lines.len());
        // SAFETY: as above; the words borrow the lines exclusively.
        unsafe { slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}
