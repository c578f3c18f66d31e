//! [`BitMesher`]: meshes of bits, with vertices in the middle of edges or where a function puts them.
//!
//! Each slab of bits becomes weights of −1 (set) and 1, which [`SlabMesher`] meshes: the passes are the same, and so
//! are the guarantees. Between −1 and 1, the crossing is exactly the middle of the edge.

mod placement;

use alloc::vec::Vec;

use super::BitGrid;
use crate::{
    buffer::MeshBuffer,
    mesher::{MeshError, MeshSettings, SlabMesher},
};

/// Turns grids of bits into meshes; keeps its scratch memory between them.
///
/// Set bits are inside. The surface is closed, 2-manifold, consistently oriented and free of zero-area and crossing
/// triangles, except that it is open at the outermost points, where it leaves the grid. This holds up to 2²³ cells per
/// axis ([placed](Self::mesh_placed): 4,096).
///
/// The mesh is byte for byte what [`Mesher`](crate::Mesher) makes of weights −1 (set) and 1: one vertex exactly in the
/// middle of each edge between a set and an unset point, with the topology of
/// [`Topology::Separated`](crate::Topology::Separated).
///
/// ```
/// use marchless::{MeshBuffer, MeshReport, Shape, bits::{BitGrid, BitMesher}};
///
/// let cross = BitGrid::from_fn(Shape::cube(7)?, |[x, y, z]| [x, y, z].iter().filter(|&&v| v == 3).count() >= 2)?;
/// let inner = BitGrid::from_fn(Shape::cube(9)?, |p| p.iter().all(|v| (1..8).contains(v)) && cross.get(p.map(|v| v - 1)))?;
/// let (mut mesher, mut mesh) = (BitMesher::new(), MeshBuffer::new());
/// mesher.mesh(&cross, &mut mesh)?;
/// assert!(!MeshReport::new(&mesh.positions, &mesh.indices).is_closed());
/// mesher.mesh(&inner, &mut mesh)?;
/// let report = MeshReport::new(&mesh.positions, &mesh.indices);
/// assert!(report.is_closed() && report.is_clean() && report.genus == Some(0));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct BitMesher {
    without_normals: bool,
    /// `None` before the first grid.
    slabs: Option<SlabMesher<i8>>,
}

impl BitMesher {
    /// A mesher that has allocated nothing yet.
    pub const fn new() -> Self {
        Self { without_normals: false, slabs: None }
    }

    /// A mesher that makes no normals.
    pub const fn without_normals() -> Self {
        Self { without_normals: true, slabs: None }
    }

    /// Meshes `bits` into `out`, whose former content is dropped. Vertices are in the middle of edges; positions are in
    /// cells from the first point. A grid without a surface is no error: `out` is then empty.
    ///
    /// Normals point from set bits to unset ones. They come from the differences of the bits around both ends of the
    /// edge. They are uniform on a flat or slanted face, but less smooth over steps than the normals of a distance.
    ///
    /// # Errors
    /// [`MeshError::TooSmall`] below 2 points per axis, [`MeshError::TooManyVertices`] if `u32` indices cannot number
    /// the vertices; `out` is then empty.
    pub fn mesh(&mut self, bits: &BitGrid, out: &mut MeshBuffer) -> Result<(), MeshError> {
        out.clear();
        let meshed = self.mesh_slabs(bits, out);
        if meshed.is_err() {
            out.clear();
        }
        meshed
    }

    /// Meshes `bits` into `out` like [`mesh`](Self::mesh), with the same triangles, and moves each vertex along its
    /// edge to where `distance` is zero.
    ///
    /// `distance` takes lattice coordinates (in cells from the first point, up to 1/8 beyond the outermost ones) and is
    /// negative inside. It need not be a true distance: only its zeros and, for normals, its gradient count.
    ///
    /// A vertex takes at most 8 evaluations: both ends of the edge, then Chandrupatla's method between them. Its normal
    /// takes 6 more: it is the direction of the gradient, from differences of ±1/8. For smooth functions, the vertex is
    /// the zero up to rounding; for others, it lies between two points where the signs differ, up to rounding.
    ///
    /// Like all crossings, vertices are rounded to 2⁻¹⁴ of their edge, and stay 1/1024 of it away from its ends. The
    /// signs of `distance` at both ends must be those of the bits: negative at the set end only. Where they are not, or
    /// where a value is not finite, the vertex stays in the middle with the bits' normal. That normal also stays where
    /// the gradient is zero or not finite. So the surface is as sound as without placement, whatever `distance` is, up
    /// to 4,096 cells per axis.
    ///
    /// # Errors
    /// Those of [`mesh`](Self::mesh).
    pub fn mesh_placed(
        &mut self,
        bits: &BitGrid,
        distance: impl Fn([f32; 3]) -> f32,
        out: &mut MeshBuffer,
    ) -> Result<(), MeshError> {
        self.mesh(bits, out)?;
        placement::place(bits, &distance, out);
        Ok(())
    }

