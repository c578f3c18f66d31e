//! [`Grid`]: a sparse volume of chunks. A chunk is one uniform voxel, or samples that are copied on write.

mod block;
pub(crate) mod border;
mod chunk;
mod chunks;
mod dirty;
mod error;
mod mesh_changes;
pub(crate) mod occupancy;
mod pool;
#[cfg(test)]
mod tests;

use alloc::collections::BTreeSet;

pub use self::block::{Block, Neighbourhood, NeighbourhoodView};
use self::border::Border;
pub use self::chunk::{BOUND_BOX_CHUNKS, GridChunk, GridSamples};
use self::chunks::Chunks;
pub use self::error::GridError;
use self::occupancy::Occupancy;
pub use self::pool::SamplePool;
use crate::buffer::MeshBuffer;
pub use crate::lattice::MAX_CHUNK_CELLS;
use crate::lattice::Region;
use crate::mesher::{MeshError, MeshMethod, Mesher};
use crate::sample::{Voxel, Weight};
use crate::source::Source;

/// The default number of cells per axis of a chunk.
pub const DEFAULT_CHUNK_CELLS: u32 = 32;
/// The smallest number of cells per axis of a chunk.
pub const MIN_CHUNK_CELLS: u32 = 8;

/// A sparse volume of samples in chunks of `n` cells per axis: the chunk at `c` owns the lattice points
/// `c·n` to `c·n + n − 1` of each axis.
///
/// A clone shares the samples, and editing one copy does not affect the other. An edit marks chunks *dirty* if their
/// meshes read a changed sample; they stay dirty until [`Grid::take_dirty`]. How far meshes read depends on the mesher:
/// for the dual one, call [`Grid::set_mesh_method`].
///
/// A **bounded** grid has air around it, so its chunks' meshes together are closed: meshes, rays and reports of edits
/// see its samples intersected with a box half a voxel inside the outermost planes ([`Grid::as_meshed`]). The stored
/// samples are not clipped, so the bounds may change at any time ([`Grid::set_bounds`]). The box's walls are flat with
/// either mesher, and the dual one bevels its edges: within a cell without smoothing, and one cell more with each step.
///
/// ```
/// use marchless::{Grid, Region, Voxel};
///
/// let mut grid = Grid::<i16>::bounded(32, Region::new([0; 3], [2, 1, 2]))?;
/// grid.set([40, 10, 3], Voxel::new(-128, 1))?;
/// assert_eq!(grid.get([40, 10, 3]), Voxel::new(-128, 1));
/// assert_eq!(grid.get([40, 10, 4]), Voxel::AIR);
/// # Ok::<(), marchless::GridError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Grid<W = i16> {
    cells: u32,
    bounds: Option<Region>,
    chunks: Chunks<W>,
    dirty: BTreeSet<[i32; 3]>,
    /// The layers of samples that a chunk's mesh reads below and above its own.
    margins: [u32; 2],
}

impl<W: Weight> Grid<W> {
    /// An empty grid without bounds. Absent chunks are air. `chunk_cells`: 8 to 62 per axis.
    ///
    /// # Errors
    /// [`GridError::ChunkCells`].
    pub fn new(chunk_cells: u32) -> Result<Self, GridError> {
        check_cells(chunk_cells)?;
        let margins = MeshMethod::default().margins();
        Ok(Self { cells: chunk_cells, bounds: None, chunks: Chunks::new(), dirty: BTreeSet::new(), margins })
    }

    /// An empty grid that is bounded to the chunk positions in `chunks`, with air around them.
    ///
    /// # Errors
    /// [`GridError::ChunkCells`]; [`GridError::Bounds`] if `chunks` is empty or its lattice points do not fit in `i32`.
    pub fn bounded(chunk_cells: u32, chunks: Region) -> Result<Self, GridError> {
        let mut grid = Self::new(chunk_cells)?;
        grid.set_bounds(Some(chunks))?;
        Ok(grid)
    }

    /// Sets the bounds, in chunk positions; `None` removes them. Chunks beyond the new bounds stay in memory, but read
    /// as air until bounds include them again.
    ///
    /// This marks no chunk dirty. The meshes that change are those of chunks at the old border, at the new border, and
    /// of chunks that were beyond the old bounds. With the dual mesher and more than `chunk_cells − 7` steps of
    /// smoothing (`chunk_cells − 8` with creases), those of the next layer of chunks inside may change too.
    ///
    /// # Errors
    /// [`GridError::Bounds`] if `bounds` is empty or its lattice points do not fit in `i32`; the grid is then
    /// unchanged.
    pub fn set_bounds(&mut self, bounds: Option<Region>) -> Result<(), GridError> {
        let limits = Self::largest(self.cells);
        if let Some(bounds) = bounds.filter(|bounds| bounds.is_empty() || bounds.intersection(&limits) != *bounds) {
            return Err(GridError::Bounds { bounds, limits });
        }
        self.bounds = bounds;
        Ok(())
    }

