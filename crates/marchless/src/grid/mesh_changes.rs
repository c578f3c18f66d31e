//! Finds the chunks whose meshes a change of samples affects, among those that read the changed samples.
//!
//! A vertex lies on an edge whose ends have different signs. It depends on the samples at both ends and on their
//! neighbours along the axes. Signs alone decide the triangles, except in the [trilinear
//! topology](Topology::Trilinear), which reads the weights at the corners of cells. So a changed sample shows only near
//! the surface before or after the change. Signs are words here, one bit a sample of a row, so a few operations test a
//! whole row.
//!
//! A vertex of the dual mesher depends on all samples within some steps of the corners of its cell: one fewer than the
//! [margin](MeshMethod::margins), since the mesh of a chunk has vertices one cell below it.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::border::Border;
use super::{Grid, GridChunk};
use crate::bits::BitGrid;
use crate::lattice::{Region, Samples, Shape};
use crate::mesher::{MeshMethod, Topology};
use crate::sample::Weight;

/// The largest isovalue, either way, in voxels, that is handled at the border. Farther from 0, adding half a voxel may
/// not change an `f32`.
const MAX_BORDER_ISOVALUE: f32 = 1e6;

impl<W: Weight> Grid<W> {
    /// The chunks whose meshes a change may have altered, out of the [chunks affected by](Self::chunks_affected_by) it.
    /// In the others, every changed sample is too far from the surface, before and after the change, to show.
    ///
    /// `changed`: a box around the changed samples. `before`: every chunk that holds a changed sample, as it was before
    /// ([`GridChunk::AIR`] if it was absent). `method`: how the meshes are made.
    ///
    /// `None` for cases that are not analysed: boxes of more than 60 points along an axis (two fewer for each step of
    /// smoothing), isovalues that are not finite and, at the border of a bounded grid, isovalues that are extreme or
    /// beyond the weights' range.
    #[doc(hidden)]
    pub fn chunks_with_mesh_changes(
        &self,
        before: &BTreeMap<[i32; 3], GridChunk<W>>,
        changed: Region,
        method: impl Into<MeshMethod>,
    ) -> Option<BTreeSet<[i32; 3]>> {
        if changed.is_empty() {
            return Some(BTreeSet::new());
        }
        let method = method.into();
        let (isovalue, reach) = (method.isovalue(), Reach::new(&method));
        // The samples through which changes show, and their neighbours.
        let read = changed.grown(reach.steps + 1, reach.steps + 1);
        let is_whole = |axis: usize| read.size()[axis] - changed.size()[axis] == 2 * (reach.steps + 1);
        let fits = (0..3).all(|axis| read.size()[axis] <= 64 && is_whole(axis));
        let (threshold, border) = (W::threshold(isovalue), self.border().filter(|border| border.reaches(&read)));
        let is_extreme = W::OUTSIDE.inside(threshold) || isovalue.abs() > MAX_BORDER_ISOVALUE;
        if !fits || border.is_some() && is_extreme {
            return None;
        }
        let shape = Shape::new(read.size()).ok()?;
        let weights = self.weights(read, shape, border);
        let signs = BitGrid::from_samples(Samples::new(shape, &weights).ok()?, isovalue).ok()?;
        let now = signs.words();
        let mut rows = Rows { read, now, before: now.to_vec(), changed: vec![0; now.len()] };
        let air = GridChunk::AIR;
        for (position, old) in before {
            let new = self.chunk(*position).unwrap_or(&air);
            rows.compare(old, new, self.chunk_region(*position), changed, threshold, border);
        }
        let shows = rows.shows(changed, reach);
        let has_changed = |position: &[i32; 3]| {
            let cells = self.chunk_region(*position).grown(reach.below, 1);
            let meshed = cells.intersection(&changed.grown(reach.steps, reach.steps));
            rows.rows_of(meshed).any(|(row, _, mask)| shows[row] & mask != 0)
        };
        Some(self.chunks_affected_by(changed).points().filter(has_changed).collect())
    }

