//! Shifting a whole grid.
//!
//! A shift along y or z moves whole rows. A shift along x moves words, and bits from each word into the next. It treats
//! the rows of a slab as one stream of words; a mask for each word of a row drops the bits that come from another row.

use super::{BitGrid, BitsError, pattern::Pattern};
use crate::simd::{Backend, Job, Simd, Words, dispatch_words};

impl BitGrid {
    /// The grid with every set point moved by `offset`: its point `p` is point `p - offset` of this grid. Zeros come in
    /// at the borders; points that leave the grid are lost.
    ///
    /// ```
    /// use marchless::{Shape, bits::BitGrid};
    ///
    /// let mut grid = BitGrid::new(Shape::cube(100)?)?;
    /// grid.set([20, 1, 1], true)?;
    /// assert!(grid.shifted([70, 0, -1]).iter().eq([[90, 1, 0]]));
    /// assert!(grid.shifted([-21, 0, 0]).is_empty());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn shifted(&self, offset: [i32; 3]) -> Self {
        let mut out = self.zeros();
        dispatch_words(Backend::fastest(), Shift { from: self, offset, out: &mut out });
        out
    }

    /// [`shifted`](Self::shifted) into an existing grid.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `out` has another shape; it is then unchanged.
    pub fn shift_into(&self, offset: [i32; 3], out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        dispatch_words(Backend::fastest(), Shift { from: self, offset, out });
        Ok(())
    }

    /// A grid of zeros of the same shape.
    pub(super) fn zeros(&self) -> Self {
        Self { shape: self.shape, row: self.row, words: Words::zeros(self.words.len()) }
    }
}

/// A shift of one grid into another.
struct Shift<'a> {
    from: &'a BitGrid,
    offset: [i32; 3],
    out: &'a mut BitGrid,
}

impl Job for Shift<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { from, offset: [dx, dy, dz], out } = self;
        let size = from.shape.size();
        if (0..3).any(|axis| self.offset[axis].unsigned_abs() >= size[axis]) {
            out.words.fill(0);
            return;
        }
        let [_, ny, nz] = size.map(|size| size as usize);
        let slab = from.row * ny;
        let along_x = AlongX::new(from, dx);
        let (source, target) = overlap(&from.words, &mut out.words, dz, slab);
        if dy == 0 {
            along_x.run(source, target);
            return;
        }
        debug_assert_eq!(source.len() % slab, 0);
        debug_assert!(source.len() / slab <= nz);
        for (source, target) in source.chunks_exact(slab).zip(target.chunks_exact_mut(slab)) {
            let (source, target) = overlap(source, target, dy, from.row);
            along_x.run(source, target);
        }
    }
}

/// The parts of `source` and `target` that correspond when all words move by `steps` pieces of `piece` words. The rest
/// of `target` becomes zero.
#[inline(always)]
fn overlap<'a>(source: &'a [u64], target: &'a mut [u64], steps: i32, piece: usize) -> (&'a [u64], &'a mut [u64]) {
    let (words, rest) = (steps.unsigned_abs() as usize * piece, target.len() - steps.unsigned_abs() as usize * piece);
    if steps < 0 {
        let (target, zeros) = target.split_at_mut(rest);
        zeros.fill(0);
        (&source[words..], target)
    } else {
        let (zeros, target) = target.split_at_mut(words);
        zeros.fill(0);
        (&source[..rest], target)
    }
}

/// A shift along x by less than a row: by whole words, and then by bits.
struct AlongX {
    up: bool,
    words: usize,
    /// Less than 64.
    bits: u32,
    /// For each word, a mask of the bits that come from its own row. Starts with the word that [`AlongX::stream`]
    /// writes first.
    masks: Pattern,
}

impl AlongX {
    #[inline(always)]
    fn new(grid: &BitGrid, offset: i32) -> Self {
        let (row, last) = (grid.row, grid.last_word());
        let (words, bits) = ((offset.unsigned_abs() / 64) as usize, offset.unsigned_abs() % 64);
        let up = offset > 0;
        let rows = grid.words.len() / row;
        let start = if up { (words + 1) % row } else { 0 };
        let masks = Pattern::new(row, if offset == 0 { 1 } else { rows }, start, |column| {
            let word = if up { Some(column) } else { (row - 1).checked_sub(column) };
            let mask = match word.and_then(|word| word.checked_sub(words)) {
                None => 0,
                Some(0) if up => u64::MAX << bits,
                Some(0) => u64::MAX >> bits,
                Some(_) => u64::MAX,
            };
            if column == row - 1 { mask & last } else { mask }
        });
        Self { up, words, bits, masks }
    }

    /// Shifts whole rows.
    #[inline(always)]
    fn run(&self, source: &[u64], target: &mut [u64]) {
        let (words, bits, len) = (self.words, self.bits, source.len());
        if words == 0 && bits == 0 {
            target.copy_from_slice(source);
        } else if self.up {
            target[..words].fill(0);
            let mask = self.masks.words().last().copied().unwrap_or(0);
            target[words] = source[0] << bits & mask;
            let (moved, carried) = (&source[1..len - words], &source[..len - words - 1]);
            self.stream(moved, carried, &mut target[words + 1..], |moved, carried| {
                moved << bits | carried >> 1 >> (63 - bits)
            });
        } else {
            let rest = len - words - 1;
            target[rest + 1..].fill(0);
            target[rest] = source[len - 1] >> bits;
            self.stream(&source[words..len - 1], &source[words + 1..], &mut target[..rest], |moved, carried| {
                moved >> bits | carried << 1 << (63 - bits)
            });
        }
    }

    /// Writes `join` of each pair of words, masked.
    #[inline(always)]
    fn stream(&self, moved: &[u64], carried: &[u64], target: &mut [u64], join: impl Fn(u64, u64) -> u64) {
        let masks = self.masks.words();
        let pieces = moved.chunks(masks.len()).zip(carried.chunks(masks.len()));
        for (target, (moved, carried)) in target.chunks_mut(masks.len()).zip(pieces) {
            for (((target, &moved), &carried), &mask) in target.iter_mut().zip(moved).zip(carried).zip(masks) {
                *target = join(moved, carried) & mask;
            }
        }
    }
}
