//! Queries of a [`Grid`]: ray casts, and the weight at any position.
//!
//! A ray descends through the grid's hierarchy of boxes to the chunks, skips uniform chunks, and walks from cell to
//! cell in the others (John Amanatides and Andrew Woo, "A Fast Voxel Traversal Algorithm
//! for Ray Tracing", 1987). In a cell that the surface crosses, it is tested against the same triangles that the
//! mesher makes.

mod boxes;
mod ray;
#[cfg(test)]
mod tests;

use crate::{
    cell::{CaseIndex, Corner, Edge},
    grid::{Grid, GridChunk, GridSamples, border::Border},
    mesher::crossing_fraction,
    sample::{Voxel, Weight},
};
use boxes::BoxWalk;
use ray::{Crossing, Cubes, Ray};

/// Where a ray hits the surface first; lengths and positions in lattice units (voxels).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The distance from the ray's origin.
    pub distance: f64,
    /// The point that was hit.
    pub position: [f64; 3],
    /// The unit normal of the triangle, towards the outside, whichever side the ray came from.
    pub normal: [f32; 3],
    /// The material of the triangle's corner nearest to the hit.
    pub material: u8,
    /// The cell that holds the triangle: its lowest lattice point.
    pub cell: [i32; 3],
    /// The position of the chunk whose mesh holds the triangle.
    pub chunk: [i32; 3],
}

impl<W: Weight> Grid<W> {
    /// The first triangle of the grid's primal meshes that a ray hits, from either side; `None` where it hits nothing or
    /// is no ray.
    ///
    /// The triangles are those that [`Grid::mesh_chunk`] makes with the primal mesher at the same isovalue (in voxels).
    /// Dual meshes have others, which no query of samples alone finds. `origin`, `direction`
    /// and `max_distance` are in lattice units; the direction may have any length but 0, and the distance may be
    /// infinite. A ray along a triangle's plane or through its very edge may count as a hit or as a miss.
    ///
    /// ```
    /// use marchless::{Grid, Operation, QuantisedShape, QuantisedStamp};
    ///
    /// let mut grid = Grid::<i16>::new(32)?;
    /// grid.apply(&QuantisedStamp::new(QuantisedShape::sphere([0.0; 3], 10.0)?, Operation::Add, 1));
    /// let hit = grid.ray_cast(0.0, [30.0, 0.5, 0.5], [-1.0, 0.0, 0.0], 100.0).expect("the ball is in its way");
    /// assert!((hit.distance - 20.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn ray_cast(&self, isovalue: f32, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<RayHit> {
        if !isovalue.is_finite() {
            return None;
        }
        let ray = Ray::new(origin, direction, max_distance)?;
        let limits = self.limits();
        let hit = |chunk: [i32; 3]| {
            let surface = limits.contains(chunk).then(|| Surface::new(self, chunk, isovalue))?;
            if surface.is_empty() {
                return None;
            }
            ray.walk(self.chunk_region(chunk), Cubes::of(1)).find_map(|cell| surface.hit(&ray, cell))
        };
        let most = if is_shown_without_chunks(self, isovalue) { MOST_WITHOUT_CHUNKS } else { NEAR };
        self.walk_chunks(&ray, most, hit)
    }

    /// Calls `find` with the chunk positions that a ray passes, in order, until it returns something. Positions may be
    /// left out where no chunk is present at 0 or 1 step along each axis. Lengths and directions are as in
    /// [`Grid::ray_cast`].
    #[doc(hidden)]
    pub fn find_along_ray<T>(
        &self,
        origin: [f64; 3],
        direction: [f64; 3],
        max_distance: f64,
        find: impl FnMut([i32; 3]) -> Option<T>,
    ) -> Option<T> {
        self.walk_chunks(&Ray::new(origin, direction, max_distance)?, NEAR, find)
    }

    /// Calls `find` with chunk positions along a ray: with all of them if they are at most `most`.
    fn walk_chunks<T>(&self, ray: &Ray, most: f64, find: impl FnMut([i32; 3]) -> Option<T>) -> Option<T> {
        let (limits, chunks) = (self.limits(), Cubes::of(self.chunk_cells().into()));
        if ray.steps(limits, chunks) <= most {
            return ray.walk(limits, chunks).find_map(find);
        }
        BoxWalk::new(self.occupancy(), ray, self.chunk_cells()).find_map(find)
    }

    /// The weight at a position minus the isovalue: its distance from the surface in voxels, negative inside.
    /// `None` where the position or the isovalue is not finite.
    ///
    /// The weight is trilinear between the eight lattice points around the position, as meshes read them
    /// ([`Grid::as_meshed`]); infinite and NaN samples count as the farthest finite ones of their side. `position`: in
    /// lattice units. The sign agrees with the mesh at lattice points; between them the mesh is made of triangles,
    /// which the trilinear surface only comes close to.
    pub fn weight_at(&self, isovalue: f32, position: [f64; 3]) -> Option<f32> {
        if !position.iter().all(|v| v.is_finite()) || !isovalue.is_finite() {
            return None;
        }
        let limits = (f64::from(i32::MIN), f64::from(i32::MAX - 1));
        let position = position.map(|v| v.clamp(limits.0, limits.1));
        let low = position.map(libm::floor);
        let weight = Corner::ALL.iter().map(|corner| {
            let offset = corner.offset();
            let share = [0, 1, 2].map(|axis| {
                let high = position[axis] - low[axis];
                if offset[axis] == 1 { high } else { 1.0 - high }
            });
            let point = [0, 1, 2].map(|axis| low[axis] as i32 + i32::from(offset[axis]));
            share[0] * share[1] * share[2] * self.as_meshed(point, isovalue).weight.finite() / f64::from(W::SCALE)
        });
        Some((weight.sum::<f64>() - f64::from(isovalue)) as f32)
    }
}