    /// The weights of a box, x fastest. They are [`Weight::OUTSIDE`] where the border excludes a point; elsewhere the
    /// border changes no sign.
    fn weights(&self, region: Region, shape: Shape, border: Option<Border>) -> Vec<W> {
        let mut weights = vec![W::OUTSIDE; shape.len()];
        let [_, along_y, along_z] = shape.strides();
        let (first, last) = (self.chunk_of(region.min), self.chunk_of(region.max.map(|v| v - 1)));
        for position in Region::new(first, last).grown(0, 1).points() {
            let part = self.chunk_region(position).intersection(&region);
            let chunk = self.seen_chunk(position);
            for z in part.min[2]..part.max[2] {
                for y in part.min[1]..part.max[1] {
                    let [dx, dy, dz] = [part.min[0] - region.min[0], y - region.min[1], z - region.min[2]];
                    let start = dx as usize + along_y * dy as usize + along_z * dz as usize;
                    let row = &mut weights[start..start + part.size()[0] as usize];
                    match chunk {
                        Some(GridChunk::Samples(samples)) => {
                            let from = self.index([part.min[0], y, z]);
                            row.copy_from_slice(&samples.weights[from..from + row.len()]);
                        }
                        Some(GridChunk::Uniform(voxel)) => row.fill(voxel.weight),
                        None => {}
                    }
                    for (weight, x) in row.iter_mut().zip(part.min[0]..) {
                        if border.is_some_and(|border| border.excludes([x, y, z])) {
                            *weight = W::OUTSIDE;
                        }
                    }
                }
            }
        }
        weights
    }
}

/// How far a changed sample shows.
#[derive(Clone, Copy)]
struct Reach {
    /// The most steps along each axis from a changed sample to one through which it shows.
    steps: u32,
    /// The cells below a chunk's own that its mesh has vertices in.
    below: u32,
    /// Whether it shows along the axes alone; otherwise through the whole cube around it.
    is_axial: bool,
    /// Whether it shows through corners of cells that the surface crosses; otherwise through ends of crossed edges.
    is_by_cells: bool,
}

impl Reach {
    const fn new(method: &MeshMethod) -> Self {
        match method {
            MeshMethod::Primal(settings) => {
                let is_by_cells = matches!(settings.topology, Topology::Trilinear);
                Self { steps: 1, below: 0, is_axial: true, is_by_cells }
            }
            MeshMethod::Dual(_) => {
                Self { steps: method.margins()[0] - 1, below: 1, is_axial: false, is_by_cells: true }
            }
        }
    }
}

/// Bits of the samples of a box, one word a row.
struct Rows<'a> {
    /// The box.
    read: Region,
    /// Set where a sample is inside after the change.
    now: &'a [u64],
    /// Set where a sample was inside before the change.
    before: Vec<u64>,
    /// Set where a sample's weight or material changed.
    changed: Vec<u64>,
}

