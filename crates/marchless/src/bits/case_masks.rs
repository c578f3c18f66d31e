//! The case index of every cell.
