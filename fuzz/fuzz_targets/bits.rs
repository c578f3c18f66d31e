//! Grids of bits that go through any sequence of operations, each beside what plain loops over the points make of it.

#![no_main]

use libfuzzer_sys::{
    arbitrary::{Result, Unstructured},
    fuzz_target,
};
use marchless::{
    Region, Shape,
    bits::{BitGrid, BitsError, Connectivity, Rule, TileGrid},
};
use marchless_fuzz::{Plain, neighbours};

/// More operations on one grid find nothing that fewer do not.
const STEPS: usize = 12;

fuzz_target!(|data: &[u8]| {
    // Out of bytes: done.
    let _ = check(&mut Unstructured::new(data));
});

fn check(u: &mut Unstructured<'_>) -> Result<()> {
    let mut pair = Pair::arbitrary(u)?;
    // What operations of two grids take as the other one; of the same shape, as a rule.
    let mut other = if u.ratio(3, 4)? { Pair::like(&pair, u)? } else { Pair::arbitrary(u)? };
    for _ in 0..STEPS {
        match u.int_in_range(0..=9)? {
            0 => pair.combine(&other, u)?,
            1 => pair.shift(&other, u)?,
            2 => pair.morph(u)?,
            3 => pair.step(&other, u)?,
            4 => pair.flood(&other, u)?,
            5 => pair.components(u)?,
            6 => pair.cut(u)?,
            7 => pair.paste(&other, u)?,
            8 => pair.overlap(&other, u)?,
            _ => std::mem::swap(&mut pair, &mut other),
        }
        assert!(pair.plain.same(&pair.grid));
        pair.case_masks();
    }
    Ok(())
}

/// A grid, and what it should be.
struct Pair {
    plain: Plain,
    grid: BitGrid,
}

impl Pair {
    fn arbitrary(u: &mut Unstructured<'_>) -> Result<Self> {
        let mut size = [u.int_in_range(1..=700)?, u.int_in_range(1..=4)?, u.int_in_range(1..=4)?];
        size.rotate_right(u.int_in_range(0..=2)?);
        Self::of(size, u)
    }

    fn like(other: &Self, u: &mut Unstructured<'_>) -> Result<Self> {
        Self::of(other.plain.size, u)
    }

    /// Bits from a few bytes, which are repeated; many or few of them set.
    fn of(size: [u32; 3], u: &mut Unstructured<'_>) -> Result<Self> {
        let shape = Shape::new(size).expect("the size is small");
        let (bytes, mix) = (u.arbitrary::<[u8; 8]>()?, u.arbitrary::<u32>()?);
        let plain = Plain::new(size, |point| {
            let index = shape.index(point) as u32;
            let place = if mix == 0 { index } else { index.wrapping_mul(mix) >> 13 };
            bytes[place as usize / 8 % 8] >> (place % 8) & 1 == 1
        });
        let grid = BitGrid::from_fn(shape, |point| plain.get(point.map(i64::from))).expect("it is small");
        Ok(Self { plain, grid })
    }

    fn differ(&self, other: &Self) -> Option<BitsError> {
        let (expected, found) = (self.grid.shape(), other.grid.shape());
        (expected != found).then_some(BitsError::ShapesDiffer { expected, found })
    }

    fn combine(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        let kind = u.int_in_range(0..=5)?;
        if kind == 5 {
            self.grid.invert();
            self.plain = Plain::new(self.plain.size, |point| !self.plain.get(point.map(i64::from)));
            return Ok(());
        }
        let done = match kind {
            0 => self.grid.and_with(&other.grid),
            1 => self.grid.or_with(&other.grid),
            2 => self.grid.xor_with(&other.grid),
            3 => self.grid.subtract(&other.grid),
            _ => self.grid.copy_from(&other.grid),
        };
        assert_eq!(done.err(), self.differ(other));
        if done.is_ok() {
            self.plain = Plain::new(self.plain.size, |point| {
                let [a, b] = [&self.plain, &other.plain].map(|plain| plain.get(point.map(i64::from)));
                [a & b, a | b, a ^ b, a & !b, b][kind as usize]
            });
        }
        Ok(())
    }

    fn shift(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        let offset = offset(u)?;
        let shifted = self.grid.shifted(offset);
        let mut out = other.grid.clone();
        let done = self.grid.shift_into(offset, &mut out);
        assert_eq!(done.err(), self.differ(other));
        assert!(out == if done.is_ok() { shifted.clone() } else { other.grid.clone() });
        self.grid = shifted;
        self.plain = Plain::new(self.plain.size, |point| {
            self.plain.get(std::array::from_fn(|axis| i64::from(point[axis]) - i64::from(offset[axis])))
        });
        Ok(())
    }

