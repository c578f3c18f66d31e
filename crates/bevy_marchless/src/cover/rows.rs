//! [`Borders`]: all chunks that a view asks for, row by row, and the differences between two views.

use core::ops;

use super::{Residency, View};

/// A set of chunks, as rows along x.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// The y and z of the first row.
    from: [i32; 2],
    /// The number of rows along y.
    count: usize,
    /// The start and the end of each row; y fastest. Some rows are empty.
    spans: Vec<[i32; 2]>,
}

impl Rows {
    /// `spans`: `[z·y]`, of `count` rows along y.
    pub(super) const fn new(from: [i32; 2], count: usize, spans: Vec<[i32; 2]>) -> Self {
        Self { from, count, spans }
    }

    /// All rows: y, z, and the range of x.
    pub(super) fn iter(&self) -> impl Iterator<Item = (i32, i32, ops::Range<i32>)> + '_ {
        let [first_y, first_z] = self.from;
        // Counted from 0, since the last row may have the highest `i32`.
        (0..).zip(self.spans.chunks(self.count.max(1))).flat_map(move |(z, spans)| {
            (0..).zip(spans).map(move |(y, &[start, end])| (first_y + y, first_z + z, start..end))
        })
    }

    /// The number of chunks.
    fn len(&self) -> usize {
        self.spans.iter().map(|[start, end]| (end - start).max(0) as usize).sum()
    }

    /// The rows of one z, from the first y on.
    fn layer(&self, z: i32) -> &[[i32; 2]] {
        let index = z.checked_sub(self.from[1]).and_then(|index| usize::try_from(index).ok());
        let start = index.and_then(|index| index.checked_mul(self.count));
        start.and_then(|start| self.spans.get(start..start + self.count)).unwrap_or_default()
    }

    /// Calls `take` with the chunks that `others` lack. `around`: rows whose own difference reports the chunks beyond
    /// them.
    fn difference(&self, others: &Self, around: Option<&Self>, take: &mut impl FnMut([i32; 3])) {
        let row_of = |rows: &Self, layer: &[[i32; 2]], y: i32| {
            // Before the first row, the index wraps to a number that no layer has.
            let index = y.wrapping_sub(rows.from[0]).cast_unsigned() as usize;
            layer.get(index).copied().unwrap_or([0, 0])
        };
        for (z, spans) in (0..).zip(self.spans.chunks(self.count.max(1))) {
            let z = self.from[1] + z;
            let other_layer = others.layer(z);
            // Most layers of two views a step apart are equal.
            if self.from[0] == others.from[0] && spans == other_layer {
                continue;
            }
            for (y, &[mut start, mut end]) in (0..).zip(spans) {
                let y = self.from[0] + y;
                let mut other = row_of(others, other_layer, y);
                if other == [start, end] {
                    continue;
                }
                if other[0] >= other[1] {
                    other = [start, start];
                }
                if let Some(around) = around {
                    let [first, last] = row_of(around, around.layer(z), y);
                    (start, end) = (start.max(first), end.min(last));
                }
                (start..end.min(other[0])).for_each(|x| take([x, y, z]));
                (start.max(other[1])..end).for_each(|x| take([x, y, z]));
            }
        }
    }
}

/// All chunks that a view asks for.
#[derive(Clone, Debug, Default)]
pub(super) struct Borders {
    /// The drawn chunks, and the chunks around them.
    drawn: Rows,
    around: Rows,
    /// The chunks that stay drawn, and the chunks around them.
    stays: Rows,
    stays_around: Rows,
    /// The chunks whose samples are wanted, and those whose samples stay; `None`: the ones around drawn chunks.
    samples: Option<[Rows; 2]>,
}

impl Borders {
    pub(super) fn of(view: &View) -> Self {
        let stays = view.with_margin();
        let samples = view.samples.map(|samples| [samples.grown(0.0), samples.widened(view.margin).grown(0.0)]);
        Self {
            drawn: view.range.grown(0.0).rows(),
            around: view.range.grown(1.0).rows(),
            stays: stays.grown(0.0).rows(),
            stays_around: stays.grown(1.0).rows(),
            samples: samples.map(|samples| samples.map(|samples| samples.rows())),
        }
    }

    /// Reports the chunks that may be wanted more than with the `old` borders, each with the residency wanted.
    pub(super) fn report_entering(&self, old: &Self, mut take: impl FnMut([i32; 3], Residency)) {
        self.drawn.difference(&old.drawn, None, &mut |position| take(position, Residency::Mesh));
        let mut take = |position| take(position, Residency::Samples);
        self.around.difference(&old.around, None, &mut take);
        if self.samples.is_some() || old.samples.is_some() {
            self.samples_wanted().difference(old.samples_wanted(), None, &mut take);
        }
    }

    /// The number of chunks within these borders, the ones around drawn chunks included, that `others` lack.
    pub(super) fn len_beyond(&self, others: &Self) -> usize {
        self.around.len().saturating_sub(others.around.len())
    }

    /// Reports the chunks that may be wanted less than with the `old` borders, each with the most residency wanted.
    pub(super) fn report_leaving(&self, old: &Self, mut take: impl FnMut([i32; 3], Residency)) {
        let stays_around = Some(&self.stays_around);
        old.stays.difference(&self.stays, stays_around, &mut |position| take(position, Residency::Samples));
        let mut take = |position| take(position, Residency::Gone);
        old.stays_around.difference(&self.stays_around, None, &mut take);
        if self.samples.is_some() || old.samples.is_some() {
            old.samples_stay().difference(self.samples_stay(), None, &mut take);
        }
    }

    fn samples_wanted(&self) -> &Rows {
        self.samples.as_ref().map_or(&self.around, |[wanted, _]| wanted)
    }

    fn samples_stay(&self) -> &Rows {
        self.samples.as_ref().map_or(&self.stays_around, |[_, stay]| stay)
    }
}
