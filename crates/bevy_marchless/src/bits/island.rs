//! [`Island`]: a connected component of solid points.

use core::fmt;
use std::sync::Arc;

use bevy_ecs::entity::Entity;
use bevy_math::IVec3;
use marchless::bits::{BitGrid, Component, Connectivity};
use marchless::{Grid, Region, Voxel, Weight as _};

use crate::brush::{BrushShape, Stamp};
use crate::mesh::ChunkSamples;
use crate::terrain::Terrain;

/// A connected component of the solid points in a box of a terrain, as it was when it was found.
///
/// Islands are equal if their points are equal.
#[derive(Clone)]
pub struct Island {
    bounds: Region,
    first: [i32; 3],
    size: usize,
    touches_boundary: bool,
    /// All solid points of the searched box.
    solid: Arc<BitGrid>,
    /// The lowest point of the searched box.
    corner: [i32; 3],
}

impl Island {
    pub(super) fn new(component: Component, region: Region, solid: &Arc<BitGrid>) -> Self {
        let place = |point: [i32; 3]| [0, 1, 2].map(|axis| region.min[axis] + point[axis]);
        let bounds = Region::new(place(component.bounds.min), place(component.bounds.max));
        Self {
            bounds,
            first: place(component.first.map(|v| v as i32)),
            size: component.size,
            touches_boundary: (0..3)
                .any(|axis| bounds.min[axis] == region.min[axis] || bounds.max[axis] == region.max[axis]),
            solid: solid.clone(),
            corner: region.min,
        }
    }

    /// The smallest box around it, in the terrain's lattice.
    pub const fn bounds(&self) -> Region {
        self.bounds
    }

    /// The number of its points: its volume in cubic voxels.
    pub const fn size(&self) -> usize {
        self.size
    }

    /// Its first point, in order of z, then y, then x.
    pub fn first(&self) -> IVec3 {
        self.first.into()
    }

    /// True if it touches the border of the box in which it was found, or the border of the terrain.
    ///
    /// Such an island may continue beyond the box, and the terrain's walls and bottom count as support. An island that
    /// does not touch the boundary is loose: it is complete, and no solid point is next to it.
    pub const fn touches_boundary(&self) -> bool {
        self.touches_boundary
    }

    /// Its points, in a grid of the size of its bounds; their lowest point is the grid's point `[0, 0, 0]`.
    pub fn bits(&self) -> BitGrid {
        let first = [0, 1, 2].map(|axis| self.first[axis].abs_diff(self.bounds.min[axis]));
        self.around().flood(&[first], Connectivity::Six).expect("its first point lies in its bounds")
    }

    /// All solid points in its bounds, other islands' included.
    fn around(&self) -> BitGrid {
        let [min, max] = [self.bounds.min, self.bounds.max];
        let [min, max] = [min, max].map(|end| [0, 1, 2].map(|axis| end[axis] - self.corner[axis]));
        self.solid.cut(Region::new(min, max)).expect("the box in which it was found is larger")
    }

    /// Its current samples in the terrain, with two points of air on each side.
    pub(super) fn samples(&self, grid: &Grid<i16>, settings: &Terrain) -> ChunkSamples {
        let (own, region, isovalue) = (self.bits(), self.bounds.grown(RIM, RIM), settings.isovalue);
        let is_own = |point: [i32; 3]| {
            let place = [0, 1, 2].map(|axis| u32::try_from(point[axis] - self.bounds.min[axis]).unwrap_or(u32::MAX));
            own.get(place)
        };
        let voxel = |point| {
            let voxel = grid.as_meshed(point, isovalue);
            let weight = voxel.weight.to_voxels();
            if weight >= isovalue || is_own(point) {
                return voxel;
            }
            // A point of another island becomes air, as far outside the surface as it was inside.
            Voxel { weight: i16::from_voxels((2.0 * isovalue - weight).max(isovalue + 1.0 / 256.0)), ..voxel }
        };
        let (weights, materials) = region.points().map(voxel).map(|voxel| (voxel.weight, voxel.material)).unzip();
        let samples =
            ChunkSamples::new(region.size().into(), weights).and_then(|samples| samples.with_materials(materials));
        let mut samples = samples.expect("a voxel for each point, and several per axis");
        (samples.isovalue, samples.normals) = (isovalue, settings.normals);
        samples.palette = settings.palette.clone();
        samples
    }

    /// The stamps that dig exactly this island out of `terrain`: all its points become air, and no other point changes
    /// sides. Surfaces less than half a voxel away may move a little.
    ///
    /// The stamps do not account for edits since the island was found. Write them in the same update, or search again
    /// first.
    pub fn stamps(&self, terrain: Entity) -> Vec<Stamp> {
        let (own, mut others) = (self.bits(), self.around());
        others.subtract(&own).expect("both have the size of its bounds");
        // A box ends this far beyond the outermost points, in voxels: samples there become half a voxel of air, and
        // their neighbours keep at least half a voxel of ground.
        let rim = 0.5;
        let origin = IVec3::from(self.bounds.min).as_dvec3();
        let mut stamps = Vec::new();
        let mut regions = vec![Region::new([0; 3], self.bounds.size().map(|v| v as i32))];
        while let Some(region) = regions.pop() {
            let Some(region) = shrunk(&own, region) else { continue };
            let size = region.size();
            let axis = (0..3).max_by_key(|axis| size[*axis]).unwrap_or(0);
            if size[axis] <= LONGEST_BOX && !others.overlaps_region(region) {
                let [low, high] = [region.min, region.max.map(|v| v - 1)].map(|end| IVec3::from(end).as_vec3());
                let shape = BrushShape::cuboid(origin + 0.5 * (low + high).as_dvec3(), 0.5 * (high - low) + rim);
                stamps.push(Stamp::dig(terrain, shape));
                continue;
            }
            let (mut low, mut high) = (region, region);
            low.max[axis] = region.min[axis] + (size[axis] / 2) as i32;
            high.min[axis] = low.max[axis];
            regions.extend([high, low]);
        }
        stamps
    }
}

/// The points of air on each side of an island's samples: one for the surface, one for its normals.
const RIM: u32 = 2;
/// The longest box that one stamp digs. [Units: voxels]
const LONGEST_BOX: u32 = 2000;

/// The smallest box around the set points of a region; `None` if there are none.
fn shrunk(bits: &BitGrid, mut region: Region) -> Option<Region> {
    if !bits.overlaps_region(region) {
        return None;
    }
    for axis in 0..3 {
        let layer = |at: i32| {
            let mut layer = region;
            (layer.min[axis], layer.max[axis]) = (at, at + 1);
            bits.overlaps_region(layer)
        };
        let mut layers = region.min[axis]..region.max[axis];
        let (low, high) = (layers.find(|at| layer(*at))?, layers.rfind(|at| layer(*at)));
        (region.min[axis], region.max[axis]) = (low, high.unwrap_or(low) + 1);
    }
    Some(region)
}

impl fmt::Debug for Island {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bounds, first, size, touches_boundary, .. } = self;
        let mut debug = f.debug_struct("Island");
        debug
            .field("bounds", bounds)
            .field("first", first)
            .field("size", size)
            .field("touches_boundary", touches_boundary);
        debug.finish_non_exhaustive()
    }
}

impl PartialEq for Island {
    fn eq(&self, other: &Self) -> bool {
        let summary = |island: &Self| (island.bounds, island.first, island.size, island.touches_boundary);
        summary(self) == summary(other) && self.bits() == other.bits()
    }
}
