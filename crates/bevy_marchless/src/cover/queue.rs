//! [`ChunkQueue`]: a priority queue of chunks for several viewers.

use core::cmp::Reverse;
use core::ops::Bound;
use std::collections::{BTreeMap, VecDeque, btree_map::Entry};

use bevy_platform::collections::HashSet;

use super::{Cover, View, ViewId};
use crate::chunk::ChunkKey;

/// The number of a viewer's chunks that are sorted at once.
const SORTED_AT_ONCE: usize = 256;
/// The least length of a viewer's backlog at which stale entries are pruned. The next time it is twice the length left,
/// and this many more.
const LEAST_TO_PRUNE: usize = 1024;

/// A priority queue that holds each chunk once. Viewers take turns, and each has its chunks in order of urgency.
///
/// Thousands of chunks may be pending while few have their turn, and urgency changes with each step of a viewer. So only
/// the most urgent chunks are sorted, and only for a viewer that has moved.
#[derive(Debug, Default)]
pub(crate) struct ChunkQueue {
    /// The chunks that are popped before all others.
    first: UniqueQueue,
    /// The queue of each viewer; that of `None` also holds the chunks that no viewer sees.
    queues: BTreeMap<ViewId, PriorityQueue>,
    members: HashSet<ChunkKey>,
    /// The viewer that had the last turn.
    last: ViewId,
}

/// A queue that holds each chunk once, first in, first out.
#[derive(Debug, Default)]
pub(crate) struct UniqueQueue {
    keys: VecDeque<ChunkKey>,
    members: HashSet<ChunkKey>,
}

impl UniqueQueue {
    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    pub(crate) fn push(&mut self, key: ChunkKey) {
        if self.members.insert(key) {
            self.keys.push_back(key);
        }
    }

    pub(crate) fn pop(&mut self) -> Option<ChunkKey> {
        let key = self.keys.pop_front()?;
        self.members.remove(&key);
        Some(key)
    }
}

impl ChunkQueue {
    pub(crate) fn is_empty(&self) -> bool {
        self.members.is_empty() && self.first.is_empty()
    }

    /// The number of chunks in the queue; a chunk that was moved to the front may count twice.
    pub(crate) fn len(&self) -> usize {
        self.members.len() + self.first.len()
    }

    /// The number of chunks in a viewer's queue.
    pub(crate) fn len_of(&self, id: ViewId) -> usize {
        self.queues.get(&id).map_or(0, |queue| queue.urgent.len() + queue.backlog.len())
    }

    /// All chunks, in no order; a chunk that was moved to the front may occur twice.
    pub(crate) fn iter(&self) -> impl Iterator<Item = ChunkKey> + '_ {
        self.first.keys.iter().chain(&self.members).copied()
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds a chunk to the queue of the viewer for which it is most urgent.
    pub(crate) fn add(&mut self, key: ChunkKey, cover: &Cover) {
        if self.members.insert(key) {
            let (id, urgency) = cover.most_urgent(key.position).unwrap_or_default();
            self.queues.entry(id).or_default().add(key, urgency);
        }
    }

    /// Adds a chunk in front of all others.
    pub(crate) fn add_first(&mut self, key: ChunkKey) {
        self.first.push(key);
    }

    /// Adds one of many chunks of a viewer to the viewer's backlog.
    pub(crate) fn add_unsorted(&mut self, key: ChunkKey, id: ViewId) {
        if self.members.insert(key) {
            self.queues.entry(id).or_default().backlog.push(key);
        }
    }

    /// Notes that the urgencies of a viewer's chunks have changed.
    pub(crate) fn sort_again(&mut self, id: ViewId) {
        if let Some(queue) = self.queues.get_mut(&id) {
            queue.sort_again();
        }
    }

    /// Hands the chunks of a removed viewer to others.
    pub(crate) fn remove_view(&mut self, id: ViewId, cover: &Cover) {
        let Some(PriorityQueue { urgent, backlog, .. }) = self.queues.remove(&id) else { return };
        for key in urgent.into_iter().map(|(_, Reverse(key))| key).chain(backlog) {
            self.members.remove(&key);
            self.add(key, cover);
        }
    }

