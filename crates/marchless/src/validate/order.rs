//! Puts points into an order in which points that follow each other are close in space.
//!
//! A cube around the points is cut into 8 × 8 × 8 cells in Morton order; each cell's points are sorted in the same way,
//! within a cube around them alone. Few points are sorted by the Morton code of 1024 cells per axis.
//!
//! The new cube for each cell keeps the order good for any points: with one vertex at 10³⁰, all others lie in one cell
//! of the first cube, and the next cube is around those others alone. Each step makes the cube eight times smaller, so
//! the range of `f32` allows about a hundred steps; hills take two.

use alloc::{vec, vec::Vec};

use super::{aabb::Aabb, work::Work};

/// Cells of the cube per axis, as bits.
const BITS: u32 = 3;
/// Cells of the cube.
const CELLS: usize = 1 << (3 * BITS);
/// Up to this many points are sorted by comparison.
const FEW: usize = 2048;

/// A point, and the number of what it stands for.
#[derive(Clone, Copy, Default)]
pub(super) struct Item {
    pub(super) point: [f32; 3],
    pub(super) index: u32,
}

/// Sorts items; `None` if the caller cancels. `share`: of the whole work.
pub(super) fn spatial(mut items: Vec<Item>, share: f32, work: &mut Work<'_>) -> Option<Vec<Item>> {
    if items.len() <= FEW {
        sort(&mut items, &mut vec![Item::default(); FEW]);
        return Some(items);
    }
    let cube = Cube::around(&items, BITS);
    let counts = cube.counts(&items);
    let mut sorted = vec![Item::default(); items.len()];
    // Each thread scatters the items of some cells: it reads all items, but writes to memory of its own.
    let scatter = |(range, mut cells): (core::ops::Range<usize>, Vec<&mut [Item]>)| {
        let mut filled = [0; CELLS];
        for item in &items {
            let cell = cube.morton(item.point);
            if let Some(local) = cell.checked_sub(range.start)
                && let Some(cell) = cells.get_mut(local)
            {
                cell[filled[local]] = *item;
                filled[local] += 1;
            }
        }
    };
    let groups = balanced(&counts, work.threads());
    let mut cells = split(&mut sorted, &counts).into_iter();
    let jobs: Vec<_> =
        groups.into_iter().map(|range| (range.clone(), cells.by_ref().take(range.len()).collect())).collect();
    work.map(share * 0.3, jobs.into_iter(), scatter)?;

    let pairs: Vec<_> = split(&mut sorted, &counts).into_iter().zip(split(&mut items, &counts)).collect();
    work.map(share * 0.7, pairs.into_iter(), |(cell, spare)| sort(cell, spare))?;
    Some(sorted)
}

/// Sorts items; `spare` is at least as long.
fn sort(items: &mut [Item], spare: &mut [Item]) {
    if items.len() <= FEW {
        return sort_few(items, spare);
    }
    let cube = Cube::around(items, BITS);
    if cube.is_point() {
        return;
    }
    let counts = cube.counts(items);
    let mut ends = [0; CELLS];
    let mut sum = 0;
    for (end, count) in ends.iter_mut().zip(counts) {
        (*end, sum) = (sum, sum + count);
    }
    for item in &*items {
        let end = &mut ends[cube.morton(item.point)];
        spare[*end] = *item;
        *end += 1;
    }
    items.copy_from_slice(&spare[..items.len()]);
    for cell in split(items, &counts) {
        sort(cell, spare);
    }
}

/// Sorts up to [`FEW`] items by Morton codes.
fn sort_few(items: &mut [Item], spare: &mut [Item]) {
    let cube = Cube::around(items, 10);
    let mut keys = [0; FEW];
    let keys = &mut keys[..items.len()];
    for ((key, item), place) in keys.iter_mut().zip(&*items).zip(0..) {
        *key = (cube.morton(item.point) as u64) << 32 | place;
    }
    keys.sort_unstable();
    for (to, &mut key) in spare.iter_mut().zip(keys) {
        *to = items[key as u32 as usize];
    }
    items.copy_from_slice(&spare[..items.len()]);
}

/// A cube around points, cut into cells.
struct Cube {
    min: [f32; 3],
    /// Cells per unit of length.
    scale: f64,
    bits: u32,
}

impl Cube {
    /// `bits`: of the number of cells per axis, up to 10.
    fn around(items: &[Item], bits: u32) -> Self {
        let aabb = Aabb::around(items.iter().map(|item| item.point));
        Self { min: aabb.min, scale: f64::from(1u32 << bits) / aabb.longest_side(), bits }
    }

    /// Whether all points are equal.
    fn is_point(&self) -> bool {
        !self.scale.is_finite()
    }

    /// The number of the cell that holds a point, in Morton order.
    #[inline(always)]
    fn morton(&self, point: [f32; 3]) -> usize {
        let last = (1u32 << self.bits) - 1;
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let cell = (f64::from(point[axis]) - f64::from(self.min[axis])) * self.scale;
            spread((cell as i32 as u32).min(last))
        });
        (x | y << 1 | z << 2) as usize
    }

    /// How many points each cell of a cube of [`CELLS`] holds.
    fn counts(&self, items: &[Item]) -> [usize; CELLS] {
        let mut counts = [0; CELLS];
        for item in items {
            counts[self.morton(item.point)] += 1;
        }
        counts
    }
}

/// Puts two zeros before each of 10 bits.
#[inline(always)]
const fn spread(bits: u32) -> u32 {
    let bits = (bits | bits << 16) & 0x0300_00ff;
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

/// Cuts a slice into pieces of these lengths.
fn split<'a>(mut items: &'a mut [Item], lens: &[usize]) -> Vec<&'a mut [Item]> {
    let mut pieces = Vec::with_capacity(lens.len());
    for &len in lens {
        let (piece, rest) = items.split_at_mut(len);
        pieces.push(piece);
        items = rest;
    }
    pieces
}

/// Consecutive ranges of cells with about the same number of items each, at most `parts` of them.
fn balanced(counts: &[usize; CELLS], parts: usize) -> Vec<core::ops::Range<usize>> {
    let most = counts.iter().sum::<usize>().div_ceil(parts);
    let (mut ranges, mut start, mut sum) = (vec![], 0, 0);
    for (cell, count) in counts.iter().enumerate() {
        sum += count;
        if sum >= most {
            ranges.push(start..cell + 1);
            (start, sum) = (cell + 1, 0);
        }
    }
    if start < CELLS {
        ranges.push(start..CELLS);
    }
    ranges
}
