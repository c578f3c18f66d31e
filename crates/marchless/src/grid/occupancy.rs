//! [`Occupancy`]: the set of chunk positions that hold a chunk, as a pyramid of bit masks.
//!
//! A box of level `k` holds 8^k chunk positions per axis. Its mask tells which of its 8 × 8 × 8 boxes of level `k − 1`
//! hold a chunk. The boxes of level 0 are the chunk positions. Only boxes that hold a chunk are kept, so a search skips
//! empty space of any size in a few steps.

use alloc::collections::{BTreeMap, btree_map::Entry};
use core::array::from_fn;

use crate::lattice::Region;

/// The level of the one box that holds all chunk positions of all grids: 2³⁰ per axis.
pub(crate) const TOP: usize = 10;
/// The offset that makes every chunk position non-negative when added to it. It is octal, one digit a level. Since all
/// digits are 4, the position 0 lies in the middle of its box on each level, not at the corner of eight boxes.
pub(crate) const OFFSET: i32 = 0o4_444_444_444;

/// A set of boxes out of 8 × 8 × 8: one word per z, bit `x + 8·y`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mask([u64; 8]);

impl Mask {
    /// The word and the bit of a box. Only the lowest three bits per axis of its index count.
    const fn place([x, y, z]: [i32; 3]) -> (usize, u64) {
        ((z & 7) as usize, 1 << ((x & 7) | (y & 7) << 3))
    }

    pub(crate) const fn contains(&self, index: [i32; 3]) -> bool {
        let (word, bit) = Self::place(index);
        self.0[word] & bit != 0
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0 == [0; 8]
    }

    /// The lowest box in the set, and true if it is the only one; `None` if the set is empty.
    fn first(&self) -> Option<([i32; 3], bool)> {
        let z = self.0.iter().position(|&word| word != 0)?;
        let bit = self.0[z].trailing_zeros() as i32;
        let is_only = self.0.iter().map(|word| word.count_ones()).sum::<u32>() == 1;
        Some(([bit & 7, bit >> 3, z as i32], is_only))
    }

    /// The boxes of the set from `low` to `high`, both included; each is 0 to 7 per axis.
    fn within(mut self, low: [i32; 3], high: [i32; 3]) -> Self {
        // `layer` has the bits from `low[0]` to `high[0]`, in the rows from `low[1]` to `high[1]`.
        let row = (0xff << low[0]) & (0xff >> (7 - high[0])) & 0xff;
        let rows = (u64::MAX << (8 * low[1])) & (u64::MAX >> (8 * (7 - high[1])));
        let layer = (row * 0x0101_0101_0101_0101) & rows;
        for (z, word) in (0..).zip(&mut self.0) {
            *word &= if (low[2]..=high[2]).contains(&z) { layer } else { 0 };
        }
        self
    }

    /// The set without its lowest box.
    fn without_first(mut self) -> Self {
        if let Some(word) = self.0.iter_mut().find(|word| **word != 0) {
            *word &= *word - 1;
        }
        self
    }
}

/// A set of chunk positions that a grid may have.
#[derive(Clone, Debug, Default)]
pub(crate) struct Occupancy {
    /// The boxes of level 1 up to [`TOP`], by their index.
    levels: [BTreeMap<[i32; 3], Mask>; TOP],
}

impl Occupancy {
    /// Adds a position.
    pub(super) fn insert(&mut self, position: [i32; 3]) {
        let mut index = position.map(|v| v + OFFSET);
        for level in &mut self.levels {
            let (word, bit) = Mask::place(index);
            index = index.map(|v| v >> 3);
            let mask = level.entry(index).or_default();
            let was_empty = mask.is_empty();
            mask.0[word] |= bit;
            if !was_empty {
                break;
            }
        }
    }

    /// Removes a position.
    pub(super) fn remove(&mut self, position: [i32; 3]) {
        let mut index = position.map(|v| v + OFFSET);
        for level in &mut self.levels {
            let (word, bit) = Mask::place(index);
            index = index.map(|v| v >> 3);
            let Entry::Occupied(mut entry) = level.entry(index) else { break };
            entry.get_mut().0[word] &= !bit;
            if !entry.get().is_empty() {
                break;
            }
            entry.remove();
        }
    }

    /// The mask of a box; `None` if it is empty. `level`: 1 to [`TOP`].
    fn mask(&self, level: usize, index: [i32; 3]) -> Option<&Mask> {
        self.levels[level - 1].get(&index)
    }

