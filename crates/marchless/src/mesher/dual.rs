//! The dual mesher: one vertex for each loop of the surface in a cell, one quad around each crossed edge.
//!
//! ```text
//! slab of samples ──signs──▶ sign words ──cells──▶ vertices of a slab of cells ──place──▶ positions, normals, materials
//!                                       └─quads──▶ one for each crossed edge with four cells ──▶ two triangles
//! ```
//!
//! The loops are those of the [`cases`](crate::cases). Loops alone can give four quads a common side: where two cells
//! share a face with four crossings, and all of these lie in one loop on both sides. Both cells then take the loops of
//! their complemented case, which has two loops there (`cells`).
//!
//! Vertices lie at multiples of 1/4096 strictly within their cells. So positions are exact in the coordinates of every
//! chunk, a choice between two diagonals can be made in integers, and one of the diagonals of each quad always gives two
//! triangles of positive area (`quads`).
//!
//! Vertices of sharp materials lie where the planes at their crossings have them (`sharp`, `quadric`), and get copies
//! where the normals break (`crease`). With smoothing and with creases, vertices and quads are kept until all are known.
//!
//! Dual methods go back to Sarah F. F. Gibson, "Constrained Elastic Surface Nets" (1998), and to Tao Ju, Frank Losasso,
//! Scott Schaefer and Joe Warren, "Dual Contouring of Hermite Data" (2002). A vertex for each loop comes from Gregory M.
//! Nielson, "Dual Marching Cubes" (2004).

mod cells;
mod crease;
mod pipeline;
mod place;
mod plain;
mod quadric;
mod quads;
mod settings;
mod sharp;
mod smooth;
mod table;

use pipeline::DualJob;
pub(super) use pipeline::DualPipeline;
pub use settings::DualSettings;

use super::{MeshError, Mesher};
use crate::{buffer::MeshBuffer, lattice::Samples, sample::Weight, signs::SlabLayout, simd::Backend};

/// Vertices lie at multiples of 1/4096 of their cells.
const STEPS: i32 = 4096;

/// The place of a vertex in its cell, in steps along x, y and z, 1 to 4095 each; then its [`VertexKind`].
type Offset = [u16; 4];

/// How a vertex is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum VertexKind {
    /// At the mean of its crossings.
    Smooth,
    /// By the planes at its crossings, which have about one direction.
    Sharp,
    /// By planes of several directions.
    Crease,
}

/// Which cells have vertices, and which edges have quads.
#[derive(Clone, Copy, Debug)]
struct Extent {
    /// The cells with vertices: the first and the end, per axis.
    cells: [[usize; 2]; 3],
    /// Whether the surface ends at the border. Otherwise other blocks continue it.
    is_open: bool,
    /// Whether edges that begin in the first cell of their axis have no quad: they are those of another block.
    skips_first: bool,
    /// The lattice point that positions count from, on each axis: the first sample that is not padding.
    origin: usize,
    /// The first and the end of the samples from which the edges of the mesh begin, per axis.
    own: [[usize; 2]; 3],
    /// Whether equally good diagonals alternate. With creases they do not: the triangles around a vertex must not
    /// depend on where a block begins.
    alternates: bool,
}

impl Extent {
    fn new(layout: &SlabLayout, padding: Option<usize>, alternates: bool) -> Self {
        let size = layout.size;
        let Some(padding) = padding else {
            let cells = size.map(|size| [0, size - 1]);
            let own = size.map(|size| [0, size]);
            return Self { cells, is_open: true, skips_first: false, origin: 0, own, alternates };
        };
        Self {
            cells: size.map(|size| [1, size - 2]),
            is_open: false,
            skips_first: padding == 2,
            origin: padding,
            own: size.map(|size| [padding, size - padding]),
            alternates,
        }
    }

    /// The edges of a cell that have no quad because of its place along `axis`, a bit each.
    #[inline(always)]
    fn lacking(&self, axis: usize, cell: usize) -> u16 {
        let [first, end] = self.cells[axis];
        let mut lacking = 0;
        if cell == first {
            lacking |= table::FACE_EDGES[2 * axis] | if self.skips_first { table::AXIS_EDGES[axis] } else { 0 };
        }
        if cell + 1 == end {
            lacking |= table::FACE_EDGES[2 * axis + 1];
        }
        lacking
    }

    /// The first coordinate on `axis` at which edges along `along` with quads begin.
    #[inline(always)]
    const fn first_edge(&self, along: usize, axis: usize) -> usize {
        self.cells[axis][0] + if axis == along && !self.skips_first { 0 } else { 1 }
    }

    /// Whether edges that begin at a coordinate are part of the mesh.
    #[inline(always)]
    const fn is_own(&self, axis: usize, at: usize) -> bool {
        self.own[axis][0] <= at && at < self.own[axis][1]
    }
}

