//! Shifting a whole grid.
