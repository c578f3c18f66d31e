//! The mesher and fast-surface-nets on the same cells of the same fields, with warm buffers.
//!
//! All boxes have a layer of padding, as chunks have: 35³ samples are 32³ cells. Both make shared vertices and normals;
//! only ours are of length 1, and ours are closed with the neighbours' on all sides, where surface nets leave that to one
//! side of each border.

use core::{hint::black_box, time::Duration};

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime};
use fast_surface_nets::{
    SurfaceNetsBuffer,
    ndshape::{RuntimeShape, Shape as _},
    surface_nets,
};
use marchless::{MeshBuffer, MeshSettings, Mesher, Samples, Shape, Weight};
use marchless_benches::Field;

/// Samples per axis.
const SIZES: [u32; 3] = [35, 64, 128];

fn mesher(criterion: &mut Criterion) {
    for size in SIZES {
        for field in Field::ALL {
            let distances = field.distances(size);
            let fixed: Vec<i16> = distances.iter().map(|&distance| i16::from_voxels(distance)).collect();
            let mut group = criterion.benchmark_group(format!("{} {size}³", field.name()));
            group.throughput(Throughput::Elements(u64::from(size - 3).pow(3)));
            ours(&mut group, "marchless i16", size, &fixed);
            ours(&mut group, "marchless f32", size, &distances);
            nets(&mut group, size, &distances);
            group.finish();
        }
    }
}

fn ours<W: Weight>(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, size: u32, weights: &[W]) {
    let shape = Shape::cube(size).expect("the sizes are small");
    let samples = Samples::new(shape, weights).expect("one weight a sample").padded();
    let (mut mesher, mut mesh, settings) = (Mesher::new(), MeshBuffer::new(), MeshSettings::default());
    mesher.mesh(samples, &settings, &mut mesh).expect("there are cells to mesh");
    println!("{name}: {} triangles, {} vertices", mesh.triangle_count(), mesh.positions.len());
    group.bench_function(name, |bencher| {
        bencher.iter(|| mesher.mesh(black_box(samples), &settings, &mut mesh));
    });
}

fn nets(group: &mut BenchmarkGroup<'_, WallTime>, size: u32, distances: &[f32]) {
    let name = "fast-surface-nets f32";
    let shape = RuntimeShape::<u32, 3>::new([size; 3]);
    assert_eq!(shape.usize(), distances.len());
    let mut mesh = SurfaceNetsBuffer::default();
    // The samples 1 to size − 2 on each axis, as in a padded block.
    let mut run = |distances: &[f32]| surface_nets(distances, &shape, [1; 3], [size - 2; 3], &mut mesh);
    run(distances);
    group.bench_function(name, |bencher| bencher.iter(|| run(black_box(distances))));
    println!("{name}: {} triangles, {} vertices", mesh.indices.len() / 3, mesh.positions.len());
}

criterion_group! {
    name = benches;
    // 54 of them: a shorter run than criterion's own, so that the whole table takes about two minutes.
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_millis(1500))
        .sample_size(40);
    targets = mesher
}
criterion_main!(benches);
