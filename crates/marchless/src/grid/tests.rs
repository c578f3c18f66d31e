//! Tests of the grid against plain oracles: a map of voxels, and brute force.

mod filling;

use alloc::boxed::Box;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::mesher::{DualSettings, MeshSettings};

fn voxel() -> impl Strategy<Value = Voxel> {
    (any::<i16>(), any::<u8>()).prop_map(|(weight, material)| Voxel { weight, material })
}

/// A chunk that is absent, uniform (often air), or made of samples.
fn chunk(cells: u32) -> impl Strategy<Value = Option<GridChunk>> {
    let len = (cells as usize).pow(3);
    prop_oneof![
        2 => Just(None),
        1 => Just(Some(GridChunk::AIR)),
        2 => voxel().prop_map(|voxel| Some(GridChunk::Uniform(voxel))),
        3 => any::<u64>().prop_map(move |seed| Some(noise_chunk(seed, len))),
    ]
}

fn noise_chunk(seed: u64, len: usize) -> GridChunk {
    let mut rng = fastrand::Rng::with_seed(seed);
    let weights = (0..len).map(|_| rng.i16(..)).collect();
    let materials = (0..len).map(|_| rng.u8(..)).collect();
    GridChunk::Samples(Arc::new(GridSamples { weights, materials }))
}

/// A grid of up to 3³ random chunks around a centre, and the centre. The grid has no bounds, or a box around the
/// centre.
fn grid() -> impl Strategy<Value = (Grid, [i32; 3])> {
    let cells = prop_oneof![Just(8u32), Just(9), Just(13)];
    let end = (i32::MAX - 2) / 13 - 3;
    let coordinate = move || prop_oneof![-3..=3i32, Just(end), Just(-end)];
    let centre = [coordinate(), coordinate(), coordinate()];
    let margins = proptest::option::of(([0..3i32, 0..3, 0..3], [1..3i32, 1..3, 1..3]));
    (cells, centre, margins).prop_flat_map(|(cells, centre, margins)| {
        proptest::collection::vec(chunk(cells), 27).prop_map(move |chunks| {
            let mut grid = match margins {
                None => Grid::new(cells),
                Some((low, high)) => {
                    let min = core::array::from_fn(|axis| centre[axis] - low[axis]);
                    let max = core::array::from_fn(|axis| centre[axis] + high[axis]);
                    Grid::bounded(cells, Region::new(min, max))
                }
            }
            .unwrap();
            for (position, chunk) in around(centre).points().zip(chunks) {
                if let Some(chunk) = chunk {
                    let fits = grid.bounds().is_none_or(|bounds| bounds.contains(position));
                    assert_eq!(grid.insert(position, chunk).is_ok(), fits);
                }
            }
            (grid, centre)
        })
    })
}

fn around(position: [i32; 3]) -> Region {
    Region::new(position, position).grown(1, 2)
}

/// The lattice points that the primal mesh of the chunk at `position` reads.
fn block_region(position: [i32; 3], cells: u32) -> Region {
    let n = cells as i32;
    Region::new(position.map(|c| n * c - 1), position.map(|c| n * c + n + 2))
}

/// The lattice points that the mesh of the chunk at `position` reads.
fn read_region(position: [i32; 3], cells: u32, smoothing: Option<u32>) -> Region {
    match smoothing {
        None => block_region(position, cells),
        Some(smoothing) => {
            let n = cells as i32;
            Region::new(position.map(|c| n * c), position.map(|c| n * c + n)).grown(2 + smoothing, 2 + smoothing)
        }
    }
}

