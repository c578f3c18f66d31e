//! Brushes against plain oracles.

mod shapes;

use alloc::{collections::BTreeSet, string::ToString as _, sync::Arc, vec, vec::Vec};
use core::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::{
    grid::{Grid, GridChunk, SamplePool},
    sample::{Voxel, Weight as _},
};

const CELLS: u32 = 8;
const BOUNDS: Region = Region::new([-1, 0, -1], [1, 2, 1]);

/// All points of the test grids, except those on the high planes.
fn all_points() -> impl Iterator<Item = [i32; 3]> {
    let scaled = |v: i32| v * CELLS as i32;
    Region::new(BOUNDS.min.map(scaled), BOUNDS.max.map(scaled)).points()
}

/// A grid of solid, air and noise chunks, with weights beyond the limit of edits.
fn grid(seed: u64, bounded: bool) -> Grid<i16> {
    let mut grid = if bounded { Grid::bounded(CELLS, BOUNDS) } else { Grid::new(CELLS) }.unwrap();
    let mut rng = fastrand::Rng::with_seed(seed);
    for (number, position) in BOUNDS.points().enumerate() {
        let chunk = match (number as u64 + seed) % 4 {
            0 => GridChunk::Uniform(Voxel::new(-3000, 7)),
            1 if !bounded => continue,
            1 => GridChunk::AIR,
            _ => {
                let weights = (0..CELLS.pow(3)).map(|_| rng.i16(-1500..1500)).collect();
                let materials = (0..CELLS.pow(3)).map(|_| rng.u8(0..3)).collect();
                GridChunk::from_samples(weights, materials, CELLS).unwrap()
            }
        };
        grid.insert(position, chunk).unwrap();
    }
    grid.take_dirty();
    grid
}

fn read(grid: &Grid<i16>) -> Vec<Voxel> {
    all_points().map(|point| grid.get(point)).collect()
}

prop_compose! {
    fn small_position()(p in prop::array::uniform3(-20 * 256i64..28 * 256)) -> [i64; 3] { p }
}

fn small_shape() -> impl Strategy<Value = QuantisedShape> {
    prop_oneof![
        (small_position(), 1u32..12 * 256).prop_map(|(center, radius)| QuantisedShape::Sphere { center, radius }),
        (small_position(), prop::array::uniform3(1u32..12 * 256))
            .prop_map(|(center, half_size)| QuantisedShape::Box { center, half_size }),
        (small_position(), small_position(), 1u32..8 * 256).prop_map(|(a, b, radius)| QuantisedShape::Capsule {
            a,
            b,
            radius
        }),
    ]
}

fn any_shape() -> impl Strategy<Value = QuantisedShape> {
    let number = || prop_oneof![Just(i64::MIN), Just(i64::MAX), any::<i64>(), -100_000i64..100_000];
    let position = move || prop::array::uniform3(number());
    let size = || prop_oneof![Just(0), Just(u32::MAX), any::<u32>(), 0u32..10_000];
    prop_oneof![
        (position(), size()).prop_map(|(center, radius)| QuantisedShape::Sphere { center, radius }),
        (position(), prop::array::uniform3(size()))
            .prop_map(|(center, half_size)| QuantisedShape::Box { center, half_size }),
        (position(), position(), size()).prop_map(|(a, b, radius)| QuantisedShape::Capsule { a, b, radius }),
    ]
}

fn operation() -> impl Strategy<Value = Operation> {
    prop_oneof![Just(Operation::Add), Just(Operation::Dig), Just(Operation::Paint)]
}

fn stroke() -> impl Strategy<Value = QuantisedStroke> {
    (0u32..20_000, 0u32..2000, 0u64..1_000_000, 0u64..1_000_000).prop_map(|(rate, falloff, start_us, span)| {
        QuantisedStroke { id: 1, rate, falloff, start_us, end_us: start_us + span }
    })
}

fn stamp() -> impl Strategy<Value = QuantisedStamp> {
    let isovalue = prop_oneof![3 => Just(0), 3 => -700..700i16, 1 => any::<i16>()];
    (small_shape(), operation(), 0u8..5, prop::option::of(stroke()), isovalue).prop_map(
        |(shape, operation, material, stroke, isovalue)| QuantisedStamp {
            shape,
            operation,
            material,
            stroke,
            isovalue,
        },
    )
}

