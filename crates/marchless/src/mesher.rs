//! [`Mesher`]: from samples to a triangle mesh, slab by slab, by way of sign bits.
//!
//! ```text
//! slab of samples ──1 signs──▶ sign words ─┬─2 vertices──▶ one per crossing: position, normal, material
//!                                          ├─3 active cells ── trilinear: cells that their weights decide
//!                                          └─4 triangles─▶ one visit per active cell between two slabs
//! ```
//!
//! All meshers share [`signs`](crate::signs) and [`active`](crate::active). The marching-cubes passes (`primal`) and
//! the dual mesher (`dual`) build on them. For [`Topology::Trilinear`], `trilinear` decides ambiguous cells by their weights. The passes work on one
//! slab of samples after the other, while it is in the cache (`pipeline`).
//!
//! Vertices are numbered slab by slab: first those on edges along z from the slab below, then those in the interior of
//! cells, then those on edges along x, then those along y, each row by row. Triangles follow the cells, x fastest.
//!
//! Finding vertices without a map comes from William Schroeder, Rob Maynard and Berk Geveci, "Flying Edges: A
//! High-Performance Scalable Isocontouring Algorithm" (2015). Here, words of sign bits replace its edge cases, and
//! counters that run through a whole slab replace its offsets per row.

mod crossing;
mod dual;
mod error;
mod gather;
mod job;
mod method;
mod normal;
mod output;
mod pipeline;
mod primal;
mod settings;
mod stream;
#[cfg(feature = "std")]
mod threads;
mod transition;
mod trilinear;

use crate::{buffer::MeshBuffer, lattice::Samples, sample::Weight, simd::Backend};
pub(crate) use crossing::{crossing_fraction, snapped};
use dual::DualPipeline;
pub use dual::DualSettings;
pub use error::MeshError;
use error::checked_layout;
use job::{Input, MeshJob};
pub use method::MeshMethod;
use pipeline::SlabPipeline;
pub use settings::{MeshSettings, Topology};
pub use stream::SlabMesher;
#[cfg(feature = "std")]
pub use threads::ThreadedMesher;
use transition::Transitions;
pub use transition::{FinerNeighbours, LeafError, LeafSamples};

/// Turns samples into meshes. It keeps its scratch memory from mesh to mesh.
///
/// The surface is closed, 2-manifold, consistently oriented and free of zero-area triangles on every input, except
/// where it leaves the meshed box. This holds up to 4,096 cells per axis; beyond, `f32` positions are too coarse for
/// the clamp. Crossings stay at least 1/1024 of their edge away from its ends and lie at multiples of 2⁻¹⁴ of it. NaN samples count as outside, infinite
/// ones by their sign; all positions and normals are finite on every input. The same samples give the same mesh, bit
/// for bit.
///
/// Not guaranteed: well-shaped triangles.
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
    /// `None` until the first mesh.
    backend: Option<Backend>,
    pipeline: SlabPipeline,
    transitions: Transitions,
    dual: DualPipeline,
}

impl Mesher {
    /// A mesher that uses the [fastest](Backend::fastest) backend. It allocates nothing until the first mesh.
    pub const fn new() -> Self {
        Self::of(None)
    }

    /// A mesher that uses `backend`, or the portable one if that is not [available](Backend::is_available).
    pub const fn with_backend(backend: Backend) -> Self {
        Self::of(Some(backend))
    }

    const fn of(backend: Option<Backend>) -> Self {
        Self { backend, pipeline: SlabPipeline::new(), transitions: Transitions::new(), dual: DualPipeline::new() }
    }

    /// Meshes `samples` into `out` and drops its former content. Samples without a surface are no error: `out` is then
    /// empty.
    ///
    /// # Errors
    /// [`MeshError`] if there is no cell to mesh, the isovalue is not finite, or `u32` indices cannot number all
    /// vertices. `out` is then empty.
    pub fn mesh<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        out.clear();
        settings.check()?;
        let layout = checked_layout(&samples)?;
        let backend = *self.backend.get_or_insert_with(Backend::fastest);
        let input = Input::Volume { samples, cells: 0..layout.size[2] - 1 };
        let meshed = MeshJob { input, layout, settings, pipeline: &mut self.pipeline, out }.run_on(backend);
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
