//! [`BoxWalk`]: finds the chunks along a ray among any number of chunks, at any distance from each other.

use core::array::from_fn;

use super::ray::{Cubes, Ray};
use crate::{
    grid::occupancy::{OFFSET, Occupancy},
    lattice::Region,
};

/// Walks along a ray from box to box of the coarsest level, and inside each box with chunks from box to box of the
/// level below.
///
/// Sorting all chunks by the distance at which the ray enters them would be simpler, but its cost grows with the grid.
pub(super) struct BoxWalk<'a> {
    occupancy: &'a Occupancy,
    ray: &'a Ray,
    /// Cells per axis of a chunk.
    cells: u32,
    /// The number of boxes, chunk positions included, that the ray has passed so far; tests check that it stays small.
    pub(super) passed: u32,
}

impl<'a> BoxWalk<'a> {
    pub(super) const fn new(occupancy: &'a Occupancy, ray: &'a Ray, cells: u32) -> Self {
        Self { occupancy, ray, cells, passed: 0 }
    }

    /// Calls `find` with chunk positions along the ray, in order, until it returns something.
    ///
    /// Positions without a chunk at 0 or 1 step along each axis are skipped: they have no mesh.
    pub(super) fn find_map<T>(&mut self, mut find: impl FnMut([i32; 3]) -> Option<T>) -> Option<T> {
        let (level, root) = self.occupancy.root()?;
        // The mesh below the root's lowest chunk is another box's.
        let around = Region::new(root.map(|v| (v - 1).max(0)), root.map(|v| v + 1));
        let boxes = self.cubes(level);
        self.ray.walk(around, boxes).find_map(|index| self.descend(level, index, &mut find))
    }

    /// Like [`find_map`](Self::find_map), within one box.
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