    /// Takes out the next chunk that is still pending.
    pub(crate) fn pop(&mut self, cover: &Cover, is_pending: impl Fn(&ChunkKey) -> bool) -> Option<ChunkKey> {
        while let Some(key) = self.first.pop() {
            if is_pending(&key) {
                return Some(key);
            }
        }
        if self.members.is_empty() {
            return None;
        }
        let Self { queues, members, last, .. } = self;
        loop {
            let behind = (Bound::Excluded(*last), Bound::Unbounded);
            let id = queues.range(behind).map(|(id, _)| *id).next().or_else(|| queues.keys().next().copied())?;
            *last = id;
            let Entry::Occupied(mut queue) = queues.entry(id) else { return None };
            let key = queue.get_mut().pop(cover.view(id), members, &is_pending);
            if key.is_some() {
                return key;
            }
            queue.remove();
        }
    }
}

/// The priority queue of one viewer.
#[derive(Debug)]
struct PriorityQueue {
    /// The most urgent chunks, the first one at the end.
    urgent: Vec<(Reverse<u32>, Reverse<ChunkKey>)>,
    is_sorted: bool,
    /// All other chunks, unsorted.
    backlog: Vec<ChunkKey>,
    /// The threshold of urgency: no chunk in the backlog has a lower urgency.
    threshold: u32,
    /// The length of the backlog at which stale entries are pruned.
    prune_at: usize,
}

impl Default for PriorityQueue {
    fn default() -> Self {
        Self { urgent: Vec::new(), is_sorted: true, backlog: Vec::new(), threshold: 0, prune_at: LEAST_TO_PRUNE }
    }
}

impl PriorityQueue {
    fn add(&mut self, key: ChunkKey, urgency: u32) {
        if urgency < self.threshold {
            self.urgent.push((Reverse(urgency), Reverse(key)));
            self.is_sorted = false;
        } else {
            self.backlog.push(key);
        }
    }

    fn sort_again(&mut self) {
        self.backlog.extend(self.urgent.drain(..).map(|(_, Reverse(key))| key));
        self.threshold = 0;
    }

    fn pop(
        &mut self,
        view: Option<&View>,
        members: &mut HashSet<ChunkKey>,
        is_pending: impl Fn(&ChunkKey) -> bool,
    ) -> Option<ChunkKey> {
        loop {
            if self.urgent.len() > 2 * SORTED_AT_ONCE {
                self.sort_again();
            }
            if self.urgent.is_empty() {
                self.select_urgent(view, members, &is_pending);
            }
            if !self.is_sorted {
                self.urgent.sort_unstable();
                self.is_sorted = true;
            }
            let (_, Reverse(key)) = self.urgent.pop()?;
            members.remove(&key);
            if is_pending(&key) {
                return Some(key);
            }
        }
    }

