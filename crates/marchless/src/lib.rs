//! Smooth voxel terrain from bit fields: a fast isosurface mesher, editable grids of samples, deterministic brushes.
//! `no_std` with `alloc`, no engine, no math crate. The plugin for Bevy is `bevy_marchless`.
//!
//! # The idea
//! The sign of a sample is one bit, and a row of samples is a word. Which cells the surface crosses, which edges carry
//! a vertex and how many there are become word operations over whole rows; only the few cells that the surface
//! really crosses are ever looked at one by one.
//!
//! # Words
//! | word | meaning |
//! |---|---|
//! | sample, [`Voxel`] | a lattice point's `weight`, its signed distance in voxels, **negative inside**, and its `material` |
//! | cell | the cube between 8 samples; its corners, edges, faces and case index stand in the module [`cell`] |
//! | chunk | the unit that is meshed: 32 cells per axis by default |
//! | block | the samples that one chunk's mesh is made from: its own, and padding |
//! | stamp, edit | one application of a brush; what it has changed |
//!
//! # From samples to a mesh
//! [`Mesher`] meshes any borrowed [`Samples`] into a reusable [`MeshBuffer`]; [`SlabMesher`] meshes volumes that come
//! slab by slab and need not fit in memory, and `ThreadedMesher` (feature `std`) large ones on several threads, all
//! three the same mesh. [`Grid`] keeps a whole volume in chunks that mesh one by one without seams:
//!
//! ```
//! use marchless::{BrushShape, Grid, MeshBuffer, MeshReport, MeshSettings, Mesher, Operation, Region, Stamp};
//!
//! // Two chunks of 32 cells with air around them, and a ball across their common border.
//! let mut grid = Grid::<i16>::bounded(32, Region::new([0; 3], [2, 1, 1]))?;
//! grid.apply(&Stamp::new(BrushShape::sphere([32.0, 16.0, 16.0], 9.5)?, Operation::Add, 1));
//!
//! let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
//! for chunk in grid.take_dirty() {
//!     grid.mesh_chunk(chunk, &mut mesher, &MeshSettings::default(), &mut mesh)?;
//!     // Open where the ball goes on in the other chunk, and flawless otherwise.
//!     let report = MeshReport::new(&mesh.positions, &mesh.indices);
//!     assert!(report.boundary_edges > 0 && report.is_clean());
//! }
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Guaranteed
//! - Within a chunk and across chunks the surface is closed, 2-manifold, consistently oriented and free of zero-area
//!   triangles, on every input, ties with the isovalue included; vertices on a shared border are equal bit for bit.
//! - The same samples give the same mesh, and the same stamps in the same order the same samples, bit for bit, on any
//!   machine.
//! - No samples, stamps, rays or meshes panic: NaN and infinite samples have a meaning ([`Weight`]), and what cannot be
//!   meshed is a typed error. (Constructors of a cell's parts say when they do.)
//! - [`Mesher::mesh`] and [`Neighbourhood::mesh`] allocate nothing once their buffers are warm.
//!
//! # Not guaranteed
//! - The topology of the trilinear interpolant: on a face whose corners alternate, inside corners are separated.
//! - Well-shaped triangles: crossings lie where the samples put them, so slivers are common.
//! - Clean meshes of more than 4,096 cells per axis at once: `f32` positions have no room for the clamp there.
//!
//! # Features
//! `std` (default) finds out at run time which instructions the processor has ([`Backend`]), instead of using those
//! that the crate was compiled for; it adds `ThreadedMesher`, and uses the standard library's square root instead of
//! `libm`'s. No feature changes a result.
#![no_std]
#![deny(unsafe_code)]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod brush;
mod buffer;
pub mod cases;
pub mod cell;
mod grid;
mod lattice;
mod math;
mod mesher;
mod query;
mod sample;
mod simd;
mod source;
mod validate;

pub use brush::{BrushError, BrushShape, EDIT_LIMIT, Edit, Operation, Stamp, Stroke, VolumeByMaterial};
pub use buffer::MeshBuffer;
pub use cell::{CaseIndex, Corner, Edge, Face};
pub use grid::{
    Block, Chunk, ChunkSamples, DEFAULT_CHUNK_CELLS, Grid, GridError, MAX_CHUNK_CELLS, MIN_CHUNK_CELLS, Neighbourhood,
};
pub use lattice::{Region, Samples, SamplesError, Shape, ShapeError};
#[cfg(feature = "std")]
pub use mesher::ThreadedMesher;
pub use mesher::{MeshError, MeshSettings, Mesher, SlabMesher, Topology};
pub use query::{RayHit, ray_cast, weight_at};
pub use sample::{Voxel, Weight};
pub use simd::Backend;
pub use source::{Bound, Source, SourceRegion};
pub use validate::{ExtractionReport, MeshReport};
