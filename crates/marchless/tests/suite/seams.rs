//! Chunks' meshes fit: equal vertices on every shared border, bit for bit, and closed together.

use core::fmt::Debug;
use std::collections::{BTreeMap, HashMap};

use marchless::{
    Block, Grid, GridChunk, GridSamples, MeshBuffer, MeshMethod, MeshReport, MeshSettings, Mesher, Region, Topology,
    Voxel, Weight,
};
use proptest::prelude::*;

use crate::support::random;

/// How the samples of a random grid are made.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Field {
    /// Any bit pattern at every point.
    Noise,
    /// Few values near the isovalue, ties included.
    Steps,
    /// A wavy distance.
    Smooth,
    /// Whole chunks inside or outside.
    Uniform,
}

/// Weights that random bits make.
pub(crate) trait AnyWeight: Weight + Debug {
    fn any(bits: u64) -> Self;
}

impl AnyWeight for i8 {
    fn any(bits: u64) -> Self {
        bits as i8
    }
}

impl AnyWeight for i16 {
    fn any(bits: u64) -> Self {
        bits as i16
    }
}

impl AnyWeight for f32 {
    fn any(bits: u64) -> Self {
        f32::from_bits(bits as u32)
    }
}

fn chunk<W: AnyWeight>(field: Field, seed: u64, region: Region) -> GridChunk<W> {
    let weight = |point: [i32; 3]| {
        let bits = random(seed, point);
        let [x, y, z] = point.map(|v| v as f32);
        let scale = 1.0 + (seed % 7) as f32;
        match field {
            Field::Noise => W::any(bits),
            Field::Steps => W::from_voxels((bits % 5) as f32 / 4.0 - 0.5),
            _ => W::from_voxels((x / scale).sin() * 3.0 + (y / 3.0).cos() * 2.0 + (z / (scale + 1.0)).sin() * 3.0),
        }
    };
    if let Field::Uniform = field {
        let inside = random(seed, region.min) % 3 < 2;
        return GridChunk::Uniform(Voxel::new(if inside { W::INSIDE } else { W::OUTSIDE }, inside as u8));
    }
    let weights = region.points().map(weight).collect();
    let materials = region.points().map(|point| (random(seed, point) >> 40) as u8).collect();
    GridChunk::Samples(GridSamples { weights, materials }.into())
}

pub(crate) fn grid<W: AnyWeight>(field: Field, seed: u64, cells: u32, bounds: Region) -> Grid<W> {
    let mut grid = Grid::bounded(cells, bounds).expect("a sound size");
    for position in bounds.points() {
        // Some chunks are absent, and some whole ones stand between sampled ones.
        let field = if random(seed, position) % 5 == 1 { Field::Uniform } else { field };
        if random(seed, position) % 7 != 2 {
            grid.insert(position, chunk(field, seed, grid.chunk_region(position))).expect("within the bounds");
        }
    }
    grid
}

/// An exact place in lattice space: `f64` holds the sum of a chunk's origin and an `f32` position within the chunk.
pub(crate) type Key = [u64; 3];

pub(crate) fn key(origin: [i32; 3], position: [f32; 3]) -> Key {
    // Adding 0.0 turns −0.0, which is the same place as 0.0, into it.
    core::array::from_fn(|axis| (f64::from(origin[axis]) + f64::from(position[axis]) + 0.0).to_bits())
}

pub(crate) fn meshes<W: AnyWeight>(grid: &Grid<W>, method: impl Into<MeshMethod>) -> BTreeMap<[i32; 3], MeshBuffer> {
    let method = method.into();
    let (mut mesher, mut block) = (Mesher::new(), Block::new());
    let mesh = |position| {
        let mut mesh = MeshBuffer::new();
        grid.neighbourhood(position).mesh(&mut mesher, &mut block, method, &mut mesh).expect("sound settings");
        (position, mesh)
    };
    grid.bounds().expect("a bounded grid").points().map(mesh).collect()
}

/// The vertices of a chunk's mesh on the border that it shares with another chunk: normal and material by place.
fn border<W: Weight>(
    grid: &Grid<W>,
    mesh: &MeshBuffer,
    own: [i32; 3],
    other: [i32; 3],
) -> BTreeMap<Key, ([u32; 3], u8)> {
    let origin = grid.chunk_region(own).min;
    let box_of_other = grid.chunk_region(other);
    let on_border = |position: &[f32; 3]| {
        (0..3).all(|axis| {
            let coordinate = f64::from(origin[axis]) + f64::from(position[axis]);
            (f64::from(box_of_other.min[axis])..=f64::from(box_of_other.max[axis])).contains(&coordinate)
        })
    };
    let vertices = mesh.positions.iter().zip(&mesh.normals).zip(&mesh.materials);
    vertices
        .filter(|((position, _), _)| on_border(position))
        .map(|((position, normal), material)| (key(origin, *position), (normal.map(f32::to_bits), *material)))
        .collect()
}

