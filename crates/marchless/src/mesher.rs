//! [`Mesher`]: from samples to a triangle mesh in four passes over rows of sign bits.
//!
//! ```text
//! samples ──1 classify──▶ sign words ──2 crossings──▶ first vertex of each row, exact counts
//!                             │                            │
//!                             ├──────────3 vertices◀───────┤   one per crossing: position, normal, material
//!                             └──────────4 triangles◀──────┘   one visit per active cell
//! ```
//!
//! The signs of a row of samples along x are packed into 64-bit words. Which edges the surface crosses, and how many, are then
//! `xor`s and population counts of neighbouring rows' words, and only the few active cells are ever looked at one by
//! one. Vertices are ordered by row (y fastest, then z), within a row by the axis of their edge, then by x;
//! triangles by cell, x fastest.
//!
//! The way vertices are found without a map is that of William Schroeder, Rob Maynard and Berk Geveci, "Flying Edges: A
//! High-Performance Scalable Isocontouring Algorithm" (2015), with words of sign bits in the place of edge cases.

mod classify;
mod crossings;
mod triangles;
mod vertices;

use alloc::vec::Vec;

use thiserror::Error;

use crate::{
    buffer::MeshBuffer,
    lattice::{Samples, Shape},
    sample::Weight,
};
use crossings::Row;
pub(crate) use vertices::crossing_fraction;

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
}

impl Default for MeshSettings {
    fn default() -> Self {
        Self { isovalue: 0.0, normals: true }
    }
}

/// Turns samples into meshes; keeps its scratch memory between them.
///
/// The surface is closed, 2-manifold, consistently oriented and free of zero-area triangles on every input, except
/// where it leaves the meshed box, and up to 4,096 cells per axis (`f32` positions have no room for the clamp
/// beyond). Crossings keep 1/1024 of their edge away from its ends. NaN samples count as outside, infinite ones by
/// their sign; all positions and normals are finite whatever the samples are. The same samples give the same mesh, bit for bit.
///
/// Not guaranteed: the topology of the trilinear interpolant in ambiguous cells; triangles of a good shape.
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
#[derive(Clone, Debug, Default)]
pub struct Mesher {
    /// The signs of all meshed samples: `words` a row, rows in order of y, then z.
    signs: Vec<u64>,
    rows: Vec<Row>,
}

impl Mesher {
    /// A mesher that has allocated nothing yet.
    pub const fn new() -> Self {
        Self { signs: Vec::new(), rows: Vec::new() }
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
        let meshed = self.mesh_or_refuse(samples, settings, out);
        if meshed != Ok(true) {
            out.clear();
        }
        meshed.map(|_| ())
    }

    /// Whether there is a surface; where there is none, `out` is left as it was. What it held is overwritten rather than
    /// dropped first, so that a warm buffer is not filled with zeros again and again.
    fn mesh_or_refuse<W: Weight>(
        &mut self,
        samples: Samples<'_, W>,
        settings: &MeshSettings,
        out: &mut MeshBuffer,
    ) -> Result<bool, MeshError> {
        if !settings.isovalue.is_finite() {
            return Err(MeshError::Isovalue { found: settings.isovalue });
        }
        let layout = Layout::new(&samples)?;
        classify::classify(&samples, &layout, W::threshold(settings.isovalue), &mut self.signs);
        let vertex_count = crossings::count(&layout, &self.signs, &mut self.rows);
        if vertex_count == 0 {
            return Ok(false);
        }
        if u32::try_from(vertex_count).is_err() {
            return Err(MeshError::TooManyVertices { found: vertex_count });
        }
        vertices::place(&samples, &layout, settings, &self.signs, &self.rows, vertex_count as usize, out);
        triangles::join(&layout, &self.signs, &self.rows, &mut out.indices);
        Ok(true)
    }
}

/// Why nothing was meshed.
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
    /// The vertices would not fit `u32` indices.
    #[error("the surface has {found} vertices, more than 32-bit indices can name")]
    TooManyVertices {
        /// How many there are.
        found: u64,
    },
}

/// Where the meshed samples lie among those given, and how their signs are packed.
struct Layout {
    /// Meshed samples per axis.
    size: [usize; 3],
    /// The index of the first meshed sample.
    origin: usize,
    /// How far apart neighbours along each axis are in memory.
    strides: [usize; 3],
    /// Sign words a row.
    words: usize,
}

impl Layout {
    fn new<W>(samples: &Samples<'_, W>) -> Result<Self, MeshError> {
        let (shape, padding) = (samples.shape(), u32::from(samples.is_padded()));
        let least = 2 + 2 * padding;
        if shape.size().iter().any(|&size| size < least) {
            return Err(MeshError::TooSmall { shape, least });
        }
        let size = shape.size().map(|size| (size - 2 * padding) as usize);
        Ok(Self { size, origin: shape.index([padding; 3]), strides: shape.strides(), words: size[0].div_ceil(64) })
    }

    /// The number of rows of samples.
    const fn rows(&self) -> usize {
        self.size[1] * self.size[2]
    }

    /// The index of the first meshed sample of row `y`, `z`.
    const fn row_start(&self, y: usize, z: usize) -> usize {
        self.origin + y * self.strides[1] + z * self.strides[2]
    }

    /// The sign words of row `row`.
    fn row<'a>(&self, signs: &'a [u64], row: usize) -> &'a [u64] {
        &signs[row * self.words..][..self.words]
    }

    /// Of word `word`, the bits of samples that have a neighbour at +x.
    const fn x_edges(&self, word: usize) -> u64 {
        let edges = self.size[0] - 1 - word * 64;
        if edges >= 64 { u64::MAX } else { (1 << edges) - 1 }
    }
}

/// The word of +x neighbours of `words[word]`.
#[inline(always)]
fn shifted(words: &[u64], word: usize) -> u64 {
    let next = if word + 1 < words.len() { words[word + 1] } else { 0 };
    words[word] >> 1 | next << 63
}

/// The positions of the set bits of `word`, lowest first.
#[inline(always)]
fn set_bits(mut word: u64) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        if word == 0 {
            return None;
        }
        let bit = word.trailing_zeros() as usize;
        word &= word - 1;
        Some(bit)
    })
}
