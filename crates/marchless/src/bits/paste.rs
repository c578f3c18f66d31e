//! Copying a grid into another, and setting whole boxes.

use super::BitGrid;
use crate::lattice::Region;

impl BitGrid {
    /// Copies all bits of another grid, zeros included: its point `p` becomes the point `p + offset`. Points that fall
    /// outside this grid are left out.
    ///
    /// ```
    /// use marchless::{Shape, bits::BitGrid};
    ///
    /// let mut grid = BitGrid::new(Shape::new([100, 3, 3])?)?;
    /// grid.paste(&BitGrid::filled(Shape::cube(2)?, true)?, [63, 2, 0]);
    /// assert_eq!(grid.iter().collect::<Vec<_>>(), [[63, 2, 0], [64, 2, 0], [63, 2, 1], [64, 2, 1]]);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn paste(&mut self, other: &Self, offset: [i32; 3]) {
        let Some([x, y, z]) = spans(self, other.shape().size(), offset.map(i64::from)) else { return };
        for to_z in z.0..z.1 {
            for to_y in y.0..y.1 {
                let from = other.row((to_y - i64::from(offset[1])) as u32, (to_z - i64::from(offset[2])) as u32);
                self.change_row(x, to_y, to_z, |first| word_at(from, first - i64::from(offset[0])));
            }
        }
    }

    /// Gives all points of a box the same value. Points outside the grid are left out.
    ///
    /// ```
    /// use marchless::{Region, Shape, bits::BitGrid};
    ///
    /// let mut grid = BitGrid::new(Shape::cube(70)?)?;
    /// grid.fill(Region::new([-5, 60, 0], [66, 80, 1]), true);
    /// assert_eq!(grid.count(), 66 * 10);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn fill(&mut self, region: Region, value: bool) {
        let Some([x, y, z]) = spans(self, region.size(), region.min.map(i64::from)) else { return };
        for to_z in z.0..z.1 {
            for to_y in y.0..y.1 {
                self.change_row(x, to_y, to_z, |_| if value { u64::MAX } else { 0 });
            }
        }
    }

    /// Replaces the bits of a row from `start` up to, but without, `end`, which lie within the grid. `word(x)` returns
    /// the 64 new bits from `x` on.
    #[inline]
    fn change_row(&mut self, (start, end): (i64, i64), y: i64, z: i64, word: impl Fn(i64) -> u64) {
        let row = self.words_per_row() * (y as usize + self.shape().size()[1] as usize * z as usize);
        for index in start / 64..=(end - 1) / 64 {
            let first = 64 * index;
            let low = u64::MAX << (start - first).max(0);
            let high = u64::MAX >> (first + 64 - end).max(0);
            let mask = low & high;
            let target = &mut self.words_mut()[row + index as usize];
            *target = *target & !mask | word(first) & mask;
        }
    }
}

/// The part of a box that lies in the grid: along each axis, the first coordinate and the one past the last. `None` if
/// box and grid have no point in common.
fn spans(grid: &BitGrid, size: [u32; 3], min: [i64; 3]) -> Option<[(i64, i64); 3]> {
    let grid = grid.shape().size();
    let span = |axis: usize| (min[axis].max(0), (min[axis] + i64::from(size[axis])).min(i64::from(grid[axis])));
    let spans = [0, 1, 2].map(span);
    spans.iter().all(|(start, end)| start < end).then_some(spans)
}

/// The 64 bits of a row from the bit `first` on; zeros beyond its ends.
pub(super) fn word_at(row: &[u64], first: i64) -> u64 {
    let (index, shift) = (first.div_euclid(64), first.rem_euclid(64) as u32);
    let word = |index: i64| usize::try_from(index).ok().and_then(|index| row.get(index)).copied().unwrap_or(0);
    // Two shifts, since one shift by 64 would overflow.
    word(index) >> shift | word(index + 1) << 1 << (63 - shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Shape;

    /// A grid of random bits.
    fn noise(size: [u32; 3], seed: u32) -> BitGrid {
        let mut rng = fastrand::Rng::with_seed(seed.into());
        BitGrid::from_fn(Shape::new(size).unwrap(), |_| rng.bool()).unwrap()
    }

    /// The point `position - offset` of a grid of `size`; `None` outside that grid.
    fn moved(size: [u32; 3], position: [u32; 3], offset: [i32; 3]) -> Option<[u32; 3]> {
        let mut from = [0; 3];
        for axis in 0..3 {
            from[axis] = u32::try_from(i64::from(position[axis]) - i64::from(offset[axis])).ok()?;
        }
        (0..3).all(|axis| from[axis] < size[axis]).then_some(from)
    }

    const SIZES: [[u32; 3]; 7] = [[1, 1, 1], [31, 2, 3], [64, 3, 2], [65, 1, 4], [127, 2, 2], [130, 3, 1], [200, 2, 3]];

    #[test]
    fn pasting_replaces_the_points_where_both_grids_overlap() {
        for (to, from) in SIZES.into_iter().flat_map(|to| SIZES.map(|from| (to, from))) {
            let (before, other) = (noise(to, 1), noise(from, 2));
            for x in [i32::MIN, -129, -64, -63, -1, 0, 1, 62, 64, 65, 128, i32::MAX] {
                for offset in [[x, 0, 0], [x, 1, -1], [x, -2, 0]] {
                    let mut after = before.clone();
                    after.paste(&other, offset);
                    let expected = |p| moved(from, p, offset).map_or(before.get(p), |p| other.get(p));
                    let expected = BitGrid::from_fn(before.shape(), expected).unwrap();
                    assert!(after == expected, "{from:?} into {to:?} at {offset:?}");
                }
            }
        }
    }

    #[test]
    fn filling_sets_the_points_of_a_box() {
        let ends = [i32::MIN, -1, 0, 1, 63, 64, 65, 129, 130, i32::MAX];
        for size in SIZES {
            let before = noise(size, 3);
            for (low, high) in ends.into_iter().flat_map(|low| ends.map(|high| (low, high))) {
                for (region, value) in [
                    (Region::new([low, 0, -7], [high, 2, 2]), true),
                    (Region::new([low, 1, 1], [high, 9, i32::MAX]), false),
                ] {
                    let mut after = before.clone();
                    after.fill(region, value);
                    let expected =
                        |p: [u32; 3]| if region.contains(p.map(|v| v as i32)) { value } else { before.get(p) };
                    let expected = BitGrid::from_fn(before.shape(), expected).unwrap();
                    assert!(after == expected, "{region:?} of {size:?}");
                }
            }
        }
    }
}
