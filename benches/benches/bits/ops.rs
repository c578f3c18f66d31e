//! Shifts, boolean operations, morphology and automata.

use criterion::Criterion;

pub(crate) fn benches(_criterion: &mut Criterion) {}
