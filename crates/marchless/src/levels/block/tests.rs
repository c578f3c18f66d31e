use core::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::{EDIT_LIMIT, LevelSettings, LevelViewer, Operation, QuantisedShape, QuantisedStroke};

/// A point that stamps change has the sample of level 0 at every level, and any other the source's own.
#[test]
fn stamps_reach_every_level() {
    let source = |[x, y, z]: [f64; 3]| y - 3.0 * libm::sin(x / 9.0) - 2.0 * libm::cos(z / 7.0);
    let ball = |center, radius| QuantisedShape::sphere(center, radius).unwrap();
    let stamps = [
        QuantisedStamp::new(ball([5.0, 1.0, -7.0], 9.0), Operation::Dig, 0),
        QuantisedStamp::new(ball([9.5, -2.0, -2.0], 5.0), Operation::Add, 3),
        QuantisedStamp::new(ball([-20.0, 14.0, 20.0], 6.0), Operation::Add, 4),
        QuantisedStamp::new(ball([8.0, 0.0, -4.0], 7.0), Operation::Paint, 5),
        QuantisedStamp::new(ball([-58.0, 0.0, -57.0], 6.0), Operation::Dig, 0),
        QuantisedStamp::new(ball([45.0, 0.0, 48.0], 12.0), Operation::Dig, 0),
    ];
    let (cells, extent) = (8, Region::new([-8; 3], [8; 3]));
    let mut plain = Grid::<i16>::bounded(cells, extent).unwrap();
    for position in extent.points() {
        plain.insert(position, GridChunk::from_source(&source, position, cells, 1.0)).unwrap();
    }
    let mut edited = plain.clone();
    stamps.iter().for_each(|stamp| _ = edited.apply(stamp));

    let from =
        LevelSource { source: &source, cells, spacing: 1.0, stamps: &stamps, known: None, planes: None, isovalue: 0.0 };
    let settings = LevelSettings { levels: 3, falloff: 1.75, extent, ..LevelSettings::default() };
    let viewer = LevelViewer { position: [-7.5, 0.0, -7.5], distance: 30.0 };
    let cover = LevelCover::new(&[viewer], &settings, None, |_| false).unwrap();
    let (mut block, mut changed) = (LeafBlock::new(), [0; 3]);
    for (leaf, _) in cover.leaves() {
        block.fill(&from, &cover, leaf);
        let corner = leaf.position.map(|v| v * cells as i32 - 1);
        for (index, at) in Region::new([0; 3], [cells as i32 + 3; 3]).points().enumerate() {
            let point = [0, 1, 2].map(|axis| (corner[axis] + at[axis]) << leaf.level);
            let (before, after) = (plain.get(point), edited.get(point));
            let found = Voxel::new(block.own.weights[index], block.own.materials[index]);
            let limits = Region::new([-64; 3], [64; 3]);
            if limits.contains(point) {
                // A closure answers alike at all levels.
                assert_eq!(found, after, "{point:?} of {leaf:?}, {before:?} before");
                changed[usize::from(leaf.level)] += usize::from(before != after);
            }
        }
        let is_stamped = stamps.iter().any(|stamp| {
            let cell = |v: [i32; 3]| v.map(|v| v * cells as i32);
            let Region { min, max } = leaf.region();
            !stamp.region().intersection(&Region::new(cell(min), cell(max))).is_empty()
        });
        assert!(!(is_stamped && from.is_empty(leaf)));
    }
    assert!(changed.iter().all(|&points| points > 0), "{changed:?}");
}

/// Rolling ground that answers differently at each level.
struct Ground {
    /// Whether a bound says where the ground cannot be.
    is_bounded: bool,
}

