//! [`LoadRegion`]: the chunks within a distance, row by row.

use core::ops;

use marchless::Region;

use super::rows::Rows;

/// The most rings in which a view is revealed.
const MOST_RINGS: u32 = 64;

/// A set of chunks: a box, or all chunks that an ellipsoid touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LoadRegion {
    /// The middle, in chunks from the lattice's origin. A box's middle lies half way between its corners.
    middle: [f64; 3],
    /// The half axes, in chunks.
    radii: [f64; 3],
    /// Whether the region is a box instead of an ellipsoid.
    is_box: bool,
    /// The chunks that exist at all.
    extent: Region,
}

impl LoadRegion {
    /// The chunks of `extent` that the ellipsoid touches.
    pub(crate) fn ellipsoid(middle: [f64; 3], radii: [f64; 3], extent: Region) -> Self {
        Self { middle, radii, is_box: false, extent }
    }

    /// The chunks of `chunks` that lie in `extent`.
    pub(crate) fn of_box(chunks: Region, extent: Region) -> Self {
        let ends = |axis: usize| [f64::from(chunks.min[axis]), f64::from(chunks.max[axis])];
        let middle = [0, 1, 2].map(|axis| (ends(axis)[0] + ends(axis)[1]) / 2.0);
        // A little less than half, so that chunks that only touch the box do not belong to it.
        let radii = [0, 1, 2].map(|axis| (ends(axis)[1] - ends(axis)[0]) / 2.0 - 0.25);
        Self { middle, radii, is_box: true, extent: if chunks.is_empty() { chunks } else { extent } }
    }

    /// The region together with every chunk at most `chunks` away from it along each axis.
    ///
    /// This is exact for the ellipsoid, too: of a chunk's neighbours, the one that is nearest along each axis is a
    /// neighbour.
    #[must_use]
    pub(crate) fn grown(self, chunks: f64) -> GrownLoadRegion {
        GrownLoadRegion { range: self, by: chunks }
    }

    /// The region with all half axes longer by `chunks`.
    #[must_use]
    pub(crate) fn widened(self, chunks: f64) -> Self {
        if self.is_box { self } else { Self { radii: self.radii.map(|radius| radius + chunks), ..self } }
    }

    /// The longest half axis, in chunks.
    pub(crate) fn longest(&self) -> f64 {
        self.radii.into_iter().fold(0.0, f64::max)
    }

    pub(crate) const fn middle(&self) -> [f64; 3] {
        self.middle
    }

    pub(crate) const fn extent(&self) -> Region {
        self.extent
    }

    /// The number of chunks in the bounding box, or slightly more.
    pub(crate) fn box_size(&self) -> f64 {
        let size = self.extent.size();
        (0..3).map(|axis| (2.0 * self.radii[axis] + 2.0).min(f64::from(size[axis]))).product()
    }

    /// The region with its half axes scaled by a factor.
    #[must_use]
    pub(crate) fn shrunk(self, factor: f64) -> Self {
        Self { radii: self.radii.map(|radius| radius * factor), ..self }
    }

    /// The vector from the middle to a chunk's middle, in chunks.
    pub(crate) fn offset(&self, position: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(position[axis]) + 0.5 - self.middle[axis])
    }
}

/// A [`LoadRegion`] grown by a number of chunks on all sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GrownLoadRegion {
    range: LoadRegion,
    by: f64,
}

impl GrownLoadRegion {
    pub(crate) fn contains(&self, position: [i32; 3]) -> bool {
        let [x, y, z] = position;
        self.range.extent.contains(position) && self.row(y, z).contains(&x)
    }

    /// The bounding box of the chunks.
    fn bounds(&self) -> Region {
        let reach = [0, 1, 2].map(|axis| self.reach(axis, self.range.radii[axis]));
        Region::new(reach.each_ref().map(|reach| reach.start), reach.each_ref().map(|reach| reach.end))
    }

