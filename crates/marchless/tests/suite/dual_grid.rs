//! Dual meshes of a grid's chunks: together one closed surface, flat at the border, and changed by edits nearby alone.

use std::collections::HashMap;

use marchless::{
    DualSettings, Grid, GridChunk, MeshError, MeshMethod, MeshUnion, Operation, QuantisedShape, QuantisedStamp, Region,
    Voxel,
};
use proptest::prelude::*;

use crate::seams::{AnyWeight, Field, any_bounds, any_field, grid, key, meshes};

fn dual(smoothing: u32) -> MeshMethod {
    DualSettings { smoothing, ..DualSettings::default() }.into()
}

/// Checks that the meshes of all chunks are one closed surface, with vertices that are equal bit for bit.
fn check_closed<W: AnyWeight>(
    field: Field,
    seed: u64,
    cells: u32,
    bounds: Region,
    isovalue: f32,
    smoothing: u32,
) -> Result<(), TestCaseError> {
    let grid = grid::<W>(field, seed, cells, bounds);
    let meshes = meshes(&grid, DualSettings { isovalue, smoothing, ..DualSettings::default() });
    let (mut union, mut looks) = (MeshUnion::new(), HashMap::new());
    for (&position, mesh) in &meshes {
        let origin = grid.chunk_region(position).min;
        union.add(mesh, origin.map(i64::from), 0);
        for ((vertex, normal), material) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.materials) {
            let look = (normal.map(f32::to_bits), *material);
            let first = *looks.entry(key(origin, *vertex)).or_insert(look);
            // Two vertices of a cell may be smoothed to one point.
            prop_assert!(first == look || smoothing > 0, "at {:?} of chunk {:?}", vertex, position);
        }
    }
    let report = union.report();
    prop_assert!(report.is_closed(), "{}", report);
    prop_assert_eq!(report.zero_area_triangles, 0, "{}", report);
    if smoothing == 0 {
        let flaws = [report.non_manifold_edges, report.non_manifold_vertices, report.inconsistent_edges];
        prop_assert_eq!(flaws, [0; 3], "{}", report);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn chunks_are_one_closed_surface(
        field in any_field(),
        seed: u64,
        cells in 8u32..=13,
        bounds in any_bounds(),
        isovalue in prop_oneof![3 => Just(0.0f32), 1 => -3.0..3.0f32],
        smoothing in prop_oneof![1 => Just(0u32), 1 => 0..=6u32],
    ) {
        check_closed::<i8>(field, seed, cells, bounds, isovalue, smoothing)?;
        check_closed::<i16>(field, seed, cells, bounds, isovalue, smoothing)?;
        check_closed::<f32>(field, seed, cells, bounds, isovalue, smoothing)?;
    }

    #[test]
    fn edits_change_no_chunk_that_is_not_dirty(
        seed: u64,
        cells in 8u32..=16,
        (smoothing, crease) in prop_oneof![(0..=6u32, Just(None)), (0..=5u32, Just(Some(0.4f32)))],
        bounded: bool,
        stamps in prop::collection::vec((prop::array::uniform3(-6.0..30.0f64), 0.6..4.0f64, any::<bool>()), 1..4),
    ) {
        let chunks = Region::new([-1; 3], [3; 3]);
        let mut grid = grid::<i16>(Field::Smooth, seed, cells, chunks);
        if !bounded {
            grid.set_bounds(None).expect("no bounds");
        }
        let sharp = [0, 3].into_iter().collect();
        let method = DualSettings { smoothing, sharp, crease, ..DualSettings::default() };
        grid.set_mesh_method(method).expect("few steps");
        grid.take_dirty();
        let mesh = |grid: &Grid, position| {
            let mut mesh = marchless::MeshBuffer::new();
            grid.mesh_chunk(position, &mut marchless::Mesher::new(), method, &mut mesh).expect("a chunk");
            mesh
        };
        let all = chunks.grown(1, 1);
        let before: Vec<_> = all.points().map(|position| mesh(&grid, position)).collect();
        for (center, radius, add) in stamps {
            let shape = QuantisedShape::sphere(center, radius).expect("in range");
            let operation = if add { Operation::Add } else { Operation::Dig };
            grid.apply(&QuantisedStamp::new(shape, operation, 3));
        }
        for (position, before) in all.points().zip(before) {
            if !grid.dirty().contains(&position) {
                prop_assert!(mesh(&grid, position) == before, "chunk {position:?}");
            }
        }
    }
}

