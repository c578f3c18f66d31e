//! A leaf beside finer neighbours, meshed by ours and by transvoxel 2.0.0 on the same samples in one run: one thread.
//!
//! The leaf has 32³ cells. Across 0, 1, 3 or 6 of its faces the neighbours are finer, and so is everything else that
//! touches one of these faces. At no edge of the leaf do levels alternate then. Both meshers make positions, normals and
//! indices from `f32` samples, join levels by transition cells, and make equally many triangles; this is checked. They
//! differ as follows:
//!
//! - Ours reads arrays into warm buffers. The checks of `LeafSamples::new` are part of its time.
//! - transvoxel makes a new mesh each time. It is timed twice: with `extract_from_field` as its documentation shows it,
//!   where a function returns samples from an array, and with `extract` on blocks that were cached before the timing.
//!   Neither pays for noise.
//! - transvoxel's normals on a finer face are those of the leaf's own samples at every second point, so they differ
//!   from the finer neighbour's. It moves points by another rule, and each transition side has vertices of its own.
//!
//! `cargo bench -p marchless_benches --bench levels` runs for less than a minute and ends with a table. Names after
//! `--` filter as usual. Times are the least of 20 samples.

mod block;
mod peer;
mod results;

use core::time::Duration;
use std::env;

use criterion::{Criterion, SamplingMode, Throughput};
use marchless_benches::Field;

use block::Block;
use results::{Results, SAMPLES, Subject};

const FIELDS: [Field; 2] = [Field::Terrain, Field::Caves];
/// Numbers of faces across which neighbours are finer.
const FACES: [usize; 4] = [0, 1, 3, 6];

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(150))
        .measurement_time(Duration::from_millis(400))
        .nresamples(2_000)
        .sample_size(SAMPLES)
        .configure_from_args();
    let mut results = Results::default();
    for field in FIELDS {
        let distances = field.distances(block::SIZE);
        for faces in FACES {
            compare(&mut criterion, &mut results, &Block::new(field, &distances, faces));
        }
    }
    // Criterion's own rule: without `--bench`, the caller is `cargo test`.
    let testing =
        !env::args().any(|argument| argument == "--bench") || env::args().any(|argument| argument == "--test");
    if !testing && !results.is_empty() {
        println!("\n{}", results.table());
    }
}

/// All meshers on one block.
fn compare(criterion: &mut Criterion, results: &mut Results, block: &Block<'_>) {
    let mut group = criterion.benchmark_group(block.name());
    group.throughput(Throughput::Elements(u64::from(block::CELLS).pow(3)));
    group.sampling_mode(SamplingMode::Flat);
    results.measure(&mut group, block, Subject::Ours, || block.ours());
    results.measure(&mut group, block, Subject::Field, || peer::field(block));
    results.measure(&mut group, block, Subject::Cached, || peer::cached(block));
    results.check(block);
    group.finish();
}
