//! [`StampLog`]: the stamps of one terrain, in an octree by the region that they touch.

use std::sync::Arc;

use bevy_platform::collections::HashMap;
use marchless::{QuantisedStamp, Region};

/// The stamps that may still be needed: those of chunks that are not resident, and those to be replayed when samples
/// come from the source again.
///
/// Each stamp is stored once, in a loose octree of chunks, at a node at least as large as the stamp's box: the box
/// begins in the node, and ends in it or in a neighbour. The stamps of a chunk, or of a box of any size, are found at
/// eight nodes of each level that has stamps, however many stamps there are elsewhere.
#[derive(Debug, Default)]
pub(crate) struct StampLog {
    nodes: HashMap<Node, Vec<LoggedStamp>>,
    /// The number of nodes with stamps on each level.
    levels: [usize; LEVELS],
    /// The number of the latest stamp; numbers count up from 1.
    last: u64,
}

/// A stamp and its number in the order of all stamps.
#[derive(Clone, Debug)]
pub(crate) struct LoggedStamp {
    pub(crate) number: u64,
    pub(crate) stamp: Arc<QuantisedStamp>,
    /// The number of chunks that it may still have to be applied to; `MANY` is not counted down.
    chunks: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Node {
    level: u8,
    /// The node's position, in nodes of its level.
    position: [i32; 3],
}

/// The number of levels: 2³⁰ chunks of the finest level are more than there can be along an axis.
const LEVELS: usize = 31;
/// A stamp on more chunks than this stays for good.
const MANY: u32 = 64;

impl StampLog {
    /// The number of the latest stamp, 0 before the first.
    pub(crate) const fn last(&self) -> u64 {
        self.last
    }

    /// Gives the next stamp its number.
    pub(crate) const fn next(&mut self) -> u64 {
        self.last += 1;
        self.last
    }

    /// Logs a stamp. `region`: the chunks that it may change; not empty. `held`: how many of them do not need it any
    /// more. Returns the number of stamps at the node of one chunk, if the stamp is that small.
    pub(crate) fn insert(&mut self, number: u64, stamp: Arc<QuantisedStamp>, region: Region, held: u32) -> usize {
        let size = region.size();
        let all = size.into_iter().map(u64::from).product::<u64>();
        let chunks = if all > u64::from(MANY) { u32::MAX } else { all as u32 - held.min(all as u32) };
        if chunks == 0 {
            return 0;
        }
        // The smallest level whose nodes are as long as the box. On level 0 a box of two chunks fits, too.
        let longest = size.into_iter().max().unwrap_or(1);
        let level = (longest - 1).max(1).next_power_of_two().ilog2().min(LEVELS as u32 - 1);
        let node = Node { level: level as u8, position: region.min.map(|v| v >> level) };
        let logged = self.nodes.entry(node).or_default();
        if logged.is_empty() {
            self.levels[level as usize] += 1;
        }
        logged.push(LoggedStamp { number, stamp, chunks });
        if level == 0 { logged.len() } else { 0 }
    }

    /// Whether any stamp after number `after` may change points of a chunk. `points`: a box around them.
    pub(crate) fn concerns(&self, chunk: [i32; 3], points: Region, after: u64) -> bool {
        let mut found = false;
        self.each_near(one(chunk), &mut |logged| found |= after_in(logged, points, after).next().is_some());
        found
    }

    /// The stamps after number `after` that may change a box of chunks, in order. `points`: the lattice points of the
    /// box.
    pub(crate) fn concerning(&self, chunks: Region, points: Region, after: u64) -> Vec<LoggedStamp> {
        let mut all = Vec::new();
        self.each_near(chunks, &mut |logged| all.extend(after_in(logged, points, after).cloned()));
        all.sort_unstable_by_key(|logged| logged.number);
        all
    }

    /// Notes that a chunk holds all stamps so far for good. Stamps that no other chunk needs are removed.
    pub(crate) fn release(&mut self, chunk: [i32; 3], points: Region) {
        let Self { nodes, levels, .. } = self;
        for node in nodes_near(levels, one(chunk)) {
            let Some(logged) = nodes.get_mut(&node) else { continue };
            logged.retain_mut(|logged| {
                if logged.chunks != u32::MAX && !logged.stamp.region().intersection(&points).is_empty() {
                    logged.chunks -= 1;
                }
                logged.chunks > 0
            });
            if logged.is_empty() {
                nodes.remove(&node);
                levels[usize::from(node.level)] -= 1;
            }
        }
    }

    /// All stamps, in no order.
    pub(crate) fn all(&self) -> impl Iterator<Item = &QuantisedStamp> {
        self.nodes.values().flatten().map(|logged| &*logged.stamp)
    }

    /// Removes all stamps; numbers continue.
    pub(crate) fn clear(&mut self) {
        *self = Self { last: self.last, ..Self::default() };
    }

    /// The number of stamps.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.nodes.values().map(Vec::len).sum()
    }

    /// Visits the nodes that may hold stamps on some of `chunks`.
    fn each_near(&self, chunks: Region, appearance: &mut impl FnMut(&[LoggedStamp])) {
        let near = (0..).zip(&self.levels).filter(|(_, nodes)| **nodes > 0);
        for (level, nodes) in near {
            let around = around(level, chunks);
            if around.size().into_iter().map(u64::from).product::<u64>() <= *nodes as u64 {
                let nodes = around.points().filter_map(|position| self.nodes.get(&Node { level, position }));
                nodes.for_each(|logged| appearance(logged));
            } else {
                let is_near = |node: &Node| node.level == level && around.contains(node.position);
                let nodes = self.nodes.iter().filter(|(node, _)| is_near(node));
                nodes.for_each(|(_, logged)| appearance(logged));
            }
        }
    }
}

