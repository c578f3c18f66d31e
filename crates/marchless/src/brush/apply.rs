//! Applying stamps to chunks and grids.

use super::{Edit, QuantisedStamp, change::Change};
use crate::{
    grid::{Grid, GridChunk, MAX_CHUNK_CELLS, MIN_CHUNK_CELLS, SamplePool, border::Border},
    lattice::Region,
    sample::Voxel,
};

impl Grid<i16> {
    /// Applies `stamp` to all chunks that it touches, and marks the chunks dirty whose meshes read a changed sample.
    /// Absent chunks count as air. In a bounded grid, nothing changes outside the bounds, and samples on the outermost
    /// planes do not count as volume, since no surface has them inside.
    pub fn apply(&mut self, stamp: &QuantisedStamp) -> Edit {
        let mut edit = Edit::NONE;
        let touched = stamp.region();
        if touched.is_empty() {
            return edit;
        }
        let last = touched.max.map(|v| v - 1);
        let chunks = Region::new(self.chunk_of(touched.min), self.chunk_of(last).map(|v| v + 1));
        let mut pool = SamplePool::new();
        for position in self.bounds().map_or(chunks, |bounds| bounds.intersection(&chunks)).points() {
            edit.merge(&self.apply_to_chunk(position, stamp, &mut pool));
        }
        edit
    }

    /// Applies `stamp` to the samples of one chunk only, and marks the chunks dirty whose meshes read a changed sample.
    ///
    /// An absent chunk counts as air within the grid's limits; outside of them, nothing changes. A present chunk beyond
    /// the bounds changes too, but its edit has no volume.
    ///
    /// Chunks may take the same stamps at different times: if each takes them in the same order, the samples equal
    /// those of [`Grid::apply`]. `pool`: memory for a copy of the samples, which is made if clones share them.
    #[doc(hidden)]
    pub fn apply_to_chunk(&mut self, position: [i32; 3], stamp: &QuantisedStamp, pool: &mut SamplePool) -> Edit {
        let (cells, planes, origin) = (self.chunk_cells(), self.planes(), self.chunk_region(position).min);
        if let Some(chunk) = self.present_chunk_mut(position) {
            let edit = chunk.change(origin, cells, planes, stamp, pool);
            self.mark_dirty(edit.region);
            return edit;
        }
        let mut chunk = GridChunk::AIR;
        let edit = chunk.change(origin, cells, planes, stamp, pool);
        if edit.is_empty() || self.check(position).and_then(|()| self.insert_clean(position, chunk)).is_err() {
            return Edit::NONE;
        }
        self.mark_dirty(edit.region);
        edit
    }
}

impl GridChunk<i16> {
    /// Applies `stamp` to the samples of the chunk. A uniform chunk stays uniform if all of it is seen to change alike.
    /// Samples are written out or copied only if some of them change.
    ///
    /// `origin`: the chunk's lowest lattice point. `cells`: its points per axis. `planes`: the outermost lattice planes
    /// of a bounded grid ([`Grid::planes`]), on and beyond which samples do not count as volume. Nothing changes if the
    /// chunk does not have `cells³` samples, or if `cells` is not a valid chunk size.
    pub fn apply_stamp(
        &mut self,
        origin: [i32; 3],
        cells: u32,
        planes: Option<Region>,
        stamp: &QuantisedStamp,
    ) -> Edit {
        self.change(origin, cells, planes, stamp, &mut SamplePool::new())
    }

    fn change(
        &mut self,
        origin: [i32; 3],
        cells: u32,
        planes: Option<Region>,
        stamp: &QuantisedStamp,
        pool: &mut SamplePool,
    ) -> Edit {
        let chunk = Region::new(origin, origin.map(|v| v.saturating_add_unsigned(cells)));
        let area = chunk.intersection(&stamp.region());
        let cells_fit = (MIN_CHUNK_CELLS..=MAX_CHUNK_CELLS).contains(&cells) && self.check(cells).is_ok();
        if area.is_empty() || !cells_fit {
            return Edit::NONE;
        }
        let border = planes.map(Border::new).filter(|border| border.reaches(&area));
        let pass = Pass { change: Change::new(stamp), origin, cells, area, border };
        if let Self::Uniform(old) = *self
            && let Some(new) = pass.change_of_all(old)
            && (new == old || area == chunk)
        {
            *self = Self::Uniform(new);
            let mut edit = Edit::NONE;
            if new != old {
                edit.region = area;
                pass.count(&mut edit, old, new, pass.seen_points());
            }
            return edit;
        }
        pass.run(self, pool)
    }
}

