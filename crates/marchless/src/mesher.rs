//! [`Mesher`]: from samples to a triangle mesh, slab by slab, by way of sign bits.
//!
//! ```text
//! slab of samples ──1 classify──▶ sign words ─┬─2 vertices──▶ one per crossing: position, normal, material
//!                                             └─3 triangles─▶ one visit per active cell between two slabs
//! ```
//!
//! The signs of a row of samples along x are packed into 64-bit words. Which edges the surface crosses are then `xor`s
//! of neighbouring words, and only the few crossings and active cells are ever looked at one by one. All passes work on
//! one slab of samples after the other, while it is in the cache, and only the signs of three slabs are kept. (Refused:
//! meshing a slab without having read the next one in one go, so that gradients fetch its samples here and there; caves
//! of 256³ `f32` samples then took 67 instead of 41 ms.)
//!
//! Between the two, [`Topology::Trilinear`] has cells whose signs leave something open decided by their weights (`exact`).
//!
//! Vertices are numbered slab by slab: those on edges along z from the slab below, then those in the interior of cells
//! where there are any, then those on edges along x and along y, each row by row. Triangles follow the cells, x fastest.
//!
//! The way vertices are found without a map is that of William Schroeder, Rob Maynard and Berk Geveci, "Flying Edges: A
//! High-Performance Scalable Isocontouring Algorithm" (2015), with words of sign bits in the place of edge cases, and
//! counters that run through a whole slab in the place of offsets per row.

mod classify;
mod exact;
mod output;
mod slabs;
mod stream;
#[cfg(feature = "std")]
mod threads;
mod triangles;
mod vertices;

use thiserror::Error;

use crate::{
    buffer::MeshBuffer,
    lattice::{Samples, Shape},
    sample::Weight,
    simd::Backend,
};
pub(crate) use classify::sign_row;
use slabs::{Input, Lattice, Meshing, Slabs};
pub use stream::SlabMesher;
#[cfg(feature = "std")]
pub use threads::ThreadedMesher;
pub(crate) use vertices::{clamped, crossing_fraction};

/// How to mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshSettings {
    /// The surface lies where the weight equals this many voxels; samples below it are inside. Finite; default 0.
    ///
    /// Chunks that a [`Source`](crate::Source)'s bound spared from sampling hold no true distances: they suit isovalues
    /// within ±3 voxels.
    pub isovalue: f32,
    /// Whether to compute normals; default true.
    pub normals: bool,
    /// Which way the surface goes where the signs of a cell's corners leave it open; default [`Topology::Separated`].
    pub topology: Topology,
}

/// Which way the surface goes where the signs of a cell's corners leave it open: on faces whose corners alternate, and
/// between two corners at the ends of a cell's diagonal that are unlike all others.
///
/// Both give closed, 2-manifold surfaces without zero-area triangles on every input, and the same vertices on the lattice's
/// edges. A plugin's terrain, its ray casts ([`ray_cast`](crate::ray_cast)) and levels of detail use the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Inside corners that stand diagonally on a face or in a cell are separated; the rule of the cases
    /// ([`cases`](crate::cases)), and the fastest.
    #[default]
    Separated,
    /// As the trilinear interpolant of the cell's corners has it, computed in `f64`. The few cells that need it (none to
    /// 3 % of those that the surface crosses in terrain and caves, half of them in white noise) get other triangles, and
    /// some of them one or six vertices in their interior. Ties and weights that are not finite are decided as by
    /// default, and tunnels with a waist within 2⁻⁴⁰ of a face of their cell are left out.
    Trilinear,
}

impl MeshSettings {
    fn check(&self) -> Result<(), MeshError> {
        if self.isovalue.is_finite() { Ok(()) } else { Err(MeshError::Isovalue { found: self.isovalue }) }
    }
}

impl Default for MeshSettings {
    fn default() -> Self {
        Self { isovalue: 0.0, normals: true, topology: Topology::Separated }
    }
}

