//! [`Times`]: how long each of many updates took.

use std::time::Duration;

/// How long each of many updates took, shortest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Times(Vec<Duration>);

impl Times {
    /// The number of updates.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The sum of all times.
    pub fn total(&self) -> Duration {
        self.0.iter().sum()
    }

    /// The mean; zero if there are none.
    pub fn mean(&self) -> Duration {
        self.total() / u32::try_from(self.count().max(1)).unwrap_or(u32::MAX)
    }

    /// The time that a share of the updates, 0 to 1, does not exceed; zero if there are none.
    pub fn quantile(&self, share: f64) -> Duration {
        let last = self.0.len().saturating_sub(1);
        self.0.get((last as f64 * share).round() as usize).copied().unwrap_or_default()
    }

    /// The longest; zero if there are none.
    pub fn max(&self) -> Duration {
        self.0.last().copied().unwrap_or_default()
    }
}

impl FromIterator<Duration> for Times {
    fn from_iter<I: IntoIterator<Item = Duration>>(times: I) -> Self {
        let mut times: Vec<_> = times.into_iter().collect();
        times.sort();
        Self(times)
    }
}
