//! Random numbers by position.

use fastrand::Rng;

/// A random number for each point, or for any other three numbers, and each seed.
///
/// Tests that need numbers one after the other take [`Rng::with_seed`].
pub(crate) fn random(seed: u64, point: [impl Into<i64>; 3]) -> u64 {
    point.into_iter().fold(seed, |seed, coordinate| Rng::with_seed(seed ^ coordinate.into() as u64).u64(..))
}
