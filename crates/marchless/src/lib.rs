//! Smooth voxel terrain from bit fields.
#![no_std]

extern crate alloc;

mod brush;
mod buffer;
pub mod cases;
mod cell;
mod grid;
mod lattice;
mod math;
mod mesher;
mod query;
mod sample;
mod source;
mod validate;

pub use brush::*;
pub use buffer::MeshBuffer;
pub use cell::{CaseIndex, Corner, Edge, Face};
pub use grid::*;
pub use lattice::{Region, Samples, SamplesError, Shape, ShapeError};
pub use mesher::{MeshError, MeshSettings, Mesher};
pub use query::*;
pub use sample::{Voxel, Weight};
pub use source::*;
pub use validate::*;