    /// Cells per axis of a chunk.
    pub const fn chunk_cells(&self) -> u32 {
        self.cells
    }

    /// The chunk positions of a bounded grid.
    pub const fn bounds(&self) -> Option<Region> {
        self.bounds
    }

    /// The outermost lattice planes of a bounded grid. Points at `min` and at `max` both lie on planes.
    pub fn planes(&self) -> Option<Region> {
        let scaled = |v: i32| v * self.cells as i32; // fits: checked by `set_bounds`
        self.bounds.map(|bounds| Region::new(bounds.min.map(scaled), bounds.max.map(scaled)))
    }

    /// The position of the chunk that owns `point`.
    pub fn chunk_of(&self, point: [i32; 3]) -> [i32; 3] {
        point.map(|v| v.div_euclid(self.cells as i32))
    }

    /// The lattice points that the chunk at `position` owns, saturating at the ends of `i32`.
    pub fn chunk_region(&self, position: [i32; 3]) -> Region {
        let min = position.map(|v| v.saturating_mul(self.cells as i32));
        Region::new(min, min.map(|v| v.saturating_add(self.cells as i32)))
    }

    /// The stored sample at `point`, not clipped to the border. Absent chunks and points beyond the bounds are air.
    pub fn get(&self, point: [i32; 3]) -> Voxel<W> {
        let position = self.chunk_of(point);
        match self.seen_chunk(position) {
            Some(chunk) => chunk.voxel(self.index(point)),
            None => Voxel::AIR,
        }
    }

    /// The sample at `point` as meshes and rays at an isovalue (in voxels) read it: in a bounded grid, intersected with
    /// the border's box. On the outermost planes, the box's weight is half a voxel above the isovalue; it grows by one
    /// voxel with each point farther out.
    pub fn as_meshed(&self, point: [i32; 3], isovalue: f32) -> Voxel<W> {
        match self.border() {
            Some(border) if self.limits().contains(self.chunk_of(point)) => {
                let Voxel { weight, material } = self.get(point);
                Voxel { weight: border.clip(point, weight, isovalue), material }
            }
            Some(border) => border.beyond(point.map(i64::from), isovalue),
            None => self.get(point),
        }
    }

    /// Sets the sample at `point` and marks the chunks dirty whose meshes read it. Writing an equal sample does
    /// nothing.
    ///
    /// # Errors
    /// [`GridError::OutOfBounds`]; the grid is then unchanged.
    pub fn set(&mut self, point: [i32; 3], voxel: Voxel<W>) -> Result<(), GridError> {
        let position = self.chunk_of(point);
        self.check(position)?;
        if self.get(point) != voxel {
            let (cells, index) = (self.cells, self.index(point));
            let samples = self.chunk_mut(position)?.samples_mut(cells, &mut SamplePool::new());
            samples.weights[index] = voxel.weight;
            samples.materials[index] = voxel.material;
            self.mark_dirty(Region::new(point, point).grown(0, 1));
        }
        Ok(())
    }

    /// Puts a whole chunk at `position`, and marks it and its neighbours dirty.
    ///
    /// # Errors
    /// [`GridError::OutOfBounds`]; [`GridError::SamplesLength`] if the chunk's size is not the grid's. The grid is then
    /// unchanged.
    pub fn insert(&mut self, position: [i32; 3], chunk: GridChunk<W>) -> Result<(), GridError> {
        self.check(position)?;
        self.insert_clean(position, chunk)?;
        self.mark_dirty(self.chunk_region(position));
        Ok(())
    }

    /// Puts a whole chunk at `position` and marks nothing dirty. Use it where neither the chunk nor its neighbours have
    /// a mesh that is now out of date. A chunk beyond the bounds is kept, but reads as air.
    ///
    /// # Errors
    /// [`GridError::SamplesLength`] if the chunk's size is not the grid's; [`GridError::OutOfBounds`] if `position` is
    /// outside of [`Grid::largest`].
    pub fn insert_clean(&mut self, position: [i32; 3], chunk: GridChunk<W>) -> Result<(), GridError> {
        chunk.check(self.cells)?;
        let bounds = Self::largest(self.cells);
        if !bounds.contains(position) {
            return Err(GridError::OutOfBounds { position, bounds });
        }
        self.chunks.insert(position, chunk);
        Ok(())
    }

