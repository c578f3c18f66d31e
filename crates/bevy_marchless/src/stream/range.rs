//! [`Range`]: the chunks within a distance, row by row.

use core::ops;

use marchless::Region;

/// Chunks: a box, or those that an ellipsoid reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    /// The middle, in chunks from the lattice's origin. For a box, half way between its corners.
    middle: [f64; 3],
    /// Half of its axes, in chunks.
    radii: [f64; 3],
    /// Whether it is a box instead of an ellipsoid.
    is_box: bool,
    /// What there is at all.
    extent: Region,
}

impl Range {
    /// The chunks of `extent` of which some point lies in the ellipsoid.
    pub(crate) fn ellipsoid(middle: [f64; 3], radii: [f64; 3], extent: Region) -> Self {
        Self { middle, radii, is_box: false, extent }
    }

    /// The chunks of `chunks` that lie in `extent`.
    pub(crate) fn of_box(chunks: Region, extent: Region) -> Self {
        let ends = |axis: usize| [f64::from(chunks.min[axis]), f64::from(chunks.max[axis])];
        let middle = [0, 1, 2].map(|axis| (ends(axis)[0] + ends(axis)[1]) / 2.0);
        // A little less than half, so that the chunks that only touch it are not in it.
        let radii = [0, 1, 2].map(|axis| (ends(axis)[1] - ends(axis)[0]) / 2.0 - 0.25);
        Self { middle, radii, is_box: true, extent: if chunks.is_empty() { chunks } else { extent } }
    }

    /// The range with every chunk at most `chunks` away from one of its own, per axis.
    ///
    /// That is exact for the ellipsoid, too: of a chunk's neighbours, the one that is nearest along each axis is a neighbour.
    #[must_use]
    pub(crate) fn grown(self, chunks: f64) -> Grown {
        Grown { range: self, by: chunks }
    }

    /// The same range, wider by so many chunks.
    #[must_use]
    pub(crate) fn widened(self, chunks: f64) -> Self {
        if self.is_box { self } else { Self { radii: self.radii.map(|radius| radius + chunks), ..self } }
    }

    /// Half of the longest axis, in chunks.
    pub(crate) fn longest(&self) -> f64 {
        self.radii.into_iter().fold(0.0, f64::max)
    }

    pub(crate) const fn middle(&self) -> [f64; 3] {
        self.middle
    }

    pub(crate) const fn extent(&self) -> Region {
        self.extent
    }

    /// How many chunks the box around it has, or a little more.
    pub(crate) fn box_size(&self) -> f64 {
        let size = self.extent.size();
        (0..3).map(|axis| (2.0 * self.radii[axis] + 2.0).min(f64::from(size[axis]))).product()
    }

    /// The same range, with its axes so many times as long.
    #[must_use]
    pub(crate) fn shrunk(self, factor: f64) -> Self {
        Self { radii: self.radii.map(|radius| radius * factor), ..self }
    }

    /// From the middle to a chunk's middle, in chunks.
    pub(crate) fn offset(&self, position: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(position[axis]) + 0.5 - self.middle[axis])
    }
}

/// A [`Range`] grown by some chunks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grown {
    range: Range,
    by: f64,
}

impl Grown {
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        let [x, y, z] = position;
        self.range.extent.contains(position) && self.row(y, z).contains(&x)
    }

    /// How many chunks there are.
    pub(crate) fn len(&self) -> u64 {
        self.table().rows().map(|(.., row)| row.len() as u64).sum()
    }

    /// Which chunks of a row belong to it.
    fn row(&self, y: i32, z: i32) -> ops::Range<i32> {
        let extent = &self.range.extent;
        let is_there = |axis: usize, position: i32| (extent.min[axis]..extent.max[axis]).contains(&position);
        if is_there(1, y) && is_there(2, z) { self.row_at(self.square(1, y), self.square(2, z)) } else { 0..0 }
    }

    /// The same, from the squares of how far the row lies along y and z.
    fn row_at(&self, y: f64, z: f64) -> ops::Range<i32> {
        let left = match self.range.is_box {
            true if y <= 1.0 && z <= 1.0 => 1.0,
            true => -1.0,
            false => 1.0 - y - z,
        };
        if left < 0.0 { 0..0 } else { self.reach(0, self.range.radii[0] * left.sqrt()) }
    }

    /// The square of how far the points of a chunk that are nearest to the middle lie from it along an axis, in radii.
    fn square(&self, axis: usize, position: i32) -> f64 {
        let low = f64::from(position) - self.by;
        let middle = self.range.middle[axis];
        let beyond = (middle.clamp(low, low + 1.0 + 2.0 * self.by) - middle) / self.range.radii[axis];
        beyond * beyond
    }

    /// Prepares for looking at all rows.
    fn table(&self) -> Table {
        let reach = |axis: usize| self.reach(axis, self.range.radii[axis]);
        let squares = |axis: usize| reach(axis).map(|position| self.square(axis, position)).collect();
        Table { grown: *self, from: [reach(1).start, reach(2).start], y: squares(1), z: squares(2) }
    }

    /// The positions along an axis of chunks that come as near as `radius` to the middle.
    fn reach(&self, axis: usize, radius: f64) -> ops::Range<i32> {
        let (middle, extent) = (self.range.middle[axis], &self.range.extent);
        let from = floor(-(middle - radius - 1.0 - self.by)).saturating_neg();
        let to = floor(middle + radius + self.by).saturating_add(1);
        let (from, to) = (from.max(extent.min[axis]), to.min(extent.max[axis]));
        from..to.max(from)
    }
}

