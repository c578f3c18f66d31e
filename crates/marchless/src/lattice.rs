//! Lattices: samples per axis, their order in memory, boxes of lattice points, and a borrowed view of samples.

use core::fmt;

use thiserror::Error;

/// The largest number of cells per axis of a chunk.
pub const MAX_CHUNK_CELLS: u32 = 62;

/// The size of a lattice in samples per axis, x fastest: the sample at `[x, y, z]` has index `x + nx·(y + ny·z)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shape([u32; 3]);

impl Shape {
    /// A shape of `size` samples per axis.
    ///
    /// # Errors
    /// [`ShapeError`] if an axis is zero, or if memory could not address all samples.
    pub const fn new(size: [u32; 3]) -> Result<Self, ShapeError> {
        if size[0] == 0 || size[1] == 0 || size[2] == 0 {
            return Err(ShapeError::Empty { size });
        }
        let Some(layer) = (size[0] as usize).checked_mul(size[1] as usize) else {
            return Err(ShapeError::TooLarge { size });
        };
        match layer.checked_mul(size[2] as usize) {
            Some(len) if len <= isize::MAX as usize / 8 => Ok(Self(size)),
            _ => Err(ShapeError::TooLarge { size }),
        }
    }

    /// A shape of `size` samples on every axis.
    ///
    /// # Errors
    /// Those of [`Shape::new`].
    pub const fn cube(size: u32) -> Result<Self, ShapeError> {
        Self::new([size; 3])
    }

    /// The samples per axis.
    pub const fn size(self) -> [u32; 3] {
        self.0
    }

    /// The number of all samples; never 0.
    #[expect(clippy::len_without_is_empty, reason = "a shape is never empty")]
    pub const fn len(self) -> usize {
        self.0[0] as usize * self.0[1] as usize * self.0[2] as usize
    }

    /// The distance in memory between neighbours along x, y and z: `[1, nx, nx·ny]`.
    pub const fn strides(self) -> [usize; 3] {
        [1, self.0[0] as usize, self.0[0] as usize * self.0[1] as usize]
    }

    /// The index of the sample at `position`, which must lie within the shape.
    ///
    /// # Panics
    /// In debug builds, if `position` lies outside.
    pub const fn index(self, position: [u32; 3]) -> usize {
        debug_assert!(position[0] < self.0[0] && position[1] < self.0[1] && position[2] < self.0[2]);
        let [sx, sy, sz] = self.strides();
        position[0] as usize * sx + position[1] as usize * sy + position[2] as usize * sz
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {} × {}", self.0[0], self.0[1], self.0[2])
    }
}

/// The reason why a size is not a [`Shape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// An axis has no samples.
    #[error("a lattice needs at least one sample per axis, but its size is {} × {} × {}", size[0], size[1], size[2])]
    Empty {
        /// The size that was given.
        size: [u32; 3],
    },
    /// Memory could not address all samples.
    #[error("a lattice of {} × {} × {} samples does not fit in memory", size[0], size[1], size[2])]
    TooLarge {
        /// The size that was given.
        size: [u32; 3],
    },
}

/// A box of lattice points (or of chunks) that includes `min` and excludes `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Region {
    /// The lowest point.
    pub min: [i32; 3],
    /// One past the highest point, on each axis.
    pub max: [i32; 3],
}

impl Region {
    /// The region from `min` (included) to `max` (excluded).
    pub const fn new(min: [i32; 3], max: [i32; 3]) -> Self {
        Self { min, max }
    }

    /// True if the region has no point.
    pub const fn is_empty(&self) -> bool {
        self.max[0] <= self.min[0] || self.max[1] <= self.min[1] || self.max[2] <= self.min[2]
    }

    /// The points per axis; 0 on each axis where the region is empty.
    pub fn size(&self) -> [u32; 3] {
        core::array::from_fn(|axis| {
            (i64::from(self.max[axis]) - i64::from(self.min[axis])).clamp(0, i64::from(u32::MAX)) as u32
        })
    }

    /// True if `point` lies in the region.
    pub fn contains(&self, point: [i32; 3]) -> bool {
        (0..3).all(|axis| (self.min[axis]..self.max[axis]).contains(&point[axis]))
    }

    /// The intersection of both regions; it may be empty.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            min: core::array::from_fn(|axis| self.min[axis].max(other.min[axis])),
            max: core::array::from_fn(|axis| self.max[axis].min(other.max[axis])),
        }
    }

    /// The smallest region that holds both; an empty region adds nothing.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        if self.is_empty() {
            return *other;
        }
        if other.is_empty() {
            return *self;
        }
        Self {
            min: core::array::from_fn(|axis| self.min[axis].min(other.min[axis])),
            max: core::array::from_fn(|axis| self.max[axis].max(other.max[axis])),
        }
    }

    /// The region grown by `low` points below and `high` points above, on each axis. It saturates at the limits of
    /// `i32`.
    #[must_use]
    pub fn grown(&self, low: u32, high: u32) -> Self {
        Self {
            min: self.min.map(|v| v.saturating_sub_unsigned(low)),
            max: self.max.map(|v| v.saturating_add_unsigned(high)),
        }
    }

    /// All points, x fastest.
    pub fn points(self) -> impl Iterator<Item = [i32; 3]> {
        let x_range = self.min[0]..self.max[0];
        (self.min[2]..self.max[2]).flat_map(move |z| {
            let x_range = x_range.clone();
            (self.min[1]..self.max[1]).flat_map(move |y| x_range.clone().map(move |x| [x, y, z]))
        })
    }
}