/// The sample that replaces `old`, straight from the definition of a stamp.
fn change_oracle(stamp: &QuantisedStamp, old: Voxel, point: [i32; 3]) -> Voxel {
    let distance = stamp.shape.distance(point);
    let isovalue = i32::from(stamp.isovalue).clamp(-31_743, 31_743);
    let from_surface = i32::from(old.weight) - isovalue;
    let clamp = |from_surface: i32| from_surface.clamp(-1024, 1024);
    let now = clamp(from_surface);
    if stamp.operation == Operation::Paint {
        return if from_surface < 0 && distance < 0 { Voxel::new(old.weight, stamp.material) } else { old };
    }
    let new = match stamp.stroke {
        None if stamp.operation == Operation::Add => clamp(now.min(distance)),
        None => clamp(now.max(-distance)),
        Some(stroke) => {
            let falloff = i128::from(stroke.falloff.max(1));
            let depth = i128::from(-distance).clamp(0, falloff);
            let until = |time: u64| i128::from(stroke.rate) * depth * i128::from(time) / (falloff * 1_000_000);
            let moved = (until(stroke.end_us) - until(stroke.start_us)).clamp(0, 5000) as i32;
            clamp(if stamp.operation == Operation::Add { now - moved } else { now + moved })
        }
    };
    let weight = if new == now { old.weight } else { (isovalue + new) as i16 };
    Voxel::new(weight, if from_surface >= 0 && new < 0 { stamp.material } else { old.material })
}

/// The number of points that `point` lies inside of the nearest outermost plane of the bounded test grid.
fn depth(point: [i32; 3]) -> i32 {
    let cells = CELLS as i32;
    (0..3).map(|i| (point[i] - BOUNDS.min[i] * cells).min(BOUNDS.max[i] * cells - point[i])).min().unwrap()
}

/// The smallest region that holds all the points where `before` and `after` differ.
fn difference(before: &[Voxel], after: &[Voxel], within: Region) -> Region {
    let mut region = Edit::NONE.region;
    for (point, (old, new)) in all_points().zip(before.iter().zip(after)) {
        if old != new && within.contains(point) {
            region = region.union(&Region::new(point, point.map(|v| v + 1)));
        }
    }
    region
}