impl Rows<'_> {
    /// Records the changes of one chunk within the box `within`. `chunk`: the points of the chunk.
    fn compare<W: Weight>(
        &mut self,
        old: &GridChunk<W>,
        new: &GridChunk<W>,
        chunk: Region,
        within: Region,
        threshold: W::Threshold,
        border: Option<Border>,
    ) {
        let [nx, ny, _] = chunk.size().map(|size| size as usize);
        let part = chunk.intersection(&within);
        if part.is_empty() {
            return;
        }
        let (mut old_scratch, mut new_scratch) = (([W::OUTSIDE; 64], [0; 64]), ([W::OUTSIDE; 64], [0; 64]));
        let (len, first_bit) = (part.size()[0] as usize, part.min[0] - self.read.min[0]);
        for (row, [y, z], _) in self.rows_of(part) {
            let may_flip = |bit: usize| border.is_none_or(|border| !border.excludes([part.min[0] + bit as i32, y, z]));
            let [dx, dy, dz] = [part.min[0] - chunk.min[0], y - chunk.min[1], z - chunk.min[2]].map(|v| v as usize);
            let from = dx + nx * (dy + ny * dz);
            let (old_weights, old_materials) = row_of(old, from..from + len, &mut old_scratch);
            let (new_weights, new_materials) = row_of(new, from..from + len, &mut new_scratch);
            let (mut changed, mut flipped) = (0u64, 0u64);
            if old_weights != new_weights {
                for (bit, (old, new)) in old_weights.iter().zip(new_weights).enumerate() {
                    changed |= u64::from(old != new) << bit;
                    let flips = old.inside(threshold) != new.inside(threshold) && may_flip(bit);
                    flipped |= u64::from(flips) << bit;
                }
            }
            if old_materials != new_materials {
                for (bit, (old, new)) in old_materials.iter().zip(new_materials).enumerate() {
                    changed |= u64::from(old != new) << bit;
                }
            }
            self.changed[row] |= changed << first_bit;
            self.before[row] ^= flipped << first_bit;
        }
    }

    /// The samples through which the change shows: the ends of edges whose vertices depend on changed samples, and the
    /// corners of cells whose triangles do. One word a row. `changed`: the box around the changed samples, one step more
    /// than the reach inside of the box that was read.
    fn shows(&self, changed: Region, reach: Reach) -> Vec<u64> {
        let ny = self.read.size()[1] as usize;
        let mut shows = vec![0; self.now.len()];
        let cubes = if reach.is_axial { Vec::new() } else { self.cubes_around_changes(reach.steps as usize) };
        for (row, ..) in self.rows_of(changed.grown(reach.steps, reach.steps)) {
            let beside = [row - 1, row + 1, row - ny, row + ny];
            let around = |rows: &[u64]| {
                rows[row] << 1 | rows[row] >> 1 | beside.iter().fold(0, |all, beside| all | rows[*beside])
            };
            let near = if reach.is_axial { self.changed[row] | around(&self.changed) } else { cubes[row] };
            if near == 0 {
                continue;
            }
            // Samples with a neighbour of the other sign. At the ends of a row this is wrong, but nothing changed
            // there.
            let ends = |signs: &[u64]| {
                let apart = beside.iter().fold(0, |all, beside| all | (signs[row] ^ signs[*beside]));
                apart | (signs[row] ^ signs[row] << 1) | (signs[row] ^ signs[row] >> 1)
            };
            shows[row] = near & (ends(self.now) | ends(&self.before));
            if reach.is_by_cells {
                // Samples of which any of the 26 neighbours has the other sign.
                let mixed = |signs: &[u64]| {
                    let nine = || [row - ny, row, row + ny].into_iter().flat_map(|row| &signs[row - 1..row + 2]);
                    let (any, all) = nine().fold((0, u64::MAX), |(any, all), word| (any | word, all & word));
                    (any | any << 1 | any >> 1) & !(all & all << 1 & all >> 1)
                };
                shows[row] |= near & (mixed(self.now) | mixed(&self.before));
            }
        }
        shows
    }

    /// Changed samples and all within some steps of them on every axis.
    fn cubes_around_changes(&self, steps: usize) -> Vec<u64> {
        let along_x = |row: &u64| (1..=steps).fold(*row, |all, step| all | *row << step | *row >> step);
        let mut rows: Vec<u64> = self.changed.iter().map(along_x).collect();
        // Rows that follow each other along y, then along z. A row of the box's other side stands for one beyond its
        // end, but nothing changed there.
        for stride in [1, self.read.size()[1] as usize] {
            let beside = |row: usize| {
                (1..=steps).fold(rows[row], |all, step| {
                    let [before, after] = [row.checked_sub(step * stride), Some(row + step * stride)];
                    [before, after]
                        .into_iter()
                        .flatten()
                        .filter_map(|row| rows.get(row))
                        .fold(all, |all, row| all | row)
                })
            };
            rows = (0..rows.len()).map(beside).collect();
        }
        rows
    }

    /// The rows of a box within the box that was read: each row's number, its y and z, and a mask of its samples that
    /// lie in the box.
    fn rows_of(&self, part: Region) -> impl Iterator<Item = (usize, [i32; 2], u64)> + use<> {
        let (read, ny) = (self.read, self.read.size()[1] as usize);
        let ends = [part.min[0], part.max[0]].map(|x| (1u128 << (x - read.min[0]).clamp(0, 64)) - 1);
        let mask = (ends[1] & !ends[0]) as u64;
        (part.min[2]..part.max[2]).flat_map(move |z| {
            (part.min[1]..part.max[1]).map(move |y| {
                let row = (y - read.min[1]) as usize + ny * (z - read.min[2]) as usize;
                (row, [y, z], mask)
            })
        })
    }
}