    /// The smallest box that holds all positions: its level, 1 to [`TOP`], and its index. `None` if the set is empty.
    pub(crate) fn root(&self) -> Option<(usize, [i32; 3])> {
        let (mut level, mut index) = (TOP, [0; 3]);
        loop {
            let (place, is_only) = self.mask(level, index)?.first()?;
            if level == 1 || !is_only {
                return Some((level, index));
            }
            (level, index) = (level - 1, from_fn(|axis| index[axis] << 3 | place[axis]));
        }
    }

    /// The boxes one level below a box from which a step of 0 or 1 per axis leads to a box that holds a position. At
    /// level 1, these are the chunk positions whose meshes read the samples of a chunk for more than normals.
    pub(crate) fn drawn(&self, level: usize, index: [i32; 3]) -> Mask {
        // The masks of the box and its neighbours on the high sides: bit 0 of `side` is x, bit 1 y, bit 2 z.
        let around: [Mask; 8] = from_fn(|side| {
            let neighbour = from_fn(|axis| index[axis] + (side as i32 >> axis & 1));
            self.mask(level, neighbour).copied().unwrap_or_default()
        });
        // Along x, y and then z, each bit is joined with that of its neighbour on the high side.
        const LAST_COLUMN: u64 = 0x8080_8080_8080_8080;
        let row = |low: u64, high: u64| low | (low >> 1 & !LAST_COLUMN) | (high << 7 & LAST_COLUMN);
        let layer = |z: usize, side: usize| {
            let [low, high] = [0, 2].map(|y| row(around[side | y].0[z], around[side | y | 1].0[z]));
            low | low >> 8 | high << 56
        };
        let mut above = layer(0, 4);
        let mut drawn = Mask::default();
        for z in (0..8).rev() {
            let this = layer(z, 0);
            drawn.0[z] = this | above;
            above = this;
        }
        drawn
    }

    /// The positions within `region`, in the order of a descent box by box.
    pub(super) fn positions_in(&self, region: Region) -> PositionsIn<'_> {
        let end = (1i64 << (3 * TOP)) - 1;
        let index = |v: i32, less: i64| (i64::from(v) + i64::from(OFFSET) - less).clamp(0, end) as i32;
        let mut positions = PositionsIn {
            occupancy: self,
            low: region.min.map(|v| index(v, 0)),
            high: region.max.map(|v| index(v, 1)),
            level: TOP,
            open: [([0; 3], Mask::default()); TOP],
        };
        // Clamping turns a region beyond all grids into an outermost layer, which holds nothing either.
        if !region.is_empty() {
            positions.open(TOP, [0; 3]);
        }
        positions
    }
}

/// An iterator over positions that descends from box to box.
#[derive(Clone, Debug)]
pub(super) struct PositionsIn<'a> {
    occupancy: &'a Occupancy,
    /// The lowest and the highest position, both included, with [`OFFSET`] added.
    low: [i32; 3],
    high: [i32; 3],
    /// The level of the current box.
    level: usize,
    /// The current box of each level from 1 on: its index, and the boxes within that are still to be visited.
    open: [([i32; 3], Mask); TOP],
}

impl PositionsIn<'_> {
    /// Makes a box the current one, unless it is empty.
    fn open(&mut self, level: usize, index: [i32; 3]) {
        let Some(mask) = self.occupancy.mask(level, index) else { return };
        // The range of its boxes that the region intersects.
        let place = |axis: usize, bound: i32| ((bound >> (3 * (level - 1))) - (index[axis] << 3)).clamp(0, 7);
        let (low, high) = (from_fn(|axis| place(axis, self.low[axis])), from_fn(|axis| place(axis, self.high[axis])));
        self.level = level;
        self.open[level - 1] = (index, mask.within(low, high));
    }
}