fn check_seams<W: AnyWeight>(
    field: Field,
    seed: u64,
    cells: u32,
    bounds: Region,
    isovalue: f32,
    topology: Topology,
) -> Result<(), TestCaseError> {
    let grid = grid::<W>(field, seed, cells, bounds);
    let settings = MeshSettings { isovalue, topology, ..MeshSettings::default() };
    let meshes = meshes(&grid, settings);

    for (&position, mesh) in &meshes {
        // Half of the 26 neighbours: the other half sees this chunk as one of theirs.
        for neighbour in Region::new(position, position).grown(1, 2).points().filter(|&other| other > position) {
            if let Some(other) = meshes.get(&neighbour) {
                let ours = border(&grid, mesh, position, neighbour);
                let theirs = border(&grid, other, neighbour, position);
                prop_assert_eq!(ours, theirs, "between {:?} and {:?}", position, neighbour);
            }
        }
    }

    let mut welded = HashMap::new();
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for (&position, mesh) in &meshes {
        let origin = grid.chunk_region(position).min;
        let ids: Vec<u32> = mesh
            .positions
            .iter()
            .map(|&vertex| {
                *welded.entry(key(origin, vertex)).or_insert_with(|| {
                    positions.push(core::array::from_fn(|axis| origin[axis] as f32 + vertex[axis]));
                    positions.len() as u32 - 1
                })
            })
            .collect();
        indices.extend(mesh.indices.iter().map(|&index| ids[index as usize]));
    }
    let report = MeshReport::new(&positions, &indices);
    prop_assert_eq!(report.boundary_edges, 0, "{}", report);
    prop_assert_eq!((report.non_manifold_edges, report.non_manifold_vertices), (0, 0), "{}", report);
    prop_assert_eq!((report.inconsistent_edges, report.duplicate_triangles), (0, 0), "{}", report);
    prop_assert_eq!(report.is_closed(), true, "{}", report);
    Ok(())
}

pub(crate) fn any_field() -> impl Strategy<Value = Field> {
    prop_oneof![Just(Field::Noise), Just(Field::Steps), Just(Field::Smooth), Just(Field::Uniform)]
}

/// The bounds of a few chunks.
pub(crate) fn any_bounds() -> impl Strategy<Value = Region> {
    let (min, size) = ([-3..3i32, -3..3, -3..3], [1..=3i32, 1..=3, 1..=2]);
    (min, size).prop_map(|(min, size)| Region::new(min, core::array::from_fn(|axis| min[axis] + size[axis])))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn borders_are_equal_and_the_union_is_closed(
        field in any_field(),
        seed: u64,
        cells in 8u32..=13,
        bounds in any_bounds(),
        isovalue in prop_oneof![3 => Just(0.0f32), 1 => -3.0..3.0f32],
        topology in prop_oneof![Just(Topology::Separated), Just(Topology::Trilinear)],
    ) {
        check_seams::<i8>(field, seed, cells, bounds, isovalue, topology)?;
        check_seams::<i16>(field, seed, cells, bounds, isovalue, topology)?;
        check_seams::<f32>(field, seed, cells, bounds, isovalue, topology)?;
    }
}

#[test]
fn borders_hold_in_the_largest_chunks_and_at_any_isovalue() {
    for topology in [Topology::Separated, Topology::Trilinear] {
        for cells in [32, 62] {
            let bounds = Region::new([-1, 0, 0], [1, 1, 1]);
            check_seams::<i16>(Field::Smooth, 5, cells, bounds, 0.0, topology).expect("sound seams");
        }
        for isovalue in [-200.0, -10.0, 3.5, 100.0] {
            let bounds = Region::new([0, -1, 0], [2, 1, 1]);
            check_seams::<i16>(Field::Noise, 6, 9, bounds, isovalue, topology).expect("sound seams");
            check_seams::<f32>(Field::Smooth, 7, 9, bounds, isovalue, topology).expect("sound seams");
        }
    }
}

#[test]
fn a_full_grid_is_a_box_half_a_voxel_inside() {
    let bounds = Region::new([-1, 0, 2], [1, 1, 3]);
    let mut grid = Grid::<i16>::bounded(8, bounds).expect("a sound size");
    for position in bounds.points() {
        grid.insert(position, GridChunk::Uniform(Voxel::new(i16::MIN, 1))).expect("within the bounds");
    }
    let meshes = meshes(&grid, MeshSettings::default());
    let mut ends = [[f64::MAX; 3], [f64::MIN; 3]];
    for (position, mesh) in &meshes {
        let origin = grid.chunk_region(*position).min;
        for vertex in &mesh.positions {
            for axis in 0..3 {
                let coordinate = f64::from(origin[axis]) + f64::from(vertex[axis]);
                ends[0][axis] = ends[0][axis].min(coordinate);
                ends[1][axis] = ends[1][axis].max(coordinate);
            }
        }
        assert!(mesh.materials.iter().all(|&material| material == 1));
    }
    assert_eq!(ends, [[-7.5, 0.5, 16.5], [7.5, 7.5, 23.5]]);
}
