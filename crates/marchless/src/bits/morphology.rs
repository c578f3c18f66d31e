//! Dilation, erosion, opening, closing.
//!
//! Two slabs are treated together, from the lowest y to the highest, in steps of one row or a few short ones. A step
//! joins its words along z and keeps the result in registers for the next two steps, which join it along y. The join
//! along x follows at once.

use core::array::from_fn;

use super::{BitGrid, BitsError, Connectivity};
use crate::simd::{Backend, Eight, Job, Simd, Words, dispatch_words};

impl BitGrid {
    /// The points that are set or have a set neighbour. Points outside the grid count as not set.
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
        spread(Backend::fastest(), self, connectivity, 0, &mut out);
        out
    }

    /// [`dilated`](Self::dilated) into an existing grid.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `out` has another shape; it is then unchanged.
    pub fn dilate_into(&self, connectivity: Connectivity, out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        spread(Backend::fastest(), self, connectivity, 0, out);
        Ok(())
    }

    /// The set points whose neighbours are all set. Points outside the grid count as set, so erosion is the dilation of
    /// the complement.
    #[must_use]
    pub fn eroded(&self, connectivity: Connectivity) -> Self {
        let mut out = self.zeros();
        spread(Backend::fastest(), self, connectivity, u64::MAX, &mut out);
        out
    }

    /// [`eroded`](Self::eroded) into an existing grid.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `out` has another shape; it is then unchanged.
    pub fn erode_into(&self, connectivity: Connectivity, out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        spread(Backend::fastest(), self, connectivity, u64::MAX, out);
        Ok(())
    }

    /// The grid eroded, then dilated. This removes parts that are too thin or too small to hold a point and all its
    /// neighbours, and adds nothing.
    #[must_use]
    pub fn opened(&self, connectivity: Connectivity) -> Self {
        self.eroded(connectivity).dilated(connectivity)
    }

    /// The grid dilated, then eroded. This closes gaps that are too narrow or too small to hold a point and all its
    /// neighbours, and removes nothing.
    #[must_use]
    pub fn closed(&self, connectivity: Connectivity) -> Self {
        self.dilated(connectivity).eroded(connectivity)
    }
}

/// Dilation with `flip` applied to each word before and after (by xor): 0 for dilation, all ones for erosion.
fn spread(backend: Backend, from: &BitGrid, connectivity: Connectivity, flip: u64, out: &mut BitGrid) {
    dispatch_words(backend, Spread { from, connectivity, flip, out });
}

struct Spread<'a> {
    from: &'a BitGrid,
    connectivity: Connectivity,
    flip: u64,
    out: &'a mut BitGrid,
}

impl Job for Spread<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        match self.from.row {
            1 => self.strip::<S, 1>(0),
            2 => self.strip::<S, 2>(0),
            4 => self.strip::<S, 4>(0),
            row => {
                // A strip's first and last words need neighbours outside the strip, except at the ends of a row. So
                // strips overlap by two words.
                let mut start = 0;
                loop {
                    self.strip::<S, LANES>(start);
                    if start + LANES >= row {
                        break;
                    }
                    start = (start + LANES - 2).min(row - LANES);
                }
            }
        }
    }
}

impl Spread<'_> {
    #[inline(always)]
    fn strip<S: Simd, const ROW: usize>(&mut self, start: usize) {
        let strip = Strip::new(self.from, start, ROW, self.flip);
        match self.connectivity {
            Connectivity::Six => strip.slabs::<S::Eight, ROW, 6>(self.from, self.out),
            Connectivity::Eighteen => strip.slabs::<S::Eight, ROW, 18>(self.from, self.out),
            Connectivity::TwentySix => strip.slabs::<S::Eight, ROW, 26>(self.from, self.out),
        }
    }
}

/// The number of words that are treated at once.
const LANES: usize = 8;

/// A part of a slab that is treated from the lowest y to the highest: eight words of each row, or several whole rows at
/// once if they are short.
struct Strip {
    /// The index in a row of the strip's first word.
    start: usize,
    /// The number of words from one step to the next.
    step: usize,
    /// For each word, a mask of the points that have a neighbour at −x.
    from_low: [u64; LANES],
    /// For each word, a mask of the points that have a neighbour at +x.
    from_high: [u64; LANES],
    /// Applied by xor to each word that is read or written.
    flip: u64,
}

