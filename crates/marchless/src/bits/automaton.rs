//! One step of a cellular automaton.
//!
//! Neighbours are counted for all 64 points of a word at once. Each bit of the counts has words of its own, which this
//! file calls a plane. A count includes the point itself:
//!
//! 1. Along z: three slabs add up to numbers of two bits.
//! 2. Along x: three of these add up to numbers of four bits.
//! 3. Along y: three of these add up to numbers of five bits.
//!
//! The rule is then a function of six bits, the count's five and the point's own. It is evaluated as a decision
//! diagram, a word at a time: each node chooses between two earlier nodes by one of the six bits.

use alloc::{vec, vec::Vec};
use core::ops::Range;

use super::{BitGrid, BitsError, Connectivity, pattern::Pattern};
use crate::simd::{Backend, Job, Simd, dispatch_words};

/// The rule of a cellular automaton: which points are born, and which survive.
///
/// ```
/// use marchless::{Shape, bits::{BitGrid, Rule}};
///
/// // Caves from noise: every point follows the majority of its neighbours.
/// let mut noise = 1u32;
/// let mut caves = BitGrid::from_fn(Shape::cube(64)?, |_| {
///     noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     noise >> 16 & 1 == 1
/// })?;
/// let rule = Rule::new(&Vec::from_iter(14..=26), &Vec::from_iter(13..=26))?.with_outside(true);
/// for _ in 0..5 {
///     caves = caves.stepped(&rule);
/// }
/// assert!(!caves.is_empty() && caves.count() < 64 * 64 * 64);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rule {
    /// Bit `n`: points with `n` set neighbours are born.
    birth: u32,
    /// Bit `n`: points with `n` set neighbours survive.
    survival: u32,
    /// Points outside the grid count as set.
    outside: bool,
    connectivity: Connectivity,
}

impl Rule {
    /// A rule with these counts of set neighbours, in any order: an unset point becomes set if its count is in `birth`;
    /// a set point stays set if its count is in `survival`.
    ///
    /// All 26 neighbours count, and points outside the grid are not set; [`with_connectivity`](Self::with_connectivity)
    /// and [`with_outside`](Self::with_outside) change that.
    ///
    /// # Errors
    /// [`BitsError::NeighbourCount`] if a count is above 26.
    pub fn new(birth: &[u8], survival: &[u8]) -> Result<Self, BitsError> {
        let bits = |counts: &[u8]| {
            counts.iter().try_fold(0, |bits, &count| match count {
                0..=26 => Ok(bits | 1 << count),
                _ => Err(BitsError::NeighbourCount { count }),
            })
        };
        let (birth, survival) = (bits(birth)?, bits(survival)?);
        Ok(Self { birth, survival, outside: false, connectivity: Connectivity::TwentySix })
    }

    /// The same rule with points outside the grid counted as set, or as not set.
    #[must_use]
    pub const fn with_outside(self, outside: bool) -> Self {
        Self { outside, ..self }
    }

    /// The same rule with other neighbours counted.
    #[must_use]
    pub const fn with_connectivity(self, connectivity: Connectivity) -> Self {
        Self { connectivity, ..self }
    }
}

impl BitGrid {
    /// The grid after one step of `rule`.
    #[must_use]
    pub fn stepped(&self, rule: &Rule) -> Self {
        let mut out = self.zeros();
        dispatch_words(Backend::fastest(), Step { from: self, rule, out: &mut out });
        out
    }

    /// [`stepped`](Self::stepped) into an existing grid.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `out` has another shape; it is then unchanged.
    pub fn step_into(&self, rule: &Rule, out: &mut Self) -> Result<(), BitsError> {
        self.same_shape(out)?;
        dispatch_words(Backend::fastest(), Step { from: self, rule, out });
        Ok(())
    }
}

/// One step of a rule, from one grid into another.
struct Step<'a> {
    from: &'a BitGrid,
    rule: &'a Rule,
    out: &'a mut BitGrid,
}

