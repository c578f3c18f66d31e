//! Flood fill and components.
//!
//! The field is caves of 256³ points with six neighbours each. The peers:
//! - a plain fill with a queue of points over bytes: one byte per point for the mask, and one for the filled points.
//!   For the components, it fills one after another and counts their points;
//! - `ndarray-ndimage` (0.6): `label`, a pass over rows of points and a pass over labels. A fill from a seed then looks
//!   for all points with the seed's label.
//!
//! No crate was found that fills a volume of bits. Other candidates: `building_blocks_search` (0.7.1, not maintained),
//! whose `von_neumann_flood_fill3` takes 1.6 times as long as `label`; `scirs2-ndimage`, which labels point by point
//! through a hash map; `fovea` and `imageproc`, which handle images in two dimensions; graph crates (`petgraph`,
//! `pathfinding`), for which every point is a node.

use std::{collections::VecDeque, hint::black_box, time::Duration};

use criterion::{BenchmarkGroup, Criterion, SamplingMode, measurement::WallTime};
use marchless::{
    Samples, Shape,
    bits::{BitGrid, Connectivity},
};
use marchless_benches::Field;
use ndarray_ndimage::{Kernel3d, label};

pub(crate) fn benches(criterion: &mut Criterion) {
    let testing = !std::env::args().any(|argument| argument == "--bench");
    let size = if testing { 40 } else { 256 };
    let shape = Shape::cube(size).expect("it is small");
    let distances = Field::Caves.distances(size);
    let grid = BitGrid::from_samples(Samples::new(shape, &distances).expect("one a point"), 0.0).expect("it is small");
    let mask: Vec<u8> = distances.iter().map(|&distance| u8::from(distance < 0.0)).collect();
    let n = size as usize;
    let volume = ndarray::Array3::from_shape_fn((n, n, n), |(z, y, x)| mask[x + n * (y + n * z)] != 0);
    let star = Kernel3d::Star.generate();

    let components = grid.components(Connectivity::Six);
    let largest = components.largest().and_then(|index| components.get(index)).expect("there are caves");
    let seed = largest.first;
    // All methods agree.
    assert_eq!(label::<u32>(&volume, &star).1, components.len());
    assert_eq!(queue_components(&mask, n).len(), components.len());
    assert_eq!(queue_flood(&mask, n, shape.index(seed)).iter().filter(|&&filled| filled == 1).count(), largest.size);

    let mut group = group(criterion, "flood 256³ caves");
    group.bench_function("marchless", |b| b.iter(|| black_box(&grid).flood(&[seed], Connectivity::Six)));
    group.bench_function("queue over bytes", |b| b.iter(|| queue_flood(black_box(&mask), n, shape.index(seed))));
    group.bench_function("ndarray-ndimage", |b| {
        b.iter(|| {
            let (labels, _) = label::<u32>(black_box(&volume), &star);
            let [x, y, z] = seed.map(|v| v as usize);
            let wanted = labels[[z, y, x]];
            labels.mapv(|label| label == wanted)
        });
    });
    group.finish();

    let mut group = self::group(criterion, "components 256³ caves");
    group.bench_function("marchless", |b| b.iter(|| black_box(&grid).components(Connectivity::Six)));
    group.bench_function("queue over bytes", |b| b.iter(|| queue_components(black_box(&mask), n)));
    group.bench_function("ndarray-ndimage", |b| b.iter(|| label::<u32>(black_box(&volume), &star)));
    group.finish();

    let mut group = self::group(criterion, "regions 256³ caves, more neighbours");
    for connectivity in [Connectivity::Eighteen, Connectivity::TwentySix] {
        group.bench_function(format!("flood, {connectivity:?}"), |b| {
            b.iter(|| black_box(&grid).flood(&[seed], connectivity));
        });
        group.bench_function(format!("components, {connectivity:?}"), |b| {
            b.iter(|| black_box(&grid).components(connectivity));
        });
    }
    group.finish();
}

fn group<'a>(criterion: &'a mut Criterion, name: &str) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    group
}

/// The points that a fill with a queue reaches from a point, a byte each.
fn queue_flood(mask: &[u8], n: usize, seed: usize) -> Vec<u8> {
    let mut visited = vec![0; mask.len()];
    fill(mask, n, seed, &mut visited, &mut VecDeque::new());
    visited
}

/// The sizes of all components, by fills with a queue.
fn queue_components(mask: &[u8], n: usize) -> Vec<usize> {
    let (mut visited, mut queue, mut sizes) = (vec![0; mask.len()], VecDeque::new(), Vec::new());
    for point in 0..mask.len() {
        if mask[point] != 0 && visited[point] == 0 {
            sizes.push(fill(mask, n, point, &mut visited, &mut queue));
        }
    }
    sizes
}

/// Fills from a point; returns the number of filled points.
fn fill(mask: &[u8], n: usize, seed: usize, visited: &mut [u8], queue: &mut VecDeque<u32>) -> usize {
    let mut count = 0;
    visited[seed] = 1;
    queue.push_back(seed as u32);
    let (side, slab) = (n as u32, (n * n) as u32);
    while let Some(point) = queue.pop_front() {
        count += 1;
        let (x, y, z) = (point % side, point / side % side, point / slab);
        let mut visit = |next: u32| {
            if mask[next as usize] != 0 && visited[next as usize] == 0 {
                visited[next as usize] = 1;
                queue.push_back(next);
            }
        };
        if x > 0 {
            visit(point - 1);
        }
        if x + 1 < side {
            visit(point + 1);
        }
        if y > 0 {
            visit(point - side);
        }
        if y + 1 < side {
            visit(point + side);
        }
        if z > 0 {
            visit(point - slab);
        }
        if z + 1 < side {
            visit(point + slab);
        }
    }
    count
}
