//! Operations on whole grids of bits against plain loops over points, and the laws that hold between them.

use core::fmt;

use marchless::{
    Region, Shape,
    bits::{BitGrid, BitsError, Connectivity, Rule},
};
use proptest::{prelude::*, sample::select};

use crate::support::random;

/// Sizes around those of one word and of four words, and of rows that are treated in one, two and three parts.
const SIZES: [u32; 14] = [1, 2, 31, 32, 33, 63, 64, 65, 127, 130, 250, 320, 645, 1000];

/// A random grid. Its debug output is the recipe, not the bits.
#[derive(Clone, Copy)]
struct Case {
    size: [u32; 3],
    seed: u64,
    /// How many of eight points are set.
    density: u64,
}

impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} points, seed {}, density {}/8", self.size, self.seed, self.density)
    }
}

impl Case {
    fn any() -> impl Strategy<Value = Self> {
        // A second axis may be long, too, if the first is at most 130.
        let second = select(&[1, 2, 3, 4, 5, 31, 33, 64, 65][..]);
        let size = (select(&SIZES[..]), second, 1..6u32, 0..3usize).prop_map(|(long, a, b, turn)| {
            let mut size = [long, if long > 130 { a.min(5) } else { a }, b];
            size.rotate_right(turn);
            size
        });
        (size, any::<u64>(), 0..9u64).prop_map(|(size, seed, density)| Self { size, seed, density })
    }

    fn shape(self) -> Shape {
        Shape::new(self.size).expect("no size is 0")
    }

    fn grid(self) -> BitGrid {
        BitGrid::from_fn(self.shape(), |p| random(self.seed, p) % 8 < self.density).expect("it is small")
    }

    /// Another grid of the same size.
    fn other(self) -> BitGrid {
        Self { seed: !self.seed, density: 8 - self.density / 2, ..self }.grid()
    }
}

/// Offsets of a point or two, of about a word, up to the size, and of any size.
fn offsets() -> impl Strategy<Value = [i32; 3]> {
    let along_x =
        prop_oneof![4 => -2..3i32, 4 => -131..132i32, 1 => any::<i32>(), 1 => select(vec![64, -64, 128, -128])];
    let along = prop_oneof![8 => -3..4i32, 2 => -131..132i32, 1 => select(vec![i32::MIN, i32::MAX])];
    (along_x, along.clone(), along).prop_map(|(x, y, z)| [x, y, z])
}

fn connectivities() -> impl Strategy<Value = Connectivity> {
    select(Connectivity::ALL.to_vec())
}

fn moved(p: [u32; 3], by: [i32; 3]) -> Option<[u32; 3]> {
    let mut place = [0; 3];
    for axis in 0..3 {
        place[axis] = u32::try_from(i64::from(p[axis]) + i64::from(by[axis])).ok()?;
    }
    Some(place)
}

/// The bit at `p + by`, or `outside` beyond the grid.
fn bit(grid: &BitGrid, p: [u32; 3], by: [i32; 3], outside: bool) -> bool {
    let size = grid.shape().size();
    match moved(p, by).filter(|q| (0..3).all(|axis| q[axis] < size[axis])) {
        Some(q) => grid.get(q),
        None => outside,
    }
}

fn neighbours(connectivity: Connectivity) -> Vec<[i32; 3]> {
    let farthest = match connectivity {
        Connectivity::Six => 1,
        Connectivity::Eighteen => 2,
        Connectivity::TwentySix => 3,
    };
    let distance = |p: &[i32; 3]| p.iter().map(|v| v.abs()).sum::<i32>();
    Region::new([-1; 3], [2; 3]).points().filter(|p| (1..=farthest).contains(&distance(p))).collect()
}

fn made(shape: Shape, is_set: impl FnMut([u32; 3]) -> bool) -> BitGrid {
    BitGrid::from_fn(shape, is_set).expect("it is small")
}

