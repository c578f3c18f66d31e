//! The mesher and its peers on the same samples of the same fields in one run: one thread, warm buffers.
//!
//! All boxes have a layer of padding, as chunks have: 35³ samples are 32³ cells. All meshers make positions, normals
//! and indices. They differ as follows:
//!
//! - fast-surface-nets reads `[1; 3]..[size − 2; 3]` of the padded samples, through a shape known at compile time; its
//!   normals are not of length 1, and it leaves the faces on one side of each border to the neighbour. It is timed
//!   unchanged, and with a pass that normalises its normals; ours is timed with and without normals.
//! - isomesh (marching cubes) and isosurface (0.0.4, marching cubes) call a function for each sample; see `peers.rs`.
//! - For fields without a surface, reading all samples once (xor) is close to the lower bound for any mesher.
//!
//! On terrain, caves and white noise up to 128³, ours is also timed with `Topology::Trilinear`, right after the
//! default, and so is the dual mesher, with means and with all vertices sharp. On terrain and caves of any size,
//! `MeshReport` checks the mesh, with one thread per processor. Up to 128³, these alone take about a minute:
//!
//! `-- '(terrain|caves|white noise) (35|64|128)³/(marchless (i16|f32)(, Trilinear|, dual|, sharp)?$|MeshReport)'`
//!
//! Terrains of 1³ to 50³ cells are those of William Svoboda, "Improving the Marching Cubes Algorithm for Use in
//! Deformable 3D Terrain", table 1. The table repeats the paper's times (C#, an Intel Core i5 of 3.5 GHz, no shared
//! vertices) for scale only: machine and terrain differ.
//!
//! `cargo bench -p marchless_benches --bench mesher` runs for about seven minutes and ends with a table. Names after
//! `--` filter as usual; the table shows what ran. With `MARCHLESS_RECORD=1` in the environment, the table is also
//! written to `record/`, under the processor's name. Times are the least of 20 samples (10 from 128³ on).

mod case;
mod peers;
mod record;
mod results;
mod threads;

use core::{hint::black_box, time::Duration};
use std::{env, process::ExitCode};

use criterion::{BenchmarkGroup, Criterion, SamplingMode, Throughput, measurement::WallTime};
use marchless::{DualSettings, MaterialSet, MeshSettings, Topology};
use marchless_benches::Field;

use case::Case;
use results::{Measured, Results, Subject};

/// Samples per axis.
const SIZES: [u32; 4] = [35, 64, 128, 256];
/// Cells per axis of the terrains in the paper's table, and its milliseconds.
const PAPER: [(u32, &str); 6] = [(1, "< 1"), (10, "1"), (20, "6"), (30, "19"), (40, "44"), (50, "83")];

fn main() -> ExitCode {
    if env::var_os(threads::WORKER).is_some() {
        threads::work();
        return ExitCode::SUCCESS;
    }
    // Criterion's own rule: without `--bench`, the caller is `cargo test`.
    let testing =
        !env::args().any(|argument| argument == "--bench") || env::args().any(|argument| argument == "--test");
    let filtered = env::args().skip(1).any(|argument| !argument.starts_with('-'));
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(150))
        .measurement_time(Duration::from_millis(400))
        .nresamples(2_000)
        .configure_from_args();
    let mut results = Results::default();
    for size in SIZES.into_iter().filter(|&size| !testing || size == SIZES[0]) {
        for field in Field::ALL {
            fields(&mut criterion, &mut results, &Case::new(field, size));
        }
    }
    for (cells, milliseconds) in PAPER.into_iter().filter(|&(cells, _)| !testing || cells == 10) {
        terrain(&mut criterion, &mut results, &Case::whole_terrain(cells, milliseconds));
    }
    if testing {
        threads::measure(1, 1);
        return ExitCode::SUCCESS;
    }
    if results.is_empty() {
        return ExitCode::SUCCESS; // `--list`, or a filter that nothing passes
    }
    let threads = (!filtered).then(|| threads::measure(4, 25));
    record::report(&results, threads.as_ref())
}

/// All meshers on one field of one size.
fn fields(criterion: &mut Criterion, results: &mut Results, case: &Case) {
    let mut group = open(criterion, case);
    ours::<i8>(&mut group, results, case);
    ours::<i16>(&mut group, results, case);
    ours::<f32>(&mut group, results, case);
    results.measure(&mut group, case, Subject::Bare, || {
        case.ours::<f32>(MeshSettings { normals: false, ..MeshSettings::default() })
    });
    if matches!(case.field, Field::Terrain | Field::Caves) {
        results.measure(&mut group, case, Subject::Report, || case.report());
    }
    let nets = |normalise| peers::nets(case.size, case.distances().to_vec(), normalise);
    results.measure(&mut group, case, Subject::Nets, || nets(false));
    if case.size < 128 {
        results.measure(&mut group, case, Subject::NetsNormalised, || nets(true));
    }
    if case.size == 256 && matches!(case.field, Field::Terrain | Field::Caves) {
        let steps = || case.weights().into_iter().map(peers::Steps).collect();
        results.measure(&mut group, case, Subject::NetsI8, || peers::nets(case.size, steps(), false));
    }
    results.measure(&mut group, case, Subject::Isosurface, || peers::isosurface(case));
    results.measure(&mut group, case, Subject::Isomesh, || peers::isomesh(case));
    results.check_same_triangles(case, Subject::Ours(f32::NAME), Subject::Isomesh);
    if matches!(case.field, Field::Terrain | Field::Caves) && [35, 64].contains(&case.size) {
        results.measure(&mut group, case, Subject::IsomeshDual, || peers::isomesh_dual(case));
    }
    group.finish();
}

/// A whole terrain as in the paper: ours, and the fastest of the peers.
fn terrain(criterion: &mut Criterion, results: &mut Results, case: &Case) {
    let mut group = open(criterion, case);
    ours::<i16>(&mut group, results, case);
    ours::<f32>(&mut group, results, case);
    results.measure(&mut group, case, Subject::Nets, || peers::nets(case.size, case.distances().to_vec(), false));
    group.finish();
}

fn open<'a>(criterion: &'a mut Criterion, case: &Case) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(case.name());
    group.throughput(Throughput::Elements(u64::from(case.size - 3).pow(3)));
    group.sample_size(case.sample_size()).sampling_mode(SamplingMode::Flat);
    group
}

/// Ours on weights of type `W`: with both topologies on fields of noise, and beside a mere read of the weights on
/// fields without a surface.
fn ours<W: Measured>(group: &mut BenchmarkGroup<'_, WallTime>, results: &mut Results, case: &Case) {
    results.measure(group, case, Subject::Ours(W::NAME), || case.ours::<W>(MeshSettings::default()));
    if matches!(case.field, Field::Terrain | Field::Caves | Field::WhiteNoise) && [35, 64, 128].contains(&case.size) {
        results.measure(group, case, Subject::Trilinear(W::NAME), || {
            case.ours::<W>(MeshSettings { topology: Topology::Trilinear, ..MeshSettings::default() })
        });
        results.measure(group, case, Subject::Dual(W::NAME), || case.dual::<W>(DualSettings::default()));
        results.measure(group, case, Subject::Sharp(W::NAME), || {
            case.dual::<W>(DualSettings { sharp: MaterialSet::ALL, ..DualSettings::default() })
        });
    }
    if matches!(case.field, Field::Empty | Field::Solid) {
        results.measure(group, case, Subject::Reading(W::NAME), || {
            let weights = case.weights::<W>();
            move || W::read(black_box(&weights))
        });
    }
}