proptest! {
    #[test]
    fn edits_follow_the_definition_of_stamps(seed: u64, bounded: bool, stamps in prop::collection::vec(stamp(), 1..4)) {
        let mut grid = grid(seed, bounded);
        for stamp in &stamps {
            let before = read(&grid);
            let edit = grid.apply(stamp);
            let after = read(&grid);
            let mut volumes = [VolumeByMaterial::new(), VolumeByMaterial::new()];
            for (point, (old, new)) in all_points().zip(before.iter().zip(&after)) {
                prop_assert_eq!(*new, change_oracle(stamp, *old, point), "{:?} was {:?}", point, old);
                let is_solid = |voxel: &Voxel| i32::from(voxel.weight) < i32::from(stamp.isovalue).clamp(-31_743, 31_743);
                match (is_solid(old), is_solid(new)) {
                    _ if bounded && depth(point) <= 0 => {}
                    (false, true) => volumes[0].add(new.material, 1),
                    (true, false) => volumes[1].add(old.material, 1),
                    _ => {}
                }
            }
            if bounded {
                let everywhere = Region::new([-100; 3], [100; 3]);
                prop_assert_eq!(edit.region, difference(&before, &after, everywhere));
                prop_assert_eq!([edit.added, edit.removed], volumes);
                let mut dirty = BTreeSet::new();
                for position in BOUNDS.points() {
                    let changed = difference(&before, &after, grid.chunk_region(position));
                    dirty.extend(grid.chunks_affected_by(changed).points());
                }
                prop_assert_eq!(grid.take_dirty(), dirty);
            }
        }
    }

    #[test]
    fn bounded_grids_look_closed(seed: u64, isovalue in -3.0..3.0f32, stamps in prop::collection::vec(stamp(), 1..6)) {
        let mut grid = grid(seed, true);
        for stamp in &stamps {
            grid.apply(stamp);
        }
        prop_assert_eq!(grid.chunks().count(), 8);
        for point in all_points() {
            let weight = grid.as_meshed(point, isovalue).weight.to_voxels();
            let least = isovalue + 0.5 - depth(point) as f32;
            prop_assert!(depth(point) > 4 || weight > least - 0.01, "{point:?}: {weight}");
            prop_assert!(weight >= isovalue || depth(point) > 0, "{point:?} is inside");
        }
    }

    #[test]
    fn stamps_work_alike_at_any_isovalue(
        seed: u64, isovalue in -700i16..700, stamp in stamp(), voxels in -2.0..2.0f32, weight: i16,
    ) {
        // If all weights and the isovalue rise by one amount, the result rises by that amount.
        let (mut low, mut high) = (grid(seed, false), grid(seed, false));
        for point in all_points() {
            let Voxel { weight, material } = low.get(point);
            high.set(point, Voxel::new(weight.saturating_add(isovalue), material)).unwrap();
        }
        let edits = [low.apply(&QuantisedStamp { isovalue: 0, ..stamp }), high.apply(&QuantisedStamp { isovalue, ..stamp })];
        for point in all_points().filter(|point| low.chunk(low.chunk_of(*point)).is_some()) {
            let (low, high) = (low.get(point), high.get(point));
            prop_assert!(low.weight == i16::MAX || low.weight + isovalue == high.weight, "at {point:?}: {low:?}, {high:?}");
        }
        prop_assert_eq!(&edits[0], &edits[1]);
        // A stamp and a mesh at one isovalue have the same samples inside.
        use crate::sample::private::Sealed as _;
        let stamp = stamp.with_isovalue(voxels);
        prop_assert_eq!(weight.inside(i16::threshold(voxels)), weight < stamp.isovalue);
    }

    #[test]
    fn stamping_chunk_by_chunk_equals_stamping_the_grid(
        seed: u64,
        bounded: bool,
        stamps in prop::collection::vec(stamp(), 1..5),
        turns in prop::collection::vec(0usize..8, 0..40),
    ) {
        let (mut at_once, mut in_turns) = (grid(seed, bounded), grid(seed, bounded));
        let mut edit = Edit::NONE;
        for stamp in &stamps {
            edit.merge(&at_once.apply(stamp));
        }
        // `apply` grows an unbounded grid beyond `BOUNDS`; only the points within are compared.
        let positions = BOUNDS.points().collect::<Vec<_>>();
        let mut done = [0; 8];
        let mut edit_in_turns = Edit::NONE;
        for chunk in turns.into_iter().chain((0..8).flat_map(|chunk| vec![chunk; stamps.len()])) {
            if let Some(stamp) = stamps.get(done[chunk]) {
                edit_in_turns.merge(&in_turns.apply_to_chunk(positions[chunk], stamp, &mut SamplePool::new()));
                done[chunk] += 1;
            }
        }
        prop_assert_eq!(read(&at_once), read(&in_turns));
        if bounded {
            prop_assert_eq!(edit, edit_in_turns);
            prop_assert_eq!(at_once.take_dirty(), in_turns.take_dirty());
        }
    }

    #[test]
    fn a_stroke_in_parts_equals_the_whole_stroke(
        seed: u64,
        bounded: bool,
        shape in small_shape(),
        dig: bool,
        stroke in stroke(),
        cuts in prop::collection::vec(0u64..2_000_000, 0..12),
    ) {
        let (mut whole, mut cut) = (grid(seed, bounded), grid(seed, bounded));
        let stamp = QuantisedStamp::new(shape, if dig { Operation::Dig } else { Operation::Add }, 9);
        let expected = whole.apply(&stamp.with_stroke(stroke));
        let mut times = cuts.iter().map(|cut| (*cut).clamp(stroke.start_us, stroke.end_us)).collect::<Vec<_>>();
        times.extend([stroke.start_us, stroke.end_us]);
        times.sort_unstable();
        let mut edit = Edit::NONE;
        for part in times.windows(2) {
            edit.merge(&cut.apply(&stamp.with_stroke(QuantisedStroke { start_us: part[0], end_us: part[1], ..stroke })));
        }
        prop_assert_eq!(read(&whole), read(&cut));
        prop_assert_eq!(expected, edit);
    }

    #[test]
    fn a_change_of_eight_voxels_turns_every_sample_inside(seed: u64, shape in small_shape()) {
        let mut grid = grid(seed, false);
        let stroke = QuantisedStroke { id: 1, rate: 8 * 256, falloff: 0, start_us: 0, end_us: 1_000_000 };
        let inside = all_points().filter(|point| shape.distance(*point) < 0).collect::<Vec<_>>();
        for (operation, expected) in [(Operation::Dig, 1024), (Operation::Add, -1024), (Operation::Dig, 1024)] {
            grid.apply(&QuantisedStamp::new(shape, operation, 5).with_stroke(stroke));
            for &point in &inside {
                let weight = i32::from(grid.get(point).weight);
                prop_assert!(weight == expected || weight.abs() > 1024 && weight.signum() == expected.signum());
            }
        }
    }

    #[test]
    fn extreme_stamps_do_not_panic(
        shape in any_shape(),
        operation in operation(),
        stroke in prop::option::of((
            prop_oneof![Just(u32::MAX), any::<u32>()],
            prop_oneof![Just(0), Just(1), Just(u32::MAX), any::<u32>()],
            prop_oneof![Just(0), Just(u64::MAX), any::<u64>()],
            prop_oneof![Just(0), Just(u64::MAX), any::<u64>()],
        )),
        seed: u64,
        isovalue: i16,
        point in prop::array::uniform3(prop_oneof![Just(i32::MIN), Just(i32::MAX), any::<i32>()]),
    ) {
        let stroke = stroke.map(|(rate, falloff, start_us, end_us)| QuantisedStroke { id: 0, rate, falloff, start_us, end_us });
        let stamp = QuantisedStamp { shape, operation, material: 1, stroke, isovalue };
        let mut grid = grid(seed, true);
        grid.apply(&stamp);
        stamp.shape.distance(point);
        let whole = GridChunk::Uniform(Voxel::new(-1, 0));
        for cells in [0, CELLS, 62, 63, u32::MAX] {
            for planes in [None, Some(stamp.region()), Some(Region::new([i32::MAX; 3], [i32::MIN; 3]))] {
                whole.clone().apply_stamp(point, cells, planes, &stamp);
                whole.clone().apply_stamp(stamp.region().min, cells, planes, &stamp);
            }
        }
    }
}