fn method(smoothing: Option<u32>) -> MeshMethod {
    smoothing.map_or_else(MeshMethod::default, |smoothing| {
        MeshMethod::Dual(DualSettings { smoothing, ..DualSettings::default() })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn get_returns_the_sample_that_was_set(
        cells in 8u32..=62,
        writes in proptest::collection::vec(([-130..130i32, -130..130, -130..130], voxel()), 1..60),
    ) {
        let mut grid = Grid::new(cells).unwrap();
        let mut oracle = BTreeMap::new();
        for &(point, voxel) in &writes {
            grid.set(point, voxel).unwrap();
            oracle.insert(point, voxel);
        }
        for (point, _) in writes {
            for neighbour in around(point).points() {
                let expected = oracle.get(&neighbour).copied().unwrap_or(Voxel::AIR);
                prop_assert_eq!(grid.get(neighbour), expected);
            }
            prop_assert!(grid.chunk_region(grid.chunk_of(point)).contains(point));
        }
    }

    #[test]
    fn blocks_hold_samples_as_meshed(
        (grid, centre) in grid(), step in [-1..=1i32, -1..=1, -1..=1], isovalue in prop_oneof![Just(0.0), -3.0..3.0f32],
        smoothing in proptest::option::of(0..=6u32),
    ) {
        let mut block = Block::new();
        // An off-centre chunk has absent neighbours, and often lies beyond the bounds itself.
        for position in [centre, core::array::from_fn(|axis| centre[axis] + step[axis])] {
            match smoothing {
                None => grid.neighbourhood(position).block(isovalue, &mut block),
                Some(smoothing) => {
                    let settings = DualSettings { isovalue, smoothing, ..DualSettings::default() };
                    grid.neighbourhood(position).dual_block(&settings, &mut block).unwrap();
                }
            }
            let samples = block.samples();
            let region = read_region(position, grid.chunk_cells(), smoothing);
            prop_assert_eq!(samples.shape().size(), region.size());
            prop_assert!(samples.is_padded());
            for (index, point) in region.points().enumerate() {
                let found = Voxel::new(samples.weights()[index], samples.materials().unwrap()[index]);
                prop_assert_eq!(found, grid.as_meshed(point, isovalue), "at {:?} of chunk {:?}", point, position);
            }
        }
    }

    #[test]
    fn uniform_neighbourhoods_have_no_surface((grid, centre) in grid()) {
        let mut emptied = grid.clone();
        let sampled: Vec<_> =
            grid.chunks().filter(|(_, chunk)| matches!(chunk, GridChunk::Samples(_))).map(|(p, _)| p).collect();
        for position in sampled {
            emptied.remove(position);
        }
        for grid in [grid, emptied] {
            for position in around(centre).points() {
                let neighbourhood = grid.neighbourhood(position);
                let mut block = Block::new();
                neighbourhood.block(0.0, &mut block);
                let weights = block.samples().weights();
                let one_weight = weights.iter().all(|weight| *weight == weights[0]);
                if neighbourhood.is_uniform() {
                    for isovalue in [-3.0, 0.0, 0.5] {
                        let mut block = Block::new();
                        neighbourhood.block(isovalue, &mut block);
                        let settings = MeshSettings { isovalue, ..MeshSettings::default() };
                        let mut mesh = MeshBuffer::new();
                        Mesher::new().mesh(block.samples(), &settings, &mut mesh).unwrap();
                        prop_assert!(mesh.is_empty(), "at isovalue {}", isovalue);
                    }
                }
                let whole = neighbourhood.chunks.iter().all(|chunk| matches!(chunk, Some(GridChunk::Uniform(_))));
                prop_assert!(!(whole && one_weight) || neighbourhood.is_uniform());
            }
        }
    }

    #[test]
    fn samples_near_the_border_are_clipped_as_meshed((grid, centre) in grid(), chunk_voxel in voxel(), isovalue in -2..3i16) {
        let mut grid = grid;
        let Some(planes) = grid.planes() else { return Ok(()) };
        grid.insert(centre, GridChunk::Uniform(chunk_voxel)).unwrap();
        for point in grid.chunk_region(centre).points() {
            let depth = (0..3).map(|axis| (point[axis] - planes.min[axis]).min(planes.max[axis] - point[axis]));
            let depth = depth.min().unwrap();
            let least = if depth <= 4 { 256 * isovalue + 128 - 256 * depth as i16 } else { i16::MIN };
            let expected = Voxel::new(chunk_voxel.weight.max(least), chunk_voxel.material);
            prop_assert_eq!(grid.as_meshed(point, isovalue.into()), expected);
            prop_assert_eq!(grid.get(point), chunk_voxel, "the stored sample is not clipped");
        }
    }

    #[test]
    fn changed_bounds_give_the_meshes_of_a_fresh_grid(
        (grid, centre) in grid(), margins in proptest::option::of(([0..3i32, 0..3, 0..3], [1..3i32, 1..3, 1..3])),
        smoothing in proptest::option::of(0..=6u32),
    ) {
        let bounds = margins.map(|(low, high)| {
            Region::new([0, 1, 2].map(|i| centre[i] - low[i]), [0, 1, 2].map(|i| centre[i] + high[i]))
        });
        let mut moved = grid.clone();
        moved.set_bounds(bounds).unwrap();
        let mut fresh = bounds.map_or_else(|| Grid::new(grid.chunk_cells()), |b| Grid::bounded(grid.chunk_cells(), b)).unwrap();
        for (position, chunk) in grid.chunks().filter(|(position, _)| bounds.is_none_or(|b| b.contains(*position))) {
            fresh.insert(position, chunk.clone()).unwrap();
        }
        // Much smoothing of small chunks lets the border show in the second layer of chunks.
        let layers = if smoothing.is_some_and(|smoothing| smoothing + 7 > grid.chunk_cells()) { 2 } else { 1 };
        let is_inner = |position: [i32; 3], bounds: Option<Region>| {
            let is_inner = |v: i32, min: i32, max: i32| min + layers <= v && v < max - layers;
            bounds.is_none_or(|Region { min, max }| (0..3).all(|i| is_inner(position[i], min[i], max[i])))
        };
        let (mut mesher, mut meshes) = (Mesher::new(), [const { MeshBuffer::new() }; 3]);
        for position in around(centre).grown(1, 1).points() {
            for (grid, mesh) in [&grid, &moved, &fresh].into_iter().zip(&mut meshes) {
                grid.mesh_chunk(position, &mut mesher, method(smoothing), mesh).unwrap();
            }
            prop_assert_eq!(&meshes[1], &meshes[2], "{:?}", position);
            let stays = is_inner(position, grid.bounds()) && is_inner(position, bounds);
            prop_assert!(!stays || meshes[0] == meshes[1], "only chunks at borders change: {position:?}");
        }
        moved.set_bounds(grid.bounds()).unwrap();
        prop_assert!(grid.chunks().eq(moved.chunks()), "nothing is lost");
    }

    #[test]
    fn affected_chunks_are_those_whose_block_changes(
        cells in 8u32..=62,
        min in [-200..200i32, -200..200, -200..200],
        size in [0..70i32, 0..70, 0..3],
        bounds in proptest::option::of(([-4..4i32, -4..4, -4..4], [1..9i32, 1..9, 1..9])),
        smoothing in proptest::option::of(0..=6u32),
    ) {
        let changed = Region::new(min, core::array::from_fn(|axis| min[axis] + size[axis]));
        let mut grid = match bounds {
            None => Grid::<i16>::new(cells),
            Some((low, size)) => {
                Grid::bounded(cells, Region::new(low, core::array::from_fn(|axis| low[axis] + size[axis])))
            }
        }
        .unwrap();
        grid.set_mesh_method(method(smoothing)).unwrap();
        let affected = grid.chunks_affected_by(changed);
        let within = grid.bounds().unwrap_or(Region::new([i32::MIN; 3], [i32::MAX; 3]));
        let mut found = 0;
        for position in Region::new(grid.chunk_of(min), grid.chunk_of(changed.max)).grown(2, 3).points() {
            let reads = !changed.is_empty() && !read_region(position, cells, smoothing).intersection(&changed).is_empty();
            prop_assert_eq!(affected.contains(position), reads && within.contains(position), "{:?}", position);
            found += u32::from(affected.contains(position));
        }
        prop_assert_eq!(affected.size().iter().product::<u32>(), found, "no affected chunk lies elsewhere");
    }

    #[test]
    fn setting_marks_the_chunks_that_read_the_point(
        (grid, centre) in grid(), offset in [0..13i32, 0..13, 0..13], smoothing in proptest::option::of(0..=6u32),
    ) {
        let mut grid = grid;
        grid.set_mesh_method(method(smoothing)).unwrap();
        let cells = grid.chunk_cells() as i32;
        let point = core::array::from_fn(|axis| centre[axis] * cells + offset[axis] % cells);
        grid.take_dirty();
        let old = grid.get(point);
        grid.set(point, old).unwrap();
        prop_assert!(grid.dirty().is_empty(), "nothing changed");
        grid.set(point, Voxel::new(old.weight, old.material ^ 1)).unwrap();
        let expected: BTreeSet<_> = around(centre)
            .points()
            .filter(|&position| read_region(position, cells as u32, smoothing).contains(point))
            .filter(|&position| grid.bounds().is_none_or(|bounds| bounds.contains(position)))
            .collect();
        prop_assert_eq!(grid.take_dirty(), expected);
    }
}

#[test]
fn every_write_of_a_clone_leaves_the_original_alone() {
    let mut grid = Grid::<i16>::new(8).unwrap();
    grid.insert([0; 3], noise_chunk(5, 512)).unwrap();
    grid.insert([1, 0, 0], GridChunk::Uniform(Voxel::new(-300, 2))).unwrap();
    let original = grid.clone();
    let snapshot = grid.neighbourhood([0; 3]);
    let samples = |grid: &Grid| -> Vec<_> { Region::new([-8; 3], [24; 3]).points().map(|p| grid.get(p)).collect() };
    let before = samples(&original);
    let mut block_before = Block::new();
    snapshot.block(0.0, &mut block_before);

    grid.set([3, 3, 3], Voxel::new(9, 9)).unwrap();
    grid.set([9, 3, 3], Voxel::new(9, 9)).unwrap();
    grid.remove([1, 0, 0]);
    grid.insert([0, 1, 0], GridChunk::Uniform(Voxel::new(-1, 1))).unwrap();

    assert_ne!(samples(&grid), before);
    assert_eq!(samples(&original), before);
    let mut block = Block::new();
    snapshot.block(0.0, &mut block);
    assert_eq!(block.samples().weights(), block_before.samples().weights());
    assert_eq!(grid.get([9, 3, 3]), Voxel::AIR, "a removed chunk reads as air");
}

#[test]
fn snapshots_may_be_sent_to_other_threads() {
    fn sent<T: Send + Sync + 'static>() {}
    sent::<(Neighbourhood<i16>, GridChunk<f32>, Grid<i8>)>();
}

#[test]
fn writing_an_equal_sample_changes_nothing() {
    let mut grid = Grid::<i16>::new(8).unwrap();
    grid.set([1, 2, 3], Voxel::AIR).unwrap();
    assert!(grid.chunks().next().is_none() && grid.dirty().is_empty());
}

#[test]
fn reading_copies_nothing() {
    let mut grid = Grid::<i16>::bounded(8, Region::new([0; 3], [1; 3])).unwrap();
    let shared = Arc::new(GridSamples { weights: (0..512).map(|i| i - 1000).collect(), materials: vec![0; 512] });
    grid.insert([0; 3], GridChunk::Samples(Arc::clone(&shared))).unwrap();
    let clone = grid.clone();
    grid.neighbourhood([0; 3]).block(0.0, &mut Block::new());
    assert!(matches!(clone.chunk([0; 3]), Some(GridChunk::Samples(kept)) if Arc::ptr_eq(kept, &shared)));
    grid.set([1, 2, 3], Voxel::new(0, 0)).unwrap();
    assert!(matches!(grid.chunk([0; 3]), Some(GridChunk::Samples(kept)) if !Arc::ptr_eq(kept, &shared)));
    grid.insert([0; 3], GridChunk::Uniform(Voxel::new(i16::MIN, 1))).unwrap();
    assert!(matches!(grid.chunk([0; 3]), Some(GridChunk::Uniform(_))), "rock needs no samples at the border");
}

#[test]
fn errors_say_what_was_expected() {
    for found in [0, 7, 63, u32::MAX] {
        assert_eq!(Grid::<i16>::new(found).unwrap_err(), GridError::ChunkCells { found });
        assert_eq!(GridChunk::<i16>::from_samples(vec![], vec![], found).unwrap_err(), GridError::ChunkCells { found });
    }
    let error = GridChunk::from_samples(vec![0i16; 512], vec![0; 511], 8).unwrap_err();
    assert_eq!(error, GridError::SamplesLength { cells: 8, expected: 512, weights: 512, materials: 511 });

    let bounds = Region::new([0; 3], [2, 1, 1]);
    let mut grid = Grid::<i16>::bounded(8, bounds).unwrap();
    for point in [[-1, 0, 0], [16, 0, 0], [0, 8, 0], [0, 0, i32::MIN]] {
        let position = grid.chunk_of(point);
        assert_eq!(grid.set(point, Voxel::AIR), Err(GridError::OutOfBounds { position, bounds }));
    }
    let error = grid.insert([0; 3], noise_chunk(1, 729)).unwrap_err();
    assert_eq!(error, GridError::SamplesLength { cells: 8, expected: 512, weights: 729, materials: 729 });
    assert!(grid.insert([2, 0, 0], GridChunk::AIR).is_err());
    assert!(grid.dirty().is_empty() && grid.chunks().next().is_none(), "refused writes change nothing");

    for bounds in
        [Region::new([0; 3], [1, 0, 1]), Region::new([i32::MIN; 3], [0; 3]), Region::new([0; 3], [i32::MAX; 3])]
    {
        assert!(matches!(Grid::<i16>::bounded(8, bounds), Err(GridError::Bounds { .. })));
    }
}

#[test]
fn the_ends_of_the_lattice_are_reached_without_panic() {
    let ends = [i32::MIN, i32::MIN + 1, -1, 0, i32::MAX - 1, i32::MAX];
    let mut block = Block::new();
    for cells in [8, 31, 62] {
        let limit = (i32::MAX - 2) / cells as i32;
        let bounds = Region::new([-limit; 3], [limit; 3]);
        for mut grid in [Grid::<i16>::new(cells).unwrap(), Grid::bounded(cells, bounds).unwrap()] {
            for (a, b) in ends.into_iter().flat_map(|a| ends.map(|b| (a, b))) {
                let point = [a, b, a];
                let stored = grid.set(point, Voxel::new(-1, 3)).is_ok();
                assert_eq!(stored, bounds.contains(grid.chunk_of(point)));
                assert_eq!(grid.get(point).material == 3, stored);
                let _ = (grid.chunks_affected_by(Region::new(point, [b, a, b])), grid.chunk_region(point));
                assert_eq!(grid.insert(point, GridChunk::AIR).is_ok(), bounds.contains(point));
                grid.neighbourhood(point).block(0.0, &mut block);
                let _ = GridChunk::<i16>::from_source(&|_| f64::NAN, point, cells, 1.0);
            }
            grid.take_dirty();
            grid.mark_dirty(Region::new([i32::MIN; 3], [i32::MAX; 3]));
            assert!(grid.chunks().all(|(position, _)| grid.dirty().contains(&position)));
            for position in [[limit - 1, 0, 0], [-limit, 0, 0]] {
                grid.neighbourhood(position).block(0.0, &mut block);
                for (index, point) in block_region(position, cells).points().enumerate() {
                    assert_eq!(block.samples().weights()[index], grid.as_meshed(point, 0.0).weight);
                }
            }
        }
    }
}

#[test]
fn huge_regions_mark_only_present_chunks_and_their_neighbours() {
    let mut grid = Grid::<i16>::new(8).unwrap();
    for position in [[0, 0, 0], [70_000, -3, 5], [-50, 2, 2], [9, 9, 400_000]] {
        grid.insert_clean(position, GridChunk::AIR).unwrap();
    }
    let region = Region::new([-80_000, -80_000, -80_000], [10_000_000, 80_000, 80_000]);
    grid.mark_dirty(region);
    let within = [[0, 0, 0], [70_000, -3, 5], [-50, 2, 2]];
    assert_eq!(grid.dirty(), &within.into_iter().flat_map(|position| around(position).points()).collect());
    // Chunks within the region read samples of a chunk just outside.
    grid.take_dirty();
    grid.mark_dirty(Region::new([8, -8_000, -8_000], [8_000, 8_000, 8_000]));
    let around_zero = around([0; 3]).points().filter(|position| position[0] >= 0);
    assert_eq!(grid.dirty(), &around_zero.collect());
}

proptest! {
    #[test]
    fn chunks_in_a_region_are_all_chunks_filtered_by_it((mut grid, centre) in grid(), shift in [-2..2i32, -2..2, -2..2]) {
        let low: [i32; 3] = core::array::from_fn(|axis| centre[axis] + shift[axis]);
        let region = Region::new(low, low.map(|v| v + 2));
        let everything = Region::new([i32::MIN; 3], [i32::MAX; 3]);
        for position in around(centre).points().step_by(2) {
            for region in [region, everything] {
                let expected: BTreeMap<_, _> = grid.chunks().filter(|(position, _)| region.contains(*position)).collect();
                prop_assert_eq!(grid.chunks_in(region).count(), expected.len());
                prop_assert_eq!(grid.chunks_in(region).collect::<BTreeMap<_, _>>(), expected);
            }
            // Every way to insert and remove a chunk.
            match position[0].rem_euclid(3) {
                0 => drop(grid.remove_clean(position)),
                1 => drop(grid.remove(position)),
                _ => drop(grid.set(grid.chunk_region(position).min, Voxel::new(-7, 1))),
            }
        }
    }
}

#[test]
fn chunks_of_one_voxel_are_uniform() {
    let rock = |_: [f64; 3]| -1e9;
    assert_eq!(GridChunk::from_source(&rock, [1, 2, 3], 8, 1.0), GridChunk::Uniform(Voxel::new(i16::MIN, 0)));
    let mut weights = vec![5i16; 512];
    assert_eq!(GridChunk::from_samples(weights.clone(), vec![3; 512], 8), Ok(GridChunk::Uniform(Voxel::new(5, 3))));
    weights[511] = 6;
    let chunk = GridChunk::from_samples(weights, vec![3; 512], 8).unwrap();
    assert_eq!((chunk.voxel(510).weight, chunk.voxel(511).weight, chunk.voxel(512)), (5, 6, Voxel::AIR));
}
