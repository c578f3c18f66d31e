//! Boolean operations on whole grids.
