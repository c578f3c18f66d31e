//! [`ChunkPart`]: the part of one chunk that a query reads.

use bevy_math::DVec3;
use marchless::bits::BitGrid;
use marchless::{Grid, Region};

use super::TerrainBitsError;
use super::cache::{BitsCache, ChunkBits, Derived};

/// The data that queries about a terrain's solid points read.
#[derive(Clone, Copy)]
pub(super) struct SolidQuery<'a> {
    pub(super) grid: &'a Grid<i16>,
    pub(super) cache: &'a BitsCache,
    /// The isovalue in effect. [Units: voxels]
    pub(super) isovalue: f32,
}

/// The part of one chunk that a query reads, in the terrain's lattice.
#[derive(Clone, Debug)]
pub(super) struct ChunkPart {
    /// The points to read; never empty.
    region: Region,
    /// The chunk's lowest point.
    origin: [i32; 3],
    bits: ChunkBits,
}

/// The part of `region` inside the terrain's outermost planes; on them and beyond, all points are air.
pub(super) fn within(grid: &Grid<i16>, region: Region) -> Region {
    let Some(planes) = grid.planes() else { return NOTHING };
    Region::new(planes.min.map(|v| v + 1), planes.max).intersection(&region)
}

/// The parts of `region` in each chunk; points beyond all chunks are air.
pub(super) fn parts(
    query: SolidQuery<'_>,
    region: Region,
) -> impl Iterator<Item = Result<ChunkPart, TerrainBitsError>> + '_ {
    let SolidQuery { grid, .. } = query;
    let inside = within(grid, region);
    let chunks = if inside.is_empty() {
        NOTHING
    } else {
        let last = grid.chunk_of(inside.max.map(|v| v - 1));
        Region::new(grid.chunk_of(inside.min), last.map(|v| v + 1))
    };
    chunks.points().map(move |position| {
        let chunk = grid.chunk_region(position);
        let bits = ChunkBits::new(query, position)?;
        Ok(ChunkPart { region: chunk.intersection(&inside), origin: chunk.min, bits })
    })
}

const NOTHING: Region = Region::new([0; 3], [0; 3]);

impl ChunkPart {
    /// True if all of its points are solid.
    pub(super) fn is_solid(&self) -> Result<bool, TerrainBitsError> {
        Ok(match self.bits.get()? {
            Derived::Uniform(solid) => *solid,
            Derived::Mixed(grid) => grid.covers_region(relative(self.region, self.origin)),
        })
    }

    /// True if any of its points is solid.
    pub(super) fn is_partly_solid(&self) -> Result<bool, TerrainBitsError> {
        Ok(match self.bits.get()? {
            Derived::Uniform(solid) => *solid,
            Derived::Mixed(grid) => grid.overlaps_region(relative(self.region, self.origin)),
        })
    }

    /// True if any of its solid points is at most `radius` from `center`.
    pub(super) fn overlaps_ball(&self, center: DVec3, radius: f32) -> Result<bool, TerrainBitsError> {
        Ok(match self.bits.get()? {
            Derived::Uniform(solid) => *solid && ball_reaches(center, radius, self.region),
            Derived::Mixed(grid) => {
                let origin = DVec3::from(self.origin.map(f64::from));
                grid.overlaps_ball((center - origin).as_vec3().to_array(), radius)
            }
        })
    }

    /// True if any of its solid points is a point of `shape`, whose lowest corner lies at `offset`.
    pub(super) fn overlaps(&self, shape: &BitGrid, offset: [i32; 3]) -> Result<bool, TerrainBitsError> {
        Ok(match self.bits.get()? {
            Derived::Uniform(solid) => *solid && shape.overlaps_region(relative(self.region, offset)),
            Derived::Mixed(grid) => grid.overlaps(shape, difference(offset, self.origin)),
        })
    }

    /// Writes the part into a grid of zeros whose lowest corner lies at `corner`.
    pub(super) fn write(&self, grid: &mut BitGrid, corner: [i32; 3]) -> Result<(), TerrainBitsError> {
        match self.bits.get()? {
            Derived::Uniform(false) => {}
            Derived::Uniform(true) => grid.fill(relative(self.region, corner), true),
            Derived::Mixed(bits) => grid.paste(bits, difference(self.origin, corner)),
        }
        Ok(())
    }
}

/// A region relative to `corner`.
fn relative(region: Region, corner: [i32; 3]) -> Region {
    Region::new(difference(region.min, corner), difference(region.max, corner))
}

fn difference(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| a[axis].saturating_sub(b[axis]))
}

/// True if any point of a non-empty region is at most `radius` from `center`.
fn ball_reaches(center: DVec3, radius: f32, region: Region) -> bool {
    let distances = [0, 1, 2].map(|axis| {
        let center = center[axis];
        center.round().clamp(f64::from(region.min[axis]), f64::from(region.max[axis] - 1)) - center
    });
    distances.iter().map(|distance| distance * distance).sum::<f64>() <= f64::from(radius) * f64::from(radius)
}