impl Job for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { from, rule, out } = self;
        let row = from.row;
        let slab = row * from.shape.size()[1] as usize;
        let outside = if rule.outside { u64::MAX } else { 0 };
        let beyond = vec![outside; slab];
        let mut sums = Sums::new(from, rule);
        let diagram = Diagram::new(rule);
        let mut values = [[0; BLOCK]; MAX_VALUES];
        values[1] = [u64::MAX; BLOCK];

        let slabs = from.words.chunks_exact(slab);
        let below = [&beyond[..]].into_iter().chain(slabs.clone());
        let above = slabs.clone().skip(1).chain([&beyond[..]]);
        for (((out, here), below), above) in out.words.chunks_exact_mut(slab).zip(slabs).zip(below).zip(above) {
            sums.add([below, here, above]);
            for (index, out) in out.chunks_mut(BLOCK).enumerate() {
                let bits = sums.counts(BLOCK * index);
                let decided = diagram.decide(&bits, &mut values);
                out.copy_from_slice(&decided[..out.len()]);
            }
        }
        out.clear_unused();
    }
}

/// The number of words that are counted and decided together.
const BLOCK: usize = 32;

/// The counts of set points around each point of a slab, with one plane for each bit of a count.
struct Sums {
    connectivity: Connectivity,
    /// Words per row.
    row: usize,
    ends: Ends,
    /// A word of points outside the grid.
    outside: u64,
    /// The slab itself, with one extra word before it and more after it.
    here: Vec<u64>,
    /// The sums of the slab and the slabs below and above: numbers of two bits. Laid out like `here`.
    along_z: [Vec<u64>; 2],
    /// What each row adds to its own counts, over all three slabs. An extra row lies on either side, then [`BLOCK`]
    /// words more. Unused for 26 neighbours, where it would equal `sides`.
    centre: [Vec<u64>; 4],
    /// What each row adds to the counts of the rows beside it, over all three slabs. Laid out like `centre`.
    sides: [Vec<u64>; 4],
}

impl Sums {
    #[inline(always)]
    fn new(grid: &BitGrid, rule: &Rule) -> Self {
        let (row, rows) = (grid.row, grid.shape.size()[1] as usize);
        let padded = || vec![0; row * rows + 2 + BLOCK];
        // What a row outside the grid adds to the row beside it if points there are set. The extra rows are filled with
        // it here, and nothing overwrites them.
        let in_row_outside: u32 = match rule.connectivity {
            Connectivity::Six => 1,
            Connectivity::Eighteen => 5,
            Connectivity::TwentySix => 9,
        };
        let sides = [0, 1, 2, 3].map(|bit| {
            let mut plane = vec![0; row * (rows + 2) + BLOCK];
            if rule.outside && in_row_outside >> bit & 1 == 1 {
                plane[..row].fill(u64::MAX);
                plane[row * (rows + 1)..][..row].fill(u64::MAX);
            }
            plane
        });
        Self {
            connectivity: rule.connectivity,
            row,
            ends: Ends::new(grid),
            outside: if rule.outside { u64::MAX } else { 0 },
            here: padded(),
            along_z: [(); 2].map(|()| padded()),
            centre: [(); 4].map(|()| vec![0; row * (rows + 2) + BLOCK]),
            sides,
        }
    }

    /// Adds up a slab's points along z, then along x.
    #[inline(always)]
    fn add(&mut self, [below, here, above]: [&[u64]; 3]) {
        let slab = here.len();
        let [low, high] = &mut self.along_z;
        let sums = low[1..].iter_mut().zip(&mut high[1..]);
        for ((((low, high), &below), &here), &above) in sums.zip(below).zip(here).zip(above) {
            [*low, *high] = full([below, here, above]);
        }
        let (ends, outside) = (&self.ends, self.outside);
        let [low, high] = &self.along_z;
        let rows = self.row..self.row + slab;
        match self.connectivity {
            Connectivity::TwentySix => square(low, high, ends, outside, parts(&mut self.sides, rows)),
            Connectivity::Eighteen => {
                square(low, high, ends, outside, parts(&mut self.centre, rows.clone()));
                self.here[1..=slab].copy_from_slice(here);
                let [a, b, c, _] = parts(&mut self.sides, rows);
                cross(low, high, &self.here, ends, outside, [a, b, c]);
            }
            Connectivity::Six => {
                self.here[1..=slab].copy_from_slice(here);
                let [a, b, c, _] = parts(&mut self.centre, rows.clone());
                cross(low, high, &self.here, ends, outside, [a, b, c]);
                self.sides[0][rows].copy_from_slice(here);
            }
        }
        // The decision needs the points themselves.
        if self.connectivity == Connectivity::TwentySix {
            self.here[1..=slab].copy_from_slice(here);
        }
    }