/// The application of one stamp to one chunk.
struct Pass {
    change: Change,
    /// The chunk's lowest lattice point.
    origin: [i32; 3],
    /// The chunk's points per axis.
    cells: u32,
    /// The chunk's points that the stamp may change; not empty.
    area: Region,
    /// The border of a bounded grid; `None` if the area does not reach it.
    border: Option<Border>,
}

impl Pass {
    /// The new sample of the whole area, given that all samples are `old`; `None` unless a quick test shows that they
    /// change alike.
    fn change_of_all(&self, old: Voxel<i16>) -> Option<Voxel<i16>> {
        if self.change.leaves(old) {
            return Some(old);
        }
        self.change.distance_over(&self.area).map(|distance| self.change.at_distance(old, distance))
    }

    /// The number of points of the area that a surface can have inside.
    fn seen_points(&self) -> u64 {
        let is_seen = |point: &[i32; 3]| self.border.is_none_or(|border| !border.excludes(*point));
        match self.border {
            None => self.area.size().into_iter().map(u64::from).product(),
            Some(_) => self.area.points().filter(is_seen).count() as u64,
        }
    }

    /// Applies the change sample by sample.
    fn run(&self, chunk: &mut GridChunk<i16>, pool: &mut SamplePool) -> Edit {
        let mut edit = Edit::NONE;
        let xs = self.area.min[0]..self.area.max[0];
        let [_, ny, nz] = self.area.size();
        let first_changed = (0..ny * nz).find(|&row| {
            let ([y, z], start) = self.row(row);
            xs.clone().zip(start..).any(|(x, index)| {
                let old = chunk.voxel(index);
                self.change.at_point(old, [x, y, z]) != old
            })
        });
        let Some(first_changed) = first_changed else { return edit };
        let samples = chunk.samples_mut(self.cells, pool);
        for row in first_changed..ny * nz {
            let ([y, z], start) = self.row(row);
            let mut changed = None;
            for (x, index) in xs.clone().zip(start..) {
                let old = Voxel::new(samples.weights[index], samples.materials[index]);
                let new = self.change.at_point(old, [x, y, z]);
                if new != old {
                    samples.weights[index] = new.weight;
                    samples.materials[index] = new.material;
                    changed = Some((changed.map_or(x, |(first, _)| first), x));
                    let is_seen = self.border.is_none_or(|border| !border.excludes([x, y, z]));
                    self.count(&mut edit, old, new, is_seen.into());
                }
            }
            if let Some((first, last)) = changed {
                edit.region = edit.region.union(&Region::new([first, y, z], [last + 1, y + 1, z + 1]));
            }
        }
        edit
    }

    /// The y and z of a row of the area, and the index of its first sample.
    fn row(&self, row: u32) -> ([i32; 2], usize) {
        let rows = self.area.size()[1];
        let [y, z] = [self.area.min[1] + (row % rows) as i32, self.area.min[2] + (row / rows) as i32];
        let [x, dy, dz] =
            [self.area.min[0] - self.origin[0], y - self.origin[1], z - self.origin[2]].map(|v| v as usize);
        let cells = self.cells as usize;
        ([y, z], x + cells * (dy + cells * dz))
    }

    /// Adds the volume of `samples` samples that changed from `old` to `new`.
    fn count(&self, edit: &mut Edit, old: Voxel<i16>, new: Voxel<i16>, samples: u64) {
        match [old, new].map(|voxel| self.change.is_solid(voxel.weight)) {
            [false, true] => edit.added.add(new.material, samples),
            [true, false] => edit.removed.add(old.material, samples),
            _ => {}
        }
    }
}