    /// Removes and returns the chunk at `position`, and marks nothing dirty.
    pub fn remove_clean(&mut self, position: [i32; 3]) -> Option<GridChunk<W>> {
        self.chunks.remove(position)
    }

    /// Puts the base samples of `source` ([`GridChunk::from_source`]) at `position`. `spacing`: world units per voxel.
    ///
    /// ```
    /// use marchless::{Grid, Region};
    ///
    /// let mut grid = Grid::<i16>::bounded(16, Region::new([0; 3], [2, 1, 2]))?;
    /// let ground = |[_, y, _]: [f64; 3]| y - 7.5;
    /// for chunk in Region::new([0; 3], [2, 1, 2]).points() {
    ///     grid.fill(chunk, &ground, 1.0)?;
    /// }
    /// assert!(grid.get([8, 7, 8]).weight < 0 && grid.get([8, 8, 8]).weight > 0);
    /// # Ok::<(), marchless::GridError>(())
    /// ```
    ///
    /// # Errors
    /// [`GridError::OutOfBounds`]; the source is then not sampled.
    pub fn fill(&mut self, position: [i32; 3], source: &(impl Source + ?Sized), spacing: f64) -> Result<(), GridError> {
        self.check(position)?;
        self.insert(position, GridChunk::from_source(source, position, self.cells, spacing))
    }

    /// The chunk at `position`, also beyond the bounds; `None` if it is absent.
    pub fn chunk(&self, position: [i32; 3]) -> Option<&GridChunk<W>> {
        self.chunks.get(position)
    }

    /// All chunks, in order of position.
    pub fn chunks(&self) -> impl Iterator<Item = ([i32; 3], &GridChunk<W>)> {
        self.chunks.iter()
    }

    /// The chunks at or after `position`, in the order of [`chunks`](Self::chunks), so that a caller can visit all
    /// chunks in portions.
    pub fn chunks_from(&self, position: [i32; 3]) -> impl Iterator<Item = ([i32; 3], &GridChunk<W>)> {
        self.chunks.from(position)
    }

    /// The chunks at positions within `region`, each once. The order is always the same, but differs from that of
    /// [`chunks`](Self::chunks). The cost is proportional to the number of chunks found, not to the size of the region
    /// or of the grid.
    ///
    /// ```
    /// use marchless::{Grid, GridChunk, Region};
    ///
    /// let mut grid = Grid::<i16>::new(32)?;
    /// for position in [[0, 0, 0], [-70_000, 3, 9], [5, 0, 0]] {
    ///     grid.insert(position, GridChunk::AIR)?;
    /// }
    /// let west = Region::new([i32::MIN; 3], [5, i32::MAX, i32::MAX]);
    /// assert_eq!(grid.chunks_in(west).count(), 2);
    /// # Ok::<(), marchless::GridError>(())
    /// ```
    pub fn chunks_in(&self, region: Region) -> impl Iterator<Item = ([i32; 3], &GridChunk<W>)> {
        self.chunks.positions_in(region).filter_map(|position| Some((position, self.chunk(position)?)))
    }

    /// Removes and returns the chunk at `position`, which then reads as air, and marks it and its neighbours dirty.
    pub fn remove(&mut self, position: [i32; 3]) -> Option<GridChunk<W>> {
        let chunk = self.chunks.remove(position)?;
        self.mark_dirty(self.chunk_region(position));
        Some(chunk)
    }

    /// A snapshot of the chunk at `position` and its neighbours: all that a task needs to mesh it.
    pub fn neighbourhood(&self, position: [i32; 3]) -> Neighbourhood<W> {
        self.neighbourhood_view(position).to_neighbourhood()
    }

