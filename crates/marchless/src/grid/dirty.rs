//! Which chunks have meshes that are out of date: those whose blocks read what has changed.

use alloc::collections::BTreeSet;

use super::Grid;
use crate::lattice::Region;
use crate::mesher::{MeshError, MeshMethod};
use crate::sample::Weight;

/// The most chunk positions that are all marked dirty, absent chunks included. In larger regions, only present chunks
/// and their neighbours are marked.
const MAX_MARKED_ABSENT: u128 = 4096;

impl<W: Weight> Grid<W> {
    /// Sets how the chunks are meshed, which tells how far an edit marks chunks dirty; default: with the primal mesher.
    /// The method's settings other than its [margins](MeshMethod::margins) make no difference. This marks no chunk
    /// dirty.
    ///
    /// ```
    /// use marchless::{DualSettings, Grid, MeshSettings, Voxel};
    ///
    /// let mut grid = Grid::<i16>::new(32)?;
    /// grid.set([29, 5, 5], Voxel::new(-128, 1))?;
    /// assert_eq!(grid.take_dirty().len(), 1);
    /// grid.set_mesh_method(DualSettings { smoothing: 1, ..DualSettings::default() })?;
    /// grid.set([29, 5, 5], Voxel::AIR)?;
    /// assert_eq!(grid.take_dirty(), [[0, 0, 0], [1, 0, 0]].into());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`MeshMethod::check`]; the grid is then unchanged.
    pub fn set_mesh_method(&mut self, method: impl Into<MeshMethod>) -> Result<(), MeshError> {
        let method = method.into();
        method.check(self.cells)?;
        self.margins = method.margins();
        Ok(())
    }

    /// The chunk positions whose block reads a point of `changed`, within the bounds. A block reaches one point below
    /// its chunk and two above, or as [`Grid::set_mesh_method`] says.
    pub fn chunks_affected_by(&self, changed: Region) -> Region {
        if changed.is_empty() {
            return Region::new([0; 3], [0; 3]);
        }
        let (n, [low, high]) = (i64::from(self.cells), self.margins.map(i64::from));
        // n·c − low < changed.max and n·c + n − 1 + high ≥ changed.min; the quotients fit.
        let affected = Region {
            min: changed.min.map(|v| (i64::from(v) - high).div_euclid(n) as i32),
            max: changed.max.map(|v| (i64::from(v) - 1 + low).div_euclid(n) as i32 + 1),
        };
        affected.intersection(&self.limits())
    }

    /// Marks the chunks dirty whose meshes read a point of `changed`. In a large region, absent chunks without a
    /// present neighbour are left out, since they have no mesh; the cost is then proportional to the number of present
    /// chunks.
    pub fn mark_dirty(&mut self, changed: Region) {
        let affected = self.chunks_affected_by(changed);
        if affected.is_empty() {
            return;
        }
        let count = affected.size().into_iter().map(u128::from).product::<u128>();
        if count <= MAX_MARKED_ABSENT {
            self.dirty.extend(affected.points());
            return;
        }
        for position in self.chunks.positions_in(affected.grown(1, 1)) {
            let around = Region::new(position, position).grown(1, 2);
            self.dirty.extend(around.intersection(&affected).points());
        }
    }

    /// The chunks whose meshes are out of date.
    pub const fn dirty(&self) -> &BTreeSet<[i32; 3]> {
        &self.dirty
    }

    /// Returns the chunks whose meshes are out of date, and clears the set.
    pub fn take_dirty(&mut self) -> BTreeSet<[i32; 3]> {
        core::mem::take(&mut self.dirty)
    }
}