impl Strip {
    #[inline(always)]
    fn new(grid: &BitGrid, start: usize, lanes_a_row: usize, flip: u64) -> Self {
        let (row, last) = (grid.row, grid.last_word());
        let column = |lane: usize| start + lane % lanes_a_row;
        let valid = |column: usize| if column == row - 1 { last } else { u64::MAX };
        Self {
            start,
            step: if lanes_a_row == LANES { row } else { LANES / lanes_a_row * lanes_a_row },
            from_low: from_fn(|lane| valid(column(lane)) & if column(lane) == 0 { !1 } else { u64::MAX }),
            from_high: from_fn(|lane| if column(lane) == row - 1 { last >> 1 } else { u64::MAX }),
            flip,
        }
    }

    /// Joins the points of all slabs with their neighbours.
    #[inline(always)]
    fn slabs<E: Eight, const ROW: usize, const NEIGHBOURS: u8>(&self, from: &BitGrid, out: &mut BitGrid) {
        let [_, ny, nz] = from.shape.size().map(|size| size as usize);
        let len = from.row * ny;
        // The lowest and the highest slab stand in for the missing ones beyond them, which changes nothing in a union.
        let slab = |z: usize| &from.words[len * z.min(nz - 1)..][..len];
        if nz == 1 {
            let mut spare = Words::zeros(len);
            self.two_slabs::<E, ROW, NEIGHBOURS>([slab(0); 4], [&mut out.words, &mut spare]);
            return;
        }
        for z in (1..nz + nz % 2).step_by(2) {
            // With an odd number of slabs, the last but one is made twice.
            let z = z.min(nz - 1);
            let (low, high) = out.words[len * (z - 1)..][..2 * len].split_at_mut(len);
            let slabs = [slab(z.saturating_sub(2)), slab(z - 1), slab(z), slab(z + 1)];
            self.two_slabs::<E, ROW, NEIGHBOURS>(slabs, [low, high]);
        }
    }

    /// Joins the points of the two middle slabs with their neighbours in all four. `ROW` is the number of words per
    /// row, or [`LANES`] if one row is treated at a time.
    #[inline(always)]
    fn two_slabs<E: Eight, const ROW: usize, const NEIGHBOURS: u8>(
        &self,
        slabs: [&[u64]; 4],
        [low, high]: [&mut [u64]; 2],
    ) {
        let (masks, flip) = ([E::load(&self.from_low), E::load(&self.from_high)], E::load(&[self.flip; LANES]));
        let nothing = E::load(&[0; LANES]);
        let (mut before, mut here) = ([[nothing; 2]; 2], self.load_part(slabs, self.start));
        let mut at = self.start;
        // A step may write past its own words; the next step overwrites that.
        if at == 0 {
            // The fast path, without branches: all that a step reads lies within the slabs.
            while let ([Some(below), Some(first), Some(second), Some(above)], Some(low), Some(high)) = (
                slabs.map(|slab| chunk(slab, at + self.step)),
                low.get_mut(at..).and_then(|low| low.first_chunk_mut()),
                high.get_mut(at..).and_then(|high| high.first_chunk_mut()),
            ) {
                let behind = join_slabs([below, first, second, above], flip);
                for (out, slab) in [low, high].into_iter().zip([0, 1]) {
                    let joined = step::<E, ROW, NEIGHBOURS>([before[slab], here[slab], behind[slab]], masks);
                    joined.xor(flip).store(out);
                }
                (before, here) = (here, behind);
                at += self.step;
            }
        }
        while at < low.len() {
            let behind = self.load_part(slabs, at + self.step);
            for (out, slab) in [&mut *low, &mut *high].into_iter().zip([0, 1]) {
                let joined = step::<E, ROW, NEIGHBOURS>([before[slab], here[slab], behind[slab]], masks).xor(flip);
                match out[at..].first_chunk_mut() {
                    Some(out) if self.start == 0 => joined.store(out),
                    _ => {
                        let mut words = [0; LANES];
                        joined.store(&mut words);
                        let first = usize::from(self.start > 0);
                        out[at..].iter_mut().zip(words).skip(first).for_each(|(out, word)| *out = word);
                    }
                }
            }
            (before, here) = (here, behind);
            at += self.step;
        }
    }

