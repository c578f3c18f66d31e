//! Height fields: one height per column, turned into distances and materials.

#[cfg(feature = "png")]
use marchless::{Bound, SourceRegion};

#[cfg(feature = "png")]
use super::detail::Detail;
#[cfg(feature = "png")]
use super::strata::{Stratum, material_at, material_within};
#[cfg(feature = "png")]
use super::{BOUND_MARGIN, rows, world_box};

#[cfg(feature = "png")]
/// A height for each column, in world units.
pub(crate) trait HeightField {
    /// The height of the ground at a position.
    fn height(&self, x: f64, z: f64) -> f64;

    /// Two heights between which all heights of a rectangle lie, given by its lowest and highest x and z.
    fn range(&self, x: [f64; 2], z: [f64; 2]) -> [f64; 2];
}

/// The ground in one column.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    /// The height of the ground. [Units: world]
    pub(crate) height: f64,
    /// The slope of the ground. [Units: rise per run] [Limit: >= 0]
    #[cfg(feature = "png")]
    pub(crate) slope: f64,
    /// The y part of the ground's unit normal: the factor from heights above the ground to distances.
    pub(crate) up: f64,
    /// The y part of the unit normal that rules for materials see. It differs from `up` at coarse levels of detail.
    #[cfg(feature = "noise")]
    pub(crate) material_up: f64,
}

impl Column {
    /// A column, with its slope from the heights of its neighbours along x and z. `run`: the distance between the two
    /// neighbours of an axis, in world units.
    pub(crate) fn new(height: f64, along_x: [f64; 2], along_z: [f64; 2], run: f64) -> Self {
        let [x, z] = [along_x, along_z].map(|[before, behind]| (behind - before) / run);
        let square = x * x + z * z;
        let up = 1.0 / (1.0 + square).sqrt();
        Self {
            height,
            #[cfg(feature = "png")]
            slope: square.sqrt(),
            up,
            #[cfg(feature = "noise")]
            material_up: up,
        }
    }

    /// The distance to the ground from a point `above` world units over it, as if the ground were a plane.
    pub(crate) fn distance(self, above: f64) -> f64 {
        above * self.up
    }
}

#[cfg(feature = "png")]
/// The ground in each column of a region, x fastest. Each height is evaluated once. Slopes are central differences, so
/// they depend only on the column's position and the spacing.
pub(crate) fn columns(field: &impl HeightField, region: &SourceRegion) -> Vec<Column> {
    let [nx, _, nz] = region.size.map(|points| points as usize);
    let at = |axis: usize, index: usize| (f64::from(region.min[axis]) + index as f64 - 1.0) * region.spacing;
    let width = nx + 2;
    let heights: Vec<f64> =
        (0..nz + 2).flat_map(|z| (0..width).map(move |x| field.height(at(0, x), at(2, z)))).collect();
    let run = 2.0 * region.spacing;
    (0..nz)
        .flat_map(|z| (0..nx).map(move |x| x + 1 + width * (z + 1)))
        .map(|index| {
            let [along_x, along_z] = [1, width].map(|step| [heights[index - step], heights[index + step]]);
            Column::new(heights[index], along_x, along_z, run)
        })
        .collect()
}

#[cfg(feature = "png")]
/// [`Source::fill`](marchless::Source::fill) of a height field.
pub(crate) fn fill(
    field: &impl HeightField,
    strata: &[Stratum],
    region: &SourceRegion,
    distances: &mut [f32],
    materials: &mut [u8],
) {
    let detail = Detail::of(region);
    let mut columns = columns(field, region);
    if !detail.is_finest() && strata.iter().any(|stratum| stratum.steeper_than > 0.0) {
        give_slopes_of_level_0(field, region, &mut columns);
    }
    let nx = region.size[0] as usize;
    for ([y, z], distances, materials) in rows(region, distances, materials) {
        let y = (f64::from(region.min[1]) + f64::from(y)) * region.spacing;
        let columns = &columns[nx * z as usize..];
        for ((column, distance), material) in columns.iter().zip(distances).zip(materials) {
            let above = y - column.height;
            *distance = (column.distance(above) / region.spacing) as f32;
            if above < 0.0 {
                let raised = detail.raised(-above, deepest(detail, column.up));
                *material = material_at(strata, -above - raised, y + raised * column.up * column.up, column.slope);
            }
        }
    }
}

#[cfg(feature = "png")]
/// Replaces the slopes of a region's columns by those of level 0. Coarse levels miss what is steep in the small, and
/// would give it another material.
fn give_slopes_of_level_0(field: &impl HeightField, region: &SourceRegion, columns: &mut [Column]) {
    let detail = Detail::of(region);
    let nx = region.size[0] as usize;
    for (index, column) in columns.iter_mut().enumerate() {
        let at = |axis: usize, index: usize, steps: f64| {
            ((f64::from(region.min[axis]) + index as f64) * detail.voxels() + steps) * detail.voxel()
        };
        let height = |along_x: f64, along_z: f64| field.height(at(0, index % nx, along_x), at(2, index / nx, along_z));
        let [along_x, along_z] = [[height(-1.0, 0.0), height(1.0, 0.0)], [height(0.0, -1.0), height(0.0, 1.0)]];
        column.slope = Column::new(column.height, along_x, along_z, 2.0 * detail.voxel()).slope;
    }
}

#[cfg(feature = "png")]
/// The depth, along y, of the deepest inside ends of edges, below ground whose normal has this y part. It is a spacing
/// along the normal. It is limited, so that deep ground is known without its slope.
fn deepest(detail: Detail, up: f64) -> f64 {
    detail.spacing() / up.max(FLATTEST)
}

#[cfg(feature = "png")]
/// The least y part of normals in [`deepest`]: that of a slope of nearly 4.
const FLATTEST: f64 = 0.25;

#[cfg(feature = "png")]
/// [`Source::bound`](marchless::Source::bound) of a height field.
pub(crate) fn bound(field: &impl HeightField, strata: &[Stratum], region: &SourceRegion) -> Bound {
    let [x, [bottom, top], z] = world_box(region);
    let [lowest, highest] = field.range(x, z);
    let margin = BOUND_MARGIN * region.spacing;
    if bottom > highest + margin {
        Bound::Outside
    } else if top < lowest - margin
        && let Some(material) = certain_material(strata, region, [lowest - top, highest - bottom], [bottom, top])
    {
        Bound::Inside { material }
    } else {
        Bound::Mixed
    }
}

#[cfg(feature = "png")]
/// The one material of all ground between two depths and two heights of a region; `None` if it may differ.
fn certain_material(strata: &[Stratum], region: &SourceRegion, depth: [f64; 2], height: [f64; 2]) -> Option<u8> {
    let detail = Detail::of(region);
    let raised = [detail.raised(depth[0], deepest(detail, 0.0)), detail.raised(depth[1], deepest(detail, 1.0))];
    material_within(strata, [depth[0] - raised[0], depth[1] - raised[1]], [height[0], height[1] + detail.most_raised()])
}