    /// The six bits that decide a block's points: five of the count, which includes the point itself, and the point's
    /// own.
    #[inline(always)]
    fn counts(&self, at: usize) -> [[u64; BLOCK]; 6] {
        let centre = if self.connectivity == Connectivity::TwentySix { &self.sides } else { &self.centre };
        let (centre, below) = (blocks(centre, at + self.row), blocks(&self.sides, at));
        let above = blocks(&self.sides, at + 2 * self.row);
        let mut bits = [[0; BLOCK]; 6];
        for k in 0..BLOCK {
            let three = |bit: usize| full([below[bit][k], centre[bit][k], above[bit][k]]);
            let (a, b, c, d) = (three(0), three(1), three(2), three(3));
            let (second, carry) = (b[0] ^ a[1], b[0] & a[1]);
            let [third, carry] = full([c[0], b[1], carry]);
            let [fourth, carry] = full([d[0], c[1], carry]);
            (bits[0][k], bits[1][k], bits[2][k], bits[3][k], bits[4][k]) = (a[0], second, third, fourth, d[1] | carry);
        }
        bits[5] = *block(&self.here, at + 1);
        bits
    }
}

/// One block of each of the four planes.
#[inline(always)]
fn blocks([a, b, c, d]: &[Vec<u64>; 4], at: usize) -> [&[u64; BLOCK]; 4] {
    [block(a, at), block(b, at), block(c, at), block(d, at)]
}

/// The block of a plane that starts with word `at`.
#[inline(always)]
fn block(plane: &[u64], at: usize) -> &[u64; BLOCK] {
    plane[at..].first_chunk().expect("planes have a block of words after their last row")
}

/// One range of words of each of the four planes.
#[inline(always)]
fn parts(planes: &mut [Vec<u64>; 4], words: Range<usize>) -> [&mut [u64]; 4] {
    let [a, b, c, d] = planes;
    [&mut a[words.clone()], &mut b[words.clone()], &mut c[words.clone()], &mut d[words]]
}

/// The neighbours at −x and at +x of a word's points, from the word before it, the word itself and the word after it.
#[inline(always)]
const fn beside([low, here, high]: [u64; 3]) -> [u64; 2] {
    [here << 1 | low >> 63, here >> 1 | high << 63]
}

/// Masks of the points that have a neighbour in their row, at −x and at +x, for each word of a row.
struct Ends {
    from_low: Pattern,
    from_high: Pattern,
}

impl Ends {
    #[inline(always)]
    fn new(grid: &BitGrid) -> Self {
        let (row, rows, last) = (grid.row, grid.shape.size()[1] as usize, grid.last_word());
        let valid = move |column: usize| if column == row - 1 { last } else { u64::MAX };
        Self {
            from_low: Pattern::new(row, rows, 0, |column| valid(column) & if column == 0 { !1 } else { u64::MAX }),
            from_high: Pattern::new(row, rows, 0, |column| if column == row - 1 { last >> 1 } else { u64::MAX }),
        }
    }
}

/// Adds three bits. Returns the low and the high bit of the sum.
#[inline(always)]
const fn full([a, b, c]: [u64; 3]) -> [u64; 2] {
    [a ^ b ^ c, a & b | c & (a ^ b)]
}

/// Adds up, along x, the numbers of two bits of each point and its two neighbours. `low` and `high` have one more word
/// on either side, with any content.
#[inline(always)]
fn square(low: &[u64], high: &[u64], ends: &Ends, outside: u64, out: [&mut [u64]; 4]) {
    let (from_low, from_high) = (ends.from_low.words(), ends.from_high.words());
    let (len, end) = (from_low.len(), out[0].len());
    let [a, b, c, d] = out;
    for at in (0..end).step_by(len) {
        let count = len.min(end - at);
        let (low, high) = (&low[at..at + count + 2], &high[at..at + count + 2]);
        let (a, b, c, d) = (&mut a[at..][..count], &mut b[at..][..count], &mut c[at..][..count], &mut d[at..][..count]);
        let (from_low, from_high) = (&from_low[..count], &from_high[..count]);
        for k in 0..count {
            let three = |plane: &[u64]| {
                let [low, high] = beside([plane[k], plane[k + 1], plane[k + 2]]);
                [
                    low & from_low[k] | outside & !from_low[k],
                    plane[k + 1],
                    high & from_high[k] | outside & !from_high[k],
                ]
            };
            let [ones, carry] = full(three(low));
            let [twos, fours] = full(three(high));
            let (twos, carry) = (twos ^ carry, twos & carry);
            (a[k], b[k], c[k], d[k]) = (ones, twos, fours ^ carry, fours & carry);
        }
    }
}

