//! [`Agenda`]: chunks that wait for something, the most urgent first.

use core::cmp::Reverse;

use super::range::Ranges;
use crate::chunk::ChunkKey;

/// So many chunks are sorted at once; who comes after them is not asked before.
const SOON: usize = 256;
/// As many chunks may be on an agenda without being gone through for those that no longer wait.
const FEW: usize = 1024;

/// Chunks that wait for something; some several times, some no longer.
///
/// Thousands may wait while few of them have their turn, and what is urgent changes with every step of a viewer. So only
/// those that come soon are sorted.
#[derive(Debug)]
pub(crate) struct Agenda {
    /// The last ones come first, as far as they are sorted.
    keys: Vec<ChunkKey>,
    sorted: usize,
    /// When it has so many chunks, those that no longer wait are taken out.
    tidied_at: usize,
}

impl Default for Agenda {
    fn default() -> Self {
        Self { keys: Vec::new(), sorted: 0, tidied_at: FEW }
    }
}

impl Agenda {
    pub(crate) fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.keys.iter().copied()
    }

    pub(crate) fn clear(&mut self) {
        self.keys.clear();
    }

    /// Adds a chunk, which comes when it is its turn.
    pub(crate) fn add(&mut self, key: ChunkKey) {
        self.keys.push(key);
        self.sorted = 0;
    }

    /// Adds a chunk, which comes before all others.
    pub(crate) fn add_first(&mut self, key: ChunkKey) {
        self.keys.push(key);
        self.sorted += 1;
    }

    /// Notes that it has become another question what is urgent.
    pub(crate) fn sort_again(&mut self) {
        self.sorted = 0;
    }

    /// Takes out the most urgent chunk that still `waits`.
    pub(crate) fn pop(&mut self, ranges: &Ranges, waits: impl Fn(&ChunkKey) -> bool) -> Option<ChunkKey> {
        loop {
            if self.sorted == 0 {
                self.sort(ranges, &waits);
            }
            let key = self.keys.pop()?;
            self.sorted -= 1;
            if waits(&key) {
                return Some(key);
            }
        }
    }

    fn sort(&mut self, ranges: &Ranges, waits: impl Fn(&ChunkKey) -> bool) {
        if self.keys.len() >= self.tidied_at {
            self.keys.retain(waits);
            self.tidied_at = 2 * self.keys.len() + FEW;
        }
        let mut order: Vec<_> = self.keys.iter().map(|key| Reverse((ranges.urgency(key.position), *key))).collect();
        let later = order.len().saturating_sub(SOON);
        if later > 0 {
            order.select_nth_unstable(later);
        }
        order[later..].sort_unstable();
        self.keys.clear();
        self.keys.extend(order.into_iter().map(|Reverse((_, key))| key));
        self.sorted = self.keys.len() - later;
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
            positions.iter().for_each(|position| agenda.add(ChunkKey::finest(*position)));
            let mut expected: BTreeSet<_> =
                positions.iter().map(|position| (ranges.urgency(*position), *position)).collect();
            expected.retain(|(_, position)| position[0] != 3);
            agenda.add_first(ChunkKey::finest(first));
            if waits(&ChunkKey::finest(first)) {
                prop_assert_eq!(agenda.pop(&ranges, waits), Some(ChunkKey::finest(first)));
            }
            // What is added in between finds its place.
            if let Some(key) = agenda.pop(&ranges, waits) {
                agenda.add(key);
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
