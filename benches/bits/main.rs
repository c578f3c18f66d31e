//! What whole-grid operations on bits take, beside copying the grid and beside what others offer for it.
//!
//! `cargo bench -p marchless_benches --bench bits`; a filter behind `--` as ever.

mod masks;
mod ops;
mod regions;
mod word_stride;

use criterion::{criterion_group, criterion_main};

criterion_group!(benches, ops::benches, regions::benches, masks::benches);
criterion_main!(benches);
