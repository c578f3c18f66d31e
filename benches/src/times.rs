//! [`Times`]: the time of one iteration, from samples of many.

use std::time::{Duration, Instant};

/// The seconds of one iteration in each of criterion's samples.
#[derive(Default)]
pub struct Times(Vec<f64>);

impl Times {
    /// Calls `once` as often as a sample wants it, and returns the time that all calls took.
    pub fn of(&mut self, iterations: u64, mut once: impl FnMut()) -> Duration {
        let start = Instant::now();
        (0..iterations).for_each(|_| once());
        let elapsed = start.elapsed();
        self.0.push(elapsed.as_secs_f64() / iterations as f64);
        elapsed
    }

    /// The least of the last `samples` times; those of the warm-up came before them. `None` if nothing was timed.
    pub fn least(&self, samples: usize) -> Option<f64> {
        self.0.iter().rev().take(samples).copied().reduce(f64::min)
    }
}