/// Checks that two grids are equal and that unused bits are zero.
fn same(found: &BitGrid, expected: &BitGrid) -> Result<(), TestCaseError> {
    prop_assert_eq!(found.shape(), expected.shape());
    let bits: u32 = found.words().iter().map(|word| word.count_ones()).sum();
    prop_assert_eq!(bits as usize, found.iter().filter(|&p| found.get(p)).count(), "bits that are no points");
    let [nx, ny, nz] = found.shape().size();
    for p in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        prop_assert!(found.get(p) == expected.get(p), "at {:?}, it is {}", p, found.get(p));
    }
    prop_assert!(found.words() == expected.words());
    Ok(())
}

/// True if every set point of `inner` is set in `outer`.
fn is_within(inner: &BitGrid, outer: &BitGrid) -> bool {
    inner.words().iter().zip(outer.words()).all(|(inner, outer)| inner & !outer == 0)
}

/// A grid of the same shape with other content, to be overwritten.
fn used(grid: &BitGrid) -> BitGrid {
    made(grid.shape(), |p| random(7, p) & 1 == 1)
}

fn changed(grid: &BitGrid, change: impl FnOnce(&mut BitGrid)) -> BitGrid {
    let mut grid = grid.clone();
    change(&mut grid);
    grid
}

proptest! {
    #[test]
    fn boolean_operations_are_those_of_points(case in Case::any()) {
        let (a, b) = (case.grid(), case.other());
        let shape = case.shape();
        same(&changed(&a, |a| a.and_with(&b).unwrap()), &made(shape, |p| a.get(p) && b.get(p)))?;
        same(&changed(&a, |a| a.or_with(&b).unwrap()), &made(shape, |p| a.get(p) || b.get(p)))?;
        same(&changed(&a, |a| a.xor_with(&b).unwrap()), &made(shape, |p| a.get(p) != b.get(p)))?;
        same(&changed(&a, |a| a.subtract(&b).unwrap()), &made(shape, |p| a.get(p) && !b.get(p)))?;
        same(&changed(&a, BitGrid::invert), &made(shape, |p| !a.get(p)))?;
        same(&changed(&a, |a| a.copy_from(&b).unwrap()), &b)?;
        // De Morgan.
        let not_both = changed(&changed(&a, |a| a.and_with(&b).unwrap()), BitGrid::invert);
        let (not_a, not_b) = (changed(&a, BitGrid::invert), changed(&b, BitGrid::invert));
        same(&not_both, &changed(&not_a, |not_a| not_a.or_with(&not_b).unwrap()))?;
    }

    #[test]
    fn a_cut_has_the_points_of_its_region(
        case in Case::any(), min in offsets(), size in [1..140u32, 1..6u32, 1..6u32], far: bool,
    ) {
        let grid = case.grid();
        let min = if far { min } else { min.map(|v| v.clamp(-20, 150)) };
        let region = Region::new(min, [0, 1, 2].map(|axis| min[axis].saturating_add_unsigned(size[axis])));
        if region.is_empty() {
            prop_assert_eq!(grid.cut(region), Err(BitsError::RegionSize { region }));
        } else {
            let cut = grid.cut(region).unwrap();
            same(&cut, &made(Shape::new(region.size()).unwrap(), |p| bit(&grid, p, min, false)))?;
        }
        same(&grid.cut(Region::new([0; 3], case.size.map(|size| size as i32))).unwrap(), &grid)?;
    }

    #[test]
    fn a_shift_moves_every_point(case in Case::any(), offset in offsets()) {
        let grid = case.grid();
        let expected = made(case.shape(), |p| {
            let back = offset.map(|v| 0i64 - i64::from(v));
            let from: Vec<_> = (0..3).filter_map(|axis| u32::try_from(i64::from(p[axis]) + back[axis]).ok()).collect();
            from.try_into().is_ok_and(|from| grid.get(from))
        });
        same(&grid.shifted(offset), &expected)?;
        let mut out = used(&grid);
        grid.shift_into(offset, &mut out).unwrap();
        same(&out, &expected)?;
    }

    #[test]
    fn shifts_compose_and_undo(case in Case::any(), a in offsets(), b in offsets()) {
        let grid = case.grid();
        // `b` gets the signs of `a`, so that no point that has left comes back.
        let b = [0, 1, 2].map(|axis| if (a[axis] < 0) == (b[axis] < 0) { b[axis] } else { !b[axis] });
        let sum = [0, 1, 2].map(|axis| a[axis].saturating_add(b[axis]));
        same(&grid.shifted(a).shifted(b), &grid.shifted(sum))?;
        // Points that do not leave the grid come back.
        if a.iter().all(|&v| v != i32::MIN) {
            let stays = made(case.shape(), |p| grid.get(p) && {
                let there = moved(p, a);
                there.is_some_and(|q| (0..3).all(|axis| q[axis] < case.size[axis]))
            });
            same(&grid.shifted(a).shifted(a.map(|v| -v)), &stays)?;
        }
    }

    #[test]
    fn dilation_and_erosion_look_at_all_neighbours(case in Case::any(), connectivity in connectivities()) {
        let grid = case.grid();
        let around = neighbours(connectivity);
        let any = made(case.shape(), |p| grid.get(p) || around.iter().any(|&by| bit(&grid, p, by, false)));
        let all = made(case.shape(), |p| grid.get(p) && around.iter().all(|&by| bit(&grid, p, by, true)));
        same(&grid.dilated(connectivity), &any)?;
        same(&grid.eroded(connectivity), &all)?;
        let mut out = used(&grid);
        grid.dilate_into(connectivity, &mut out).unwrap();
        same(&out, &any)?;
        let mut out = used(&grid);
        grid.erode_into(connectivity, &mut out).unwrap();
        same(&out, &all)?;
    }

    #[test]
    fn morphology_keeps_its_laws(case in Case::any(), connectivity in connectivities(), offset in [-2..3i32, -2..3, -2..3]) {
        let grid = case.grid();
        prop_assert!(is_within(&grid, &grid.closed(connectivity)));
        prop_assert!(is_within(&grid.opened(connectivity), &grid));
        same(&grid.opened(connectivity), &grid.eroded(connectivity).dilated(connectivity))?;
        same(&grid.closed(connectivity), &grid.dilated(connectivity).eroded(connectivity))?;
        let not = changed(&grid, BitGrid::invert);
        same(&grid.eroded(connectivity), &changed(&not.dilated(connectivity), BitGrid::invert))?;
        let more = changed(&grid, |grid| grid.or_with(&case.other()).unwrap());
        prop_assert!(is_within(&grid.dilated(connectivity), &more.dilated(connectivity)));
        // Away from the border, dilation and shift commute.
        let mut far = BitGrid::new(Shape::new(case.size.map(|size| size + 6)).unwrap()).unwrap();
        for p in grid.iter() {
            far.set(p.map(|v| v + 3), true).unwrap();
        }
        same(&far.dilated(connectivity).shifted(offset), &far.shifted(offset).dilated(connectivity))?;
    }

    #[test]
    fn an_automaton_counts_neighbours(
        case in Case::any(), birth in 0..1u32 << 27, survival in 0..1u32 << 27, outside: bool,
        connectivity in connectivities(),
    ) {
        let counts = |bits: u32| -> Vec<u8> { (0..27).rev().filter(|count| bits >> count & 1 == 1).collect() };
        let rule = Rule::new(&counts(birth), &counts(survival)).unwrap();
        let rule = rule.with_outside(outside).with_connectivity(connectivity);
        let grid = case.grid();
        let around = neighbours(connectivity);
        let expected = made(case.shape(), |p| {
            let count = around.iter().filter(|&&by| bit(&grid, p, by, outside)).count();
            (if grid.get(p) { survival } else { birth }) >> count & 1 == 1
        });
        same(&grid.stepped(&rule), &expected)?;
        let mut out = used(&grid);
        grid.step_into(&rule, &mut out).unwrap();
        same(&out, &expected)?;
    }
}