/// Adds to each point's number of two bits the bits of its two neighbours along x. `low`, `high` and `here` have one
/// more word on either side, with any content.
#[inline(always)]
fn cross(low: &[u64], high: &[u64], here: &[u64], ends: &Ends, outside: u64, out: [&mut [u64]; 3]) {
    let (from_low, from_high) = (ends.from_low.words(), ends.from_high.words());
    let (len, end) = (from_low.len(), out[0].len());
    let [a, b, c] = out;
    for at in (0..end).step_by(len) {
        let count = len.min(end - at);
        let (low, high, here) = (&low[at + 1..][..count], &high[at + 1..][..count], &here[at..at + count + 2]);
        let (a, b, c) = (&mut a[at..][..count], &mut b[at..][..count], &mut c[at..][..count]);
        let (from_low, from_high) = (&from_low[..count], &from_high[..count]);
        for k in 0..count {
            let [left, right] = beside([here[k], here[k + 1], here[k + 2]]);
            let left = left & from_low[k] | outside & !from_low[k];
            let right = right & from_high[k] | outside & !from_high[k];
            let [ones, carry] = full([low[k], left, right]);
            (a[k], b[k], c[k]) = (ones, high[k] ^ carry, high[k] & carry);
        }
    }
}

/// The most values that a diagram can have: zeros, ones, and at most 1 + 2 + 4 + 8 + 12 + 2 functions of the six bits.
const MAX_VALUES: usize = 32;

/// A function of six bits, as a reduced ordered binary decision diagram (Bryant 1986).
struct Diagram {
    choices: [Choice; MAX_VALUES],
    /// The number of values, with zeros and ones.
    len: usize,
    /// The index of the whole function's value.
    result: usize,
}

/// A node of a diagram: a value that is chosen from two earlier ones by a bit.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// The function as a table of `2^(bit + 1)` entries.
    table: u64,
    bit: usize,
    /// The index of the value where the bit is zero.
    zero: usize,
    /// The index of the value where the bit is one.
    one: usize,
}

impl Diagram {
    /// The diagram of `rule`. Bits 0–4 of its input are a count that includes the point itself, bit 5 is the point.
    fn new(rule: &Rule) -> Self {
        let entry = |index: u32| {
            // Counts above 27 do not occur. They share the entries of lower counts, which makes the diagram smaller.
            let count = if index & 31 > 27 { index & 27 } else { index & 31 };
            let (counts, count) =
                if index < 32 { (rule.birth, count.min(26)) } else { (rule.survival, count.saturating_sub(1)) };
            u64::from(counts >> count & 1) << index
        };
        let mut diagram = Self { choices: [Choice::default(); MAX_VALUES], len: 2, result: 0 };
        diagram.result = diagram.value((0..64).map(entry).sum(), 6);
        diagram
    }

    /// The index of the value for a table of `2^bits` entries. Adds the nodes that are missing.
    fn value(&mut self, table: u64, bits: usize) -> usize {
        let all = u64::MAX >> (64 - (1 << bits));
        if table == 0 || table == all {
            return usize::from(table == all);
        }
        let (bit, half) = (bits - 1, 1 << (bits - 1));
        let (zero, one) = (table & u64::MAX >> (64 - half), table >> half);
        if zero == one {
            return self.value(zero, bit);
        }
        let known = self.choices[2..self.len].iter().position(|choice| (choice.table, choice.bit) == (table, bit));
        if let Some(known) = known {
            return known + 2;
        }
        let choice = Choice { table, bit, zero: self.value(zero, bit), one: self.value(one, bit) };
        self.choices[self.len] = choice;
        self.len += 1;
        self.len - 1
    }

    /// Evaluates the function for a block of bits. `values` starts with zeros and all ones; the rest is overwritten.
    #[inline(always)]
    fn decide<'a>(&self, bits: &[[u64; BLOCK]; 6], values: &'a mut [[u64; BLOCK]; MAX_VALUES]) -> &'a [u64; BLOCK] {
        for index in 2..self.len {
            let Choice { bit, zero, one, .. } = self.choices[index];
            let (earlier, later) = values.split_at_mut(index);
            let (bit, zero, one, value) = (&bits[bit], &earlier[zero], &earlier[one], &mut later[0]);
            for k in 0..BLOCK {
                value[k] = zero[k] ^ (zero[k] ^ one[k]) & bit[k];
            }
        }
        &values[self.result]
    }
}
