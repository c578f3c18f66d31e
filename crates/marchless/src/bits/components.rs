//! Connected components.
//!
//! A component consists of runs of set bits, which are found a word at a time. Union–find joins the runs of
//! neighbouring rows that touch. The root of a component is its first run, so the last pass, which numbers the
//! components, meets each root before the other runs of its component.

use alloc::vec::Vec;

use super::{
    BitGrid, Connectivity,
    runs::{Runs, span_words},
    set_bits,
};
use crate::{
    lattice::{Region, Shape},
    simd::{Backend, Job, Simd, dispatch_words},
};

/// The connected components of a grid's set points, numbered by their first points in memory order.
///
/// ```
/// use marchless::{Shape, bits::{BitGrid, Connectivity}};
///
/// let grid = BitGrid::from_fn(Shape::cube(9)?, |[x, y, z]| x != 4 && y != 6 && z < 9)?;
/// let components = grid.components(Connectivity::Six);
/// assert_eq!(components.len(), 4);
/// assert_eq!(components.get(3).map(|component| component.size), Some(4 * 2 * 9));
/// assert_eq!(components.label([0, 8, 8]), Some(2));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
///
/// Memory is proportional to the number of runs of set bits and of rows, not of points.
#[derive(Clone, Debug)]
pub struct Components {
    shape: Shape,
    runs: Runs,
    /// For each run, the number of its component.
    labels: Vec<usize>,
    components: Vec<Component>,
}

/// One connected component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Component {
    /// The number of its points.
    pub size: usize,
    /// The smallest region that holds it. Coordinates beyond `i32` become `i32::MAX`; the region may then be empty.
    pub bounds: Region,
    /// Its first point in memory order: lowest z, then lowest y, then lowest x.
    pub first: [u32; 3],
}

impl BitGrid {
    /// The connected components of the set points.
    pub fn components(&self, connectivity: Connectivity) -> Components {
        let runs = Runs::of(self);
        let parents = dispatch_words(Backend::fastest(), Join { grid: self, runs: &runs, connectivity });
        number(self.shape, runs, parents)
    }
}

/// Joins all runs that touch. Returns a parent for each run: itself for a component's first run, an earlier run of the
/// same component for the others.
struct Join<'a> {
    grid: &'a BitGrid,
    runs: &'a Runs,
    connectivity: Connectivity,
}

impl Job for Join<'_> {
    type Output = Vec<usize>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<usize> {
        let mut parents: Vec<usize> = (0..self.runs.spans.len()).collect();
        let [_, ny, nz] = self.grid.shape.size().map(|size| size as usize);
        let six = self.connectivity == Connectivity::Six;
        let all = self.connectivity == Connectivity::TwentySix;
        for z in 0..nz {
            for y in 0..ny {
                let row = y + ny * z;
                if y > 0 {
                    self.join(row, row - 1, !six, &mut parents);
                }
                if z > 0 {
                    self.join(row, row - ny, !six, &mut parents);
                    if !six && y > 0 {
                        self.join(row, row - ny - 1, all, &mut parents);
                    }
                    if !six && y + 1 < ny {
                        self.join(row, row - ny + 1, all, &mut parents);
                    }
                }
            }
        }
        parents
    }
}

impl Join<'_> {
    /// Joins the runs of two rows that overlap; if the neighbourhood is `wide`, also those that touch diagonally.
    #[inline(always)]
    fn join(&self, row_a: usize, row_b: usize, wide: bool, parents: &mut [usize]) {
        let len = self.grid.row;
        let words_a = &self.grid.words[row_a * len..][..len];
        let words_b = &self.grid.words[row_b * len..][..len];
        // The number of runs that start before this word, and the last bit of the word before.
        let (mut run_a, mut run_b) = (self.runs.starts[row_a], self.runs.starts[row_b]);
        let (mut last_a, mut last_b) = (0, 0);
        let wide = if wide { u64::MAX } else { 0 };
        for (&a, &b) in words_a.iter().zip(words_b) {
            let (behind_a, behind_b) = (a << 1 | last_a, b << 1 | last_b);
            let (starts_a, starts_b) = (a & !behind_a, b & !behind_b);
            // The lowest place where two runs touch is where one starts and the other has a bit there or just before.
            let touching = starts_a & (b | behind_b & wide) | starts_b & (a | behind_a & wide);
            for bit in set_bits(touching) {
                let until = u64::MAX >> (63 - bit);
                let a = run_a + (starts_a & until).count_ones() as usize - 1;
                let b = run_b + (starts_b & until).count_ones() as usize - 1;
                union(parents, a, b);
            }
            run_a += starts_a.count_ones() as usize;
            run_b += starts_b.count_ones() as usize;
            (last_a, last_b) = (a >> 63, b >> 63);
        }
    }
}

/// Unites the sets of two runs. A parent never comes after its child.
#[inline(always)]
fn union(parents: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b)] = a.min(b);
}

/// The root of a run's set, which is its first run; halves the path to it.
#[inline(always)]
fn root(parents: &mut [usize], mut run: usize) -> usize {
    while parents[run] != run {
        parents[run] = parents[parents[run]];
        run = parents[run];
    }
    run
}