/// The weights and materials of a chunk's samples at `indices`, at most 64. Those of a uniform chunk are written to
/// `scratch`.
fn row_of<'a, W: Weight>(
    chunk: &'a GridChunk<W>,
    indices: Range<usize>,
    scratch: &'a mut ([W; 64], [u8; 64]),
) -> (&'a [W], &'a [u8]) {
    match chunk {
        GridChunk::Samples(samples) => (&samples.weights[indices.clone()], &samples.materials[indices]),
        GridChunk::Uniform(voxel) => {
            let (weights, materials) = (&mut scratch.0[..indices.len()], &mut scratch.1[..indices.len()]);
            weights.fill(voxel.weight);
            materials.fill(voxel.material);
            (weights, materials)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::brush::{Operation, QuantisedShape, QuantisedStamp};
    use crate::{DualSettings, MaterialSet, MeshBuffer, MeshSettings, Mesher, Voxel};

    const CELLS: u32 = 8;
    const CHUNKS: Region = Region::new([-1; 3], [2; 3]);

    /// Hills with distances beyond the reach of edits, or noise.
    fn ground(seed: u32, bounded: bool, is_noise: bool) -> Grid<i16> {
        let mut grid = if bounded { Grid::bounded(CELLS, CHUNKS) } else { Grid::new(CELLS) }.unwrap();
        let [a, b] = [seed % 7, seed % 5].map(f64::from);
        let hills = move |[x, y, z]: [f64; 3]| y - 6.0 - (x / (3.0 + a)).sin() * 3.0 - (z / (2.0 + b)).cos() * 2.0;
        let noise = move |p: [f64; 3]| {
            let point_seed =
                p.iter().fold(u64::from(seed), |seed, v| seed << 8 ^ u64::from((*v as i32).cast_unsigned()));
            fastrand::Rng::with_seed(point_seed).f64() * 8.0 - 4.0
        };
        for position in CHUNKS.points() {
            if is_noise { grid.fill(position, &noise, 1.0) } else { grid.fill(position, &hills, 1.0) }.unwrap();
        }
        grid.take_dirty();
        grid
    }

    fn stamp() -> impl Strategy<Value = QuantisedStamp> {
        let center = || prop::array::uniform3(-10.0..18.0f64);
        let shape = prop_oneof![
            (center(), 0.5..7.0f64).prop_map(|(center, radius)| QuantisedShape::sphere(center, radius).unwrap()),
            (center(), prop::array::uniform3(0.5..6.0f64))
                .prop_map(|(center, half)| QuantisedShape::cuboid(center, half).unwrap()),
        ];
        let operation = prop_oneof![Just(Operation::Dig), Just(Operation::Add), Just(Operation::Paint)];
        (shape, operation).prop_map(|(shape, operation)| QuantisedStamp::new(shape, operation, 3))
    }

    fn mesh(grid: &Grid, position: [i32; 3], method: impl Into<MeshMethod>) -> MeshBuffer {
        let mut mesh = MeshBuffer::new();
        grid.mesh_chunk(position, &mut Mesher::new(), method, &mut mesh).unwrap();
        mesh
    }

    fn chunks(grid: &Grid) -> BTreeMap<[i32; 3], GridChunk> {
        grid.chunks().map(|(position, chunk)| (position, chunk.clone())).collect()
    }

    proptest! {
        #[test]
        fn chunks_without_mesh_changes_have_equal_meshes(
            seed in any::<u32>(),
            [bounded, is_noise, exact] in any::<[bool; 3]>(),
            (smoothing, sharp, crease) in (prop::option::of(0..=5u32), any::<bool>(), prop::option::of(Just(0.6f32))),
            isovalue in prop_oneof![Just(0.0f32), -2.0..2.0f32],
            stamps in prop::collection::vec(stamp(), 1..3),
        ) {
            let before = ground(seed, bounded, is_noise);
            let mut after = before.clone();
            let topology = if exact { Topology::Trilinear } else { Topology::Separated };
            let sharp = if sharp { MaterialSet::ALL } else { [3].into_iter().collect() };
            let method = match smoothing {
                None => MeshMethod::Primal(MeshSettings { isovalue, topology, ..MeshSettings::default() }),
                Some(smoothing) => {
                    MeshMethod::Dual(DualSettings { isovalue, smoothing, sharp, crease, ..DualSettings::default() })
                }
            };
            after.set_mesh_method(method).unwrap();
            let changed = stamps.iter().fold(Region::new([0; 3], [0; 3]), |all, stamp| all.union(&after.apply(stamp).region));
            let affected = after.chunks_affected_by(changed);
            let mut old = chunks(&before);
            for position in affected.points() {
                old.entry(position).or_insert(GridChunk::AIR);
            }
            let changed_meshes = after.chunks_with_mesh_changes(&old, changed, method);
            prop_assert!(changed_meshes.is_some());
            for position in affected.points() {
                let is_equal = || mesh(&before, position, method) == mesh(&after, position, method);
                let has_changed = changed_meshes.as_ref().is_none_or(|changed_meshes| changed_meshes.contains(&position));
                prop_assert!(has_changed || is_equal(), "chunk {:?}", position);
            }
        }
    }

    /// Puts one solid sample in the air at each position around the common corner of eight chunks, and changes each
    /// sample near it in turn.
    fn changes_one_sample_at_a_time(method: MeshMethod, grounds: impl Iterator<Item = [i32; 3]>) {
        let (mut shown, mut hidden, reach) = (0, 0, method.margins()[1] + 1);
        for ground in grounds {
            let mut before = Grid::new(CELLS).unwrap();
            before.set_mesh_method(method).unwrap();
            for position in CHUNKS.points() {
                // All samples differ, so that every sample that a normal depends on has an effect.
                before.fill(position, &|[x, y, z]: [f64; 3]| 3.0 + 0.03 * x + 0.05 * y + 0.07 * z, 1.0).unwrap();
            }
            before.set(ground, Voxel::new(-300, 1)).unwrap();
            let old = chunks(&before);
            let meshes = Region::new([-1; 3], [1; 3]).points().map(|position| mesh(&before, position, method));
            let meshes: Vec<_> = meshes.collect();
            for point in Region::new(ground, ground).grown(reach, reach + 1).points() {
                let mut after = before.clone();
                after.set(point, Voxel::new(before.get(point).weight - 9, 2)).unwrap();
                let changed = Region::new(point, point).grown(0, 1);
                let changed_meshes = after.chunks_with_mesh_changes(&old, changed, method).unwrap();
                for (position, mesh_before) in Region::new([-1; 3], [1; 3]).points().zip(&meshes) {
                    let has_changed = changed_meshes.contains(&position);
                    *if has_changed { &mut shown } else { &mut hidden } += 1;
                    assert!(
                        has_changed || mesh(&after, position, method) == *mesh_before,
                        "{ground:?}, {point:?}, chunk {position:?}"
                    );
                }
            }
        }
        assert!(shown > 1000 && hidden > 1000, "{shown}, {hidden}");
    }

    #[test]
    fn no_mesh_change_is_missed() {
        changes_one_sample_at_a_time(MeshMethod::default(), Region::new([-2; 3], [2; 3]).points());
    }

    #[test]
    fn no_change_of_a_dual_mesh_is_missed() {
        for (smoothing, step) in [(0, 3), (2, 15)] {
            let method = MeshMethod::Dual(DualSettings { smoothing, ..DualSettings::default() });
            changes_one_sample_at_a_time(method, Region::new([-2; 3], [2; 3]).points().step_by(step));
        }
    }

    /// Digs a ball into flat ground. Its effect on deep chunks does not show.
    #[test]
    fn only_chunks_near_the_surface_change_meshes() {
        let mut grid = Grid::new(16).unwrap();
        for position in CHUNKS.points() {
            grid.fill(position, &|[_, y, _]: [f64; 3]| y - 6.5, 1.0).unwrap();
        }
        let (before, settings) = (chunks(&grid), MeshSettings::default());
        let ball = QuantisedShape::sphere([8.0, 6.5, 8.0], 3.0).unwrap();
        let changed = grid.apply(&QuantisedStamp::new(ball, Operation::Dig, 0)).region;
        let affected = grid.chunks_affected_by(changed).points().count();
        assert_eq!(grid.chunks_with_mesh_changes(&before, changed, settings), Some(BTreeSet::from([[0; 3]])));
        assert!(affected > 1, "{affected}");
        assert_eq!(
            grid.chunks_with_mesh_changes(&chunks(&grid), changed, settings),
            Some(BTreeSet::new()),
            "nothing has changed"
        );
        let not_finite = MeshSettings { isovalue: f32::NAN, ..settings };
        assert_eq!(grid.chunks_with_mesh_changes(&before, changed, not_finite), None);
        assert_eq!(grid.chunks_with_mesh_changes(&before, Region::new([0; 3], [61, 1, 1]), settings), None);
        assert_eq!(
            grid.chunks_with_mesh_changes(&before, Region::new([0; 3], [0; 3]), settings),
            Some(BTreeSet::new())
        );
        let ends = Region::new([i32::MIN; 3], [i32::MIN + 1; 3]);
        assert_eq!(grid.chunks_with_mesh_changes(&before, ends, settings), None);
    }
}
