//! Words in memory that vector instructions take a whole cache line of at a time.
#![expect(unsafe_code, reason = "a view of whole lines as single words")]

use alloc::{collections::TryReserveError, vec, vec::Vec};
use core::{
    ops::{Deref, DerefMut},
    slice,
};

/// Words from the start of a cache line on. With vectors of 64 bytes that reach from one line into the next, dilation
/// takes 1.7 times as long.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Words {
    /// What is behind the last word is zero.
    lines: Vec<Line>,
    len: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(C, align(64))]
struct Line([u64; 8]);

impl Words {
    /// So many zeros.
    pub(crate) fn zeros(len: usize) -> Self {
        Self { lines: vec![Line([0; 8]); len.div_ceil(8)], len }
    }

    /// So many zeros, where memory holds them.
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
        // SAFETY: lines are eight words each, without anything in between, and there are enough of them.
        unsafe { slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

impl DerefMut for Words {
    #[inline]
    fn deref_mut(&mut self) -> &mut [u64] {
        debug_assert!(self.len <= 8 * self.lines.len());
        // SAFETY: as above, and they are borrowed for as long.
        unsafe { slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}