/// Numbers the components, and gives each its size, bounds and first point.
fn number(shape: Shape, runs: Runs, mut parents: Vec<usize>) -> Components {
    let ny = shape.size()[1] as usize;
    let saturated = |v: u32| i32::try_from(v).unwrap_or(i32::MAX);
    let mut components: Vec<Component> = Vec::new();
    for (row, bounds) in runs.starts.windows(2).enumerate() {
        let (y, z) = ((row % ny) as u32, (row / ny) as u32);
        for run in bounds[0]..bounds[1] {
            let [start, end] = runs.spans[run];
            let min = [start, y, z].map(saturated);
            let max = [end, y + 1, z + 1].map(saturated);
            if parents[run] == run {
                parents[run] = components.len();
                components.push(Component {
                    size: (end - start) as usize,
                    bounds: Region { min, max },
                    first: [start, y, z],
                });
            } else {
                // The parent comes earlier: its entry already holds its component's number.
                parents[run] = parents[parents[run]];
                let component = &mut components[parents[run]];
                component.size += (end - start) as usize;
                // Not the union of regions: it ignores empty regions, and beyond `i32` this one may be empty.
                let bounds = &mut component.bounds;
                for axis in 0..3 {
                    bounds.min[axis] = bounds.min[axis].min(min[axis]);
                    bounds.max[axis] = bounds.max[axis].max(max[axis]);
                }
            }
        }
    }
    Components { shape, runs, labels: parents, components }
}

impl Components {
    /// The number of components.
    pub const fn len(&self) -> usize {
        self.components.len()
    }

    /// True if there is no component: no point is set.
    pub const fn is_empty(&self) -> bool {
        self.components.is_empty()
    }

    /// The component with this number; `None` if there is none.
    pub fn get(&self, index: usize) -> Option<&Component> {
        self.components.get(index)
    }

    /// All components, in order of number.
    pub fn iter(&self) -> core::slice::Iter<'_, Component> {
        self.components.iter()
    }

    /// The number of the largest component, the first of equals; `None` if there is no component.
    pub fn largest(&self) -> Option<usize> {
        let most = self.components.iter().map(|component| component.size).max()?;
        self.components.iter().position(|component| component.size == most)
    }

    /// The number of a point's component; `None` if the point is not set or lies outside the grid.
    pub fn label(&self, [x, y, z]: [u32; 3]) -> Option<usize> {
        let [_, ny, nz] = self.shape.size();
        if y >= ny || z >= nz {
            return None;
        }
        let row = y as usize + ny as usize * z as usize;
        let (first, behind) = (self.runs.starts[row], self.runs.starts[row + 1]);
        let run = first + self.runs.spans[first..behind].partition_point(|&[_, end]| end <= x);
        (run < behind && self.runs.spans[run][0] <= x).then(|| self.labels[run])
    }

    /// A grid of the same shape with the points of one component; empty if no component has that number. For many
    /// components at once, [`keep`](Self::keep) visits the grid only once.
    pub fn mask(&self, index: usize) -> BitGrid {
        let mut grid = BitGrid::empty(self.shape);
        let Some(Component { bounds, .. }) = self.get(index) else { return grid };
        let [_, ny, nz] = self.shape.size();
        // `i32::MAX` stands for all higher coordinates, up to the end of the grid.
        let rows = |axis: usize, size: u32| {
            let [min, max] = [bounds.min[axis], bounds.max[axis]];
            min as u32..if max == i32::MAX { size } else { max as u32 }
        };
        for z in rows(2, nz) {
            for y in rows(1, ny) {
                self.write_row(y as usize + ny as usize * z as usize, |label| label == index, &mut grid);
            }
        }
        grid
    }

    /// A grid of the same shape with the points of the components for which `keep` returns true.
    pub fn keep(&self, keep: impl Fn(&Component) -> bool) -> BitGrid {
        let kept: Vec<bool> = self.components.iter().map(keep).collect();
        let mut grid = BitGrid::empty(self.shape);
        for row in 0..self.runs.starts.len() - 1 {
            self.write_row(row, |label| kept[label], &mut grid);
        }
        grid
    }

    /// Sets the points of a row whose component's number is `wanted`.
    fn write_row(&self, row: usize, wanted: impl Fn(usize) -> bool, grid: &mut BitGrid) {
        let words = &mut grid.words[row * grid.row..][..grid.row];
        for run in self.runs.starts[row]..self.runs.starts[row + 1] {
            if wanted(self.labels[run]) {
                for (index, bits) in span_words(self.runs.spans[run]) {
                    words[index] |= bits;
                }
            }
        }
    }
}

impl<'a> IntoIterator for &'a Components {
    type Item = &'a Component;
    type IntoIter = core::slice::Iter<'a, Component>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;

    #[test]
    fn components_beyond_i32_coordinates_keep_their_points() {
        let nx = (1u32 << 31) + 64;
        let shape = Shape::new([nx, 3, 1]).unwrap();
        let span = [nx - 10, nx - 4];
        let runs = Runs { spans: vec![span, span], starts: vec![0, 0, 1, 2] };
        let components = number(shape, runs, vec![0, 0]);
        let bounds = Region::new([i32::MAX, 1, 0], [i32::MAX, 3, 1]);
        assert_eq!(
            components.iter().copied().collect::<Vec<_>>(),
            [Component { size: 12, bounds, first: [nx - 10, 1, 0] }]
        );
    }
}