/// A ray that passes at most this number of chunk positions visits them all, without the hierarchy of boxes.
const NEAR: f64 = 8.0;
/// The limit instead of [`NEAR`] if absent chunks may have meshes; a longer ray visits only chunks that are there.
const MOST_WITHOUT_CHUNKS: f64 = 65536.0;

/// Whether absent chunks are inside, so that the border of a bounded grid has a mesh without them. This is the case at
/// isovalues beyond the weights' range.
fn is_shown_without_chunks<W: Weight>(grid: &Grid<W>, isovalue: f32) -> bool {
    grid.bounds().is_some() && W::OUTSIDE.inside(W::threshold(isovalue))
}

/// The triangles of one chunk.
struct Surface<'a, W: Weight> {
    position: [i32; 3],
    /// The chunk's lowest lattice point.
    origin: [i32; 3],
    /// The chunk and its neighbours on the high sides: bit 0 of the index is x, bit 1 y, bit 2 z.
    chunks: [Part<'a, W>; 8],
    /// Cells per axis.
    cells: i32,
    isovalue: f32,
    /// The border of a bounded grid, where the chunk's cells reach it.
    border: Option<Border>,
}

/// A chunk, borrowed.
#[derive(Clone, Copy)]
enum Part<'a, W> {
    Uniform(Voxel<W>),
    Samples(&'a GridSamples<W>),
}

impl<'a, W: Weight> Surface<'a, W> {
    fn new(grid: &'a Grid<W>, position: [i32; 3], isovalue: f32) -> Self {
        let chunks = Corner::ALL.map(|corner| {
            let offset = corner.offset();
            let position = [0, 1, 2].map(|axis| position[axis].saturating_add(offset[axis].into()));
            match grid.seen_chunk(position) {
                Some(GridChunk::Uniform(voxel)) => Part::Uniform(*voxel),
                Some(GridChunk::Samples(samples)) => Part::Samples(samples),
                // Beyond the bounds, all that a chunk's cells read lies on the outermost planes and is the same.
                None => Part::Uniform(grid.as_meshed(grid.chunk_region(position).min, isovalue)),
            }
        });
        let region = grid.chunk_region(position);
        Self {
            position,
            origin: region.min,
            chunks,
            cells: grid.chunk_cells() as i32,
            isovalue,
            border: grid.border().filter(|border| border.reaches(&region.grown(0, 1))),
        }
    }

