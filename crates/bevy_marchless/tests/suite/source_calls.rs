//! Counts of noise evaluations for all chunks around a viewer, and of chunks sampled without a surface.

use std::sync::Arc;
use std::thread;

use bevy_marchless::source::{Bound, Caves, Landscape, LandscapeSettings, NoiseHeights, Solid, Source, SourceRegion};

/// The number of samples along a chunk.
const CELLS: i32 = 32;

/// The requests that streaming makes of a source.
#[derive(Debug, Default)]
struct Asked {
    chunks: u64,
    filled: u64,
    /// The filled chunks without a surface.
    empty: u64,
    calls: u64,
}

/// Loads all chunks of a ball of 8 chunks around a viewer near the ground: bound, closer bound, samples. `checked`: the
/// same source, to find surfaces without counting the evaluations.
fn load(source: &dyn Source, checked: &dyn Source, calls: impl Fn() -> u64) -> Asked {
    let mut asked = Asked::default();
    let middle = [16, 70, 16];
    let range = 8 * CELLS;
    for (z, y, x) in (-9..=9).flat_map(|z| (-9..=11).flat_map(move |y| (-9..=9).map(move |x| (z, y, x)))) {
        let min = [x, y, z].map(|chunk| chunk * CELLS);
        let away: i32 = (0..3)
            .map(|axis| middle[axis] - middle[axis].clamp(min[axis], min[axis] + CELLS))
            .map(|away| away * away)
            .sum();
        if away > range * range {
            continue;
        }
        asked.chunks += 1;
        let region = SourceRegion { min, size: [CELLS as u32; 3], level: 0, spacing: 1.0 };
        let around = region.grown(4);
        if source.bound(&around) != Bound::Mixed || source.bound_closely(&region) != Bound::Mixed {
            continue;
        }
        asked.filled += 1;
        let (mut distances, mut materials) = (vec![0.0; region.len()], vec![0; region.len()]);
        source.fill(&region, &mut distances, &mut materials);
        // The surface of a chunk lies in its cells, which reach to the first samples of the next chunks.
        let region = SourceRegion { size: region.size.map(|size| size + 1), ..region };
        let (mut distances, mut materials) = (vec![0.0; region.len()], vec![0; region.len()]);
        checked.fill(&region, &mut distances, &mut materials);
        let inside = distances.iter().filter(|distance| **distance < 0.0).count();
        asked.empty += u64::from(inside == 0 || inside == distances.len());
    }
    asked.calls = calls();
    asked
}

/// The columns of a chunk, and its samples.
const COLUMNS: u64 = (CELLS * CELLS) as u64;
const SAMPLES: u64 = COLUMNS * CELLS as u64;

#[test]
fn a_height_field_needs_a_fifth_of_the_noise_and_fills_few_chunks_in_vain() {
    let hills = NoiseHeights::default();
    let asked = load(&hills, &NoiseHeights::default(), || hills.noise_calls());
    assert!(asked.calls * 5 <= asked.chunks * COLUMNS * 5, "{asked:?}");
    assert!(asked.empty * 100 <= asked.filled * 15, "{asked:?}");
    assert!(asked.filled > 100);
}

#[test]
fn caves_need_half_of_the_noise_and_fill_few_chunks_in_vain() {
    for (caves, times) in [(Caves::default(), 2), (Caves { lattice: 2, ..Default::default() }, 10)] {
        let solid = Solid::default().subtraction(caves);
        let settings = LandscapeSettings { solid, ..Default::default() };
        let [source, checked] = [(); 2].map(|()| Landscape::new(settings.clone()).expect("in range"));
        let asked = load(&source, &checked, || source.noise_calls());
        assert!(asked.calls * times <= asked.chunks * (COLUMNS * 5 + SAMPLES * 3), "{asked:?}");
        assert!(asked.empty * 100 <= asked.filled * 15, "{asked:?}");
    }
}

#[test]
fn a_column_that_was_evaluated_costs_no_noise_above_and_below() {
    let hills = NoiseHeights::default();
    let at = |y: i32| SourceRegion { min: [-7, y, 40], size: [33; 3], level: 0, spacing: 0.7 };
    let fill = |region: &SourceRegion| {
        let (mut distances, mut materials) = (vec![0.0; region.len()], vec![0; region.len()]);
        hills.fill(region, &mut distances, &mut materials);
    };
    fill(&at(0));
    let calls = hills.noise_calls();
    assert!(calls > 0);
    for y in [-33, 33, 66] {
        fill(&at(y));
        assert_eq!(hills.noise_calls(), calls);
    }
    fill(&SourceRegion { spacing: 0.8, ..at(0) });
    assert!(hills.noise_calls() > calls, "columns of another spacing are others");
}

/// Threads that need the same columns at the same time evaluate them once, and all get the same heights.
#[test]
fn threads_share_columns() {
    let hills = Arc::new(NoiseHeights::default());
    let region = SourceRegion { min: [0, 40, 0], size: [32; 3], level: 0, spacing: 1.0 };
    let fill = |hills: &NoiseHeights| {
        let (mut distances, mut materials) = (vec![0.0; region.len()], vec![0; region.len()]);
        hills.fill(&region, &mut distances, &mut materials);
        distances
    };
    let expected = fill(&NoiseHeights::default());
    thread::scope(|scope| {
        let threads: Vec<_> = (0..8).map(|_| scope.spawn(|| fill(&hills))).collect();
        for thread in threads {
            assert_eq!(thread.join().expect("no panic"), expected);
        }
    });
    let alone = NoiseHeights::default();
    fill(&alone);
    assert_eq!(hills.noise_calls(), alone.noise_calls());
}

/// Long flights do not keep all columns; dropped ones are evaluated again, to the same heights.
#[test]
fn columns_are_dropped_and_come_back() {
    let hills = NoiseHeights::default();
    let sample = |x: i32| {
        let region = SourceRegion { min: [x, 56, 0], size: [1; 3], level: 0, spacing: 1.0 };
        let mut distance = [0.0];
        hills.fill(&region, &mut distance, &mut [0]);
        distance[0]
    };
    let first = sample(5);
    let calls = hills.noise_calls();
    sample(6);
    assert_eq!(hills.noise_calls(), calls);
    for step in 1..20_000 {
        sample(step * 32);
    }
    let calls = hills.noise_calls();
    assert_eq!(sample(5), first);
    assert!(hills.noise_calls() > calls);
}
