//! The times of whole-grid operations on bits, compared with a copy of the grid and with peers.
//!
//! Run it by `cargo bench -p marchless_benches --bench bits`; a filter may follow after `--`.

mod masks;
mod ops;
mod regions;
mod word_stride;

use criterion::{criterion_group, criterion_main};

criterion_group!(benches, ops::benches, regions::benches, masks::benches);
criterion_main!(benches);
