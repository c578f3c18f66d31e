//! Leaves of several levels: the union of their meshes is one closed surface, whatever the samples and the levels are.

use std::collections::HashMap;

use fastrand::Rng;
use marchless::{
    LeafError, LeafKey, LevelCover, LevelSettings, LevelViewer, MeshBuffer, MeshReport, MeshSettings, MeshUnion,
    Mesher, Region, Topology,
};

use crate::support::TestWeight;
use cover::{Cover, Leaf};
use field::Field;

mod blocks;
mod cover;
mod field;
mod refusals;

/// Meshes all leaves of a cover and checks their union.
fn check<W: TestWeight>(cover: &Cover, field: &Field<W>, mesher: &mut Mesher) -> MeshReport {
    check_leaves(cover, cover.leaves(), field, mesher)
}

/// Meshes leaves of a cover, all that have a surface, and checks their union.
fn check_leaves<W: TestWeight>(
    cover: &Cover,
    leaves: impl Iterator<Item = Leaf>,
    field: &Field<W>,
    mesher: &mut Mesher,
) -> MeshReport {
    let settings = MeshSettings { isovalue: field.isovalue, ..MeshSettings::default() };
    let (mut mesh, mut union) = (MeshBuffer::new(), MeshUnion::new());
    let mut vertices: HashMap<[u64; 3], ([u32; 3], u8)> = HashMap::new();
    for leaf in leaves {
        let block = field.block(cover, leaf);
        let samples = block.leaf().unwrap_or_else(|error| panic!("{error} in {cover:?}, {field:?}"));
        mesher.mesh_leaf(&samples, &settings, &mut mesh).expect("the settings are sound");
        assert_eq!(mesh.positions.len(), mesh.normals.len());
        assert_eq!(mesh.positions.len(), mesh.materials.len());
        let origin = leaf.min.map(i64::from);
        union.add(&mesh, origin, leaf.level);
        for ((position, normal), &material) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.materials) {
            let length = normal.iter().map(|v| v * v).sum::<f32>();
            assert!((0.999..1.001).contains(&length), "{normal:?} in {cover:?}, {field:?}");
            let cell = f64::from(1 << leaf.level);
            let place = [0, 1, 2].map(|k| (origin[k] as f64 + f64::from(position[k]) * cell).to_bits());
            let shown = (normal.map(f32::to_bits), material);
            let known = *vertices.entry(place).or_insert(shown);
            assert_eq!(known, shown, "a common vertex of two leaves in {cover:?}, {field:?}");
        }
    }
    let report = union.report();
    // In noise, triangles of cells with a moved corner may cross.
    let but_crossings = {
        let mut report = report.clone();
        report.crossing_triangles = 0;
        report
    };
    assert!(report.is_closed() && but_crossings.is_clean(), "{report} in {cover:?}, {field:?}");
    assert!(report.crossing_triangles == 0 || !field.is_plane(), "{report} in {cover:?}, {field:?}");
    report
}

/// All ways in which the eight leaves around a lattice point can be finer or not. Whatever lies at a border of leaves
/// belongs to such a point, so nothing else can happen, except farther apart.
#[test]
fn every_pattern_of_levels_around_a_point_is_closed() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(8));
    let (mut refused, mut reports) = (0, Vec::new());
    for pattern in 0..256u32 {
        let cover = Cover::of_places([2; 3], 3, |place| pattern >> (place[0] + 2 * place[1] + 4 * place[2]) & 1 == 1);
        if cover.has_alternating_edge() {
            let field = Field::<i16>::random(&mut random);
            let is_refused = |leaf| matches!(field.block(&cover, leaf).leaf(), Err(LeafError::AlternatingEdge { .. }));
            assert!(cover.leaves().any(is_refused), "{cover:?}");
            refused += 1;
            continue;
        }
        for _ in 0..8 {
            reports.push(check(&cover, &Field::<i16>::random(&mut random), &mut mesher));
            reports.push(check(&cover, &Field::<f32>::random(&mut random), &mut mesher));
        }
        reports.push(check(&cover, &Field::<i8>::random(&mut random), &mut mesher));
    }
    assert_eq!(refused, 120);
    let triangles: usize = reports.iter().map(|report| report.triangles).sum();
    let crossing = reports.iter().filter(|report| report.crossing_triangles > 0).count();
    assert!(triangles > 500_000 && crossing < reports.len() / 50, "{triangles} triangles, {crossing} unions cross");
}

#[test]
fn random_neighbours_are_closed() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(26));
    let mut checked = 0;
    while checked < 150 {
        let share = random.f32();
        let mut places = [[[false; 3]; 3]; 3];
        places.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|finer| *finer = random.f32() < share);
        places[1][1][1] = false;
        let cells = random.i32(1..5);
        let cover = Cover::of_places([3; 3], cells, |[x, y, z]| places[x][y][z]);
        if !cover.has_alternating_edge() {
            check(&cover, &Field::<i16>::random(&mut random), &mut mesher);
            check(&cover, &Field::<f32>::random(&mut random), &mut mesher);
            checked += 1;
        }
    }
}