#[test]
fn uniform_chunks_stay_uniform_if_a_stamp_changes_all_or_no_samples() {
    let solid = GridChunk::Uniform(Voxel::new(i16::MIN, 3));
    let everything = QuantisedShape::sphere([4.0; 3], 100.0).unwrap();
    let dig = QuantisedStamp::new(everything, Operation::Dig, 0);

    let mut chunk = solid.clone();
    let edit = chunk.apply_stamp([0; 3], 8, None, &dig);
    assert_eq!(chunk, GridChunk::Uniform(Voxel::new(EDIT_LIMIT, 3)));
    assert_eq!((edit.region, edit.removed.get(3)), (Region::new([0; 3], [8; 3]), 512));
    assert!(chunk.apply_stamp([0; 3], 8, None, &dig).is_empty());
    let edit = chunk.apply_stamp([0; 3], 8, None, &QuantisedStamp::new(everything, Operation::Add, 4));
    assert_eq!(chunk, GridChunk::Uniform(Voxel::new(-EDIT_LIMIT, 4)));
    assert_eq!(edit.added.get(4), 512);

    let mut air = GridChunk::AIR;
    let partly = QuantisedStamp::new(QuantisedShape::sphere([0.0; 3], 3.0).unwrap(), Operation::Dig, 0);
    assert!(air.apply_stamp([0; 3], 8, None, &partly).is_empty());
    assert_eq!(air, GridChunk::AIR);

    let mut grid = Grid::<i16>::new(8).unwrap();
    assert!(grid.apply(&partly).is_empty());
    assert!(grid.chunks().next().is_none() && grid.dirty().is_empty());
}

#[test]
fn samples_are_shared_until_one_changes() {
    let weights = (0..512).map(|v| v - 256).collect();
    let original = GridChunk::from_samples(weights, vec![1; 512], 8).unwrap();
    let shares = |chunk: &GridChunk| match (chunk, &original) {
        (GridChunk::Samples(a), GridChunk::Samples(b)) => Arc::ptr_eq(a, b),
        _ => false,
    };
    let mut chunk = original.clone();
    let shape = QuantisedShape::sphere([4.0; 3], 2.0).unwrap();
    assert!(chunk.apply_stamp([0; 3], 8, None, &QuantisedStamp::new(shape, Operation::Paint, 1)).is_empty());
    assert!(shares(&chunk));
    assert!(!chunk.apply_stamp([0; 3], 8, None, &QuantisedStamp::new(shape, Operation::Paint, 2)).is_empty());
    assert!(!shares(&chunk));
}

#[test]
fn digging_a_ball_removes_exactly_its_points() {
    let mut grid = Grid::<i16>::new(32).unwrap();
    for position in Region::new([-1; 3], [1; 3]).points() {
        grid.insert(position, GridChunk::Uniform(Voxel::new(i16::MIN, 2))).unwrap();
    }
    let edit = grid.apply(&QuantisedStamp::new(QuantisedShape::sphere([0.0; 3], 10.0).unwrap(), Operation::Dig, 0));
    let exact = Region::new([-10; 3], [11; 3]).points().filter(|p| p.iter().map(|v| v * v).sum::<i32>() <= 100);
    assert_eq!(edit.removed.get(2), exact.count() as u64);
    assert_eq!((edit.removed.total(), edit.added.total()), (edit.removed.get(2), 0));
    assert_eq!((grid.get([0; 3]).weight, grid.get([10, 0, 0]).weight), (EDIT_LIMIT, 0));
    assert_eq!((grid.get([12, 0, 0]).weight, grid.get([14, 0, 0]).weight), (-512, i16::MIN));
}