    /// The number of chunks.
    pub(crate) fn len(&self) -> u64 {
        self.rows().iter().map(|(.., row)| row.len() as u64).sum()
    }

    /// The chunks of one row that belong to the region.
    fn row(&self, y: i32, z: i32) -> ops::Range<i32> {
        let extent = &self.range.extent;
        let is_there = |axis: usize, position: i32| (extent.min[axis]..extent.max[axis]).contains(&position);
        if is_there(1, y) && is_there(2, z) { self.row_at(self.square(1, y), self.square(2, z)) } else { 0..0 }
    }

    /// The chunks of a row, given the squared distances of the row along y and z, in radii.
    fn row_at(&self, y: f64, z: f64) -> ops::Range<i32> {
        let left = match self.range.is_box {
            true if y <= 1.0 && z <= 1.0 => 1.0,
            true => -1.0,
            false => 1.0 - y - z,
        };
        if left < 0.0 { 0..0 } else { self.reach(0, self.range.radii[0] * left.sqrt()) }
    }

    /// The squared distance from the middle to the nearest point of a chunk along one axis, in radii.
    fn square(&self, axis: usize, position: i32) -> f64 {
        let low = f64::from(position) - self.by;
        let middle = self.range.middle[axis];
        let beyond = (middle.clamp(low, low + 1.0 + 2.0 * self.by) - middle) / self.range.radii[axis];
        beyond * beyond
    }

    /// All chunks of the region, row by row.
    pub(super) fn rows(&self) -> Rows {
        let reach = |axis: usize| self.reach(axis, self.range.radii[axis]);
        let squares = |axis: usize| reach(axis).map(|position| self.square(axis, position)).collect::<Vec<_>>();
        let (from, y_squares, z_squares) = ([reach(1).start, reach(2).start], squares(1), squares(2));
        let mut spans = Vec::with_capacity(y_squares.len() * z_squares.len());
        for &z in &z_squares {
            spans.extend(y_squares.iter().map(|&y| self.row_at(y, z)).map(|row| [row.start, row.end]));
        }
        Rows::new(from, y_squares.len(), spans)
    }

    /// The positions, along an axis, of chunks that reach within `radius` of the middle.
    fn reach(&self, axis: usize, radius: f64) -> ops::Range<i32> {
        let (middle, extent) = (self.range.middle[axis], &self.range.extent);
        let from = floor(-(middle - radius - 1.0 - self.by)).saturating_neg();
        let to = floor(middle + radius + self.by).saturating_add(1);
        let (from, to) = (from.max(extent.min[axis]), to.min(extent.max[axis]));
        from..to.max(from)
    }
}

/// The floor of a number, saturating. Without SSE4.1 [`f64::floor`] is a function call, and regions have many rows.
fn floor(value: f64) -> i32 {
    let towards_zero = value as i32;
    towards_zero.saturating_sub((f64::from(towards_zero) > value).into())
}

/// A viewer's view of a terrain: the chunks to load, and those that stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct View {
    pub(crate) range: LoadRegion,
    /// The extra distance at which drawn chunks are unloaded, in chunks.
    pub(crate) margin: f64,
    /// The region in which samples stay; `None`: everywhere.
    pub(crate) samples: Option<LoadRegion>,
    /// The viewing direction in the terrain's space; zero where it is not known.
    pub(crate) forward: [f64; 3],
    /// The bounding box of everything in the view.
    bounds: Region,
}

impl View {
    pub(crate) fn new(range: LoadRegion, margin: f64, samples: Option<LoadRegion>, forward: [f64; 3]) -> Self {
        let all = [Some(range.widened(margin).grown(1.0)), samples.map(|samples| samples.widened(margin).grown(0.0))];
        let bounds = all.into_iter().flatten().map(|grown| grown.bounds());
        let bounds = bounds.reduce(|a, b| a.union(&b)).unwrap_or(Region::new([0; 3], [0; 3]));
        Self { range, margin, samples, forward, bounds }
    }