    fn morph(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let connectivity = *u.choose(&Connectivity::ALL)?;
        let dilated = |plain: &Plain| {
            let any = |point: [u32; 3]| plain.around(point, connectivity, false) > 0;
            Plain::new(plain.size, |point| plain.get(point.map(i64::from)) || any(point))
        };
        let eroded = |plain: &Plain| {
            let all = |point: [u32; 3]| plain.around(point, connectivity, true) == neighbours(connectivity).count();
            Plain::new(plain.size, |point| plain.get(point.map(i64::from)) && all(point))
        };
        (self.grid, self.plain) = match u.int_in_range(0..=3)? {
            0 => (self.grid.dilated(connectivity), dilated(&self.plain)),
            1 => (self.grid.eroded(connectivity), eroded(&self.plain)),
            2 => (self.grid.opened(connectivity), dilated(&eroded(&self.plain))),
            _ => (self.grid.closed(connectivity), eroded(&dilated(&self.plain))),
        };
        Ok(())
    }

    fn step(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        let connectivity = *u.choose(&Connectivity::ALL)?;
        let (counts, outside) = (u.arbitrary::<[u32; 2]>()?, u.arbitrary()?);
        let [birth, survival] =
            counts.map(|counts| (0..=26).filter(|count| counts >> count & 1 == 1).collect::<Vec<u8>>());
        let rule = Rule::new(&birth, &survival).expect("no count is above 26");
        let rule = rule.with_outside(outside).with_connectivity(connectivity);
        let stepped = self.grid.stepped(&rule);
        let mut out = other.grid.clone();
        let done = self.grid.step_into(&rule, &mut out);
        assert_eq!(done.err(), self.differ(other));
        assert!(done.is_err() || out == stepped);
        self.grid = stepped;
        self.plain = Plain::new(self.plain.size, |point| {
            let set = self.plain.get(point.map(i64::from));
            counts[usize::from(set)] >> self.plain.around(point, connectivity, outside) & 1 == 1
        });
        Ok(())
    }

    fn flood(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        let connectivity = *u.choose(&Connectivity::ALL)?;
        let filled = if u.arbitrary()? {
            let filled = self.grid.flood_from(&other.grid, connectivity);
            assert_eq!(filled.as_ref().err().copied(), self.differ(other));
            filled.map(|filled| (filled, self.plain.flood(&other.plain.set(), connectivity)))
        } else {
            let seeds: Vec<[u32; 3]> = (0..u.int_in_range(0..=3)?)
                .map(|_| Ok([u.int_in_range(0..=140)?, u.int_in_range(0..=140)?, u.int_in_range(0..=140)?]))
                .collect::<Result<_>>()?;
            // Inside, but for one in eight.
            let inside = !u.ratio(1, 8)?;
            let seeds: Vec<[u32; 3]> = seeds
                .into_iter()
                .map(|seed| {
                    std::array::from_fn(|axis| if inside { seed[axis] % self.plain.size[axis] } else { seed[axis] })
                })
                .collect();
            let outside = seeds.iter().find(|seed| (0..3).any(|axis| seed[axis] >= self.plain.size[axis]));
            let shape = self.grid.shape();
            let filled = self.grid.flood(&seeds, connectivity);
            let error = outside.map(|&position| BitsError::OutOfRange { position, shape });
            assert_eq!(filled.as_ref().err().copied(), error);
            filled.map(|filled| (filled, self.plain.flood(&seeds, connectivity)))
        };
        let Ok((filled, plain)) = filled else { return Ok(()) };
        assert!(plain.same(&filled));
        if u.arbitrary()? {
            (self.grid, self.plain) = (filled, plain);
        }
        Ok(())
    }

    fn components(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let connectivity = *u.choose(&Connectivity::ALL)?;
        let components = self.grid.components(connectivity);
        let mut rest = self.plain.clone();
        for (index, component) in components.iter().enumerate() {
            let first = rest.set()[0];
            assert_eq!(component.first, first);
            let plain = self.plain.flood(&[first], connectivity);
            let points = plain.set();
            assert_eq!(component.size, points.len());
            let ends = [0, 1, 2].map(|axis| {
                let all = || points.iter().map(|point| point[axis] as i32);
                (all().min().expect("it has a point"), all().max().expect("it has a point") + 1)
            });
            assert_eq!(component.bounds, Region::new(ends.map(|(min, _)| min), ends.map(|(_, max)| max)));
            assert!(points.iter().all(|&point| components.label(point) == Some(index)));
            rest = Plain::new(rest.size, |point| rest.get(point.map(i64::from)) && !plain.get(point.map(i64::from)));
            if index < 4 {
                assert!(plain.same(&components.mask(index)));
            }
            // Enough of white noise; the rest is as many components as there are.
            if index == 16 {
                return Ok(());
            }
        }
        assert!(rest.set().is_empty());
        let most = components.iter().map(|component| component.size).max();
        assert_eq!(components.largest().map(|index| Some(components.get(index)?.size)), most.map(Some));
        if u.arbitrary()? && !components.is_empty() {
            let kept = components.keep(|component| Some(component.size) == most);
            let largest =
                |point| components.label(point).and_then(|index| components.get(index)).map(|c| c.size) == most;
            self.plain = Plain::new(self.plain.size, largest);
            self.grid = kept;
        }
        Ok(())
    }

