//! [`Borders`]: all chunks that a view asks for, row by row, and how those of two views differ.

use core::ops;

use super::{Residency, View};

/// Chunks in rows along x.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// The first y and z.
    from: [i32; 2],
    /// How many rows follow each other along y.
    count: usize,
    /// Where each row starts and ends; y fastest. Some rows are empty.
    spans: Vec<[i32; 2]>,
}

impl Rows {
    /// `spans`: `[z·y]`, of `count` rows along y.
    pub(super) const fn new(from: [i32; 2], count: usize, spans: Vec<[i32; 2]>) -> Self {
        Self { from, count, spans }
    }

    /// All rows: y, z, and which x.
    pub(super) fn iter(&self) -> impl Iterator<Item = (i32, i32, ops::Range<i32>)> + '_ {
        let [first_y, first_z] = self.from;
        // Counted from 0: the last row may be the last that there is a number for.
        (0..).zip(self.spans.chunks(self.count.max(1))).flat_map(move |(z, spans)| {
            (0..).zip(spans).map(move |(y, &[start, end])| (first_y + y, first_z + z, start..end))
        })
    }

    /// How many chunks they hold.
    fn len(&self) -> usize {
        self.spans.iter().map(|[start, end]| (end - start).max(0) as usize).sum()
    }

    /// The rows of a z, from their first y on.
    fn layer(&self, z: i32) -> &[[i32; 2]] {
        let index = z.checked_sub(self.from[1]).and_then(|index| usize::try_from(index).ok());
        let start = index.and_then(|index| index.checked_mul(self.count));
        start.and_then(|start| self.spans.get(start..start + self.count)).unwrap_or_default()
    }

    /// Takes the chunks that others do not have. `around`: rows whose own difference has what lies beyond them.
    fn difference(&self, others: &Self, around: Option<&Self>, take: &mut impl FnMut([i32; 3])) {
        let row_of = |rows: &Self, layer: &[[i32; 2]], y: i32| {
            // Before the first row, that is a number that no layer has.
            let index = y.wrapping_sub(rows.from[0]).cast_unsigned() as usize;
            layer.get(index).copied().unwrap_or([0, 0])
        };
        for (z, spans) in (0..).zip(self.spans.chunks(self.count.max(1))) {
            let z = self.from[1] + z;
            let other_layer = others.layer(z);
            // Most layers of two views a step apart are alike.
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
    /// Those that are drawn, and those around them, too.
    drawn: Rows,
    around: Rows,
    /// Those that stay drawn, and those around them, too.
    stays: Rows,
    stays_around: Rows,
    /// Those whose samples are wanted, and those whose samples stay; `None`: the ones around those that are drawn.
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

    /// The chunks of which more may be wanted than with `old` borders, and how much.
    pub(super) fn come(&self, old: &Self, mut take: impl FnMut([i32; 3], Residency)) {
        self.drawn.difference(&old.drawn, None, &mut |position| take(position, Residency::Mesh));
        let mut take = |position| take(position, Residency::Samples);
        self.around.difference(&old.around, None, &mut take);
        if self.samples.is_some() || old.samples.is_some() {
            self.samples_wanted().difference(old.samples_wanted(), None, &mut take);
        }
    }

    /// How many of the chunks, those around the drawn ones included, others do not have that lie within these.
    pub(super) fn len_beyond(&self, others: &Self) -> usize {
        self.around.len().saturating_sub(others.around.len())
    }

    /// The chunks of which less may be wanted than with `old` borders, and how much at most.
    pub(super) fn go(&self, old: &Self, mut take: impl FnMut([i32; 3], Residency)) {
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
