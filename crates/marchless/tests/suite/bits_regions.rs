//! Flood fill, connected components and overlaps, against plain versions point by point.

use std::collections::HashSet;

use fastrand::Rng;
use marchless::{
    Region, Shape,
    bits::{BitGrid, BitsError, Connectivity},
};
use proptest::{array::uniform3, prelude::*, test_runner::TestCaseResult};

use crate::support::{points, random};

/// Sizes around those of words.
const SIZES: [u32; 12] = [1, 2, 31, 32, 33, 63, 64, 65, 127, 130, 250, 600];

/// A random grid: its size, how many of eight points are set, and the seed.
#[derive(Clone, Copy, Debug)]
struct Case {
    size: [u32; 3],
    eighths: u64,
    seed: u64,
}

impl Case {
    fn is_set(&self, point: [u32; 3]) -> bool {
        random(self.seed, point) % 8 < self.eighths
    }

    fn grid(&self) -> BitGrid {
        BitGrid::from_fn(Shape::new(self.size).unwrap(), |point| self.is_set(point)).unwrap()
    }

    /// The set points, in memory order.
    fn set(&self) -> Vec<[u32; 3]> {
        points(self.size).filter(|&point| self.is_set(point)).collect()
    }
}

fn cases() -> impl Strategy<Value = Case> {
    // A second axis may be long, too, if the first is at most 130.
    let second = proptest::sample::select(&[1, 2, 3, 4, 5, 31, 33, 65][..]);
    let sizes = (proptest::sample::select(&SIZES[..]), second, 1..6u32, 0..3usize);
    (sizes, 0..=8u64, any::<u64>()).prop_map(|((long, a, b, turn), eighths, seed)| {
        let mut size = [long, if long > 130 { a.min(5) } else { a }, b];
        size.rotate_right(turn);
        Case { size, eighths, seed }
    })
}

/// The points that a breadth-first search reaches from seeds.
fn reached(case: &Case, seeds: &[[u32; 3]], connectivity: Connectivity) -> HashSet<[u32; 3]> {
    let far = match connectivity {
        Connectivity::Six => 1,
        Connectivity::Eighteen => 2,
        Connectivity::TwentySix => 3,
    };
    let mut found: HashSet<_> = seeds.iter().copied().filter(|&seed| case.is_set(seed)).collect();
    let mut queue: Vec<_> = found.iter().copied().collect();
    while let Some(point) = queue.pop() {
        for step in 0..27 {
            let step = [step % 3, step / 3 % 3, step / 9].map(|v| v - 1i64);
            let next: [i64; 3] = std::array::from_fn(|axis| i64::from(point[axis]) + step[axis]);
            let inside = (0..3).all(|axis| (0..i64::from(case.size[axis])).contains(&next[axis]));
            let next = next.map(|v| v as u32);
            if step.map(i64::abs).iter().sum::<i64>() <= far && inside && case.is_set(next) && found.insert(next) {
                queue.push(next);
            }
        }
    }
    found
}

fn points_of(grid: &BitGrid) -> HashSet<[u32; 3]> {
    grid.iter().collect()
}

/// The smallest region that holds all these points.
fn bounds(points: &HashSet<[u32; 3]>) -> Region {
    let ends = |axis: usize| {
        let all = points.iter().map(|point| point[axis] as i32);
        (all.clone().min().unwrap(), all.max().unwrap() + 1)
    };
    let ends = [ends(0), ends(1), ends(2)];
    Region::new(ends.map(|(min, _)| min), ends.map(|(_, max)| max))
}

/// Some points of the grid, set or not.
fn some_points(case: &Case, count: usize) -> Vec<[u32; 3]> {
    let mut random = Rng::with_seed(case.seed);
    (0..count).map(|_| case.size.map(|size| random.u32(..size))).collect()
}

