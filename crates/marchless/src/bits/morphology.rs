//! Dilation, erosion, opening, closing.
//!
//! Slab by slab: first along z, where whole slabs are joined, then along y, where whole rows are, and along x last. The
//! box of 26 neighbours is all three in turn; those of 18 and of 6 take what is joined less from the sides. A slab or a
//! row beyond the border adds nothing, and is replaced by the one beside it.

use alloc::{vec, vec::Vec};

use super::{BitGrid, BitsError, Connectivity, pattern::Pattern};
use crate::simd::{Backend, Job, Simd, dispatch};

impl BitGrid {
    /// The points that are set or have a neighbour that is. Points outside are not set.
    ///
    /// ```
    /// use marchless::{Shape, bits::{BitGrid, Connectivity}};
    ///
    /// let mut grid = BitGrid::new(Shape::cube(9)?)?;
    /// grid.set([4, 4, 4], true)?;
    /// assert_eq!(Connectivity::ALL.map(|connectivity| grid.dilated(connectivity).count()), [7, 19, 27]);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn dilated(&self, connectivity: Connectivity) -> Self {
        let mut out = self.zeros();
        dispatch(Backend::fastest(), Spread::<false> { from: self, connectivity, out: &mut out });
        out
    }

    /// [`dilated`](Self::dilated), into a grid that is there.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] where `out` has another shape; it is then as it was.
    pub fn dilate_into(&self, connectivity: Connectivity, out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        dispatch(Backend::fastest(), Spread::<false> { from: self, connectivity, out });
        Ok(())
    }

    /// The points that are set together with all their neighbours. Points outside count as set: erosion is dilation of
    /// what is not set.
    #[must_use]
    pub fn eroded(&self, connectivity: Connectivity) -> Self {
        let mut out = self.zeros();
        dispatch(Backend::fastest(), Spread::<true> { from: self, connectivity, out: &mut out });
        out
    }

    /// [`eroded`](Self::eroded), into a grid that is there.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] where `out` has another shape; it is then as it was.
    pub fn erode_into(&self, connectivity: Connectivity, out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        dispatch(Backend::fastest(), Spread::<true> { from: self, connectivity, out });
        Ok(())
    }

    /// Eroded, then dilated: without what is too thin or too small to hold a point and all its neighbours. Nothing is
    /// added.
    #[must_use]
    pub fn opened(&self, connectivity: Connectivity) -> Self {
        self.eroded(connectivity).dilated(connectivity)
    }

    /// Dilated, then eroded: with gaps closed that are too narrow or too small to hold a point and all its neighbours.
    /// Nothing is taken away.
    #[must_use]
    pub fn closed(&self, connectivity: Connectivity) -> Self {
        self.dilated(connectivity).eroded(connectivity)
    }
}

/// Dilation, or erosion.
struct Spread<'a, const ERODE: bool> {
    from: &'a BitGrid,
    connectivity: Connectivity,
    out: &'a mut BitGrid,
}

impl<const ERODE: bool> Job for Spread<'_, ERODE> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { from, connectivity, out } = self;
        let row = from.row;
        let slab = row * from.shape.size()[1] as usize;
        let ends = Ends::new(from);
        let mut along_z = vec![0; slab];
        // With one more word on either side.
        let [mut across, mut square]: [Vec<u64>; 2] = [(); 2].map(|()| vec![0; slab + 2]);
        let slabs = from.words.chunks_exact(slab);
        let below = slabs.clone().take(1).chain(slabs.clone());
        let above = slabs.clone().skip(1).chain(slabs.clone().next_back());
        for (((out, here), below), above) in out.words.chunks_exact_mut(slab).zip(slabs).zip(below).zip(above) {
            for (((joined, &here), &below), &above) in along_z.iter_mut().zip(here).zip(below).zip(above) {
                *joined = join::<ERODE>(join::<ERODE>(here, below), above);
            }
            match connectivity {
                Connectivity::Six => {
                    along_y::<ERODE>(&along_z, here, row, &mut square[1..=slab]);
                    across[1..=slab].copy_from_slice(here);
                    along_x::<ERODE>(&square[1..=slab], &across, &ends, out);
                }
                Connectivity::Eighteen => {
                    along_y::<ERODE>(&along_z, here, row, &mut across[1..=slab]);
                    along_y::<ERODE>(&along_z, &along_z, row, &mut square[1..=slab]);
                    along_x::<ERODE>(&square[1..=slab], &across, &ends, out);
                }
                Connectivity::TwentySix => {
                    along_y::<ERODE>(&along_z, &along_z, row, &mut square[1..=slab]);
                    along_x::<ERODE>(&square[1..=slab], &square, &ends, out);
                }
            }
        }
    }
}

