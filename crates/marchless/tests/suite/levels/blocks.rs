//! Blocks of leaves filled from a source.

use std::time::Duration;

use fastrand::Rng;
use marchless::{
    Bound, Grid, GridChunk, LeafBlock, LevelCover, LevelSettings, LevelSource, LevelViewer, MeshBuffer, MeshSettings,
    MeshUnion, Mesher, Operation, QuantisedShape, QuantisedStamp, QuantisedStroke, Region, Source, SourceRegion,
};

use crate::support::random;

/// A ball with bumps, which answers differently at each level.
#[derive(Clone, Copy)]
struct Bumps {
    middle: [f64; 3],
    radius: f64,
}

impl Bumps {
    /// The distance in world units, without the noise of coarse levels, which do not see the bumps.
    fn distance(&self, position: [f64; 3], level: u8) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| position[axis] - self.middle[axis]);
        let bumps = 2.0 * (x / 3.0).sin() + (y / 4.0).cos() * (z / 3.5).sin();
        (x * x + y * y + z * z).sqrt() - self.radius + if level == 0 { bumps } else { 0.0 }
    }
}

/// The most by which the distance of [`Bumps`] differs from that of its ball at a level, in world units.
const fn most_off(level: u8) -> f64 {
    if level == 0 { 3.0 } else { 0.5 }
}

impl Source for Bumps {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let [nx, ny, _] = region.size;
        for (index, (distance, material)) in (0u32..).zip(distances.iter_mut().zip(materials)) {
            let at = [index % nx, index / nx % ny, index / (nx * ny)];
            let position = region.position(at);
            let point = [0, 1, 2].map(|axis| region.min[axis] + at[axis] as i32);
            let mut random = Rng::with_seed(random(region.level.into(), point));
            let jitter = if region.level == 0 { 0.0 } else { random.f64() - 0.5 };
            *distance = ((self.distance(position, region.level) + jitter) / region.spacing) as f32;
            *material = random.u8(1..5);
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let ends = [region.position([0; 3]), region.position(region.size.map(|size| size - 1))];
        let [mut nearest, mut farthest] = [0.0f64; 2];
        let [lows, highs] = ends.map(|end| [0, 1, 2].map(|axis| end[axis] - self.middle[axis]));
        for (low, high) in lows.into_iter().zip(highs) {
            let near = low.max(-high).max(0.0);
            let far = low.abs().max(high.abs());
            (nearest, farthest) = (nearest + near * near, farthest + far * far);
        }
        let [nearest, farthest] = [nearest, farthest].map(|square| square.sqrt() - self.radius);
        if nearest > most_off(region.level) {
            Bound::Outside
        } else if farthest < -most_off(region.level) {
            Bound::Inside { material: 1 }
        } else {
            Bound::Mixed
        }
    }
}

/// Meshes all leaves of a cover that may have a surface.
fn union(source: &LevelSource<'_>, cover: &LevelCover, settings: &MeshSettings) -> MeshUnion {
    let (mut mesher, mut block, mut mesh) = (Mesher::new(), LeafBlock::new(), MeshBuffer::new());
    let mut union = MeshUnion::new();
    for (leaf, _) in cover.leaves().filter(|(_, is_empty)| !is_empty) {
        block.fill(source, cover, leaf);
        let samples = block.samples().expect("a source has one answer for a point");
        mesher.mesh_leaf(&samples, settings, &mut mesh).expect("the settings are sound");
        union.add(&mesh, leaf.region().min.map(|v| i64::from(v) * i64::from(source.cells)), leaf.level);
    }
    union
}