fn floods_are_what_a_queue_reaches(case: Case, count: usize) -> TestCaseResult {
    let (grid, seeds) = (case.grid(), some_points(&case, count));
    let mut from = BitGrid::new(grid.shape()).unwrap();
    for &seed in &seeds {
        from.set(seed, true).unwrap();
    }
    for connectivity in Connectivity::ALL {
        let expected = reached(&case, &seeds, connectivity);
        let filled = grid.flood(&seeds, connectivity).unwrap();
        prop_assert!(points_of(&filled) == expected, "{connectivity:?}");
        prop_assert!(filled == grid.flood_from(&from, connectivity).unwrap());
        // A flood from several seeds is the union of the floods from each.
        let mut each = HashSet::new();
        for &seed in &seeds {
            each.extend(grid.flood(&[seed], connectivity).unwrap().iter());
        }
        prop_assert!(each == expected);
    }
    Ok(())
}

fn components_are_what_a_queue_finds(case: Case) -> TestCaseResult {
    let (grid, set) = (case.grid(), case.set());
    for connectivity in Connectivity::ALL {
        let components = grid.components(connectivity);
        let mut seen = HashSet::new();
        let mut sizes = Vec::new();
        for &first in &set {
            if seen.contains(&first) {
                continue;
            }
            // The next component is that of the next point that no other component has.
            let expected = reached(&case, &[first], connectivity);
            let component = components.get(sizes.len());
            prop_assert!(component.is_some(), "too few with {connectivity:?}");
            let component = component.unwrap();
            prop_assert_eq!(component.first, first);
            prop_assert_eq!(component.size, expected.len());
            prop_assert_eq!(component.bounds, bounds(&expected));
            // Masks of all components would take long if there are many.
            if sizes.len() < 20 {
                let mask = components.mask(sizes.len());
                prop_assert!(points_of(&mask) == expected);
                prop_assert!(mask == grid.flood(&[first], connectivity).unwrap());
            }
            prop_assert!(expected.iter().all(|&point| components.label(point) == Some(sizes.len())));
            sizes.push(expected.len());
            seen.extend(expected);
        }
        prop_assert_eq!(components.len(), sizes.len());
        prop_assert_eq!(components.is_empty(), set.is_empty());
        prop_assert!(components.iter().map(|component| component.size).eq(sizes.iter().copied()));
        prop_assert_eq!(components.iter().map(|component| component.size).sum::<usize>(), grid.count());
        prop_assert!(points(case.size).all(|point| components.label(point).is_some() == case.is_set(point)));
        prop_assert!(components.keep(|_| true) == grid && components.keep(|_| false).is_empty());
        let most = sizes.iter().copied().max();
        prop_assert_eq!(components.largest(), sizes.iter().position(|&size| Some(size) == most));
        let large: HashSet<_> = set.iter().copied().filter(|&p| sizes[components.label(p).unwrap()] > 2).collect();
        prop_assert!(points_of(&components.keep(|component| component.size > 2)) == large);
    }
    Ok(())
}

/// A region inside the grid, across its border or far outside, or an inverted one.
fn regions() -> impl Strategy<Value = Region> {
    let end = || prop_oneof![8 => -3..135i32, 1 => Just(i32::MIN), 1 => Just(i32::MAX)];
    let short = || prop_oneof![8 => -2..8i32, 1 => Just(i32::MIN), 1 => Just(i32::MAX)];
    let axes = [[0, 1, 2], [1, 0, 2], [1, 2, 0]];
    ([end(), end(), short(), short(), short(), short()], proptest::sample::select(axes.to_vec())).prop_map(
        |([a, b, c, d, e, f], axes)| {
            let ends = [[a.min(b), a.max(b)], [c, d], [e.min(f), e.max(f)]];
            Region::new(axes.map(|axis: usize| ends[axis][0]), axes.map(|axis| ends[axis][1]))
        },
    )
}