    fn cut(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let (min, size) = (offset(u)?, [u.int_in_range(0..=140)?, u.int_in_range(1..=4)?, u.int_in_range(1..=4)?]);
        let region = Region::new(min, std::array::from_fn(|axis| min[axis].saturating_add(size[axis])));
        let cut = self.grid.cut(region);
        if region.is_empty() {
            assert_eq!(cut.err(), Some(BitsError::RegionSize { region }));
            return Ok(());
        }
        self.grid = cut.expect("it is small");
        self.plain = Plain::new(region.size(), |point| {
            self.plain.get(std::array::from_fn(|axis| i64::from(point[axis]) + i64::from(min[axis])))
        });
        Ok(())
    }

    fn paste(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        if u.arbitrary()? {
            let offset = offset(u)?;
            self.grid.paste(&other.grid, offset);
            self.plain = Plain::new(self.plain.size, |point| {
                let place = std::array::from_fn(|axis| i64::from(point[axis]) - i64::from(offset[axis]));
                if other.plain.holds(place) { other.plain.get(place) } else { self.plain.get(point.map(i64::from)) }
            });
        } else {
            let (region, value) = (Region::new(offset(u)?, offset(u)?), u.arbitrary()?);
            self.grid.fill(region, value);
            self.plain = Plain::new(self.plain.size, |point| {
                if region.contains(point.map(|v| v as i32)) { value } else { self.plain.get(point.map(i64::from)) }
            });
        }
        Ok(())
    }

    fn overlap(&mut self, other: &Self, u: &mut Unstructured<'_>) -> Result<()> {
        let set = self.plain.set();
        let region = Region::new(offset(u)?, offset(u)?);
        let inside = set.iter().filter(|point| region.contains(point.map(|v| v as i32))).count();
        assert_eq!(self.grid.count_in(region), inside);
        assert_eq!(self.grid.overlaps_region(region), inside > 0);
        let volume: u128 = region.size().iter().map(|&size| u128::from(size)).product();
        assert_eq!(self.grid.covers_region(region), inside as u128 == volume);

        let offset = offset(u)?;
        let lies = |point: &[u32; 3]| std::array::from_fn(|axis| i64::from(point[axis]) + i64::from(offset[axis]));
        let expected = other.plain.set().iter().any(|point| self.plain.get(lies(point)));
        assert_eq!(self.grid.overlaps(&other.grid, offset), expected);

        // Quarters, whose squares `f64` holds.
        let (centre, radius) = (
            [u.int_in_range(-20..=600)?, u.int_in_range(-20..=600)?, u.int_in_range(-20..=600)?],
            u.int_in_range(-1..=300)?,
        );
        let quarters = |v: i32| v as f32 / 4.0;
        let distance =
            |point: &[u32; 3]| (0..3).map(|axis| (4 * point[axis] as i32 - centre[axis]).pow(2)).sum::<i32>();
        let expected = radius >= 0 && set.iter().any(|point| distance(point) <= radius * radius);
        assert_eq!(self.grid.overlaps_ball(centre.map(quarters), quarters(radius)), expected);
        // Any numbers at all: an answer, soon.
        let any = u.arbitrary::<[u32; 4]>()?.map(f32::from_bits);
        let _ = self.grid.overlaps_ball([any[0], any[1], any[2]], any[3]);
        Ok(())
    }

    fn case_masks(&self) {
        let [nx, ny, nz] = self.plain.size;
        let case = |[x, y, z]: [u32; 3]| {
            (0..8u32).fold(0u8, |case, corner| {
                let at = [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)];
                case | u8::from(self.plain.get(at.map(i64::from))) << corner
            })
        };
        match self.grid.case_masks() {
            Ok(masks) => {
                let cells =
                    (0..nz - 1).flat_map(|z| (0..ny - 1).flat_map(move |y| (0..nx - 1).map(move |x| [x, y, z])));
                assert!(masks.iter().copied().eq(cells.map(case)));
            }
            Err(error) => assert!(matches!(error, BitsError::TooSmall { .. }) && nx.min(ny).min(nz) < 2),
        }
        let tiles = TileGrid::from_bits(&self.grid).expect("it is small");
        assert!(tiles.to_bits().is_ok_and(|bits| bits == self.grid));
        let masks = tiles.case_masks([0; 3]).expect("there is a tile");
        let cells = (0..8).flat_map(|z| (0..8).flat_map(move |y| (0..8).map(move |x| [x, y, z])));
        assert!(masks.iter().copied().eq(cells.map(case)));
    }
}

/// A few points this way or that, or any number of them.
fn offset(u: &mut Unstructured<'_>) -> Result<[i32; 3]> {
    let far = u.ratio(1, 8)?;
    let mut component = || if far { u.arbitrary() } else { u.int_in_range(-6..=6) };
    let mut offset = [component()?, component()?, component()?];
    if !far {
        // Along one axis as far as the longest grid reaches.
        offset[u.int_in_range(0..=2)?] = u.int_in_range(-140..=140)?;
    }
    Ok(offset)
}