/// The nodes that may hold stamps on some of `chunks`, whether or not they have any.
fn nodes_near(levels: &[usize; LEVELS], chunks: Region) -> Vec<Node> {
    let levels = (0..).zip(levels).filter(|(_, nodes)| **nodes > 0).map(|(level, _)| level);
    levels.flat_map(|level| around(level, chunks).points().map(move |position| Node { level, position })).collect()
}

/// The nodes of a level in which a box that reaches some of `chunks` may begin.
fn around(level: u8, chunks: Region) -> Region {
    let first = chunks.min.map(|v| (v >> level).saturating_sub(1));
    Region::new(first, chunks.max.map(|v| (v.saturating_sub(1) >> level).saturating_add(1)))
}

fn one(chunk: [i32; 3]) -> Region {
    Region::new(chunk, chunk.map(|v| v.saturating_add(1)))
}

/// The stamps of a node are in order.
fn after_in(logged: &[LoggedStamp], points: Region, after: u64) -> impl Iterator<Item = &LoggedStamp> {
    let start = logged.partition_point(|logged| logged.number <= after);
    logged[start..].iter().filter(move |logged| !logged.stamp.region().intersection(&points).is_empty())
}

#[cfg(test)]
mod tests {
    use marchless::{Operation, QuantisedShape};
    use proptest::prelude::*;

    use super::*;

    const CELLS: i32 = 8;

    fn stamp(center: [f64; 3], radius: f64) -> QuantisedStamp {
        QuantisedStamp::new(QuantisedShape::sphere(center, radius).unwrap(), Operation::Dig, 0)
    }

    /// The chunks that a box of points lies in.
    fn chunks(points: Region) -> Region {
        let [low, high] = [points.min, points.max.map(|v| v - 1)].map(|end| end.map(|v| v.div_euclid(CELLS)));
        Region::new(low, high.map(|v| v + 1))
    }

    fn points(chunks: Region) -> Region {
        Region::new(chunks.min.map(|v| v * CELLS), chunks.max.map(|v| v * CELLS))
    }

    proptest! {
        #[test]
        fn what_concerns_a_box_is_found_in_order(
            stamps in prop::collection::vec((prop::array::uniform3(-90.0..90.0f64), 0.3..1_000.0f64), 1..60),
            boxes in prop::collection::vec((prop::array::uniform3(-20..20i32), 1..5i32, 0..40u64), 1..30),
        ) {
            let mut log = StampLog::default();
            let stamps: Vec<_> = stamps.into_iter().map(|(center, radius)| stamp(center, radius.min(1_000.0 / radius))).collect();
            for stamp in &stamps {
                let number = log.next();
                log.insert(number, Arc::new(*stamp), chunks(stamp.region()), 0);
            }
            for (min, size, after) in boxes {
                let region = Region::new(min, min.map(|v| v + size));
                let found: Vec<_> =
                    log.concerning(region, points(region), after).iter().map(|logged| logged.number).collect();
                let touches = |stamp: &QuantisedStamp| !stamp.region().intersection(&points(region)).is_empty();
                let expected: Vec<_> = (1..).zip(&stamps)
                    .filter(|(number, stamp)| *number > after && touches(stamp)).map(|(number, _)| number).collect();
                prop_assert_eq!(found, expected);
                let concerns = log.concerns(min, points(one(min)), after);
                prop_assert_eq!(concerns, !log.concerning(one(min), points(one(min)), after).is_empty());
            }
        }

        #[test]
        fn stamps_go_when_every_chunk_holds_them(
            stamps in prop::collection::vec((prop::array::uniform3(-20.0..20.0f64), 0.3..9.0f64), 1..30),
        ) {
            let mut log = StampLog::default();
            let mut all = Region::new([0; 3], [0; 3]);
            let mut stay = 0;
            for (center, radius) in stamps {
                let stamp = stamp(center, radius);
                let touched = chunks(stamp.region());
                let number = log.next();
                log.insert(number, Arc::new(stamp), touched, 0);
                stay += usize::from(touched.points().count() > MANY as usize);
                all = all.union(&touched);
            }
            for chunk in all.points() {
                log.release(chunk, points(one(chunk)));
            }
            prop_assert_eq!(log.len(), stay);
        }
    }

    #[test]
    fn small_stamps_are_found_at_few_nodes_however_many_there_are() {
        let mut log = StampLog::default();
        for x in 0..4_000 {
            let number = log.next();
            let stamp = stamp([f64::from(x) * 5.0, 0.0, 0.0], 3.0);
            log.insert(number, Arc::new(stamp), chunks(stamp.region()), 0);
        }
        assert!(nodes_near(&log.levels, one([7, 0, 0])).len() <= 16, "two levels");
        let found = log.concerning(one([7, 0, 0]), points(one([7, 0, 0])), 0);
        assert!((2..8).contains(&found.len()), "{}", found.len());
    }

    #[test]
    fn the_ends_of_the_lattice_are_no_exception() {
        let mut log = StampLog::default();
        let shape = QuantisedShape::sphere([f64::from(1 << 30), -f64::from(1 << 30), 0.0], 1_024.0).unwrap();
        let stamp = QuantisedStamp::new(shape, Operation::Dig, 0);
        let touched = chunks(stamp.region());
        let number = log.next();
        log.insert(number, Arc::new(stamp), touched, 0);
        assert!(log.concerns(touched.min, points(one(touched.min)), 0));
        let end = [i32::MAX / CELLS - 1, i32::MIN / CELLS + 1, 0];
        assert!(!log.concerns(end, points(one(end)), 0));
        assert!(!log.concerns([i32::MAX, i32::MIN, 0], Region::new([0; 3], [0; 3]), 0));
    }
}