/// A [`Grown`] with what all its rows have in common.
struct Table {
    grown: Grown,
    /// The first y and z.
    from: [i32; 2],
    /// The squares of each, from there on.
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Table {
    /// All chunks, row by row: y, z, and which x; some rows are empty.
    fn rows(&self) -> impl Iterator<Item = (i32, i32, ops::Range<i32>)> + '_ {
        let [first_y, first_z] = self.from;
        // Counted from 0: the last row may be the last that there is a number for.
        (0..).zip(&self.z).flat_map(move |(z, &z_square)| {
            let row = move |(y, &y_square)| (first_y + y, first_z + z, self.grown.row_at(y_square, z_square));
            (0..).zip(&self.y).map(row)
        })
    }

    /// Which chunks of a row belong to it.
    fn row(&self, y: i32, z: i32) -> ops::Range<i32> {
        let square =
            |squares: &[f64], from: i32, at: i32| squares.get(usize::try_from(at.checked_sub(from)?).ok()?).copied();
        match (square(&self.y, self.from[0], y), square(&self.z, self.from[1], z)) {
            (Some(y), Some(z)) => self.grown.row_at(y, z),
            _ => 0..0,
        }
    }
}

/// The greatest integer that is not greater, saturating. Without SSE4.1 [`f64::floor`] is a call, and ranges have many rows.
fn floor(value: f64) -> i32 {
    let towards_zero = value as i32;
    towards_zero.saturating_sub((f64::from(towards_zero) > value).into())
}

/// The ranges of a terrain, as the viewers' and what is kept ask for them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Ranges(pub(crate) Vec<Viewed>);

/// One range, in the steps that decide what becomes of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Viewed {
    pub(crate) range: Range,
    /// How many chunks farther away chunks stay.
    pub(crate) margin: f64,
    /// Within this range samples stay; `None`: everywhere.
    pub(crate) samples: Option<Range>,
    /// Where it looks, in the terrain's space; zero where that is not known.
    pub(crate) forward: [f64; 3],
}

/// What ranges ask of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Wanted {
    /// Nothing.
    Gone,
    /// Its samples, for the sake of its neighbours.
    Samples,
    /// Its mesh.
    Mesh,
}

impl Viewed {
    /// The ranges into which chunks come: those that are drawn, and those with samples for them; where samples are wanted again.
    fn entries(&self) -> [Option<Grown>; 3] {
        [Some(self.range.grown(0.0)), Some(self.range.grown(1.0)), self.samples.map(|samples| samples.grown(0.0))]
    }

    /// The same, out of which they go.
    fn exits(&self) -> [Option<Grown>; 3] {
        let stays = self.range.widened(self.margin);
        let samples = self.samples.map(|samples| samples.widened(self.margin).grown(0.0));
        [Some(stays.grown(0.0)), Some(stays.grown(1.0)), samples]
    }

    /// The square of how far chunks are from the viewer, in chunks, and farther where they are behind it. Where the
    /// ellipsoid's axes are not equal, distances are scaled to the longest.
    fn urgency(&self) -> impl Fn([i32; 3]) -> f64 + use<> {
        let Self { range, forward, .. } = *self;
        let scale = range.radii.map(|radius| range.longest() / radius.max(1e-9));
        move |position| {
            let offset = range.offset(position);
            let distance: f64 = (0..3).map(|axis| (offset[axis] * scale[axis]).powi(2)).sum();
            let ahead: f64 = (0..3).map(|axis| offset[axis] * forward[axis]).sum();
            // What is close may be turned to in no time.
            if ahead < 0.0 && distance > 4.0 { 2.0 * distance } else { distance }
        }
    }