impl Mesher {
    /// Meshes `samples` into `out` with the dual method, and drops its former content: one vertex for each loop of the
    /// surface in a cell, and a quad of two triangles around each crossed edge. Samples without a surface are no error:
    /// `out` is then empty.
    ///
    /// If the samples are [padded](Samples::padded), the outermost [`padding`](DualSettings::padding) layers on each
    /// side are padding: `2 + smoothing`, and one more with creases. The mesh has the quads of all edges that begin at one
    /// of the other samples, and positions count from the first of these. So each edge belongs to one block, and the
    /// meshes of blocks whose samples continue each other fit: together they are one surface, and vertices that several
    /// of them have are equal bit for bit, with normals and materials. A block has at least as many samples per axis that
    /// are not padding as it has layers of padding, or one without smoothing.
    ///
    /// Without padding, edges with fewer than four cells have no quad. The surface then ends up to one cell before the
    /// border.
    ///
    /// The surface is 2-manifold, consistently oriented and free of zero-area triangles on every input, and closed
    /// except where it leaves the meshed box; so is the union of blocks. This holds up to 4,096 cells per axis. Vertices
    /// lie strictly within their cells, at multiples of 1/4096. NaN samples count as outside, infinite ones by their
    /// sign; all positions and normals are finite on every input. The same samples give the same mesh, bit for bit.
    ///
    /// Not guaranteed: that no two triangles cross, that the mesh of a single block is 2-manifold where its surface leaves
    /// it, and that smoothed or sharp vertices of the same cell lie apart.
    ///
    /// ```
    /// use marchless::{DualSettings, MeshBuffer, MeshReport, Mesher, Samples, Shape};
    ///
    /// // A ball of radius 5 around the middle of 16³ samples.
    /// let shape = Shape::cube(16)?;
    /// let distance = |index: i32| {
    ///     let [x, y, z] = [index % 16, index / 16 % 16, index / 256].map(|v| v as f32 - 7.5);
    ///     (x * x + y * y + z * z).sqrt() - 5.0
    /// };
    /// let weights: Vec<f32> = (0..16 * 16 * 16).map(distance).collect();
    /// let mut mesh = MeshBuffer::new();
    /// let settings = DualSettings { smoothing: 2, ..DualSettings::default() };
    /// Mesher::new().mesh_dual(Samples::new(shape, &weights)?, &settings, &mut mesh)?;
    /// let report = MeshReport::new(&mesh.positions, &mesh.indices);
    /// assert!(report.is_closed() && report.is_clean(), "{report}");
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// Materials can keep their creases ([`DualSettings::sharp`], [`DualSettings::crease`]):
    ///
    /// ```
    /// use marchless::{DualSettings, MaterialSet, MeshBuffer, Mesher, Samples, Shape};
    ///
    /// // A box between lattice points: 4.6 wide, around the middle of 10³ samples.
    /// let shape = Shape::cube(10)?;
    /// let distance = |index: i32| {
    ///     let [x, y, z] = [index % 10, index / 10 % 10, index / 100].map(|v| (v as f32 - 4.5).abs() - 2.3);
    ///     x.max(y).max(z)
    /// };
    /// let weights: Vec<f32> = (0..1000).map(distance).collect();
    /// let mut mesh = MeshBuffer::new();
    /// let settings = DualSettings { sharp: MaterialSet::ALL, crease: Some(0.5), ..DualSettings::default() };
    /// Mesher::new().mesh_dual(Samples::new(shape, &weights)?, &settings, &mut mesh)?;
    /// // Each of its eight corners is there three times, once for each side.
    /// let is_corner = |position: &[f32; 3]| position.iter().all(|v| ((v - 4.5).abs() - 2.3).abs() < 0.001);
    /// assert_eq!(mesh.positions.iter().filter(|position| is_corner(position)).count(), 24);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshError`] if there is no cell to mesh, the isovalue is not finite, there are more steps of smoothing than 8 or
    /// than the block allows, the crease angle is not one from 0 to π, or `u32` indices cannot number all vertices. `out`
    /// is then empty.
    pub fn mesh_dual<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &DualSettings,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        out.clear();
        settings.check()?;
        let smoothing = settings.smoothing;
        let padding = samples.is_padded().then(|| settings.padding());
        let shape = samples.shape();
        let least = padding.map_or(2, |padding| 2 * padding + 1);
        let smallest = shape.size().into_iter().min().unwrap_or(0);
        if smallest < least {
            return Err(MeshError::TooSmall { shape, least });
        }
        if let Some(padding) = padding
            && smoothing > 0
            && smallest - 2 * padding < padding
        {
            // With `k` layers of padding, `smallest − 2·k` samples are the block's own; their neighbours need as many.
            let most = (smallest / 3).saturating_sub(padding - smoothing);
            return Err(MeshError::Smoothing { found: smoothing, most });
        }
        // The mesher itself knows no padding: it reads all samples.
        let whole = Samples::new(shape, samples.weights()).and_then(|whole| match samples.materials() {
            Some(materials) => whole.with_materials(materials),
            None => Ok(whole),
        });
        let samples = whole.expect("the slices have not changed");
        let layout = SlabLayout::of(&samples).ok_or(MeshError::TooSmall { shape, least })?;
        let extent = Extent::new(&layout, padding.map(|padding| padding as usize), settings.crease.is_none());
        let backend = *self.backend.get_or_insert_with(Backend::fastest);
        let pipeline = &mut self.dual;
        let meshed = DualJob { samples, layout, extent, settings, backend, pipeline, out: &mut *out }.mesh();
        if meshed.is_err() {
            out.clear();
        }
        meshed
    }
}