impl Source for Ground {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        let points = Region::new([0; 3], region.size.map(|size| size as i32)).points();
        for (at, (distance, material)) in points.zip(distances.iter_mut().zip(materials)) {
            let [x, y, z] = region.position(at.map(|v| v as u32));
            let level = f64::from(region.level);
            let height = 6.0 * libm::sin(x / 9.0) + 5.0 * libm::cos(z / 7.0) + level * libm::sin(x * 1.3 + z);
            *distance = ((y - height) / region.spacing) as f32;
            *material = if y < -17.0 { 1 } else { 1 + region.level + u8::from(libm::sin(x + z) > 0.0) };
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        let [low, high] = [[0; 3], region.size].map(|at| region.position(at)[1]);
        // 6 + 5, and at most one for each level.
        match (low > 17.0, high < -17.0) {
            (true, _) if self.is_bounded => Bound::Outside,
            (_, true) if self.is_bounded => Bound::Inside { material: 1 },
            _ => Bound::Mixed,
        }
    }
}

/// The boxes that are meshed.
fn boxes(block: &LeafBlock) -> impl Iterator<Item = &SampleBox> {
    let faces = Face::ALL.into_iter().filter(|&face| block.finer.contains_face(face));
    faces.map(|face| &block.faces[face.index()]).chain([&block.own])
}

fn shape() -> impl Strategy<Value = QuantisedShape> {
    let place = [-70.0..70.0f64, -40.0..40.0f64, -70.0..70.0f64];
    let offset = proptest::array::uniform3(-10.0..10.0f64);
    (place, offset, 0.5..9.0f64, 0..3).prop_map(|(place, offset, radius, kind)| {
        let shape = match kind {
            0 => QuantisedShape::sphere(place, radius),
            1 => QuantisedShape::cuboid(place, [radius, radius / 2.0, 3.0]),
            _ => QuantisedShape::capsule(place, [0, 1, 2].map(|axis| place[axis] + offset[axis]), radius / 3.0),
        };
        shape.expect("it is small")
    })
}