#[test]
fn random_octrees_are_closed() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(3));
    for _ in 0..40 {
        let cells = random.i32(2..5);
        let cover = Cover::random_octree(&mut random, 3, cells);
        check(&cover, &Field::<i16>::random(&mut random), &mut mesher);
        check(&cover, &Field::<f32>::random(&mut random), &mut mesher);
    }
}

/// Covers of viewers over rolling ground, of which only the leaves that may have a surface are meshed.
#[test]
fn covers_of_viewers_are_closed() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(4));
    let (cells, size, field) = (4, [16, 16, 16], Field::<i16>::hills());
    let extent = Region::new([0; 3], size);
    for _ in 0..12 {
        let viewers: Vec<LevelViewer> = (0..random.usize(1..4))
            .map(|_| LevelViewer {
                position: [16.0 * random.f64(), 6.0 + 4.0 * random.f64(), 16.0 * random.f64()],
                distance: 40.0,
            })
            .collect();
        let settings = LevelSettings { levels: 4, falloff: 1.75, extent, ..Default::default() };
        let levels = LevelCover::new(&viewers, &settings, None, |leaf| {
            let Region { min, max } = leaf.region();
            // The extent's border has walls where it cuts the ground.
            let is_inner = (0..3).all(|axis| min[axis] > 0 && max[axis] < size[axis]);
            field.is_empty(min.map(|v| v * cells), max.map(|v| v * cells), is_inner)
        });
        let levels = levels.expect("the settings are sound");
        let cover = Cover::of_levels(&levels, size, cells);
        let drawn: Vec<Leaf> = cover
            .leaves()
            .filter(|leaf| {
                levels.leaves().any(|(key, empty)| !empty && key.region().min.map(|v| v * cells) == leaf.min)
            })
            .collect();
        assert!(drawn.len() > 30 && drawn.len() < cover.leaves().count());
        for leaf in &drawn {
            let key = LeafKey { level: leaf.level, position: leaf.min.map(|v| (v / cells) >> leaf.level) };
            assert_eq!(levels.finer_neighbours(key), field.block(&cover, *leaf).finer);
        }
        check_leaves(&cover, drawn.into_iter(), &field, &mut mesher);
    }
}

/// The largest leaves that there are: positions near the far end still have the bits that they need.
#[test]
fn the_largest_leaves_are_closed() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(62));
    let cover = Cover::of_places([2, 1, 1], 62, |[x, ..]| x == 1);
    let cover = [cover, Cover::of_places([1, 2, 1], 62, |[_, y, _]| y == 0)];
    for cover in cover {
        check(&cover, &Field::<i16>::plane(&mut random), &mut mesher);
    }
}

#[test]
fn without_finer_neighbours_nothing_changes() {
    let (mut mesher, mut random) = (Mesher::new(), Rng::with_seed(1));
    let cover = Cover::of_places([1; 3], 6, |_| false);
    for topology in [Topology::Separated, Topology::Trilinear] {
        for _ in 0..50 {
            let field = Field::<i16>::random(&mut random);
            let settings = MeshSettings { isovalue: field.isovalue, topology, ..MeshSettings::default() };
            let leaf = cover.leaves().next().expect("a cover has leaves");
            let block = field.block(&cover, leaf);
            let (mut found, mut expected) = (MeshBuffer::new(), MeshBuffer::new());
            mesher
                .mesh_leaf(&block.leaf().expect("no neighbour is finer"), &settings, &mut found)
                .expect("it is sound");
            mesher.mesh(block.samples(), &settings, &mut expected).expect("it is sound");
            assert_eq!(found, expected);
        }
    }
}

/// A lattice line of flat ground: the transition cells lie in the ground, without a fold.
#[test]
fn flat_ground_stays_flat() {
    let mut mesher = Mesher::new();
    let cover = Cover::of_places([3; 3], 4, |[x, y, _]| x == 0 || y == 2);
    let field = Field::<i16>::ground(12.5);
    let settings = MeshSettings::default();
    let mut mesh = MeshBuffer::new();
    for leaf in cover.leaves() {
        let block = field.block(&cover, leaf);
        mesher.mesh_leaf(&block.leaf().expect("levels fit"), &settings, &mut mesh).expect("the settings are sound");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let height = position[2] * f32::from(1u8 << leaf.level) + leaf.min[2] as f32;
            let is_inside = leaf.contains_within(&cover, position);
            assert!(
                !is_inside || (height - 12.5).abs() < 1e-6 && *normal == [0.0, 0.0, 1.0],
                "{position:?} {normal:?}"
            );
        }
    }
}