    /// The chunk at `position` and its neighbours, borrowed: all that is needed to mesh it at once.
    pub fn neighbourhood_view(&self, position: [i32; 3]) -> NeighbourhoodView<'_, W> {
        let limits = self.limits();
        let step = |index: usize| [index % 3, index / 3 % 3, index / 9];
        let is_beyond = |index: &usize| {
            let neighbour = [0, 1, 2].map(|axis| i64::from(position[axis]) + step(*index)[axis] as i64 - 1);
            let is_within = |axis: usize| (limits.min[axis].into()..limits.max[axis].into()).contains(&neighbour[axis]);
            !(0..3).all(is_within)
        };
        let beyond = (0..27).filter(is_beyond).fold(0, |beyond, index| beyond | 1 << index);
        let mut chunks = [None; 27];
        // Neighbours along z follow each other in the map, so one range finds three chunks.
        let around = position.map(|v| [v.saturating_sub(1), v, v.saturating_add(1)]);
        for (j, y) in around[1].into_iter().enumerate() {
            for (i, x) in around[0].into_iter().enumerate() {
                // A range with one end is quicker than one with two.
                let column = self.chunks.from([x, y, around[2][0]]);
                for (neighbour, chunk) in column.take_while(|(neighbour, _)| *neighbour <= [x, y, around[2][2]]) {
                    let k = (neighbour[2] - around[2][0]) as usize;
                    let index = i + 3 * (j + 3 * k);
                    chunks[index] = (beyond >> index & 1 == 0).then_some(chunk);
                }
            }
        }
        let origin = position.map(|v| i64::from(v) * i64::from(self.cells));
        NeighbourhoodView { chunks, beyond, cells: self.cells, origin, border: self.border() }
    }

    /// Meshes the chunk at `position`. Vertex positions are in cells from its lowest lattice point. To mesh many
    /// chunks, [`NeighbourhoodView::mesh`] is faster, since it reuses its block.
    ///
    /// The dual mesher makes the quads of all edges that begin at the chunk's own lattice points. With either mesher,
    /// the meshes of all chunks together are one surface, and in a bounded grid a closed one.
    ///
    /// # Errors
    /// As [`NeighbourhoodView::mesh`]; `out` is then empty.
    pub fn mesh_chunk(
        &self,
        position: [i32; 3],
        mesher: &mut Mesher,
        method: impl Into<MeshMethod>,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        self.neighbourhood_view(position).mesh(mesher, &mut Block::new(), method, out)
    }

    /// The chunk at `position`; `None` if it is absent or beyond the bounds.
    pub(crate) fn seen_chunk(&self, position: [i32; 3]) -> Option<&GridChunk<W>> {
        let is_seen = self.bounds.is_none_or(|bounds| bounds.contains(position));
        self.chunks.get(position).filter(|_| is_seen)
    }

    /// The chunk at `position`, to be edited; an absent chunk is first inserted as air. The caller marks changes dirty.
    ///
    /// # Errors
    /// [`GridError::OutOfBounds`].
    pub(crate) fn chunk_mut(&mut self, position: [i32; 3]) -> Result<&mut GridChunk<W>, GridError> {
        self.check(position)?;
        Ok(self.chunks.get_mut_or_air(position))
    }

    /// The chunk at `position`, to be edited, also beyond the bounds; `None` if it is absent. The caller marks changes
    /// dirty.
    pub(crate) fn present_chunk_mut(&mut self, position: [i32; 3]) -> Option<&mut GridChunk<W>> {
        self.chunks.get_mut(position)
    }

    /// The set of chunk positions that hold a chunk.
    pub(crate) const fn occupancy(&self) -> &Occupancy {
        self.chunks.occupancy()
    }

    /// The border of a bounded grid.
    pub(crate) fn border(&self) -> Option<Border> {
        self.planes().map(Border::new)
    }

    /// The index of `point` among the samples of its chunk.
    pub(crate) fn index(&self, point: [i32; 3]) -> usize {
        let n = self.cells as i32;
        let [x, y, z] = point.map(|v| v.rem_euclid(n) as usize);
        x + n as usize * (y + n as usize * z)
    }

    /// Checks that the grid may hold a chunk at `position`.
    ///
    /// # Errors
    /// [`GridError::OutOfBounds`] if `position` is outside of [`Grid::limits`].
    pub(crate) fn check(&self, position: [i32; 3]) -> Result<(), GridError> {
        let bounds = self.limits();
        if bounds.contains(position) { Ok(()) } else { Err(GridError::OutOfBounds { position, bounds }) }
    }

    /// The chunk positions that meshes and reads see: the bounds, or [`Grid::largest`] in a grid without bounds.
    pub(crate) fn limits(&self) -> Region {
        self.bounds.unwrap_or_else(|| Self::largest(self.cells))
    }

    /// All chunk positions that any grid can have: those whose blocks fit in `i32`. `chunk_cells`: 8 to 62, clamped.
    pub fn largest(chunk_cells: u32) -> Region {
        let end = (i32::MAX - 2) / chunk_cells.clamp(MIN_CHUNK_CELLS, MAX_CHUNK_CELLS) as i32;
        Region::new([-end; 3], [end; 3])
    }
}

fn check_cells(cells: u32) -> Result<(), GridError> {
    if (MIN_CHUNK_CELLS..=MAX_CHUNK_CELLS).contains(&cells) {
        Ok(())
    } else {
        Err(GridError::ChunkCells { found: cells })
    }
}