/// Union, or intersection.
#[inline(always)]
fn join<const ERODE: bool>(a: u64, b: u64) -> u64 {
    if ERODE { a & b } else { a | b }
}

/// Joins the rows of `centre` with the rows beside them in `sides`, rows of `row` words.
#[inline(always)]
fn along_y<const ERODE: bool>(centre: &[u64], sides: &[u64], row: usize, out: &mut [u64]) {
    let rest = centre.len() - row;
    if rest == 0 {
        out.copy_from_slice(centre);
        return;
    }
    let both = |centre: &[u64], below: &[u64], above: &[u64], out: &mut [u64]| {
        for (((out, &centre), &below), &above) in out.iter_mut().zip(centre).zip(below).zip(above) {
            *out = join::<ERODE>(join::<ERODE>(centre, below), above);
        }
    };
    both(&centre[..row], &centre[..row], &sides[row..2 * row], &mut out[..row]);
    both(&centre[row..rest], &sides[..rest - row], &sides[2 * row..], &mut out[row..rest]);
    both(&centre[rest..], &sides[rest - row..rest], &centre[rest..], &mut out[rest..]);
}

/// Joins the points of `centre` with the points beside them in `sides`, along x. `sides` has one more word on either
/// side, whatever it is.
#[inline(always)]
fn along_x<const ERODE: bool>(centre: &[u64], sides: &[u64], ends: &Ends, out: &mut [u64]) {
    let (from_low, from_high) = (ends.from_low.words(), ends.from_high.words());
    let (len, end) = (from_low.len(), centre.len());
    let windows = sides[..end].chunks(len).zip(sides[1..=end].chunks(len)).zip(sides[2..].chunks(len));
    for ((out, centre), ((low, here), high)) in out.chunks_mut(len).zip(centre.chunks(len)).zip(windows) {
        let masks = from_low.iter().zip(from_high);
        let words = centre.iter().zip(low).zip(here).zip(high);
        for ((out, (((&centre, &low), &here), &high)), (&from_low, &from_high)) in out.iter_mut().zip(words).zip(masks)
        {
            let [low, high] = beside([low, here, high]).map(|word| if ERODE { !word } else { word });
            let sides = low & from_low | high & from_high;
            *out = if ERODE { centre & !sides } else { centre | sides };
        }
    }
}

/// The points beside those of a word, at −x and at +x, of the word before it, itself and the word behind it.
#[inline(always)]
pub(super) const fn beside([low, here, high]: [u64; 3]) -> [u64; 2] {
    [here << 1 | low >> 63, here >> 1 | high << 63]
}

/// Which points have a neighbour at −x and at +x in the same row, for each word of a row.
pub(super) struct Ends {
    pub(super) from_low: Pattern,
    pub(super) from_high: Pattern,
}

impl Ends {
    #[inline(always)]
    pub(super) fn new(grid: &BitGrid) -> Self {
        let (row, rows, last) = (grid.row, grid.shape.size()[1] as usize, grid.last_word());
        let valid = move |column: usize| if column == row - 1 { last } else { u64::MAX };
        Self {
            from_low: Pattern::new(row, rows, 0, |column| valid(column) & if column == 0 { !1 } else { u64::MAX }),
            from_high: Pattern::new(row, rows, 0, |column| if column == row - 1 { last >> 1 } else { u64::MAX }),
        }
    }
}