/// A borrowed view of samples to be meshed: weights and optional materials.
///
/// ```
/// use marchless::{Samples, Shape};
///
/// let weights = [1.0f32, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
/// let samples = Samples::new(Shape::cube(2)?, &weights)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a, W> {
    shape: Shape,
    weights: &'a [W],
    materials: Option<&'a [u8]>,
    padded: bool,
}

impl<'a, W> Samples<'a, W> {
    /// Samples of `shape`. All their cells are meshed; at the border the gradient is one-sided.
    ///
    /// `weights`: `[nx·ny·nz]`, x fastest.
    ///
    /// # Errors
    /// [`SamplesError::WeightsLength`] if the slice's length is not the shape's.
    pub const fn new(shape: Shape, weights: &'a [W]) -> Result<Self, SamplesError> {
        if weights.len() != shape.len() {
            return Err(SamplesError::WeightsLength { shape, expected: shape.len(), found: weights.len() });
        }
        Ok(Self { shape, weights, materials: None, padded: false })
    }

    /// Adds a material to each sample.
    ///
    /// `materials`: `[nx·ny·nz]`, x fastest.
    ///
    /// # Errors
    /// [`SamplesError::MaterialsLength`] if the slice's length is not the shape's.
    pub const fn with_materials(self, materials: &'a [u8]) -> Result<Self, SamplesError> {
        if materials.len() != self.shape.len() {
            let (shape, expected) = (self.shape, self.shape.len());
            return Err(SamplesError::MaterialsLength { shape, expected, found: materials.len() });
        }
        Ok(Self { materials: Some(materials), ..self })
    }

    /// Makes the outermost layer of samples padding: gradients read it, but its cells are not meshed.
    ///
    /// Positions are then relative to the sample at `[1, 1, 1]`. Two blocks that overlap in their padding agree on
    /// their shared border bit for bit. [`Mesher::mesh_dual`](crate::Mesher::mesh_dual) takes more layers as padding.
    #[must_use]
    pub const fn padded(self) -> Self {
        Self { padded: true, ..self }
    }

    /// The samples per axis, padding included.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// The weights, x fastest.
    pub const fn weights(&self) -> &'a [W] {
        self.weights
    }

    /// The materials, x fastest, if there are any.
    pub const fn materials(&self) -> Option<&'a [u8]> {
        self.materials
    }

    /// True if the outermost layer is padding.
    pub const fn is_padded(&self) -> bool {
        self.padded
    }
}

/// The reason why slices are not [`Samples`] of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SamplesError {
    /// The number of weights is not the shape's.
    #[error("{shape} samples need {expected} weights, but there are {found}")]
    WeightsLength {
        /// The shape.
        shape: Shape,
        /// Its number of samples.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
    /// The number of materials is not the shape's.
    #[error("{shape} samples need {expected} materials, but there are {found}")]
    MaterialsLength {
        /// The shape.
        shape: Shape,
        /// Its number of samples.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_beyond_addressable_memory_are_refused() {
        assert_eq!(Shape::new([3, 0, 2]), Err(ShapeError::Empty { size: [3, 0, 2] }));
        assert_eq!(Shape::cube(u32::MAX), Err(ShapeError::TooLarge { size: [u32::MAX; 3] }));
        let shape = Shape::new([3, 4, 5]).unwrap();
        assert_eq!((shape.len(), shape.strides(), shape.index([1, 2, 3])), (60, [1, 3, 12], 1 + 6 + 36));
    }

    #[test]
    fn errors_of_samples_name_the_expected_length() {
        let shape = Shape::cube(2).unwrap();
        let error = Samples::new(shape, &[0i16; 7]).unwrap_err();
        assert_eq!(error, SamplesError::WeightsLength { shape, expected: 8, found: 7 });
        let error = Samples::new(shape, &[0i16; 8]).unwrap().with_materials(&[0; 9]).unwrap_err();
        assert_eq!(error, SamplesError::MaterialsLength { shape, expected: 8, found: 9 });
    }

    #[test]
    fn regions_combine() {
        let a = Region::new([0, 0, 0], [2, 3, 4]);
        let b = Region::new([1, 1, 1], [5, 2, 9]);
        assert_eq!(a.intersection(&b), Region::new([1, 1, 1], [2, 2, 4]));
        assert_eq!(a.union(&b), Region::new([0, 0, 0], [5, 3, 9]));
        assert_eq!(a.points().count(), 24);
        assert_eq!(a.points().nth(1), Some([1, 0, 0]));
        assert!(Region::new([i32::MIN; 3], [i32::MAX; 3]).grown(1, 1).contains([0; 3]));
    }
}