    /// Whether the uniform chunks alone show that there are no triangles.
    fn is_empty(&self) -> bool {
        let threshold = W::threshold(self.isovalue);
        let inside = |chunk: &Part<'_, W>| match chunk {
            Part::Uniform(voxel) => Some(voxel.weight.inside(threshold)),
            Part::Samples(_) => None,
        };
        let first = inside(&self.chunks[0]);
        // A border makes air of what is inside, and leaves what is outside there.
        first.is_some_and(|first| self.border.is_none() || !first)
            && self.chunks.iter().all(|chunk| inside(chunk) == first)
    }

    /// The nearest hit in `cell`.
    fn hit(&self, ray: &Ray, cell: [i32; 3]) -> Option<RayHit> {
        let local = [0, 1, 2].map(|axis| cell[axis] - self.origin[axis]);
        let threshold = W::threshold(self.isovalue);
        if self.is_one_sided(local, threshold) {
            return None;
        }
        let corners = Corner::ALL.map(|corner| self.voxel(local, corner));
        let case = (0..8).fold(0, |case, i| case | u8::from(corners[i].weight.inside(threshold)) << i);
        let mut nearest: Option<(Crossing, [Edge; 3])> = None;
        for &edges in CaseIndex(case).triangles() {
            let triangle = edges.map(|edge| self.vertex(local, &corners, edge));
            if let Some(crossing) = ray.cross(triangle, self.origin)
                && nearest.is_none_or(|(best, _)| crossing.distance < best.distance)
            {
                nearest = Some((crossing, edges));
            }
        }
        let (crossing, edges) = nearest?;
        let [low, high] = edges[crossing.nearest_corner].corners().map(Corner::index);
        let inside = if CaseIndex(case).is_inside(Corner::ALL[low]) { low } else { high };
        Some(RayHit {
            distance: crossing.distance,
            position: ray.at(crossing.distance),
            normal: crossing.normal,
            material: corners[inside].material,
            cell,
            chunk: self.position,
        })
    }

    /// Whether the cell at `local` lies within the chunk's own samples and has all its corners on one side. This skips
    /// most cells of a ray quickly.
    fn is_one_sided(&self, local: [i32; 3], threshold: W::Threshold) -> bool {
        let Part::Samples(GridSamples { weights, .. }) = self.chunks[0] else { return false };
        if self.border.is_some() || local.iter().any(|&v| v + 1 >= self.cells) {
            return false;
        }
        let [x, y, z] = local.map(|v| v as usize);
        let row = self.cells as usize;
        let start = x + row * (y + row * z);
        let first = weights[start].inside(threshold);
        [0, row, row * row, row * row + row].into_iter().all(|step| {
            let [low, high] = [weights[start + step], weights[start + step + 1]];
            low.inside(threshold) == first && high.inside(threshold) == first
        })
    }

    /// The sample at a corner of the cell at `local`, counted from the chunk's lowest point.
    fn voxel(&self, local: [i32; 3], corner: Corner) -> Voxel<W> {
        let (mut chunk, mut index, mut stride) = (0, 0, 1);
        for (axis, (low, offset)) in local.into_iter().zip(corner.offset()).enumerate() {
            let at = low + i32::from(offset);
            if at == self.cells {
                chunk |= 1 << axis;
            } else {
                index += at as usize * stride;
            }
            stride *= self.cells as usize;
        }
        let voxel = match self.chunks[chunk] {
            Part::Uniform(voxel) => voxel,
            Part::Samples(samples) => Voxel::new(samples.weights[index], samples.materials[index]),
        };
        match &self.border {
            Some(border) => {
                let offset = corner.offset();
                let point = [0, 1, 2].map(|axis| self.origin[axis] + local[axis] + i32::from(offset[axis]));
                Voxel { weight: border.clip(point, voxel.weight, self.isovalue), ..voxel }
            }
            None => voxel,
        }
    }

    /// The mesh's vertex on an edge of the cell at `local`, counted from the chunk's lowest point, bit for bit.
    fn vertex(&self, local: [i32; 3], corners: &[Voxel<W>; 8], edge: Edge) -> [f32; 3] {
        let [low, high] = edge.corners();
        let offset = low.offset();
        let (a, b) = (corners[low.index()].weight, corners[high.index()].weight);
        let mut vertex = [0, 1, 2].map(|axis| (local[axis] + i32::from(offset[axis])) as f32);
        vertex[edge.axis()] += crossing_fraction(a, b, self.isovalue * W::SCALE);
        vertex
    }
}