#[test]
fn whole_covers_are_closed() {
    let mut random = Rng::with_seed(11);
    for round in 0..10 {
        let cells = [4, 8, 5][round % 3];
        let bumps = Bumps { middle: [(); 3].map(|()| 10.0 * random.f64() - 5.0), radius: 20.0 + 20.0 * random.f64() };
        // Half of them are cut by the border of a bounded volume.
        let planes = (round % 2 == 1).then(|| Region::new([-17, -40, -23], [30, 21, 38]));
        let isovalue = if round % 4 < 2 { 0.0 } else { 1.25 };
        let stamps: Vec<QuantisedStamp> = (0..random.usize(0..20))
            .map(|_| {
                let center = [(); 3].map(|()| (random.f64() - 0.5) * 90.0);
                let shape = QuantisedShape::sphere(center, 2.0 + 14.0 * random.f64()).expect("it is finite");
                let operation = [Operation::Dig, Operation::Add, Operation::Paint][random.usize(..3)];
                QuantisedStamp::new(shape, operation, random.u8(5..9)).with_isovalue(isovalue)
            })
            .collect();
        let source =
            LevelSource { source: &bumps, cells, spacing: 1.0, stamps: &stamps, known: None, planes, isovalue };
        let settings = LevelSettings { levels: 4, falloff: 1.75, ..LevelSettings::default() };
        let viewers: Vec<LevelViewer> = (0..random.usize(1..4))
            .map(|_| LevelViewer {
                position: [(); 3].map(|()| (random.f64() - 0.5) * 80.0 / f64::from(cells)),
                distance: 40.0,
            })
            .collect();
        let cover = LevelCover::new(&viewers, &settings, None, |leaf| source.is_empty(leaf));
        let cover = cover.expect("the settings are sound");
        let levels: Vec<u8> = cover.leaves().filter(|(_, empty)| !empty).map(|(leaf, _)| leaf.level).collect();
        assert!(levels.iter().max() > levels.iter().min());
        let union = union(&source, &cover, &MeshSettings { isovalue, ..MeshSettings::default() });
        let report = union.report();
        assert!(report.triangles > 500 && report.is_closed() && report.is_clean(), "round {round}: {report}");
    }
}

/// Leaves of level 0 are chunks of a grid, coarser ones are filled from a source, and edits reach far from its surface,
/// where a bound decides what chunks are made of.
#[test]
fn edits_far_from_the_surface_are_closed() {
    let mut random = Rng::with_seed(5);
    for round in 0..12 {
        let (cells, size) = (8, 8);
        let bumps = Bumps { middle: [3.0, -2.0, 7.0], radius: if round % 2 == 0 { 70.0 } else { 9.0 } };
        let place = |random: &mut Rng| [(); 3].map(|()| (random.f64() - 0.5) * 80.0);
        let stamps: Vec<QuantisedStamp> = (0..8)
            .map(|number| {
                let center = place(&mut random);
                let end = [0, 1, 2].map(|axis| center[axis] + 20.0 * (random.f64() - 0.5));
                let shape = QuantisedShape::capsule(center, end, 2.0 + 6.0 * random.f64()).expect("it is finite");
                let operation = [Operation::Dig, Operation::Add][(round + usize::from(random.u8(..8) == 0)) % 2];
                let stroke =
                    QuantisedStroke::new(number, 40.0, 2.0 * random.f64(), Duration::ZERO, Duration::from_secs(9));
                let stamp = QuantisedStamp::new(shape, operation, random.u8(5..9));
                if random.bool() { stamp.with_stroke(stroke.expect("it is finite")) } else { stamp }
            })
            .collect();
        let chunks = Region::new([-size; 3], [size; 3]);
        let mut grid = Grid::<i16>::new(cells).expect("the grid is small");
        for position in chunks.points() {
            grid.insert(position, GridChunk::from_source(&bumps, position, cells, 1.0))
                .expect("it is within the bounds");
        }
        let base = grid.clone();
        stamps.iter().for_each(|stamp| _ = grid.apply(stamp));
        // Some edited chunks are given by their samples.
        let mut known = Grid::<i16>::new(cells).expect("the grid is small");
        for (position, chunk) in grid.chunks() {
            if base.chunk(position) != Some(chunk) && random.bool() {
                known.insert(position, chunk.clone()).expect("it is within the bounds");
            }
        }
        let source = LevelSource {
            source: &bumps,
            cells,
            spacing: 1.0,
            stamps: &stamps,
            known: (round % 4 < 2).then_some(&known),
            planes: None,
            isovalue: 0.0,
        };
        let settings = LevelSettings { levels: 3, falloff: 1.75, ..LevelSettings::default() };
        let viewer = LevelViewer { position: place(&mut random).map(|v| v / 16.0), distance: 30.0 };
        let cover = LevelCover::new(&[viewer], &settings, None, |leaf| source.is_empty(leaf)).expect("it is small");
        let (mut mesher, mut block, mut mesh) = (Mesher::new(), LeafBlock::new(), MeshBuffer::new());
        let (mut union, mut drawn) = (MeshUnion::new(), [0; 3]);
        for (leaf, _) in cover.leaves().filter(|(_, is_empty)| !is_empty) {
            if leaf.level == 0 {
                assert!(chunks.contains(leaf.position));
                grid.mesh_chunk(leaf.position, &mut mesher, MeshSettings::default(), &mut mesh).expect("it is sound");
            } else {
                block.fill(&source, &cover, leaf);
                let samples = block.samples().expect("a source has one answer for a point");
                mesher.mesh_leaf(&samples, &MeshSettings::default(), &mut mesh).expect("it is sound");
            }
            union.add(&mesh, leaf.region().min.map(|v| i64::from(v) * i64::from(cells)), leaf.level);
            drawn[usize::from(leaf.level)] += usize::from(!mesh.is_empty());
        }
        let report = union.report();
        assert!(report.is_closed() && report.is_clean(), "round {round}: {report}");
        assert!(drawn[..2].iter().all(|&leaves| leaves > 0), "round {round}: {drawn:?}");
    }
}