    /// The view of a terrain with another extent.
    #[must_use]
    pub(crate) fn with_extent(self, extent: Region) -> Self {
        let of = |range: LoadRegion| LoadRegion { extent, ..range };
        Self::new(of(self.range), self.margin, self.samples.map(of), self.forward)
    }

    /// Whether it is a box of chunks, rather than what a viewer sees.
    pub(crate) const fn is_box(&self) -> bool {
        self.range.is_box
    }

    /// The bounding box of the chunks in range.
    pub(crate) fn chunks(&self) -> Region {
        self.range.grown(0.0).bounds()
    }

    /// The view with another viewing direction.
    #[must_use]
    pub(crate) const fn facing(self, forward: [f64; 3]) -> Self {
        Self { forward, ..self }
    }

    /// The bounding box of everything in the view.
    pub(crate) const fn bounds(&self) -> Region {
        self.bounds
    }

    /// The region in which drawn chunks stay.
    pub(crate) fn with_margin(&self) -> LoadRegion {
        self.range.widened(self.margin)
    }

    /// The urgency of a chunk: lower comes sooner. Near chunks come before far ones, and chunks in front before those
    /// behind. Where the ellipsoid's axes differ, distances are scaled to the longest.
    pub(crate) fn urgency(&self, position: [i32; 3]) -> u32 {
        self.urgencies()(position)
    }

    /// The [`urgency`](Self::urgency) of chunks, as a function to call for many of them.
    pub(crate) fn urgencies(&self) -> impl Fn([i32; 3]) -> u32 + use<> {
        let Self { range, forward, .. } = *self;
        let scale = range.radii.map(|radius| range.longest() / radius.max(1e-9));
        move |position| {
            let offset = range.offset(position);
            let distance: f64 = (0..3).map(|axis| (offset[axis] * scale[axis]).powi(2)).sum();
            let ahead: f64 = (0..3).map(|axis| offset[axis] * forward[axis]).sum();
            // The viewer may turn to close chunks at any moment.
            (16.0 * if ahead < 0.0 && distance > 4.0 { 2.0 * distance } else { distance }) as u32
        }
    }

    /// The view with its radii scaled down to a part of them.
    #[must_use]
    pub(super) fn within(&self, part: f64) -> Self {
        let samples = self.samples.map(|samples| samples.shrunk(part));
        Self::new(self.range.shrunk(part), self.margin, samples, self.forward)
    }

    /// The part of the radii that reaches about a chunk farther than `part`; 1 if nothing lies beyond.
    pub(super) fn next_ring(&self, part: f64) -> f64 {
        let LoadRegion { middle, radii, .. } = self.range;
        let existing = self.range.grown(0.0).bounds();
        if existing.is_empty() {
            return 1.0;
        }
        // The distances of the nearest and the farthest existing points from the middle, in radii.
        let [nearest, farthest] = [false, true].map(|is_farthest| {
            let squares = (0..3).map(|axis| {
                let ends = [existing.min[axis], existing.max[axis]].map(|end| f64::from(end) - middle[axis]);
                let nearest = 0.0f64.clamp(ends[0], ends[1]).abs();
                let distance = if is_farthest { ends[0].abs().max(ends[1].abs()) } else { nearest };
                (distance / radii[axis]).powi(2)
            });
            squares.sum::<f64>().sqrt().min(1.0)
        });
        let size = existing.size().into_iter().max().unwrap_or(1);
        let rings = f64::from((size / 2).clamp(1, MOST_RINGS));
        let next = part.max(nearest) + (farthest - nearest) / rings;
        if next < farthest { next.max(f64::MIN_POSITIVE) } else { 1.0 }
    }

