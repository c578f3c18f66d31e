//! [`SlabLayout`]: where the samples of a slab lie in memory, and how their signs are packed.

use crate::lattice::{Samples, Shape};

/// The layout of slabs in memory, and of their signs in words.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabLayout {
    /// Meshed samples per axis.
    pub(crate) size: [usize; 3],
    /// True if a layer of padding surrounds the meshed samples.
    pub(crate) padded: bool,
    /// Samples of one slab, padding included.
    pub(crate) len: usize,
    /// The index of a slab's first meshed sample.
    pub(crate) origin: usize,
    /// The distance in memory between neighbours along y.
    pub(crate) stride: usize,
    /// Sign words per row.
    pub(crate) words: usize,
    /// The bits of a row's last word that stand for samples.
    pub(crate) last_word: u64,
}

impl SlabLayout {
    /// The layout of a whole volume; `None` if an axis has fewer samples than [`SlabLayout::min_size`].
    pub(crate) fn of<W>(samples: &Samples<'_, W>) -> Option<Self> {
        let (shape, padding) = (samples.shape(), u32::from(samples.is_padded()));
        if shape.size().iter().any(|&size| size < Self::min_size(samples.is_padded())) {
            return None;
        }
        let [_, stride, len] = shape.strides();
        let size = shape.size().map(|size| (size - 2 * padding) as usize);
        Some(Self::new(size, padding as usize, stride, len))
    }

    /// The samples per axis, padding included, that make one cell.
    pub(crate) const fn min_size(padded: bool) -> u32 {
        if padded { 4 } else { 2 }
    }

    /// The layout of slabs of `size` samples without padding, of unknown number. `None` if they have no cells or do not
    /// fit in memory.
    pub(crate) fn of_slabs(size: [u32; 2]) -> Option<Self> {
        let shape = Shape::new([size[0], size[1], 1]).ok()?;
        let [_, stride, len] = shape.strides();
        (size[0] >= 2 && size[1] >= 2)
            .then(|| Self::new([size[0] as usize, size[1] as usize, usize::MAX], 0, stride, len))
    }

    fn new(size: [usize; 3], padding: usize, stride: usize, len: usize) -> Self {
        Self {
            size,
            padded: padding == 1,
            len,
            origin: padding * (1 + stride),
            stride,
            words: size[0].div_ceil(64),
            last_word: u64::MAX >> (size[0].next_multiple_of(64) - size[0]),
        }
    }

    /// The bit of a row's last sample in the row's last word.
    #[inline(always)]
    pub(crate) const fn last_sample(&self) -> u64 {
        self.last_word ^ self.last_word >> 1
    }

    /// The index in its slab of the meshed sample at `x`, `y`.
    #[inline(always)]
    pub(crate) const fn index(&self, x: u32, y: u32) -> usize {
        self.origin + y as usize * self.stride + x as usize
    }

    /// The `x` and `y` of the meshed sample with this [index](SlabLayout::index).
    pub(crate) const fn position_of(&self, index: usize) -> (u32, u32) {
        let from_origin = index - self.origin;
        ((from_origin % self.stride) as u32, (from_origin / self.stride) as u32)
    }

    /// The distance in memory between the ends of an edge along `AXIS`, each counted in its own slab.
    #[inline(always)]
    pub(crate) const fn step<const AXIS: usize>(&self) -> usize {
        match AXIS {
            0 => 1,
            1 => self.stride,
            _ => 0,
        }
    }

    /// The y of a slab's sign word number `word`, and the x of its lowest bit.
    #[inline(always)]
    pub(crate) const fn word_position(&self, word: usize) -> (u32, u32) {
        if self.words == 1 {
            return (word as u32, 0);
        }
        ((word / self.words) as u32, 64 * (word % self.words) as u32)
    }
}
