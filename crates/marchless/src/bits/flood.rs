//! Flood fill from seeds through a mask.
//!
//! The flood goes row by row. Points that are new in a row spread to the rows beside it. There, each run of the mask
//! that they touch becomes new as a whole, once. Rows with new points wait in a queue, so that many points are new by
//! the time a row's turn comes. The work is proportional to the number of rows reached, except in mazes.

use alloc::{collections::VecDeque, vec, vec::Vec};

use super::{BitGrid, BitsError, Connectivity};

impl BitGrid {
    /// The set points that are connected to any seed through set points. The grid is the mask; seeds that are not set
    /// fill nothing.
    ///
    /// A step fills whole runs of a row, which suits caves and terrain. The paths of a maze return to the same rows
    /// many times; [`components`](Self::components) takes far less time there.
    ///
    /// ```
    /// use marchless::{Shape, bits::{BitGrid, Connectivity}};
    ///
    /// let halves = BitGrid::from_fn(Shape::cube(70)?, |[x, ..]| x != 30)?;
    /// assert_eq!(halves.flood(&[[0, 0, 0]], Connectivity::TwentySix)?.count(), 30 * 70 * 70);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`BitsError::OutOfRange`] if a seed lies outside the grid.
    pub fn flood(&self, seeds: &[[u32; 3]], connectivity: Connectivity) -> Result<Self, BitsError> {
        let mut flood = Flood::new(self);
        let mut source = vec![0; self.row];
        for &position in seeds {
            let Some((word, bit)) = self.place_of(position) else {
                return Err(BitsError::OutOfRange { position, shape: self.shape });
            };
            source[word % self.row] = 1 << bit;
            flood.fill(word / self.row, &source);
            source[word % self.row] = 0;
        }
        Ok(flood.run(connectivity))
    }

    /// Fills from the points of another grid of the same shape, as [`flood`](Self::flood) does from a list.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `seeds` has another shape.
    pub fn flood_from(&self, seeds: &Self, connectivity: Connectivity) -> Result<Self, BitsError> {
        self.same_shape(seeds)?;
        let mut flood = Flood::new(self);
        for (row, source) in seeds.words.chunks_exact(seeds.row).enumerate() {
            flood.fill(row, source);
        }
        Ok(flood.run(connectivity))
    }
}

/// A flood in progress. It fills whole runs of the mask only.
struct Flood<'a> {
    mask: &'a BitGrid,
    filled: BitGrid,
    /// The filled points that have not spread yet, laid out as in `filled`.
    fresh: Vec<u64>,
    /// The rows with fresh points.
    queue: VecDeque<usize>,
}

impl<'a> Flood<'a> {
    fn new(mask: &'a BitGrid) -> Self {
        let fresh = vec![0; mask.words.len()];
        Self { mask, filled: BitGrid::empty(mask.shape), fresh, queue: VecDeque::new() }
    }

    /// Spreads until no point is fresh.
    fn run(mut self, connectivity: Connectivity) -> BitGrid {
        let len = self.mask.row;
        let [_, ny, nz] = self.mask.shape.size().map(|size| size as usize);
        let (mut exact, mut wide) = (vec![0; len], vec![0; len]);
        while let Some(row) = self.queue.pop_front() {
            let fresh = &mut self.fresh[row * len..][..len];
            exact.copy_from_slice(fresh);
            fresh.fill(0);
            if connectivity != Connectivity::Six {
                widen(&exact, &mut wide);
            }
            let faces = if connectivity == Connectivity::Six { &exact } else { &wide };
            let edges = if connectivity == Connectivity::TwentySix { &wide } else { &exact };
            let (y, z) = (row % ny, row / ny);
            let (below, above) = (y > 0, y + 1 < ny);
            if below {
                self.fill(row - 1, faces);
            }
            if above {
                self.fill(row + 1, faces);
            }
            for beside in [(z > 0).then(|| row - ny), (z + 1 < nz).then(|| row + ny)].into_iter().flatten() {
                self.fill(beside, faces);
                if connectivity != Connectivity::Six {
                    if below {
                        self.fill(beside - 1, edges);
                    }
                    if above {
                        self.fill(beside + 1, edges);
                    }
                }
            }
        }
        self.filled
    }

    /// Fills the runs of a row that have a bit set in `source`.
    #[inline]
    fn fill(&mut self, row: usize, source: &[u64]) {
        let len = self.mask.row;
        let range = row * len..(row + 1) * len;
        let mask = &self.mask.words[range.clone()];
        let filled = &mut self.filled.words[range.clone()];
        let fresh = &mut self.fresh[range];
        let mut touched = 0;
        for ((&source, &mask), &filled) in source.iter().zip(mask).zip(&*filled) {
            touched |= source & mask & !filled;
        }
        if touched == 0 {
            return;
        }
        if fresh.iter().all(|&word| word == 0) {
            self.queue.push_back(row);
        }
        // Upwards: adding a bit to a run clears all bits from there to the run's end, and carries into the next word.
        let mut carry = false;
        for (((&source, &mask), &filled), fresh) in source.iter().zip(mask).zip(&*filled).zip(&mut *fresh) {
            let free = mask & !filled;
            let seeds = source & free;
            let (sum, over) = free.overflowing_add(seeds);
            let (sum, over_again) = sum.overflowing_add(u64::from(carry));
            carry = over | over_again;
            *fresh |= free & !sum | seeds;
        }
        // Downwards, in steps of 1, 2, 4 to 32 bits.
        let mut carry = 0;
        for ((&mask, filled), fresh) in mask.iter().zip(filled).zip(fresh).rev() {
            let mut free = mask & !*filled;
            let mut bits = *fresh & free | carry << 63 & free;
            if bits >> 1 & free & !bits != 0 {
                for shift in [1, 2, 4, 8, 16, 32] {
                    bits |= bits >> shift & free;
                    free &= free >> shift;
                }
            }
            carry = bits & 1;
            *filled |= bits;
            *fresh |= bits;
        }
    }
}

/// Sets each bit that is set or has a set neighbour in its row.
fn widen(exact: &[u64], wide: &mut [u64]) {
    let mut before = 0;
    for (index, (&word, wide)) in exact.iter().zip(wide).enumerate() {
        let behind = exact.get(index + 1).map_or(0, |next| next << 63);
        *wide = word | word << 1 | before >> 63 | word >> 1 | behind;
        before = word;
    }
}