    fn has_borders_of(&self, other: &Self) -> bool {
        Self { forward: other.forward, ..*self } == *other
    }
}

impl Ranges {
    /// Whether a chunk is in range: to be drawn as soon as it can be.
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        self.0.iter().any(|viewed| viewed.range.grown(0.0).contains(position))
    }

    /// What is asked of a chunk that is `now` so.
    pub(crate) fn wanted(&self, position: [i32; 3], now: Wanted) -> Wanted {
        let grown = |by: f64| self.0.iter().any(|viewed| viewed.range.grown(by).contains(position));
        let stays =
            |by: f64| self.0.iter().any(|viewed| viewed.range.widened(viewed.margin).grown(by).contains(position));
        if grown(0.0) || now == Wanted::Mesh && stays(0.0) {
            Wanted::Mesh
        } else if grown(1.0) || now >= Wanted::Samples && stays(1.0) {
            Wanted::Samples
        } else {
            Wanted::Gone
        }
    }

    /// Whether samples are to be there, where they have been dropped.
    pub(crate) fn wants_samples(&self, position: [i32; 3]) -> bool {
        self.0.iter().any(|viewed| {
            viewed.samples.map_or_else(
                || viewed.range.widened(viewed.margin).grown(1.0).contains(position),
                |range| range.grown(0.0).contains(position),
            )
        })
    }

    /// Whether samples that are there may be dropped.
    pub(crate) fn may_drop_samples(&self, position: [i32; 3]) -> bool {
        !self.0.iter().any(|viewed| {
            let Some(range) = viewed.samples else {
                return viewed.range.widened(viewed.margin).grown(1.0).contains(position);
            };
            range.widened(viewed.margin).grown(0.0).contains(position)
        })
    }

    /// What comes first: the lower, the sooner. Near before far, and in front before behind.
    pub(crate) fn urgency(&self, position: [i32; 3]) -> u32 {
        as_number(self.0.iter().map(|viewed| viewed.urgency()(position)))
    }

    /// [`urgency`](Self::urgency), for many chunks.
    pub(crate) fn urgencies(&self) -> impl Fn([i32; 3]) -> u32 {
        let of_viewers: Vec<_> = self.0.iter().map(Viewed::urgency).collect();
        move |position| as_number(of_viewers.iter().map(|of| of(position)))
    }

    /// Whether other chunks may be urgent for these ranges than for `old` ones.
    pub(crate) fn differ_in_urgency(&self, old: &Self) -> bool {
        let far = |(new, old): (&Viewed, &Viewed)| {
            let [new_middle, old_middle] = [new, old].map(|viewed| viewed.range.middle);
            new.forward != old.forward || (0..3).any(|axis| (new_middle[axis] - old_middle[axis]).abs() >= 1.0)
        };
        self.0.len() != old.0.len() || self.0.iter().zip(&old.0).any(far)
    }

    /// The chunks that come into these ranges from `old` ones, and those that go out of the old ones.
    pub(crate) fn differences(&self, old: &Self, mut come: impl FnMut([i32; 3]), mut go: impl FnMut([i32; 3])) {
        for index in 0..self.0.len().max(old.0.len()) {
            let (new, old) = (self.0.get(index), old.0.get(index));
            if new.zip(old).is_some_and(|(new, old)| new.has_borders_of(old)) {
                continue;
            }
            let borders =
                |viewed: Option<&Viewed>, of: fn(&Viewed) -> [Option<Grown>; 3]| viewed.map(of).unwrap_or_default();
            difference(borders(new, Viewed::entries), borders(old, Viewed::entries), &mut come);
            difference(borders(old, Viewed::exits), borders(new, Viewed::exits), &mut go);
        }
    }
}

/// The least of all viewers' urgencies, as a number that can be sorted by.
fn as_number(urgencies: impl Iterator<Item = f64>) -> u32 {
    (16.0 * urgencies.fold(f64::INFINITY, f64::min)) as u32
}