    fn mesh_slabs(&mut self, bits: &BitGrid, out: &mut MeshBuffer) -> Result<(), MeshError> {
        let [nx, ny, nz] = bits.shape.size();
        if nx.min(ny).min(nz) < 2 {
            return Err(MeshError::TooSmall { shape: bits.shape, least: 2 });
        }
        let slabs = match &mut self.slabs {
            Some(slabs) => {
                slabs.start_over([nx, ny])?;
                slabs
            }
            none => {
                let settings = MeshSettings { normals: !self.without_normals, ..MeshSettings::default() };
                none.insert(SlabMesher::new([nx, ny], settings)?)
            }
        };
        let (width, len) = (nx as usize, nx as usize * ny as usize);
        for slab in bits.words.chunks_exact(bits.row * ny as usize) {
            let fill = |weights: &mut Vec<i8>| {
                weights.resize(len, 0);
                for (row, words) in weights.chunks_exact_mut(width).zip(slab.chunks_exact(bits.row)) {
                    spell_out(words, row);
                }
            };
            slabs.push_with(fill, out)?;
        }
        slabs.end(out)
    }
}

impl BitGrid {
    /// Meshes the bits into `out`, whose former content is dropped, with one vertex in the middle of each edge between
    /// a set and an unset point. See [`BitMesher::mesh`], which also keeps its memory from grid to grid.
    ///
    /// ```
    /// use marchless::{MeshBuffer, Shape, bits::BitGrid};
    ///
    /// let mut point = BitGrid::new(Shape::cube(3)?)?;
    /// point.set([1, 1, 1], true)?;
    /// let mut mesh = MeshBuffer::new();
    /// point.mesh(&mut mesh)?;
    /// assert_eq!((mesh.positions.len(), mesh.triangle_count()), (6, 8));
    /// assert!(mesh.positions.contains(&[1.5, 1.0, 1.0]));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshError::TooSmall`] below 2 points per axis, [`MeshError::TooManyVertices`]; `out` is then empty.
    pub fn mesh(&self, out: &mut MeshBuffer) -> Result<(), MeshError> {
        BitMesher::new().mesh(self, out)
    }

    /// Meshes the bits into `out`, with each vertex where `distance` is zero on its edge. The bits decide what is
    /// connected; the function, negative inside, decides where the surface lies. See [`BitMesher::mesh_placed`].
    ///
    /// ```
    /// use marchless::{MeshBuffer, Shape, bits::BitGrid};
    ///
    /// let distance = |[x, y, z]: [f32; 3]| ((x - 8.0).powi(2) + (y - 8.0).powi(2) + (z - 8.0).powi(2)).sqrt() - 5.3;
    /// let ball = BitGrid::from_fn(Shape::cube(17)?, |p| distance(p.map(|v| v as f32)) < 0.0)?;
    /// let mut mesh = MeshBuffer::new();
    /// ball.mesh_placed(distance, &mut mesh)?;
    /// assert!(mesh.positions.iter().all(|&position| distance(position).abs() < 1e-4));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`mesh`](Self::mesh).
    pub fn mesh_placed(&self, distance: impl Fn([f32; 3]) -> f32, out: &mut MeshBuffer) -> Result<(), MeshError> {
        BitMesher::new().mesh_placed(self, distance, out)
    }
}

/// The weights of each byte's eight bits, lowest first: −1 for a set bit, 1 for an unset one.
static WEIGHTS: [[i8; 8]; 256] = {
    let (mut weights, mut byte) = ([[1; 8]; 256], 0);
    while byte < 256 {
        let mut bit = 0;
        while bit < 8 {
            if byte >> bit & 1 == 1 {
                weights[byte][bit] = -1;
            }
            bit += 1;
        }
        byte += 1;
    }
    weights
};

/// Writes the weights of a row of bits.
fn spell_out(words: &[u64], weights: &mut [i8]) {
    for (word, weights) in words.iter().zip(weights.chunks_mut(64)) {
        let bytes = word.to_le_bytes();
        let (eights, rest) = weights.as_chunks_mut::<8>();
        for (eight, &byte) in eights.iter_mut().zip(&bytes) {
            *eight = WEIGHTS[usize::from(byte)];
        }
        if !rest.is_empty() {
            rest.copy_from_slice(&WEIGHTS[usize::from(bytes[eights.len()])][..rest.len()]);
        }
    }
}
