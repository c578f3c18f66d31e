//! [`CachedSource`]: remembers what a source has answered for leaves.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy_platform::collections::HashMap;
use marchless::{Bound, Source, SourceRegion};

/// The most samples that are remembered: about 130 MB, the leaves of a view.
const MOST_SAMPLES: usize = 40 << 20;
/// Smaller regions are not remembered.
const FEWEST_SAMPLES: usize = 4_096;
/// The bytes of a sample.
const SAMPLE_BYTES: usize = size_of::<i16>() + size_of::<u8>();

/// A source that remembers what it has answered for large regions, as a leaf is meshed again whenever a neighbour's
/// level changes, and after each edit. Shared with jobs.
pub(crate) struct CachedSource {
    source: Arc<dyn Source>,
    cache: Mutex<Cache>,
}

#[derive(Default)]
struct Cache {
    answers: HashMap<Place, Answer>,
    /// The number of samples in all answers.
    samples: usize,
    /// The number of questions so far.
    now: u64,
}

/// The level, the lowest point and the size of a region.
type Place = (u8, [i32; 3], [u32; 3]);

struct Answer {
    /// Weights, as blocks have them, and materials.
    samples: Arc<(Vec<i16>, Vec<u8>)>,
    last_used: u64,
}

impl CachedSource {
    pub(crate) fn new(source: Arc<dyn Source>) -> Self {
        Self { source, cache: Mutex::default() }
    }

    /// The memory that the answers take, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.lock().samples * SAMPLE_BYTES
    }

    fn lock(&self) -> MutexGuard<'_, Cache> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Source for CachedSource {
    fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
        self.source.fill(region, distances, materials);
    }

    fn fill_weights(&self, region: &SourceRegion, distances: &mut Vec<f32>, weights: &mut [i16], materials: &mut [u8]) {
        let place = (region.level, region.min, region.size);
        let is_large = weights.len() >= FEWEST_SAMPLES;
        let known = if is_large { self.lock().find(place) } else { None };
        if let Some(known) = known {
            weights.copy_from_slice(&known.0);
            materials.copy_from_slice(&known.1);
            return;
        }
        self.source.fill_weights(region, distances, weights, materials);
        if is_large {
            self.lock().insert(place, (weights.to_vec(), materials.to_vec()));
        }
    }

    fn bound(&self, region: &SourceRegion) -> Bound {
        self.source.bound(region)
    }

    fn bound_closely(&self, region: &SourceRegion) -> Bound {
        self.source.bound_closely(region)
    }
}

impl Cache {
    fn find(&mut self, place: Place) -> Option<Arc<(Vec<i16>, Vec<u8>)>> {
        self.now += 1;
        let answer = self.answers.get_mut(&place)?;
        answer.last_used = self.now;
        Some(answer.samples.clone())
    }

    fn insert(&mut self, place: Place, samples: (Vec<i16>, Vec<u8>)) {
        self.samples += samples.0.len();
        let answer = Answer { samples: Arc::new(samples), last_used: self.now };
        if let Some(former) = self.answers.insert(place, answer) {
            self.samples -= former.samples.0.len();
        }
        if self.samples > MOST_SAMPLES {
            self.forget_half();
        }
    }

    /// Forgets the half of the answers that have not been used for longest.
    fn forget_half(&mut self) {
        let mut uses: Vec<u64> = self.answers.values().map(|answer| answer.last_used).collect();
        let middle = uses.len() / 2;
        let (_, middle, _) = uses.select_nth_unstable(middle);
        let middle = *middle;
        self.answers.retain(|_, answer| answer.last_used >= middle);
        self.samples = self.answers.values().map(|answer| answer.samples.0.len()).sum();
    }
}

#[cfg(test)]
mod tests {
    use core::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    struct Counting(Arc<AtomicUsize>);

    impl Source for Counting {
        fn fill(&self, region: &SourceRegion, distances: &mut [f32], materials: &mut [u8]) {
            self.0.fetch_add(1, Ordering::Relaxed);
            for (index, (distance, material)) in distances.iter_mut().zip(materials).enumerate() {
                (*distance, *material) = ((index as f32 - 7.3) / 91.0 + region.min[0] as f32, (index % 200) as u8);
            }
        }
    }

    #[test]
    fn a_second_answer_makes_the_same_samples() {
        let asked = Arc::new(AtomicUsize::new(0));
        let source = CachedSource::new(Arc::new(Counting(asked.clone())));
        let ask = |level: u8, x: i32, size: u32| {
            let region = SourceRegion { min: [x, 0, 0], size: [size; 3], level, spacing: f64::from(1 << level) };
            let len = (size * size * size) as usize;
            let (mut weights, mut materials) = (vec![0; len], vec![0; len]);
            source.fill_weights(&region, &mut Vec::new(), &mut weights, &mut materials);
            (weights, materials)
        };
        for (level, x) in [(0, 0), (3, 0), (3, 5), (6, -1)] {
            assert_eq!(ask(level, x, 16), ask(level, x, 16));
        }
        assert_eq!(asked.load(Ordering::Relaxed), 4);
        assert!(source.bytes() > 0);
        // Small regions are asked for again.
        assert_eq!(ask(1, 0, 4), ask(1, 0, 4));
        assert_eq!(asked.load(Ordering::Relaxed), 6);
    }

    #[test]
    fn it_forgets_what_has_not_been_used_for_long() {
        let mut cache = Cache::default();
        for x in 0..120 {
            cache.insert((1, [x, 0, 0], [80; 3]), (vec![0; 512_000], vec![0; 512_000]));
            assert!(cache.find((1, [0; 3], [80; 3])).is_some(), "it is used all the time");
            assert!(cache.samples <= MOST_SAMPLES);
        }
        assert!(cache.find((1, [1, 0, 0], [80; 3])).is_none());
        assert!(cache.find((1, [119, 0, 0], [80; 3])).is_some());
    }
}
