//! [`FrameBudget`]: how much of an update's time each kind of work may take on the main thread.

use core::time::Duration;

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;

/// The main thread's time in one update, and how much of it is spent.
#[derive(Resource, Debug, Default)]
pub(crate) struct FrameBudget {
    limit: Duration,
    spent: Duration,
    /// The time spent on edits, which is not limited and not part of `spent`.
    edits: Duration,
    /// Whether streaming holds back for new edits in this update.
    yields: bool,
    since_yielded: u32,
}

/// A kind of streaming work, with its share of the update's time. A share includes the time of the kinds before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Share {
    /// Loading and unloading chunks.
    Follow,
    /// Taking sampled chunks into the volumes.
    Fill,
    /// Showing meshes and starting new ones. Meshes of edits are exempt.
    Mesh,
}

impl Share {
    /// The share of `limit`. Loading leaves half of it to later work, filling a quarter.
    const fn of(self, limit: Duration) -> Duration {
        match self {
            Self::Follow => limit.checked_div(2).expect("not by zero"),
            Self::Fill => limit.checked_div(4).expect("not by zero").saturating_mul(3),
            Self::Mesh => limit,
        }
    }
}

/// Divides streaming's time in an update that holds back for new edits.
const HELD_BACK: u32 = 4;
/// Streaming holds back in at most one of this many updates, so that edits in every update do not stop it.
const EVERY: u32 = 5;
/// The approximate time to spawn or despawn a chunk's entity, which commands do later.
pub(crate) const ENTITY_TIME: Duration = Duration::from_micros(10);

impl FrameBudget {
    /// Begins an update. `edits`: whether it has new edits to apply.
    pub(crate) fn begin(&mut self, limit: Duration, edits: bool) {
        self.since_yielded = self.since_yielded.saturating_add(1);
        self.yields = edits && self.since_yielded >= EVERY;
        if self.yields {
            self.since_yielded = 0;
        }
        (self.limit, self.spent, self.edits) = (limit, Duration::ZERO, Duration::ZERO);
    }

    /// The deadline of a kind of work, for a system that began at `start`.
    pub(crate) fn until(&self, start: Instant, share: Share) -> Instant {
        let part = share.of(self.limit);
        let part = if self.yields { part / HELD_BACK } else { part };
        let left = part.saturating_sub(self.spent);
        start.checked_add(left).unwrap_or_else(|| start + Duration::from_secs(3_600))
    }

    /// Adds the time since `start` to the time spent.
    pub(crate) fn spend(&mut self, start: Instant) {
        self.spent += start.elapsed();
    }

    /// Adds `time` to the time spent on edits.
    pub(crate) fn spend_on_edits(&mut self, time: Duration) {
        self.edits += time;
    }

    /// The time that the update's systems have taken so far, edits included.
    pub(crate) fn spent(&self) -> Duration {
        self.spent + self.edits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_hold_streaming_back_but_never_stop_it() {
        let mut budget = FrameBudget::default();
        let (start, limit) = (Instant::now(), Duration::from_millis(8));
        let mut shares = |edits| {
            budget.begin(limit, edits);
            [Share::Follow, Share::Fill, Share::Mesh].map(|share| (budget.until(start, share) - start).as_millis())
        };
        assert_eq!(shares(false), [4, 6, 8]);
        (0..EVERY).for_each(|_| assert_eq!(shares(false), [4, 6, 8]));
        for _ in 0..3 {
            assert_eq!(shares(true), [1, 1, 2]);
            (1..EVERY).for_each(|_| assert_eq!(shares(true), [4, 6, 8]));
        }
    }

    #[test]
    fn edits_take_nothing_from_others() {
        let mut budget = FrameBudget::default();
        let start = Instant::now();
        budget.begin(Duration::from_millis(8), false);
        budget.spend_on_edits(Duration::from_millis(100));
        assert_eq!(budget.until(start, Share::Mesh) - start, Duration::from_millis(8));
        assert_eq!(budget.spent(), Duration::from_millis(100));
    }

    #[test]
    fn any_limit_will_do() {
        let mut budget = FrameBudget::default();
        let start = Instant::now();
        budget.begin(Duration::MAX, false);
        assert!(budget.until(start, Share::Fill) > start);
        budget.begin(Duration::ZERO, false);
        budget.spend(start);
        assert_eq!(budget.until(start, Share::Mesh), start);
    }
}
