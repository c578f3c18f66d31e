//! [`BoxWalk`]: the chunks that a ray passes, out of any number of them, any distance apart.

use core::array::from_fn;

use super::ray::{Cubes, Ray};
use crate::{
    grid::occupancy::{OFFSET, Occupancy},
    lattice::Region,
};

/// A walk along a ray, from box to box on the coarsest level, and within a box that holds a chunk from box to box of the
/// level below.
///
/// Sorting all chunks by when the ray enters them would be simpler, and cost as much as there are chunks in the grid.
pub(super) struct BoxWalk<'a> {
    occupancy: &'a Occupancy,
    ray: &'a Ray,
    /// Cells per axis of a chunk.
    cells: u32,
    /// How many boxes, chunk positions among them, the ray has passed so far: tests hold it to be small.
    pub(super) passed: u32,
}

impl<'a> BoxWalk<'a> {
    pub(super) const fn new(occupancy: &'a Occupancy, ray: &'a Ray, cells: u32) -> Self {
        Self { occupancy, ray, cells, passed: 0 }
    }

    /// The first answer of `find`, which is asked for the chunk positions that the ray passes, in order, where the position
    /// or one a step of 0 or 1 per axis from it holds a chunk. Others have no mesh.
    pub(super) fn find_map<T>(&mut self, mut find: impl FnMut([i32; 3]) -> Option<T>) -> Option<T> {
        let (level, root) = self.occupancy.root()?;
        // The mesh below the root's lowest chunk is another box's.
        let around = Region::new(root.map(|v| (v - 1).max(0)), root.map(|v| v + 1));
        let boxes = self.cubes(level);
        self.ray.walk(around, boxes).find_map(|index| self.descend(level, index, &mut find))
    }

    /// The same within a box.
    fn descend<T>(&mut self, level: usize, index: [i32; 3], find: &mut impl FnMut([i32; 3]) -> Option<T>) -> Option<T> {
        let drawn = self.occupancy.drawn(level, index);
        if drawn.is_empty() {
            return None;
        }
        let inner = Region::new(index.map(|v| v << 3), index.map(|v| (v << 3) + 8));
        for below in self.ray.walk(inner, self.cubes(level - 1)) {
            self.passed += 1;
            let found = match level {
                _ if !drawn.contains(below) => None,
                1 => find(from_fn(|axis| below[axis] - OFFSET)),
                _ => self.descend(level - 1, below, find),
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// The boxes of a level; those of level 0 are the chunk positions.
    fn cubes(&self, level: usize) -> Cubes {
        let cells = i64::from(self.cells);
        Cubes { size: cells << (3 * level), origin: -cells * i64::from(OFFSET) }
    }
}
