//! Smooth voxel terrain from bit fields: a fast isosurface mesher, editable grids of samples, deterministic brushes.
//! `no_std` with `alloc`, no engine, no math crate. The plugin for Bevy is `bevy_marchless`.
//!
//! # The idea
//! The sign of a sample is one bit, and a row of samples is a word. Word operations over whole rows find the cells that
//! the surface crosses, and find and count the edges that carry a vertex. Only the few cells that the surface crosses
//! are visited one by one.
//!
//! # Words
//! | word | meaning |
//! |---|---|
//! | sample, [`Voxel`] | a lattice point's `weight`, its signed distance in voxels, **negative inside**, and its `material` |
//! | cell | the cube between 8 samples; the module [`cell`] defines its corners, edges, faces and case index |
//! | chunk | the unit that is meshed: 32 cells per axis by default |
//! | block | the samples that one chunk's mesh is made from: the chunk's own, and padding |
//! | level | a level of detail: 0 is the finest, and each further one has cells twice as wide |
//! | leaf | a chunk of an octree of chunks of several levels |
//! | stamp, edit | a stamp is one application of a brush; an edit is the change that it made |
//!
//! # From samples to a mesh
//! [`Mesher`] meshes any borrowed [`Samples`] into a reusable [`MeshBuffer`]. [`SlabMesher`] meshes a volume that
//! arrives slab by slab and need not fit in memory. `ThreadedMesher` (feature `std`) meshes a large volume on several
//! threads. All three give the same mesh. [`Mesher::mesh_dual`] makes another, with vertices inside of cells, which
//! may be smoothed. [`Grid`] keeps a whole volume in chunks, which mesh one by one without seams:
//!
//! ```
//! use marchless::{Grid, MeshBuffer, MeshReport, MeshSettings, Mesher, Operation, QuantisedShape, QuantisedStamp, Region};
//!
//! // Two chunks of 32 cells with air around them, and a ball across their common border.
//! let mut grid = Grid::<i16>::bounded(32, Region::new([0; 3], [2, 1, 1]))?;
//! grid.apply(&QuantisedStamp::new(QuantisedShape::sphere([32.0, 16.0, 16.0], 9.5)?, Operation::Add, 1));
//!
//! let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
//! for chunk in grid.take_dirty() {
//!     grid.mesh_chunk(chunk, &mut mesher, &MeshSettings::default(), &mut mesh)?;
//!     // The mesh is open where the ball continues in the other chunk, and has no other flaw.
//!     let report = MeshReport::new(&mesh.positions, &mesh.indices);
//!     assert!(report.boundary_edges > 0 && report.is_clean());
//! }
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Levels of detail
//! [`Mesher::mesh_leaf`] meshes a chunk beside neighbours that are one level finer. The seam is part of its mesh, so that
//! nothing special is needed to draw it. [`LevelCover`] chooses the chunks for the places of viewers, [`LeafBlock`] fills
//! their samples from a [`Source`] and stamps, and [`MeshUnion`] judges the meshes of many chunks as one surface.
//!
//! # Guaranteed
//! - Within a chunk and across chunks, the surface is closed, 2-manifold, consistently oriented and free of zero-area
//!   triangles, and every vertex and normal is finite. This holds in both [`Topology`]s and on every input: ties with
//!   the isovalue, NaN, infinities and subnormal numbers included. Vertices on a shared border are equal bit for bit.
//! - The same holds across levels of detail, as [`Mesher::mesh_leaf`] says in detail; only that triangles do not cross
//!   is not promised there.
//! - With [`Topology::Separated`], the default, no two triangles cross, and the surface is that of digital topology:
//!   inside points are neighbours along the axes only, outside points also along the diagonals of faces.
//! - With [`Topology::Trilinear`], the surface has the topology of the trilinear interpolant in every cell, to the
//!   precision of `f64`. The one exception is a tunnel whose waist is within 2⁻⁴⁰ of a face of its cell: there, the
//!   sheets stay apart. Where a tie or a non-finite weight decides a face, the inside stays separated.
//! - The same samples give the same mesh, and the same stamps in the same order give the same samples, bit for bit, on
//!   any machine.
//! - No samples, stamps, rays or meshes cause a panic. NaN and infinite samples have a meaning ([`Weight`]), and input
//!   that cannot be meshed gives a typed error. (The constructors of a cell's parts may panic; their docs say when.)
//! - [`Mesher::mesh`] and [`NeighbourhoodView::mesh`] allocate nothing once their buffers are warm.
//!
//! # Not guaranteed
//! - Triangles of [`Topology::Trilinear`] may cross. None did in tens of millions of random cells, with ties and with
//!   weights of all magnitudes, but there is no proof.
//! - Triangles need not be well shaped. Crossings lie where the samples put them, so slivers are common.
//! - A single mesh of more than 4,096 cells per axis need not be clean: `f32` positions are too coarse there to keep
//!   crossings away from lattice points.
//!
//! # Evidence
//! The table counts the fields, out of 304, whose mesh has a flaw. The fields are generated (noise, periodic surfaces,
//! thin sheets, integers with ties, infinities, all magnitudes) and closed. [`MeshReport`] judges every mesh. In the
//! repository, `cargo bench -p marchless_benches --bench soundness` reproduces the figures of the crates, and
//! `benches/peers/soundness.py` those of the others.
//!
//! | extractor | any flaw | open or non-manifold edges | zero-area triangles | crossing triangles | not finite |
//! |---|---|---|---|---|---|
//! | marchless, both topologies | 0 | 0 | 0 | 0 | 0 |
//! | isomesh 0.0.14, marching cubes | 161 | 0 | 128 | 41 | 32 |
//! | `PyMCubes` 0.1.6 | 174 | 0 | 171 | 62 | 32 |
//! | transvoxel 2.0.0, regular cells | 177 | 0 | 176 | 68 | 32 |
//! | VTK 9.7.2, flying edges | 177 | 0 | 177 | 65 | 32 |
//! | VTK 9.7.2, synchronized templates | 88 | 26 | 48 | 40 | 32 |
//! | scikit-image 0.26.0, Lewiner | 186 | 72 open, 42 not manifold | 174 | 90 | 32 |
//! | isomesh 0.0.14, its trilinear option | 202 | 2 open, 94 not manifold | 116 | 23 | 32 |
//! | fast-surface-nets 0.2.1 | 228 | 220 | 44 | 16 | 32 |
//!
//! Most flaws come from ties: in the 96 fields without ties and non-finite samples, the first four of the other
//! extractors have no flaws. Dual methods such as the last are non-manifold by nature where two sheets share a cell.
//!
//! The crate's tests mesh every pattern of signs of one, two and 2 × 2 × 1 cells and ten million patterns of 2 × 2 × 2
//! cells. They compare both topologies with references that share no code with the mesher.
//!
//! # Hidden items
//! Items that this documentation hides serve `bevy_marchless` and tests, and may change at any time.
//!
//! # Features
//! `std` (default) detects the processor's instruction set at run time ([`Backend`]); without it, the crate uses the
//! instructions that it was compiled for. It adds `ThreadedMesher`, and uses the standard library's square root instead
//! of `libm`'s. No feature changes a result.
#![no_std]
#![deny(unsafe_code)]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod active;
pub mod bits;
mod brush;
mod buffer;
pub mod cases;
pub mod cell;
mod grid;
mod lattice;
mod levels;
mod material;
mod math;
mod mesher;
mod query;
mod sample;
mod signs;
mod simd;
mod source;
mod validate;