    /// Moves the most urgent chunks of the backlog to `urgent`.
    fn select_urgent(
        &mut self,
        view: Option<&View>,
        members: &mut HashSet<ChunkKey>,
        is_pending: impl Fn(&ChunkKey) -> bool,
    ) {
        if self.backlog.len() >= self.prune_at {
            self.backlog.retain(|key| {
                let is_stale = !is_pending(key);
                if is_stale {
                    members.remove(key);
                }
                !is_stale
            });
            self.prune_at = 2 * self.backlog.len() + LEAST_TO_PRUNE;
        }
        let urgency = view.map(View::urgencies);
        let urgency = |key: ChunkKey| urgency.as_ref().map_or(0, |urgency| urgency(key.position));
        self.urgent.extend(self.backlog.drain(..).map(|key| (Reverse(urgency(key)), Reverse(key))));
        self.is_sorted = false;
        let most = self.urgent.len().saturating_sub(SORTED_AT_ONCE);
        if most > 0 {
            let (_, (Reverse(threshold), _), _) = self.urgent.select_nth_unstable(most);
            self.threshold = *threshold;
            self.backlog.extend(self.urgent.drain(..most).map(|(_, Reverse(key))| key));
        } else {
            self.threshold = u32::MAX;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use bevy_ecs::entity::Entity;
    use marchless::Region;
    use proptest::prelude::*;

    use super::*;
    use crate::cover::LoadRegion;

    fn view(middle: f64) -> View {
        let range = LoadRegion::ellipsoid([middle, 0.5, 0.5], [40.0; 3], Region::new([-90; 3], [90; 3]));
        View::new(range, 0.0, None, [1.0, 0.0, 0.0])
    }

    fn cover(views: &[(ViewId, View)]) -> Cover {
        let mut cover = Cover::default();
        for (id, view) in views {
            cover.set(*id, Some(*view), |_, _| {}, |_, _| {});
        }
        cover
    }

    proptest! {
        #[test]
        fn pending_chunks_are_popped_once_in_order_of_urgency(
            positions in prop::collection::vec(prop::array::uniform3(-9..9i32), 0..3_000),
            first in prop::array::uniform3(-9..9i32),
        ) {
            let cover = cover(&[(None, view(0.5))]);
            let mut queue = ChunkQueue::default();
            let is_pending = |key: &ChunkKey| key.position[0] != 3;
            for (index, position) in positions.iter().enumerate() {
                if index % 2 == 0 {
                    queue.add(ChunkKey::finest(*position), &cover);
                } else {
                    queue.add_unsorted(ChunkKey::finest(*position), None);
                }
            }
            let mut expected: BTreeSet<_> =
                positions.iter().map(|position| (cover.urgency(*position), *position)).collect();
            prop_assert_eq!(queue.len(), expected.len());
            expected.retain(|(_, position)| position[0] != 3);
            queue.add_first(ChunkKey::finest(first));
            queue.add_first(ChunkKey::finest(first));
            if is_pending(&ChunkKey::finest(first)) {
                prop_assert_eq!(queue.pop(&cover, is_pending), Some(ChunkKey::finest(first)));
            }
            // A chunk that is added between two pops is sorted in.
            if let Some(key) = queue.pop(&cover, is_pending) {
                queue.add(key, &cover);
            }
            let found: Vec<_> = core::iter::from_fn(|| queue.pop(&cover, is_pending))
                .map(|key| (cover.urgency(key.position), key.position))
                .collect();
            prop_assert!(found.is_sorted());
            prop_assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
            prop_assert!(queue.is_empty());
        }

        #[test]
        fn removing_a_viewer_keeps_its_chunks(
            positions in prop::collection::vec((prop::array::uniform3(-9..9i32), 0u32..3), 0..600),
        ) {
            let ids = [0, 1, 2].map(Entity::from_raw_u32);
            let mut cover = cover(&[(ids[0], view(0.0)), (ids[1], view(5.0)), (ids[2], view(-3.0))]);
            let mut queue = ChunkQueue::default();
            for (position, owner) in &positions {
                queue.add_unsorted(ChunkKey::finest(*position), ids[*owner as usize]);
            }
            cover.set(ids[1], None, |_, _| {}, |_, _| {});
            queue.remove_view(ids[1], &cover);
            let found: Vec<_> =
                core::iter::from_fn(|| queue.pop(&cover, |_| true)).map(|key| key.position).collect();
            let unique: BTreeSet<_> = found.iter().copied().collect();
            prop_assert_eq!(found.len(), unique.len());
            prop_assert_eq!(unique, positions.iter().map(|(position, _)| *position).collect());
        }
    }

    #[test]
    fn viewers_take_turns() {
        let ids = [1, 2].map(Entity::from_raw_u32);
        let cover = cover(&[(ids[0], view(0.0)), (ids[1], view(60.0))]);
        let mut queue = ChunkQueue::default();
        (-4..4).for_each(|x| queue.add(ChunkKey::finest([x, 0, 0]), &cover));
        (56..64).for_each(|x| queue.add(ChunkKey::finest([x, 0, 0]), &cover));
        let turns: Vec<bool> =
            core::iter::from_fn(|| queue.pop(&cover, |_| true)).map(|key| key.position[0] > 30).collect();
        assert_eq!(turns.len(), 16);
        assert!(turns.windows(2).all(|pair| pair[0] != pair[1]), "{turns:?}");
    }
}