/// At one level, leaves are the chunks of a grid.
#[test]
fn leaves_of_level_0_are_chunks_of_a_grid() {
    let bumps = Bumps { middle: [3.0, -2.0, 7.0], radius: 21.0 };
    let chunks = Region::new([-2, -3, -1], [4, 2, 3]);
    let mut grid = Grid::<i16>::bounded(8, chunks).expect("the grid is small");
    for position in chunks.points() {
        grid.insert(position, GridChunk::from_source(&bumps, position, 8, 1.0)).expect("it is within the bounds");
    }
    let source = LevelSource {
        source: &bumps,
        cells: 8,
        spacing: 1.0,
        stamps: &[],
        known: None,
        planes: grid.planes(),
        isovalue: 0.0,
    };
    let settings = LevelSettings { levels: 1, extent: chunks, ..LevelSettings::default() };
    let cover = LevelCover::new(&[LevelViewer { position: [0.0; 3], distance: 30.0 }], &settings, None, |_| false)
        .expect("the settings are sound");
    let (mut mesher, mut block) = (Mesher::new(), LeafBlock::new());
    let (mut found, mut expected, mut drawn) = (MeshBuffer::new(), MeshBuffer::new(), 0);
    for (leaf, _) in cover.leaves() {
        block.fill(&source, &cover, leaf);
        mesher.mesh_leaf(&block.samples().unwrap(), &MeshSettings::default(), &mut found).unwrap();
        grid.mesh_chunk(leaf.position, &mut mesher, MeshSettings::default(), &mut expected).unwrap();
        assert_eq!(found, expected, "{leaf:?}");
        drawn += usize::from(!found.is_empty());
    }
    assert!(drawn > 30);
}

/// At every level, the samples are the source's answers in voxels of level 0.
#[test]
fn samples_are_in_voxels_of_level_0() {
    let slope = |[x, y, z]: [f64; 3]| (3.0 * x - 2.0 * y + 6.0 * z) / 7.0 - 5.0;
    let source =
        LevelSource { source: &slope, cells: 6, spacing: 1.0, stamps: &[], known: None, planes: None, isovalue: 0.0 };
    let settings = LevelSettings { levels: 7, falloff: 1.75, ..LevelSettings::default() };
    let cover = LevelCover::new(&[LevelViewer { position: [0.3; 3], distance: 200.0 }], &settings, None, |_| false)
        .expect("the settings are sound");
    let (mut mesher, mut block, mut mesh) = (Mesher::new(), LeafBlock::new(), MeshBuffer::new());
    let mut levels = [0; 7];
    for (leaf, _) in cover.leaves() {
        block.fill(&source, &cover, leaf);
        mesher.mesh_leaf(&block.samples().unwrap(), &MeshSettings::default(), &mut mesh).unwrap();
        levels[usize::from(leaf.level)] += mesh.positions.len();
        let (corner, cell) = (leaf.region().min.map(|v| f64::from(v) * 6.0), f64::from(1u8 << leaf.level));
        for position in &mesh.positions {
            let at = [0, 1, 2].map(|axis| corner[axis] + f64::from(position[axis]) * cell);
            // Samples are rounded to 1/256 voxel and crossings to 2⁻¹⁴ of a cell; where lattice points make room, vertices
            // move by up to an eighth of a cell along each axis.
            let moved = if cover.finer_neighbours(leaf).is_empty() { 0.0 } else { 11.0 / 7.0 / 8.0 * cell };
            assert!(slope(at).abs() < 0.01 * cell + moved, "{at:?} of {leaf:?} is {} off", slope(at));
        }
    }
    assert!(levels.iter().all(|&vertices| vertices > 0), "{levels:?}");
}
