//! [`FrameBudget`]: how much of an update's time each kind of work may take on the main thread.

use core::time::Duration;

use bevy_ecs::prelude::*;
use bevy_platform::time::Instant;

/// The main thread's time in one update, and what of it has been spent.
#[derive(Resource, Debug, Default)]
pub(crate) struct FrameBudget {
    limit: Duration,
    spent: Duration,
    /// Apart from that: edits take what they need.
    edits: Duration,
    /// Whether new edits have this update for themselves, and for how many updates streaming has not been held back.
    yields: bool,
    since_yielded: u32,
}

/// A kind of work, by what it may spend of the update's time together with all that came before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Share {
    /// Loading and unloading chunks.
    Follow,
    /// Taking sampled chunks in.
    Fill,
    /// Showing meshes, and starting new ones. Those of edits do not ask.
    Mesh,
}

impl Share {
    /// The part of the update's time. Half of it is left for what follows loading, a quarter for what follows filling.
    const fn of(self, limit: Duration) -> Duration {
        match self {
            Self::Follow => limit.checked_div(2).expect("not by zero"),
            Self::Fill => limit.checked_div(4).expect("not by zero").saturating_mul(3),
            Self::Mesh => limit,
        }
    }
}

/// What streaming has of its time where it holds back for new edits.
const HELD_BACK: u32 = 4;
/// Streaming holds back in one of this many updates at most, so that edits in every update do not stop it.
const EVERY: u32 = 5;
/// About how long it takes to spawn or despawn a chunk's entity, which commands do later.
pub(crate) const ENTITY_TIME: Duration = Duration::from_micros(10);

impl FrameBudget {
    /// Begins an update. `edits`: whether new edits are to be applied.
    pub(crate) fn begin(&mut self, limit: Duration, edits: bool) {
        self.since_yielded = self.since_yielded.saturating_add(1);
        self.yields = edits && self.since_yielded >= EVERY;
        if self.yields {
            self.since_yielded = 0;
        }
        (self.limit, self.spent, self.edits) = (limit, Duration::ZERO, Duration::ZERO);
    }

    /// Until when a system that has begun at `start` may go on with a kind of work.
    pub(crate) fn until(&self, start: Instant, share: Share) -> Instant {
        let part = share.of(self.limit);
        let part = if self.yields { part / HELD_BACK } else { part };
        let left = part.saturating_sub(self.spent);
        start.checked_add(left).unwrap_or_else(|| start + Duration::from_secs(3_600))
    }

    /// Notes that a system that has begun at `start` is done.
    pub(crate) fn spend(&mut self, start: Instant) {
        self.spent += start.elapsed();
    }

    /// Notes that edits have taken so long.
    pub(crate) fn spend_on_edits(&mut self, time: Duration) {
        self.edits += time;
    }

    /// What the update's systems have taken so far.
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
