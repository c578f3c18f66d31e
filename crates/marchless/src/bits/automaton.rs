//! One step of a cellular automaton.
//!
//! The neighbours of all points of a word are counted at once, bit by bit of the count: three slabs are added to
//! numbers of two bits, three of those along x to numbers of four, and three rows of those to numbers of five, the
//! point itself included. What the rule makes of such a number and of the point is a function of six bits: a decision
//! diagram, of which every node chooses between two earlier ones, a word at a time.

use alloc::{vec, vec::Vec};
use core::ops::Range;

use super::{BitGrid, BitsError, Connectivity, pattern::Pattern};
use crate::simd::{Backend, Job, Simd, dispatch_words};

/// When points of a cellular automaton are born and when they survive.
///
/// ```
/// use marchless::{Shape, bits::{BitGrid, Rule}};
///
/// // Caves: noise, in which every point follows most of its neighbours.
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
    /// A bit for each count of neighbours.
    birth: u32,
    survival: u32,
    outside: bool,
    connectivity: Connectivity,
}

impl Rule {
    /// A rule by which a point that is not set becomes so where it has one of the counts `birth` of set neighbours, and
    /// one that is set stays so where it has one of the counts `survival`; in any order. All 26 neighbours count, and
    /// points outside the grid are not set.
    ///
    /// # Errors
    /// [`BitsError::NeighbourCount`] where a count is above 26.
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

    /// Whether points outside the grid count as set.
    #[must_use]
    pub const fn with_outside(self, outside: bool) -> Self {
        Self { outside, ..self }
    }

    /// Which neighbours count.
    #[must_use]
    pub const fn with_connectivity(self, connectivity: Connectivity) -> Self {
        Self { connectivity, ..self }
    }
}

impl BitGrid {
    /// The grid one step of `rule` later.
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

/// Words that are counted and decided together.
const BLOCK: usize = 32;

/// How many points are set around each point of a slab, the bits of a number each in their own plane.
struct Sums {
    connectivity: Connectivity,
    row: usize,
    ends: Ends,
    outside: u64,
    /// The slab itself, and the sums of it and the slabs below and above: numbers of two bits. With one more word on
    /// either side.
    here: Vec<u64>,
    along_z: [Vec<u64>; 2],
    /// The points around a point in its own row, and in the rows beside it, all three slabs together. With a row more
    /// on either side, and up to a multiple of [`BLOCK`].
    centre: [Vec<u64>; 4],
    sides: [Vec<u64>; 4],
}

impl Sums {
    #[inline(always)]
    fn new(grid: &BitGrid, rule: &Rule) -> Self {
        let (row, rows) = (grid.row, grid.shape.size()[1] as usize);
        let padded = || vec![0; row * rows + 2 + BLOCK];
        // What there is in the row beside one at the border: it is filled once, and never written to again.
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

    /// Adds up along z and x.
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
        // The points themselves, for the decision.
        if self.connectivity == Connectivity::TwentySix {
            self.here[1..=slab].copy_from_slice(here);
        }
    }

    /// The bits of the counts of a block, the point itself included, and those of the points.
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

/// A block of all planes.
#[inline(always)]
fn blocks([a, b, c, d]: &[Vec<u64>; 4], at: usize) -> [&[u64; BLOCK]; 4] {
    [block(a, at), block(b, at), block(c, at), block(d, at)]
}

#[inline(always)]
fn block(plane: &[u64], at: usize) -> &[u64; BLOCK] {
    plane[at..].first_chunk().expect("planes go on for a block behind their last row")
}

/// One range of words of each of the four planes.
#[inline(always)]
fn parts(planes: &mut [Vec<u64>; 4], words: Range<usize>) -> [&mut [u64]; 4] {
    let [a, b, c, d] = planes;
    [&mut a[words.clone()], &mut b[words.clone()], &mut c[words.clone()], &mut d[words]]
}

/// The points beside those of a word, at −x and at +x, of the word before it, itself and the word behind it.
#[inline(always)]
const fn beside([low, here, high]: [u64; 3]) -> [u64; 2] {
    [here << 1 | low >> 63, here >> 1 | high << 63]
}

/// Which points have a neighbour at −x and at +x in the same row, for each word of a row.
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

/// Adds three bits: the sum's low bit and its high one.
#[inline(always)]
const fn full([a, b, c]: [u64; 3]) -> [u64; 2] {
    [a ^ b ^ c, a & b | c & (a ^ b)]
}

/// The sums of three numbers of two bits along x. Numbers have a word more on either side, whatever it is.
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

/// The sums of a number of two bits and the points beside it along x. Numbers and points have a word more on either
/// side, whatever it is.
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

/// Values that a diagram knows at most: none, all, and at most 1 + 2 + 4 + 8 + 12 + 2 functions of the six bits.
const MAX_VALUES: usize = 32;

/// A function of six bits, as a reduced ordered binary decision diagram (Bryant 1986).
struct Diagram {
    choices: [Choice; MAX_VALUES],
    len: usize,
    /// Which value is the function's.
    result: usize,
}

/// A value made of two earlier ones.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// The function as a table of `2^(bit + 1)` entries.
    table: u64,
    bit: usize,
    zero: usize,
    one: usize,
}

impl Diagram {
    /// What `rule` makes of a count that includes the point itself, in bits 0–4, and of the point, bit 5.
    fn new(rule: &Rule) -> Self {
        let entry = |index: u32| {
            // Counts that cannot be are taken for others, so that fewer choices remain.
            let count = if index & 31 > 27 { index & 27 } else { index & 31 };
            let (counts, count) =
                if index < 32 { (rule.birth, count.min(26)) } else { (rule.survival, count.saturating_sub(1)) };
            u64::from(counts >> count & 1) << index
        };
        let mut diagram = Self { choices: [Choice::default(); MAX_VALUES], len: 2, result: 0 };
        diagram.result = diagram.value((0..64).map(entry).sum(), 6);
        diagram
    }

    /// The value of a table of `2^bits` entries.
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

    /// The function of a block of bits. The first of `values` is zero, the second all ones; the others are overwritten.
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