/// Rows longer than the inline masks, which hold 256 words.
#[test]
fn long_rows_are_shifted_and_counted() {
    let case = Case { size: [16_500, 2, 2], seed: 5, density: 3 };
    let grid = case.grid();
    for offset in [[1, 0, 0], [-1, 1, 0], [70, 0, -1], [-16_400, 0, 0], [16_499, 1, 1], [0, -1, 0]] {
        let expected = made(case.shape(), |p| bit(&grid, p, offset.map(|v: i32| -v), false));
        same(&grid.shifted(offset), &expected).unwrap();
    }
    let counts = [1, 4, 5, 7];
    let around = neighbours(Connectivity::TwentySix);
    let expected = made(case.shape(), |p| {
        let count = around.iter().filter(|&&by| bit(&grid, p, by, true)).count();
        !grid.get(p) && counts.contains(&(count as u8))
    });
    same(&grid.stepped(&Rule::new(&counts, &[]).unwrap().with_outside(true)), &expected).unwrap();
}

/// Every count of neighbours around a set and an unset point, with rules of a single count and with ranges.
#[test]
fn rules_tell_every_count_apart() {
    let around = neighbours(Connectivity::TwentySix);
    for (count, middle) in (0..=26).flat_map(|count| [(count, false), (count, true)]) {
        let mut grid = BitGrid::new(Shape::cube(3).unwrap()).unwrap();
        grid.set([1; 3], middle).unwrap();
        for by in &around[..count] {
            grid.set(moved([1; 3], *by).unwrap(), true).unwrap();
        }
        for wanted in 0..=26u8 {
            for rule in [&[wanted][..], &Vec::from_iter(wanted..=26), &Vec::from_iter(0..=wanted)] {
                let expected = rule.contains(&(count as u8));
                let (born, survived) = (Rule::new(rule, &[]).unwrap(), Rule::new(&[], rule).unwrap());
                assert_eq!(grid.stepped(&born).get([1; 3]), !middle && expected, "{count} of {rule:?}");
                assert_eq!(grid.stepped(&survived).get([1; 3]), middle && expected, "{count} of {rule:?}");
            }
        }
    }
}