/// Turns samples into meshes; keeps its scratch memory between them.
///
/// The surface is closed, 2-manifold, consistently oriented and free of zero-area triangles on every input, except
/// where it leaves the meshed box, and up to 4,096 cells per axis (`f32` positions have no room for the clamp beyond).
/// Crossings keep 1/1024 of their edge away from its ends. NaN samples count as outside, infinite ones by their sign;
/// all positions and normals are finite whatever the samples are. The same samples give the same mesh, bit for bit.
///
/// Not guaranteed: triangles of a good shape.
///
/// ```
/// use marchless::{MeshBuffer, MeshSettings, Mesher, Samples, Shape};
///
/// // A sphere of radius 5 around the middle of 16³ samples.
/// let shape = Shape::cube(16)?;
/// let mut weights = Vec::with_capacity(shape.len());
/// for z in 0..16 {
///     for y in 0..16 {
///         for x in 0..16 {
///             let [x, y, z] = [x, y, z].map(|v| v as f32 - 7.5);
///             weights.push((x * x + y * y + z * z).sqrt() - 5.0);
///         }
///     }
/// }
/// let mut mesh = MeshBuffer::new();
/// Mesher::new().mesh(Samples::new(shape, &weights)?, &MeshSettings::default(), &mut mesh)?;
/// assert!(mesh.triangle_count() > 500);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Mesher {
    /// Found out at the first mesh.
    backend: Option<Backend>,
    slabs: Slabs,
}

impl Mesher {
    /// A mesher that has allocated nothing yet, and will use the [fastest](Backend::fastest) backend.
    pub const fn new() -> Self {
        Self { backend: None, slabs: Slabs::new() }
    }

    /// A mesher that uses `backend`; the portable one where it is not [available](Backend::is_available).
    pub const fn with_backend(backend: Backend) -> Self {
        Self { backend: Some(backend), slabs: Slabs::new() }
    }

    /// Meshes `samples` into `out`, whose former content is dropped. No surface is no error: `out` is then empty.
    ///
    /// # Errors
    /// [`MeshError`] where there is no cell to mesh, the isovalue is not finite, or vertices would outnumber `u32`
    /// indices; `out` is then empty.
    pub fn mesh<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        out.clear();
        settings.check()?;
        let lattice = Lattice::of(&samples)?;
        let backend = *self.backend.get_or_insert_with(Backend::fastest);
        let input = Input::Volume { samples, cells: 0..lattice.size[2] - 1 };
        let meshed = Meshing { input, lattice, settings, slabs: &mut self.slabs, out }.on(backend);
        if meshed.is_err() {
            out.clear();
        }
        meshed
    }
}

impl Default for Mesher {
    fn default() -> Self {
        Self::new()
    }
}

/// Why meshing stopped.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The isovalue is NaN or infinite.
    #[error("the isovalue must be finite, but it is {found}")]
    Isovalue {
        /// What was given.
        found: f32,
    },
    /// Some axis has no cell.
    #[error("meshing needs at least {least} samples per axis, but there are {shape}")]
    TooSmall {
        /// What was given.
        shape: Shape,
        /// 2, or 4 where the outermost layer is padding.
        least: u32,
    },
    /// Slabs have no cells, or do not fit in memory.
    #[error("slabs need at least 2 samples along x and y and must fit in memory, but they are {} × {}", size[0], size[1])]
    SlabSize {
        /// What was given: samples along x and y.
        size: [u32; 2],
    },
    /// A slab is not as large as was said.
    #[error("a slab of {} × {} samples needs {expected} weights, but there are {found}", size[0], size[1])]
    SlabLength {
        /// Samples along x and y.
        size: [u32; 2],
        /// Their product.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
    /// There are no cells between the slabs.
    #[error("meshing needs at least 2 slabs, but there are {found}")]
    TooFewSlabs {
        /// How many came.
        found: usize,
    },
    /// The vertices would not fit `u32` indices.
    #[error("the surface has at least {found} vertices, more than 32-bit indices can name")]
    TooManyVertices {
        /// How many there were when meshing stopped.
        found: u64,
    },
}
