//! Shifts, boolean operations, morphology and automata on 256³ points of caves, compared with a copy of the grid.
//!
//! All of them write into an existing grid. Compare each time with `copy` of the same run.

use std::{hint::black_box, time::Duration};

use criterion::Criterion;
use marchless::{
    Samples, Shape,
    bits::{BitGrid, Connectivity, Rule},
};
use marchless_benches::Field;

const SIZE: u32 = 256;

pub(crate) fn benches(criterion: &mut Criterion) {
    let shape = Shape::cube(SIZE).expect("it is small");
    let grid_of = |field: Field| {
        let distances = field.distances(SIZE);
        let samples = Samples::new(shape, &distances).expect("one a point");
        BitGrid::from_samples(samples, 0.0).expect("it is small")
    };
    let (caves, other) = (grid_of(Field::Caves), grid_of(Field::Terrain));
    let mut out = BitGrid::new(shape).expect("it is small");
    // Points follow most of their neighbours.
    let rule = Rule::new(&Vec::from_iter(14..=26), &Vec::from_iter(13..=26)).expect("counts of neighbours");

    let mut group = criterion.benchmark_group("operations on 256³ caves");
    group.sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    let mut bench = |name: &str, operation: &mut dyn FnMut(&mut BitGrid)| {
        group.bench_function(name, |bencher| bencher.iter(|| operation(black_box(&mut out))));
    };
    bench("copy", &mut |out| out.copy_from(&caves).expect("shapes are the same"));
    bench("and", &mut |out| out.and_with(&other).expect("shapes are the same"));
    bench("or", &mut |out| out.or_with(&other).expect("shapes are the same"));
    bench("xor", &mut |out| out.xor_with(&other).expect("shapes are the same"));
    bench("subtract", &mut |out| out.subtract(&other).expect("shapes are the same"));
    bench("invert", &mut BitGrid::invert);
    for offset in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [5, -3, 2], [70, 0, 0]] {
        let name = format!("shift by {offset:?}");
        bench(&name, &mut |out| caves.shift_into(offset, out).expect("shapes are the same"));
    }
    for (neighbours, connectivity) in [6, 18, 26].into_iter().zip(Connectivity::ALL) {
        let dilate = format!("dilate, {neighbours} neighbours");
        bench(&dilate, &mut |out| caves.dilate_into(connectivity, out).expect("shapes are the same"));
        let erode = format!("erode, {neighbours} neighbours");
        bench(&erode, &mut |out| caves.erode_into(connectivity, out).expect("shapes are the same"));
    }
    bench("step of an automaton", &mut |out| caves.step_into(&rule, out).expect("shapes are the same"));
    group.finish();
}