impl Iterator for PositionsIn<'_> {
    type Item = [i32; 3];

    fn next(&mut self) -> Option<[i32; 3]> {
        while self.level <= TOP {
            let (index, left) = &mut self.open[self.level - 1];
            let Some((place, _)) = left.first() else {
                self.level += 1;
                continue;
            };
            *left = left.without_first();
            let below: [i32; 3] = from_fn(|axis| index[axis] << 3 | place[axis]);
            if self.level == 1 {
                return Some(below.map(|v| v - OFFSET));
            }
            self.open(self.level - 1, below);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use alloc::{collections::BTreeSet, vec::Vec};

    use proptest::prelude::*;

    use super::*;
    use crate::grid::Grid;

    const LIMITS: Region = Region::new([-0x1000_0000; 3], [0x1000_0000; 3]);

    fn coordinate() -> impl Strategy<Value = i32> {
        let end = LIMITS.max[0] - 1;
        prop_oneof![3 => -12..12i32, 1 => -end - 1..=end, 1 => (-3..=0i32).prop_map(move |v| end + v), 1 => Just(-end - 1)]
    }

    fn position() -> impl Strategy<Value = [i32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    /// A set after inserting positions and removing some of them, and a plain set of the same positions.
    fn sets() -> impl Strategy<Value = (Occupancy, BTreeSet<[i32; 3]>)> {
        let changes = proptest::collection::vec((position(), any::<prop::sample::Index>(), any::<bool>()), 0..80);
        changes.prop_map(|changes| {
            let (mut occupancy, mut oracle) = (Occupancy::default(), BTreeSet::new());
            for (position, index, removes) in changes {
                occupancy.insert(position);
                oracle.insert(position);
                if removes {
                    let old = *oracle.iter().nth(index.index(oracle.len())).unwrap();
                    occupancy.remove(old);
                    oracle.remove(&old);
                    occupancy.remove(old);
                }
            }
            (occupancy, oracle)
        })
    }

    #[test]
    fn all_grids_fit() {
        for cells in [8, 62] {
            let largest = Grid::<i16>::largest(cells);
            assert_eq!(LIMITS.intersection(&largest), largest);
        }
        for position in [LIMITS.min, LIMITS.max] {
            assert!(position.iter().all(|&v| (0..1 << (3 * TOP)).contains(&(i64::from(v) + i64::from(OFFSET)))));
        }
    }

    proptest! {
        #[test]
        fn regions_hold_the_positions_of_a_plain_set(
            (occupancy, oracle) in sets(),
            regions in proptest::collection::vec((position(), position()), 8),
        ) {
            let everything = Region::new([i32::MIN; 3], [i32::MAX; 3]);
            let beyond = Region::new([i32::MIN; 3], [i32::MIN + 5, i32::MAX, i32::MAX]);
            let random = regions.into_iter().map(|(a, b)| Region::new(a, b));
            let sorted = random.clone().map(|region| Region::new(
                from_fn(|axis| region.min[axis].min(region.max[axis])),
                from_fn(|axis| region.min[axis].max(region.max[axis])),
            ));
            for region in random.chain(sorted).chain([everything, beyond]) {
                let found: Vec<_> = occupancy.positions_in(region).collect();
                let expected: BTreeSet<_> = oracle.iter().copied().filter(|&p| region.contains(p)).collect();
                prop_assert_eq!(found.len(), expected.len());
                prop_assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), expected);
            }
        }

        #[test]
        fn removed_positions_leave_no_boxes((mut occupancy, oracle) in sets()) {
            for (level, boxes) in occupancy.levels.iter().enumerate() {
                let shift = 3 * (level + 1);
                let expected: BTreeSet<_> = oracle.iter().map(|p| p.map(|v| (v + OFFSET) >> shift)).collect();
                prop_assert!(boxes.keys().eq(&expected));
            }
            for position in oracle {
                occupancy.remove(position);
            }
            prop_assert!(occupancy.levels.iter().all(BTreeMap::is_empty) && occupancy.root().is_none());
        }

        #[test]
        fn the_root_is_the_smallest_box_of_all((occupancy, oracle) in sets()) {
            let holds = |level: usize| oracle.iter().map(|p| p.map(|v| (v + OFFSET) >> (3 * level))).collect::<BTreeSet<_>>();
            let expected = (1..=TOP).find(|&level| holds(level).len() == 1).map(|level| (level, *holds(level).first().unwrap()));
            prop_assert_eq!(occupancy.root(), expected);
        }

        #[test]
        fn drawn_boxes_are_one_step_below_occupied_boxes((occupancy, oracle) in sets(), level in 1..=TOP) {
            let below = |p: &[i32; 3]| p.map(|v| (v + OFFSET) >> (3 * (level - 1)));
            let occupied: BTreeSet<_> = oracle.iter().map(below).collect();
            let boxes: BTreeSet<_> = occupied.iter().map(|p| p.map(|v| v >> 3)).collect();
            for index in boxes.iter().flat_map(|p| Region::new(*p, *p).grown(1, 1).points()) {
                let mask = occupancy.drawn(level, index);
                for place in Region::new([0; 3], [8; 3]).points() {
                    let child: [i32; 3] = from_fn(|axis| 8 * index[axis] + place[axis]);
                    let expected = Region::new(child, child).grown(0, 2).points().any(|p| occupied.contains(&p));
                    prop_assert_eq!(mask.contains(child), expected, "at {:?} of level {}", child, level);
                }
            }
        }
    }
}
