//! Tests of the grid against plain oracles.
