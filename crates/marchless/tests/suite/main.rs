//! The core from outside, one topic a module.
//!
//! They share one binary, which links once; what needs a process of its own has a file beside this folder.

mod backends;
mod base_samples;
mod bits;
mod bits_masks;
mod bits_mesh;
mod bits_ops;
mod bits_regions;
mod cases;
mod chunks;
mod crossings;
mod dual;
mod dual_grid;
mod exhaustive;
mod extraction;
mod levels;
mod oracle;
mod seams;
mod support;
mod surface;
mod topology;
mod transition_cells;
