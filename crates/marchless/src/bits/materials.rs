//! [`MaterialGrid`]: a grid of up to 256 materials. It meshes the boundary of any set of materials against the rest.

mod planes;
mod selection;

use alloc::vec::Vec;

use super::{BitGrid, BitMesher, BitsError};
use crate::{
    buffer::MeshBuffer,
    lattice::Shape,
    material::MaterialSet,
    mesher::MeshError,
    simd::{Backend, dispatch_words},
};
use planes::FillPlanes;
use selection::Selection;

/// A grid of one material for each lattice point, in 2 to 8 planes of bits, for 4 to 256 materials: bit `k` of a
/// point's material is its bit in plane `k`.
///
/// ```
/// use marchless::{MeshBuffer, Shape, bits::MaterialGrid};
///
/// // Layers of sand (2) and water (1) below air (0).
/// let shape = Shape::cube(8)?;
/// let layer = |index| match index / 64 { 0..3 => 2, 3..5 => 1, _ => 0 };
/// let grid = MaterialGrid::from_materials(shape, &(0..512).map(layer).collect::<Vec<_>>(), 2)?;
/// assert_eq!(grid.get([1, 2, 3]), Some(1));
/// assert_eq!(grid.select([1, 2]).count(), 5 * 64);
///
/// let (mut sand, mut water) = (MeshBuffer::new(), MeshBuffer::new());
/// grid.mesh([2], &mut sand)?;
/// grid.mesh([1], &mut water)?;
/// // Water has a surface and a bed, and the bed is where the sand ends.
/// assert!(sand.positions.iter().all(|position| position[2] == 2.5 && water.positions.contains(position)));
/// assert!(sand.materials.iter().all(|&material| material == 2));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct MaterialGrid {
    /// 2 to 8, of one shape.
    planes: Vec<BitGrid>,
}

impl MaterialGrid {
    /// A grid of material 0 with `planes` bits per point, 2 to 8.
    ///
    /// # Errors
    /// [`BitsError::PlanesOutOfRange`], [`BitsError::TooLarge`] if memory cannot hold the grid.
    pub fn new(shape: Shape, planes: u32) -> Result<Self, BitsError> {
        if !(2..=8).contains(&planes) {
            return Err(BitsError::PlanesOutOfRange { found: planes });
        }
        let planes = (0..planes).map(|_| BitGrid::new(shape)).collect::<Result<_, _>>()?;
        Ok(Self { planes })
    }

    /// The grid of these materials: `[nx·ny·nz]`, x fastest, each below 2 to the power of `planes`.
    ///
    /// # Errors
    /// [`BitsError::MaterialsLength`] if the slice's length is not the shape's, [`BitsError::MaterialTooLarge`], and
    /// those of [`new`](Self::new).
    pub fn from_materials(shape: Shape, materials: &[u8], planes: u32) -> Result<Self, BitsError> {
        let mut grid = Self::new(shape, planes)?;
        if materials.len() != shape.len() {
            return Err(BitsError::MaterialsLength { shape, expected: shape.len(), found: materials.len() });
        }
        let bits = materials.iter().fold(0, |bits, material| bits | material);
        if !grid.holds(bits)
            && let Some(index) = materials.iter().position(|&material| !grid.holds(material))
        {
            let [_, row, slab] = shape.strides();
            let position = [index % row, index % slab / row, index / slab].map(|v| v as u32);
            return Err(BitsError::MaterialTooLarge { material: materials[index], position, planes });
        }
        dispatch_words(Backend::fastest(), FillPlanes { materials, planes: &mut grid.planes });
        Ok(grid)
    }

    /// Points per axis.
    pub fn shape(&self) -> Shape {
        self.planes[0].shape
    }

    /// The planes, lowest bit first.
    pub fn planes(&self) -> &[BitGrid] {
        &self.planes
    }

    /// The material of a point; `None` outside the grid.
    pub fn get(&self, position: [u32; 3]) -> Option<u8> {
        let (word, bit) = self.planes[0].place_of(position)?;
        let bits = self.planes.iter().map(|plane| (plane.words[word] >> bit & 1) as u8);
        Some(bits.rev().fold(0, |material, bit| material << 1 | bit))
    }

    /// Sets the material of a point.
    ///
    /// # Errors
    /// [`BitsError::OutOfRange`] if the grid has no such point, [`BitsError::MaterialTooLarge`]; the grid is then
    /// unchanged.
    pub fn set(&mut self, position: [u32; 3], material: u8) -> Result<(), BitsError> {
        if !self.holds(material) {
            return Err(BitsError::MaterialTooLarge { material, position, planes: self.planes.len() as u32 });
        }
        self.planes.iter_mut().enumerate().try_for_each(|(k, plane)| plane.set(position, material >> k & 1 == 1))
    }

    /// The points that have any of these materials. Materials that do not fit the planes select nothing.
    ///
    /// This takes a few word operations per 64 points: one per plane for a single material, at most 77 for any set.
    pub fn select(&self, materials: impl IntoIterator<Item = u8>) -> BitGrid {
        self.select_set(&materials.into_iter().collect())
    }

    /// [`select`](Self::select) into an existing grid of the same shape, whose content is replaced.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if `out` has another shape; it is then unchanged.
    pub fn select_into(&self, materials: impl IntoIterator<Item = u8>, out: &mut BitGrid) -> Result<(), BitsError> {
        self.planes[0].same_shape(out)?;
        self.select_set_into(&materials.into_iter().collect(), out);
        Ok(())
    }

    /// Meshes the boundary of these materials against all others into `out`, whose former content is dropped.
    ///
    /// The mesh is that of [`BitGrid::mesh`], up to 2²³ cells per axis. [`MeshBuffer::materials`] says which of the
    /// materials is inside at each vertex.
    ///
    /// Where two materials touch, the boundaries of both have the same vertices bit for bit, in the middle of the edges
    /// between them. Their triangles may differ in cells where more than two materials meet, or where a material
    /// touches itself only along an edge or a diagonal.
    ///
    /// To keep memory from mesh to mesh, or to place vertices by a function, [`select`](Self::select) the points and
    /// mesh them with a [`BitMesher`].
    ///
    /// # Errors
    /// Those of [`BitGrid::mesh`]; `out` is then empty.
    pub fn mesh(&self, materials: impl IntoIterator<Item = u8>, out: &mut MeshBuffer) -> Result<(), MeshError> {
        let inside = self.select_set(&materials.into_iter().collect());
        BitMesher::new().mesh(&inside, out)?;
        self.name_materials(&inside, out);
        Ok(())
    }

    /// True if a material fits the planes.
    fn holds(&self, material: u8) -> bool {
        u32::from(material) >> self.planes.len() == 0
    }

    fn select_set(&self, set: &MaterialSet) -> BitGrid {
        let mut out = self.planes[0].clone();
        self.select_set_into(set, &mut out);
        out
    }

    fn select_set_into(&self, set: &MaterialSet, out: &mut BitGrid) {
        dispatch_words(Backend::fastest(), Selection::new(set, &self.planes, &mut out.words));
        out.clear_unused();
    }

    /// Appends the material at the inside end of each vertex's edge. All vertices are in the middle of their edges.
    fn name_materials(&self, inside: &BitGrid, out: &mut MeshBuffer) {
        out.materials.extend(out.positions.iter().map(|middle| {
            let low = middle.map(|v| v as u32);
            let high = [0, 1, 2].map(|axis| low[axis] + u32::from(low[axis] as f32 != middle[axis]));
            self.get(if inside.get(low) { low } else { high }).unwrap_or_default()
        }));
    }
}
