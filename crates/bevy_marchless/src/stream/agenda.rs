//! [`Agenda`]: chunks that wait for something, the most urgent first.

use core::cmp::Reverse;

use super::range::Ranges;
use crate::chunk::ChunkKey;

/// So many chunks are sorted at once.
const SOON: usize = 256;
/// As many chunks may wait without being gone through for those that no longer do.
const FEW: usize = 1024;

/// Chunks that wait for something; some several times, some no longer.
///
/// Thousands may wait while few of them have their turn, and what is urgent changes with the steps of a viewer. So only
/// those that come soon are sorted.
#[derive(Debug)]
pub(crate) struct Agenda {
    /// The most urgent ones, the first at the end.
    soon: Vec<(Reverse<u32>, Reverse<ChunkKey>)>,
    is_sorted: bool,
    later: Vec<ChunkKey>,
    /// None that comes later is more urgent. The lower, the sooner.
    bar: u32,
    /// When so many come later, those that no longer wait are taken out.
    tidied_at: usize,
}

impl Default for Agenda {
    fn default() -> Self {
        Self { soon: Vec::new(), is_sorted: true, later: Vec::new(), bar: 0, tidied_at: FEW }
    }
}

impl Agenda {
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn len(&self) -> usize {
        self.soon.len() + self.later.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.soon.iter().map(|(_, Reverse(key))| *key).chain(self.later.iter().copied())
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds a chunk, which comes when it is its turn.
    pub(crate) fn add(&mut self, key: ChunkKey, ranges: &Ranges) {
        let urgency = ranges.urgency(key.position);
        if urgency < self.bar {
            self.soon.push((Reverse(urgency), Reverse(key)));
            self.is_sorted = false;
        } else {
            self.later.push(key);
        }
    }

    /// Adds a chunk, which comes before all others.
    pub(crate) fn add_first(&mut self, key: ChunkKey) {
        self.soon.push((Reverse(0), Reverse(key)));
        self.is_sorted = false;
    }

    /// Adds a chunk, which comes after all that are chosen already, however urgent it is.
    pub(crate) fn add_unsorted(&mut self, key: ChunkKey) {
        self.later.push(key);
    }

    /// Notes that it has become another question what is urgent.
    pub(crate) fn sort_again(&mut self) {
        self.later.extend(self.soon.drain(..).map(|(_, Reverse(key))| key));
        self.bar = 0;
    }

    /// Takes out the most urgent chunk that still `waits`.
    pub(crate) fn pop(&mut self, ranges: &Ranges, waits: impl Fn(&ChunkKey) -> bool) -> Option<ChunkKey> {
        loop {
            if self.soon.len() > 2 * SOON {
                self.sort_again();
            }
            if self.soon.is_empty() {
                self.choose(ranges, &waits);
            }
            if !self.is_sorted {
                self.soon.sort_unstable();
                self.is_sorted = true;
            }
            let (_, Reverse(key)) = self.soon.pop()?;
            if waits(&key) {
                return Some(key);
            }
        }
    }

    /// Chooses who comes soon from all that come later.
    fn choose(&mut self, ranges: &Ranges, waits: impl Fn(&ChunkKey) -> bool) {
        if self.later.len() >= self.tidied_at {
            self.later.retain(waits);
            self.tidied_at = 2 * self.later.len() + FEW;
        }
        let urgency = ranges.urgencies();
        self.soon.extend(self.later.drain(..).map(|key| (Reverse(urgency(key.position)), Reverse(key))));
        self.is_sorted = false;
        let most = self.soon.len().saturating_sub(SOON);
        if most > 0 {
            let (_, (Reverse(bar), _), _) = self.soon.select_nth_unstable(most);
            self.bar = *bar;
            self.later.extend(self.soon.drain(..most).map(|(_, Reverse(key))| key));
        } else {
            self.bar = u32::MAX;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use marchless::Region;
    use proptest::prelude::*;

    use super::*;
    use crate::stream::range::{Range, Viewed};

    fn ranges() -> Ranges {
        let range = Range::ellipsoid([0.5; 3], [9.0; 3], Region::new([-40; 3], [40; 3]));
        Ranges(vec![Viewed { range, margin: 0.0, samples: None, forward: [1.0, 0.0, 0.0] }])
    }

    proptest! {
        #[test]
        fn all_that_wait_come_by_urgency(
            positions in prop::collection::vec(prop::array::uniform3(-9..9i32), 0..3_000),
            first in prop::array::uniform3(-9..9i32),
        ) {
            let ranges = ranges();
            let mut agenda = Agenda::default();
            let waits = |key: &ChunkKey| key.position[0] != 3;
            positions.iter().for_each(|position| agenda.add(ChunkKey::finest(*position), &ranges));
            let mut expected: BTreeSet<_> =
                positions.iter().map(|position| (ranges.urgency(*position), *position)).collect();
            expected.retain(|(_, position)| position[0] != 3);
            agenda.add_first(ChunkKey::finest(first));
            if waits(&ChunkKey::finest(first)) {
                prop_assert_eq!(agenda.pop(&ranges, waits), Some(ChunkKey::finest(first)));
            }
            // What is added in between finds its place.
            if let Some(key) = agenda.pop(&ranges, waits) {
                agenda.add(key, &ranges);
            }
            let mut found: Vec<_> = core::iter::from_fn(|| agenda.pop(&ranges, waits))
                .map(|key| (ranges.urgency(key.position), key.position))
                .collect();
            prop_assert!(found.is_sorted());
            found.dedup();
            prop_assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
            prop_assert!(agenda.is_empty());
        }
    }
}
