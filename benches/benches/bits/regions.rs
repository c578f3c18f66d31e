//! Flood fill, components and overlaps.

use criterion::Criterion;

pub(crate) fn benches(_criterion: &mut Criterion) {}