#[test]
fn refused_operations_return_typed_errors_and_change_nothing() {
    let grid = made(Shape::new([5, 4, 3]).unwrap(), |p| random(1, p) & 1 == 1);
    let other = made(Shape::new([5, 3, 4]).unwrap(), |p| random(2, p) & 1 == 1);
    let rule = Rule::new(&[3], &[2, 3]).unwrap();
    let error = Err(BitsError::ShapesDiffer { expected: grid.shape(), found: other.shape() });
    for change in [BitGrid::and_with, BitGrid::or_with, BitGrid::xor_with, BitGrid::subtract, BitGrid::copy_from] {
        let mut changed = grid.clone();
        assert_eq!(change(&mut changed, &other), error);
        assert!(changed == grid);
    }
    let mut out = other.clone();
    assert_eq!(grid.shift_into([1, 0, 0], &mut out), error);
    assert_eq!(grid.dilate_into(Connectivity::Six, &mut out), error);
    assert_eq!(grid.erode_into(Connectivity::Six, &mut out), error);
    assert_eq!(grid.step_into(&rule, &mut out), error);
    assert!(out == other);
    assert_eq!(Rule::new(&[0, 27], &[]), Err(BitsError::NeighbourCount { count: 27 }));
    assert_eq!(Rule::new(&[26], &[255, 28]), Err(BitsError::NeighbourCount { count: 255 }));
    for region in
        [Region::new([0; 3], [4, 4, 0]), Region::new([3; 3], [2; 3]), Region::new([i32::MIN; 3], [i32::MAX; 3])]
    {
        assert_eq!(grid.cut(region), Err(BitsError::RegionSize { region }));
    }
    let region = Region::new([0; 3], [1, i32::MAX, 1 << 29]);
    let shape = Shape::new(region.size()).unwrap();
    assert_eq!(grid.cut(region), Err(BitsError::TooLarge { shape }));
}