fn regions_are_counted(case: Case, region: Region) -> TestCaseResult {
    let grid = case.grid();
    let inside = case.set().iter().filter(|point| region.contains(point.map(|v| v as i32))).count();
    let volume: u128 = region.size().iter().map(|&size| u128::from(size)).product();
    prop_assert_eq!(grid.count_in(region), inside);
    prop_assert_eq!(grid.overlaps_region(region), inside > 0);
    prop_assert_eq!(grid.covers_region(region), inside as u128 == volume);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn floods(case in cases(), count in 0..4usize) {
        floods_are_what_a_queue_reaches(case, count)?;
    }

    #[test]
    fn components(case in cases()) {
        components_are_what_a_queue_finds(case)?;
    }

    #[test]
    fn counts_in_regions(case in cases(), regions in proptest::collection::vec(regions(), 20)) {
        for region in regions {
            regions_are_counted(case, region)?;
        }
    }

    /// Centres and radii are multiples of 1/8. `f64` holds their squares and the sums of these exactly.
    #[test]
    fn balls(case in cases(), balls in proptest::collection::vec((uniform3(-40..1100i32), 0..400i32, any::<bool>()), 20)) {
        let (grid, set) = (case.grid(), case.set());
        for (centre, radius, near) in balls {
            // Half of the balls are moved near the grid.
            let centre: [i32; 3] = std::array::from_fn(|axis| {
                if near { centre[axis] % (8 * case.size[axis] as i32 + 8) } else { centre[axis] }
            });
            let distance = |point: &[u32; 3]| (0..3).map(|axis| (8 * point[axis] as i32 - centre[axis]).pow(2)).sum::<i32>();
            let nearest = set.iter().map(distance).min();
            let eighths = |v: i32| v as f32 / 8.0;
            let expected = nearest.is_some_and(|nearest| nearest <= radius * radius);
            prop_assert_eq!(grid.overlaps_ball(centre.map(eighths), eighths(radius)), expected);
            // Balls that barely reach the nearest set point, and barely miss it.
            if let Some(nearest) = nearest {
                let root = f64::from(nearest).sqrt();
                prop_assert!(grid.overlaps_ball(centre.map(eighths), (root / 8.0 * 1.000_001) as f32));
                prop_assert!(nearest == 0 || !grid.overlaps_ball(centre.map(eighths), (root / 8.0 * 0.999_999) as f32));
            }
        }
    }

    /// Centres and radii of any bits. Nothing panics or takes long, and all answers outside of rounding are right.
    #[test]
    fn any_ball(case in cases(), centre: [u32; 3], radius: u32) {
        let (centre, radius) = (centre.map(f32::from_bits), f32::from_bits(radius));
        let grid = case.grid();
        let distance = |point: &[u32; 3]| {
            (0..3).map(|axis| (f64::from(point[axis]) - f64::from(centre[axis])).powi(2)).sum::<f64>().sqrt()
        };
        let nearest = case.set().iter().map(distance).min_by(f64::total_cmp);
        let (nearest, radius_wide) = (nearest.unwrap_or(f64::INFINITY), f64::from(radius));
        if centre.iter().any(|v| !v.is_finite()) || radius.is_nan() || radius < 0.0 || nearest > radius_wide * (1.0 + 1e-9) {
            prop_assert!(!grid.overlaps_ball(centre, radius));
        } else if nearest < radius_wide * (1.0 - 1e-9) {
            prop_assert!(grid.overlaps_ball(centre, radius));
        }
    }

    #[test]
    fn grids_at_offsets(a in cases(), b in cases(), offsets in proptest::collection::vec(uniform3(-131..131i32), 20)) {
        let (one, other) = (a.grid(), b.grid());
        let far = [[i32::MAX, 0, 0], [0, i32::MIN, 0], [0, 0, i32::MAX], [i32::MIN; 3], [0; 3]];
        // These offsets mostly leave the grids with points in common.
        let near = offsets.iter().map(|offset| {
            std::array::from_fn(|axis| offset[axis] % (a.size[axis].max(b.size[axis]) as i32 + 1))
        });
        for offset in near.chain(far) {
            let expected = b.set().iter().any(|point| {
                let moved: [i64; 3] = std::array::from_fn(|axis| i64::from(point[axis]) + i64::from(offset[axis]));
                (0..3).all(|axis| (0..i64::from(a.size[axis])).contains(&moved[axis])) && a.is_set(moved.map(|v| v as u32))
            });
            prop_assert_eq!(one.overlaps(&other, offset), expected, "at {:?}", offset);
            let back = offset.map(i32::checked_neg);
            if let [Some(x), Some(y), Some(z)] = back {
                prop_assert_eq!(other.overlaps(&one, [x, y, z]), expected, "back from {:?}", offset);
            }
        }
    }
}