    /// [`join_slabs`] of the words from `at` on, as many as the slabs have.
    #[inline(always)]
    fn load_part<E: Eight>(&self, slabs: [&[u64]; 4], at: usize) -> [[E; 2]; 2] {
        let mut words = [[self.flip; LANES]; 4];
        for (words, slab) in words.iter_mut().zip(slabs) {
            words.iter_mut().zip(slab.iter().skip(at)).for_each(|(word, &there)| *word = there);
        }
        join_slabs(words.each_ref(), E::load(&[self.flip; LANES]))
    }
}

#[inline(always)]
fn chunk(slab: &[u64], at: usize) -> Option<&[u64; LANES]> {
    slab.get(at..)?.first_chunk()
}

/// For each of the two middle slabs: its own words, and their union with the words of the slabs below and above it.
#[inline(always)]
fn join_slabs<E: Eight>(slabs: [&[u64; LANES]; 4], flip: E) -> [[E; 2]; 2] {
    let [below, first, second, above] = slabs;
    let (below, above) = (E::load(below).xor(flip), E::load(above).xor(flip));
    let (first, second) = (E::load(first).xor(flip), E::load(second).xor(flip));
    let both = first.or(second);
    [[first, both.or(below)], [second, both.or(above)]]
}

/// The joined words of one step, from the words of the step before, this step and the next: for each, those of the slab
/// alone and those of [`join_slabs`].
#[inline(always)]
fn step<E: Eight, const ROW: usize, const NEIGHBOURS: u8>(
    [before, here, behind]: [[E; 2]; 3],
    [from_low, from_high]: [E; 2],
) -> E {
    let (centre, sides) = match NEIGHBOURS {
        6 => (along_y::<E, ROW>(here[1], [before[0], here[0], behind[0]]), here[0]),
        18 => (
            along_y::<E, ROW>(here[1], [before[1], here[1], behind[1]]),
            along_y::<E, ROW>(here[1], [before[0], here[0], behind[0]]),
        ),
        _ => {
            let square = along_y::<E, ROW>(here[1], [before[1], here[1], behind[1]]);
            (square, square)
        }
    };
    centre.spread(sides, from_low, from_high)
}

/// Joins the words of `centre` with their neighbours along y, from the step before, this step and the next.
#[inline(always)]
fn along_y<E: Eight, const ROW: usize>(centre: E, [before, here, behind]: [E; 3]) -> E {
    let [low, high] = match ROW {
        1 => [E::window::<7>(before, here), E::window::<1>(here, behind)],
        2 => [E::window::<6>(before, here), E::window::<2>(here, behind)],
        4 => [E::window::<4>(before, here), E::window::<4>(here, behind)],
        _ => [before, behind],
    };
    centre.or(low).or(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Shape;

    fn spread(backend: Backend, from: &BitGrid, connectivity: Connectivity, flip: u64) -> BitGrid {
        let mut out = from.zeros();
        super::spread(backend, from, connectivity, flip, &mut out);
        out
    }

    #[test]
    fn backends_agree() {
        for nx in [1, 63, 64, 65, 127, 128, 130, 250, 256, 320, 512, 513, 1000] {
            for ny in [1, 2, 3, 7, 8, 9] {
                let mut rng = fastrand::Rng::with_seed(1);
                let noise = |_| rng.u8(0..4) != 0;
                let dense = BitGrid::from_fn(Shape::new([nx, ny, 1 + (nx + ny) % 4]).unwrap(), noise).unwrap();
                let mut sparse = dense.clone();
                sparse.invert();
                for (backend, connectivity) in Backend::ALL
                    .iter()
                    .flat_map(|&backend| Connectivity::ALL.map(|connectivity| (backend, connectivity)))
                {
                    let dilated = spread(backend, &sparse, connectivity, 0);
                    assert!(dilated == spread(Backend::Portable, &sparse, connectivity, 0), "{backend:?} {nx} {ny}");
                    let eroded = spread(backend, &dense, connectivity, u64::MAX);
                    assert!(
                        eroded == spread(Backend::Portable, &dense, connectivity, u64::MAX),
                        "{backend:?} {nx} {ny}"
                    );
                }
            }
        }
    }
}
