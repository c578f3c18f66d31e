//! Boolean operations on whole grids, and cutting a box out of a grid.

use super::{BitGrid, BitsError, paste::word_at};
use crate::{
    lattice::{Region, Shape},
    simd::{Backend, Job, Simd, dispatch_words},
};

impl BitGrid {
    /// Keeps the points that are also set in `other`: the intersection.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`]; the grid is then unchanged.
    pub fn and_with(&mut self, other: &Self) -> Result<(), BitsError> {
        self.combine(other, |word, other| word & other)
    }

    /// Adds the points that are set in `other`: the union.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`]; the grid is then unchanged.
    pub fn or_with(&mut self, other: &Self) -> Result<(), BitsError> {
        self.combine(other, |word, other| word | other)
    }

    /// Inverts the points that are set in `other`: the symmetric difference.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`]; the grid is then unchanged.
    pub fn xor_with(&mut self, other: &Self) -> Result<(), BitsError> {
        self.combine(other, |word, other| word ^ other)
    }

    /// Clears the points that are set in `other`: the difference.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`]; the grid is then unchanged.
    pub fn subtract(&mut self, other: &Self) -> Result<(), BitsError> {
        self.combine(other, |word, other| word & !other)
    }

    /// Inverts every point: the complement.
    pub fn invert(&mut self) {
        dispatch_words(Backend::fastest(), Invert { words: &mut self.words });
        self.clear_unused();
    }

    /// Copies all bits of `other` into the existing memory.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`]; the grid is then unchanged.
    pub fn copy_from(&mut self, other: &Self) -> Result<(), BitsError> {
        self.same_shape(other)?;
        self.words.copy_from_slice(&other.words);
        Ok(())
    }

    /// The points in `region` as a grid of their own: its point `p` is point `region.min + p` of this grid. The region
    /// may reach beyond this grid; points outside are zero.
    ///
    /// ```
    /// use marchless::{Region, Shape, bits::BitGrid};
    ///
    /// let grid = BitGrid::filled(Shape::cube(10)?, true)?;
    /// let cut = grid.cut(Region::new([-1, 2, 2], [4, 5, 5]))?;
    /// assert_eq!((cut.shape().size(), cut.count()), ([5, 3, 3], 4 * 3 * 3));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`BitsError::RegionSize`] if the region is empty or has more points than can be counted, [`BitsError::TooLarge`]
    /// if memory cannot hold the grid.
    pub fn cut(&self, region: Region) -> Result<Self, BitsError> {
        let shape = Shape::new(region.size()).map_err(|_| BitsError::RegionSize { region })?;
        let mut cut = Self::new(shape)?;
        let size = self.shape.size().map(i64::from);
        let within = |axis: usize, v: u32| {
            let place = i64::from(region.min[axis]) + i64::from(v);
            (0..size[axis]).contains(&place).then_some(place as u32)
        };
        let ny = shape.size()[1];
        for (number, out) in cut.words.chunks_exact_mut(cut.row).enumerate() {
            let (y, z) = ((number % ny as usize) as u32, (number / ny as usize) as u32);
            let (Some(y), Some(z)) = (within(1, y), within(2, z)) else { continue };
            let row = self.row(y, z);
            for (first, out) in (i64::from(region.min[0])..).step_by(64).zip(out) {
                *out = word_at(row, first);
            }
        }
        cut.clear_unused();
        Ok(cut)
    }

    /// Replaces each word by `combine` of it and the other grid's word. Unused bits stay zero if `combine` of two zero
    /// bits is zero.
    fn combine(&mut self, other: &Self, combine: impl Fn(u64, u64) -> u64) -> Result<(), BitsError> {
        self.same_shape(other)?;
        dispatch_words(Backend::fastest(), Combine { words: &mut self.words, others: &other.words, combine });
        Ok(())
    }
}

struct Combine<'a, F> {
    words: &'a mut [u64],
    others: &'a [u64],
    combine: F,
}

impl<F: Fn(u64, u64) -> u64> Job for Combine<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        for (word, &other) in self.words.iter_mut().zip(self.others) {
            *word = (self.combine)(*word, other);
        }
    }
}

struct Invert<'a> {
    words: &'a mut [u64],
}

impl Job for Invert<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        for word in self.words {
            *word = !*word;
        }
    }
}