/// A path that winds through a whole volume: first whole, then cut in two.
#[test]
fn a_long_winding_path_is_one_component() {
    let size = [130, 33, 9];
    // Every other row is a wall with a gap at one end, every other layer a floor with a gap; the ends alternate.
    let open = |[x, y, z]: [u32; 3]| match (z % 2, y % 2) {
        (0, 0) => true,
        (0, _) => x == if y / 2 % 2 == 0 { 129 } else { 0 },
        _ => [x, y] == [0, if z / 2 % 2 == 0 { 32 } else { 0 }],
    };
    let grid = BitGrid::from_fn(Shape::new(size).unwrap(), open).unwrap();
    for connectivity in Connectivity::ALL {
        assert_eq!(grid.components(connectivity).len(), 1);
        for seed in [[0, 0, 0], [64, 16, 4]] {
            assert!(grid.flood(&[seed], connectivity).unwrap() == grid, "from {seed:?}");
        }
    }
    let mut cut = grid.clone();
    cut.set([64, 16, 4], false).unwrap();
    assert_eq!(cut.components(Connectivity::TwentySix).len(), 2);
}

#[test]
fn degenerate_arguments_are_typed_errors_or_match_nothing() {
    let case = Case { size: [65, 3, 4], eighths: 8, seed: 0 };
    let (grid, shape) = (case.grid(), Shape::new(case.size).unwrap());
    for position in [[65, 0, 0], [0, 3, 0], [0, 0, 4], [u32::MAX; 3]] {
        let error = grid.flood(&[[0; 3], position], Connectivity::Six);
        assert!(error == Err(BitsError::OutOfRange { position, shape }));
        assert_eq!(grid.components(Connectivity::Six).label(position), None);
    }
    let found = Shape::new([65, 4, 3]).unwrap();
    let error = grid.flood_from(&BitGrid::new(found).unwrap(), Connectivity::Six);
    assert!(error == Err(BitsError::ShapesDiffer { expected: shape, found }));

    assert!(grid.flood(&[], Connectivity::Six).unwrap().is_empty());
    let nothing = BitGrid::new(shape).unwrap();
    assert!(nothing.flood(&[[1, 1, 1]], Connectivity::Six).unwrap().is_empty());
    let components = grid.components(Connectivity::Six);
    assert!(components.get(1).is_none() && components.mask(1).is_empty() && components.mask(usize::MAX).is_empty());
    assert_eq!(nothing.components(Connectivity::Six).largest(), None);

    assert!(grid.covers_region(Region::new([5; 3], [5; 3])) && nothing.covers_region(Region::new([900; 3], [0; 3])));
    assert!(grid.covers_region(Region::new([0; 3], [65, 3, 4])) && !grid.covers_region(Region::new([-1; 3], [1; 3])));
    for centre in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY]] {
        assert!(!grid.overlaps_ball(centre, f32::INFINITY), "{centre:?}");
    }
    for radius in [f32::NAN, -1.0, f32::NEG_INFINITY] {
        assert!(!grid.overlaps_ball([1.0; 3], radius), "{radius}");
    }
    assert!(grid.overlaps_ball([64.0, 2.0, 3.0], 0.0) && !grid.overlaps_ball([64.0, 2.0, 3.5], 0.0));
    assert!(grid.overlaps_ball([64.0, 2.0, 3.5], 0.5) && grid.overlaps_ball([1e30, -1e30, 0.0], f32::MAX));
    assert!(grid.overlaps_ball([1e30; 3], f32::INFINITY) && !grid.overlaps_ball([1e30; 3], 1e29));
    assert!(!nothing.overlaps_ball([1.0; 3], f32::INFINITY) && !nothing.overlaps(&grid, [0; 3]));
}