    /// Whether the view differs from another one by a few steps of a viewer, so that few chunks differ.
    pub(super) fn is_near(&self, other: &Self) -> bool {
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() <= 2.0);
        let are_near = |a: &LoadRegion, b: &LoadRegion| {
            near(a.middle, b.middle) && near(a.radii, b.radii) && (a.is_box, a.extent) == (b.is_box, b.extent)
        };
        let have_near_samples = match (&self.samples, &other.samples) {
            (Some(samples), Some(other)) => are_near(samples, other),
            (samples, other) => samples.is_none() && other.is_none(),
        };
        are_near(&self.range, &other.range) && have_near_samples
    }

    /// Whether other chunks may be urgent for this view than for an old one.
    pub(crate) fn differs_in_urgency(&self, old: &Self) -> bool {
        let moved = |axis: usize| (self.range.middle[axis] - old.range.middle[axis]).abs() >= 1.0;
        self.forward != old.forward || self.range.radii != old.range.radii || (0..3).any(moved)
    }

    /// Whether two views ask for the same chunks.
    pub(super) fn has_borders_of(&self, other: &Self) -> bool {
        other.facing(self.forward) == *self
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

    fn range() -> impl Strategy<Value = LoadRegion> {
        let ellipsoid = (prop::array::uniform3(-5.0..5.0f64), prop::array::uniform3(0.1..5.0f64))
            .prop_map(|(middle, radii)| LoadRegion::ellipsoid(middle, radii, EXTENT));
        let boxed = (prop::array::uniform3(-6..6i32), prop::array::uniform3(0..5i32))
            .prop_map(|(min, size)| LoadRegion::of_box(Region::new(min, [0, 1, 2].map(|i| min[i] + size[i])), EXTENT));
        prop_oneof![ellipsoid, boxed]
    }

    fn set(grown: &GrownLoadRegion) -> BTreeSet<[i32; 3]> {
        all().filter(|position| grown.contains(*position)).collect()
    }

    proptest! {
        #[test]
        fn rows_hold_what_the_range_contains(range in range(), by in 0..2i32) {
            let grown = range.grown(by.into());
            let rows: BTreeSet<_> =
                grown.rows().iter().flat_map(|(y, z, row)| row.map(move |x| [x, y, z])).collect();
            prop_assert_eq!(grown.len(), rows.len() as u64);
            prop_assert_eq!(rows, set(&grown));
        }

        #[test]
        fn an_ellipsoid_holds_the_chunks_it_reaches(
            middle in prop::array::uniform3(-5.0..5.0f64),
            radii in prop::array::uniform3(0.1..5.0f64),
        ) {
            let range = LoadRegion::ellipsoid(middle, radii, EXTENT);
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
            // Where the extent cuts the region, chunks beyond it may have been the neighbours.
            prop_assert!(!plain.is_empty() || grown.len() <= EXTENT.points().count());
        }

        #[test]
        fn few_rings_reveal_any_view(
            middle in prop::array::uniform3(prop_oneof![-9.0..9.0f64, -1e30..1e30f64, Just(1e300)]),
            radii in prop::array::uniform3(prop_oneof![0.1..9.0f64, 0.1..1e9f64]),
            range in range(),
            is_ellipsoid: bool,
        ) {
            let range = if is_ellipsoid { LoadRegion::ellipsoid(middle, radii, EXTENT) } else { range };
            let view = View::new(range, 1.0, None, [0.0; 3]);
            let (mut part, mut rings) = (0.0, 0);
            while part < 1.0 {
                let next = view.next_ring(part);
                prop_assert!(next > part);
                (part, rings) = (next, rings + 1);
            }
            prop_assert!(rings <= MOST_RINGS + 1, "{} rings", rings);
        }

        #[test]
        fn a_box_holds_its_chunks(min in prop::array::uniform3(-9..9i32), size in prop::array::uniform3(0..6i32)) {
            let chunks = Region::new(min, [0, 1, 2].map(|i| min[i] + size[i]));
            let expected: BTreeSet<_> = chunks.intersection(&EXTENT).points().collect();
            prop_assert_eq!(set(&LoadRegion::of_box(chunks, EXTENT).grown(0.0)), expected);
        }
    }
}
