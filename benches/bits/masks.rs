//! Case masks: by rows, by tiles, and by the word strides of the peer, at 256³.
//!
//! On one shared core of an AMD EPYC (Zen 4, AVX-512), rows take 2.0 ms and tiles 2.6 ms on any field. The peer takes 6
//! ms on an empty field, 39 ms on ground alone, 47 ms on caves, 53 ms on white noise. The peer's algorithm in C takes
//! longer (gcc -O2: 58 ms on caves, 130 ms on white noise; -O3: 52 ms and 169 ms), since LLVM turns most branches into
//! selections.

use core::{hint::black_box, time::Duration};
use std::env;

use criterion::{Criterion, SamplingMode, Throughput};
use marchless::{
    Samples, Shape,
    bits::{BitGrid, TileGrid},
};
use marchless_benches::Field;

use crate::word_stride::WordStride;

const FIELDS: [Field; 4] = [Field::Empty, Field::Solid, Field::Caves, Field::WhiteNoise];

pub(crate) fn benches(criterion: &mut Criterion) {
    // Criterion's own rule: without `--bench`, the caller is `cargo test`.
    let testing =
        !env::args().any(|argument| argument == "--bench") || env::args().any(|argument| argument == "--test");
    let size = if testing { 64 } else { 256 };
    for field in FIELDS {
        let mut group = criterion.benchmark_group(format!("case masks/{} {size}³", field.name()));
        group.sample_size(10).sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(100)).measurement_time(Duration::from_millis(500));
        let mut prepared = None;
        group.throughput(Throughput::Elements(u64::from(size - 1).pow(3)));
        group.bench_function("marchless, rows", |bencher| {
            let Prepared { grid, masks, .. } = prepared.get_or_insert_with(|| Prepared::new(field, size));
            bencher.iter(|| black_box(&*grid).case_masks_into(black_box(masks)));
        });
        group.bench_function("marchless, tiles", |bencher| {
            let Prepared { tiles, masks_of_tiles, .. } = prepared.get_or_insert_with(|| Prepared::new(field, size));
            bencher.iter(|| black_box(&*tiles).case_masks_into(black_box(masks_of_tiles)));
        });
        group.bench_function("word stride", |bencher| {
            let Prepared { word_stride, .. } = prepared.get_or_insert_with(|| Prepared::new(field, size));
            bencher.iter(|| black_box(&mut *word_stride).run());
        });
        group.finish();
    }
}

/// The bits in every method's form, and warm buffers.
struct Prepared {
    grid: BitGrid,
    masks: Vec<u8>,
    tiles: TileGrid,
    masks_of_tiles: Vec<u8>,
    word_stride: WordStride,
}

impl Prepared {
    /// # Panics
    /// If the methods' masks differ.
    fn new(field: Field, size: u32) -> Self {
        let distances = field.distances(size);
        let samples = Samples::new(Shape::cube(size).expect("it is small"), &distances).expect("a cube of distances");
        let grid = BitGrid::from_samples(samples, 0.0).expect("it fits into memory");
        let masks = grid.case_masks().expect("it has cells");
        let tiles = TileGrid::from_bits(&grid).expect("it fits into memory");
        let mut masks_of_tiles = Vec::new();
        tiles.case_masks_into(&mut masks_of_tiles).expect("they fit into memory");
        let mut word_stride = WordStride::new(&grid);
        word_stride.run();
        assert!(word_stride.masks().eq(masks.iter().copied()), "the peer's masks differ on {}", field.name());
        let [nx, ny, _] = tiles.tiles_per_axis().map(|count| count as usize);
        let cells = size as usize - 1;
        for (index, &mask) in masks.iter().enumerate() {
            let [x, y, z] = [index % cells, index / cells % cells, index / cells / cells];
            let tile = x / 8 + nx * (y / 8 + ny * (z / 8));
            assert_eq!(masks_of_tiles[512 * tile + x % 8 + 8 * (y % 8) + 64 * (z % 8)], mask, "cell {x} {y} {z}");
        }
        Self { grid, masks, tiles, masks_of_tiles, word_stride }
    }
}