#[test]
fn chunks_of_all_sizes_are_one_closed_surface() {
    let bounds = Region::new([-1, 0, 0], [1, 1, 1]);
    for (cells, smoothing) in [(8, 0), (8, 6), (9, 7), (10, 8), (16, 8), (31, 3), (32, 0), (32, 8), (33, 1), (62, 2)] {
        for field in [Field::Smooth, Field::Noise] {
            check_closed::<i16>(field, 5, cells, bounds, 0.0, smoothing).expect("sound seams");
        }
    }
    for isovalue in [-200.0, -10.0, 3.5, 100.0] {
        let bounds = Region::new([0, -1, 0], [2, 1, 1]);
        check_closed::<i16>(Field::Noise, 6, 9, bounds, isovalue, 0).expect("sound seams");
        check_closed::<f32>(Field::Smooth, 7, 9, bounds, isovalue, 5).expect("sound seams");
    }
}

#[test]
fn a_full_grid_has_flat_walls_and_bevelled_edges() {
    let bounds = Region::new([-2, 0, 2], [2, 4, 5]);
    let mut full = Grid::<i16>::bounded(8, bounds).expect("a sound size");
    for position in bounds.points() {
        full.insert(position, GridChunk::Uniform(Voxel::new(i16::MIN, 1))).expect("within the bounds");
    }
    let planes = full.planes().expect("bounded");
    for smoothing in [0, 1, 6] {
        let (mut flat, mut bevelled) = (0, 0);
        for (position, mesh) in meshes(&full, dual(smoothing)) {
            let origin = full.chunk_region(position).min;
            for vertex in &mesh.positions {
                // How far inside of the nearest wall, along each axis.
                let mut depths = [0, 1, 2].map(|axis| {
                    let at = f64::from(origin[axis]) + f64::from(vertex[axis]);
                    (at - f64::from(planes.min[axis])).min(f64::from(planes.max[axis]) - at) - 0.5
                });
                depths.sort_by(f64::total_cmp);
                let is_at_edge = depths[1] <= f64::from(smoothing) + 1.0;
                assert!(depths[0] == 0.0 || depths[0] > 0.0 && is_at_edge, "{smoothing} steps: {depths:?}");
                *if depths[0] == 0.0 { &mut flat } else { &mut bevelled } += 1;
            }
        }
        assert!(flat > 1000 && bevelled > 100, "{flat}, {bevelled}");
    }
}

#[test]
fn too_much_smoothing_for_the_chunks_is_refused() {
    let mut grid = Grid::<i16>::new(8).expect("a sound size");
    grid.set([3, 3, 3], Voxel::new(-5, 0)).expect("no bounds");
    let refused = Err(MeshError::Smoothing { found: 7, most: 6 });
    assert_eq!(grid.set_mesh_method(dual(7)), refused);
    let mut mesh = marchless::MeshBuffer { positions: vec![[0.0; 3]], ..marchless::MeshBuffer::new() };
    let mut mesher = marchless::Mesher::new();
    assert_eq!(grid.mesh_chunk([0; 3], &mut mesher, dual(7), &mut mesh), refused);
    assert!(mesh.positions.is_empty());
    assert_eq!(grid.mesh_chunk([0; 3], &mut mesher, dual(6), &mut mesh), Ok(()));
    assert_eq!(mesh.triangle_count(), 12);
    let most = u32::MAX;
    let found = Grid::<i16>::new(62).expect("a sound size").set_mesh_method(dual(most));
    assert_eq!(found, Err(MeshError::Smoothing { found: most, most: 8 }));
}