/// What is in ranges and not in others, border by border. The second border is around the first.
fn difference(these: [Option<Grown>; 3], others: [Option<Grown>; 3], take: &mut impl FnMut([i32; 3])) {
    let others = others.map(|other| other.map(|other| other.table()));
    let row_of = |border: usize, y: i32, z: i32| others[border].as_ref().map_or(0..0, |other| other.row(y, z));
    for (border, range) in these.into_iter().enumerate() {
        let Some(range) = range.map(|range| range.table()) else { continue };
        for (y, z, mut row) in range.rows() {
            let other = row_of(border, y, z);
            if row == other {
                continue;
            }
            let other = if other.is_empty() { row.start..row.start } else { other };
            // Of the first, what lies beyond the other's second is in the second's difference, too.
            if border == 0 {
                let around = row_of(1, y, z);
                row = row.start.max(around.start)..row.end.min(around.end);
            }
            (row.start..row.end.min(other.start)).for_each(|x| take([x, y, z]));
            (row.start.max(other.end)..row.end).for_each(|x| take([x, y, z]));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    const EXTENT: Region = Region { min: [-6, -4, -9], max: [7, 3, 9] };

    fn all() -> impl Iterator<Item = [i32; 3]> {
        EXTENT.grown(2, 2).points()
    }

    fn range() -> impl Strategy<Value = Range> {
        let ellipsoid = (prop::array::uniform3(-5.0..5.0f64), prop::array::uniform3(0.1..5.0f64))
            .prop_map(|(middle, radii)| Range::ellipsoid(middle, radii, EXTENT));
        let boxed = (prop::array::uniform3(-6..6i32), prop::array::uniform3(0..5i32))
            .prop_map(|(min, size)| Range::of_box(Region::new(min, [0, 1, 2].map(|i| min[i] + size[i])), EXTENT));
        prop_oneof![ellipsoid, boxed]
    }

    fn set(grown: &Grown) -> BTreeSet<[i32; 3]> {
        all().filter(|position| grown.contains(*position)).collect()
    }

    proptest! {
        #[test]
        fn rows_hold_what_the_range_contains(range in range(), by in 0..2i32) {
            let grown = range.grown(by.into());
            let rows: BTreeSet<_> =
                grown.table().rows().flat_map(|(y, z, row)| row.map(move |x| [x, y, z])).collect();
            prop_assert_eq!(grown.len(), rows.len() as u64);
            prop_assert_eq!(rows, set(&grown));
        }

        #[test]
        fn an_ellipsoid_holds_the_chunks_it_reaches(
            middle in prop::array::uniform3(-5.0..5.0f64),
            radii in prop::array::uniform3(0.1..5.0f64),
        ) {
            let range = Range::ellipsoid(middle, radii, EXTENT);
            for position in all() {
                let nearest = [0, 1, 2].map(|i| middle[i].clamp(position[i].into(), f64::from(position[i]) + 1.0));
                let size: f64 = (0..3).map(|i| ((nearest[i] - middle[i]) / radii[i]).powi(2)).sum();
                prop_assume!((size - 1.0).abs() > 1e-9);
                prop_assert_eq!(range.grown(0.0).contains(position), size < 1.0 && EXTENT.contains(position));
            }
        }

        #[test]
        fn a_grown_range_holds_the_neighbours(range in range()) {
            let plain = set(&range.grown(0.0));
            let neighbours: BTreeSet<_> = plain
                .iter()
                .flat_map(|position| Region::new(position.map(|v| v - 1), position.map(|v| v + 2)).points())
                .filter(|position| EXTENT.contains(*position))
                .collect();
            let grown = set(&range.grown(1.0));
            prop_assert!(neighbours.is_subset(&grown));
            // Where the extent cuts the range, chunks beyond it may have been the neighbours.
            prop_assert!(!plain.is_empty() || grown.len() <= EXTENT.points().count());
        }

        #[test]
        fn a_box_holds_its_chunks(min in prop::array::uniform3(-9..9i32), size in prop::array::uniform3(0..6i32)) {
            let chunks = Region::new(min, [0, 1, 2].map(|i| min[i] + size[i]));
            let expected: BTreeSet<_> = chunks.intersection(&EXTENT).points().collect();
            prop_assert_eq!(set(&Range::of_box(chunks, EXTENT).grown(0.0)), expected);
        }

        #[test]
        fn differences_hold_every_chunk_whose_lot_changes(a in range(), b in range(), margin in 0.0..2.0f64) {
            let viewed = |range| Viewed { range, margin, samples: None, forward: [0.0; 3] };
            let (new, old) = (Ranges(vec![viewed(a)]), Ranges(vec![viewed(b)]));
            let (mut come, mut gone) = (BTreeSet::new(), BTreeSet::new());
            new.differences(&old, |position| { come.insert(position); }, |position| { gone.insert(position); });
            for position in all() {
                for now in [Wanted::Gone, Wanted::Samples, Wanted::Mesh] {
                    let wanted = new.wanted(position, now);
                    if old.wanted(position, now) == now && wanted != now {
                        let found = if wanted > now { &come } else { &gone };
                        prop_assert!(found.contains(&position), "{:?} as {:?}", position, now);
                    }
                }
            }
        }
    }
}
