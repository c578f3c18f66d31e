//! Height fields: one height per column, turned into distances and materials.

#[cfg(feature = "png")]
use marchless::{Bound, SourceRegion};

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
}

impl Column {
    /// A column, with its slope from the heights of its neighbours along x and z. `run`: the distance between the two
    /// neighbours of an axis, in world units.
    pub(crate) fn new(height: f64, along_x: [f64; 2], along_z: [f64; 2], run: f64) -> Self {
        let [x, z] = [along_x, along_z].map(|[before, behind]| (behind - before) / run);
        let square = x * x + z * z;
        Self {
            height,
            #[cfg(feature = "png")]
            slope: square.sqrt(),
            up: 1.0 / (1.0 + square).sqrt(),
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
    let columns = columns(field, region);
    let nx = region.size[0] as usize;
    for ([y, z], distances, materials) in rows(region, distances, materials) {
        let y = (f64::from(region.min[1]) + f64::from(y)) * region.spacing;
        let columns = &columns[nx * z as usize..];
        for ((column, distance), material) in columns.iter().zip(distances).zip(materials) {
            let above = y - column.height;
            *distance = (column.distance(above) / region.spacing) as f32;
            if above < 0.0 {
                *material = material_at(strata, -above, y, column.slope);
            }
        }
    }
}

#[cfg(feature = "png")]
/// [`Source::bound`](marchless::Source::bound) of a height field.
pub(crate) fn bound(field: &impl HeightField, strata: &[Stratum], region: &SourceRegion) -> Bound {
    let [x, [bottom, top], z] = world_box(region);
    let [lowest, highest] = field.range(x, z);
    let margin = BOUND_MARGIN * region.spacing;
    if bottom > highest + margin {
        Bound::Outside
    } else if top < lowest - margin
        && let Some(material) = material_within(strata, [lowest - top, highest - bottom], [bottom, top])
    {
        Bound::Inside { material }
    } else {
        Bound::Mixed
    }
}