pub use brush::{
    BrushError, EDIT_LIMIT, Edit, Operation, QuantisedShape, QuantisedStamp, QuantisedStroke, VolumeByMaterial,
};
pub use buffer::MeshBuffer;
pub use grid::{
    BOUND_BOX_CHUNKS, Block, DEFAULT_CHUNK_CELLS, Grid, GridChunk, GridError, GridSamples, MAX_CHUNK_CELLS,
    MIN_CHUNK_CELLS, Neighbourhood, NeighbourhoodView, SamplePool,
};
pub use lattice::{Region, Samples, SamplesError, Shape, ShapeError};
pub use levels::{LeafBlock, LeafKey, LevelChange, LevelCover, LevelError, LevelSettings, LevelSource, LevelViewer};
pub use material::MaterialSet;
#[cfg(feature = "std")]
pub use mesher::ThreadedMesher;
pub use mesher::{
    DualSettings, FinerNeighbours, LeafError, LeafSamples, MeshError, MeshMethod, MeshSettings, Mesher, SlabMesher,
    Topology,
};
pub use query::RayHit;
pub use sample::{Voxel, Weight};
pub use simd::Backend;
pub use source::{Bound, Source, SourceRegion};
pub use validate::{ExtractionReport, MeshReport, MeshUnion};