fn stamp() -> impl Strategy<Value = QuantisedStamp> {
    let operation = prop_oneof![Just(Operation::Dig), Just(Operation::Add), Just(Operation::Paint)];
    let stroke = (0.0..200.0f64, 0.0..3.0f64).prop_map(|(rate, falloff)| {
        QuantisedStroke::new(1, rate, falloff, Duration::ZERO, Duration::from_millis(100)).expect("it is finite")
    });
    (shape(), operation, 5..9u8, prop::option::of(stroke)).prop_map(|(shape, operation, material, stroke)| {
        QuantisedStamp { stroke, ..QuantisedStamp::new(shape, operation, material) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// It makes no difference whether edits are given as stamps or as known samples, other than at points that are far
    /// from all edits.
    #[test]
    fn known_samples_are_as_good_as_stamps(
        stamps in prop::collection::vec(stamp(), 0..16),
        viewer in [-9.0..9.0f64, -3.0..3.0f64, -9.0..9.0f64],
        (cells, levels, which, is_bounded) in (8..11u32, 1..5u8, any::<u32>(), any::<bool>()),
        planes in prop::option::of(Just(Region::new([-40, -9, -60], [50, 30, 33]))),
    ) {
        let ground = Ground { is_bounded };
        // Edits change chunks of level 0, one stamp after the other.
        let mut all = Grid::<i16>::new(cells).unwrap();
        for stamp in &stamps {
            let Region { min, max } = stamp.region();
            let chunks = Region::new(all.chunk_of(min), all.chunk_of(max).map(|v| v + 1));
            for position in chunks.points() {
                if all.chunk(position).is_none() {
                    all.insert(position, GridChunk::from_source(&ground, position, cells, 1.0)).unwrap();
                }
            }
            all.apply(stamp);
        }
        let is_known = |[x, y, z]: [i32; 3]| which >> ((x + 3 * y + 5 * z) & 31) & 1 == 1;
        let mut some = all.clone();
        for (position, _) in all.chunks().filter(|(position, _)| !is_known(*position)) {
            some.remove(position);
        }
        let as_stamps = LevelSource {
            source: &ground,
            cells,
            spacing: 1.0,
            stamps: &stamps,
            known: None,
            planes,
            isovalue: 0.0,
        };
        let as_both = LevelSource { known: Some(&some), ..as_stamps };
        let as_samples = LevelSource { known: Some(&all), stamps: &[], ..as_stamps };
        // A grid of other chunks is ignored.
        let mut others = Grid::<i16>::new(cells + 1).unwrap();
        others.insert([0; 3], GridChunk::AIR).unwrap();
        let with_others = LevelSource { known: Some(&others), ..as_stamps };

        let settings = LevelSettings { levels, falloff: 1.75, ..LevelSettings::default() };
        let viewer = LevelViewer { position: viewer, distance: 6.0 };
        let cover = LevelCover::new(&[viewer], &settings, None, |leaf| as_stamps.is_empty(leaf))?;
        let (mut expected, mut block) = (LeafBlock::new(), LeafBlock::new());
        for (leaf, _) in cover.leaves() {
            expected.fill(&as_stamps, &cover, leaf);
            for from in [as_both, as_samples, with_others] {
                block.fill(&from, &cover, leaf);
                for (found, expected) in boxes(&block).zip(boxes(&expected)) {
                    for index in 0..expected.weights.len() {
                        let [found, expected] = [found, expected].map(|it| (it.weights[index], it.materials[index]));
                        // What a bound decides is too far from all surfaces to matter.
                        let is_far = |(weight, _): (i16, u8)| weight.unsigned_abs() > EDIT_LIMIT.unsigned_abs();
                        let are_alike = is_far(found) && is_far(expected) && (found.0 < 0) == (expected.0 < 0);
                        let is_same = found == expected || is_bounded && are_alike;
                        prop_assert!(is_same, "{:?} is not {:?} in {:?}", found, expected, leaf);
                    }
                }
            }
            // Known chunks may have a surface, wherever they are; their points may lie at the leaf's border.
            let is_near = all.chunks_in(leaf.region().grown(1, 1)).next().is_some();
            prop_assert!(!is_near || !as_samples.is_empty(leaf), "{:?}", leaf);
        }
    }

    /// A leaf that a change does not mention has the same samples before and after, even if the source answers
    /// differently at every level.
    #[test]
    fn changes_mention_all_leaves_whose_samples_change(
        viewers in proptest::array::uniform2([-9.0..9.0f64, -3.0..3.0f64, -9.0..9.0f64]),
        (levels, falloff, meshes) in (3..5u8, 1.75..2.5f64, 0..30usize),
    ) {
        // A thin layer of chunks has the surface, so that empty leaves lie beside coarser ones with a surface.
        let is_empty = |leaf: LeafKey| {
            let mut chunks = leaf.region().points();
            !chunks.any(|[x, y, z]| y == (2.0 * libm::sin(f64::from(x) / 3.0) + 2.0 * libm::cos(f64::from(z) / 2.0)) as i32)
        };
        let ground = Ground { is_bounded: false };
        let from = LevelSource {
            source: &ground,
            cells: 8,
            spacing: 1.0,
            stamps: &[],
            known: None,
            planes: None,
            isovalue: 0.0,
        };
        let settings = LevelSettings { levels, falloff, ..LevelSettings::default() };
        let covers = viewers.map(|position| {
            LevelCover::new(&[LevelViewer { position, distance: 7.0 }], &settings, None, is_empty).expect("few leaves")
        });
        let [mut cover, target] = covers;
        let (changes, _) = cover.first_changes_to(&target, 40, meshes, |_| 0).expect("the same levels");
        let (mut before, mut after) = (LeafBlock::new(), LeafBlock::new());
        for change in changes {
            let former = cover.clone();
            cover.apply(&change);
            let mentioned: Vec<LeafKey> = change.leaves().collect();
            let near = cover.leaves_near(change.region()).into_iter();
            for (leaf, _) in near.filter(|(leaf, is_empty)| !is_empty && !mentioned.contains(leaf)) {
                before.fill(&from, &former, leaf);
                after.fill(&from, &cover, leaf);
                prop_assert!(before.finer == after.finer);
                for (before, after) in boxes(&before).zip(boxes(&after)) {
                    prop_assert!(before.weights == after.weights && before.materials == after.materials, "{:?}", leaf);
                }
            }
        }
    }
}
