//! [`BitGrid`]: a three-dimensional grid of bits, with operations on whole grids that cost a few word operations a row.
//!
//! [caves]: ../../../../crates/marchless/docs/pictures/caves.png
//! [water]: ../../../../crates/marchless/docs/pictures/water.png
//! [erosion]: ../../../../crates/marchless/docs/pictures/erosion.png
//! [collision]: ../../../../crates/marchless/docs/pictures/collision.png
//! [floating]: ../../../../crates/marchless/docs/pictures/floating.png
//!
#![doc = include_str!("../docs/bits.md")]

mod automaton;
mod case_masks;
mod components;
mod connectivity;
mod flood;
mod logic;
mod materials;
mod mesh;
mod morphology;
mod overlap;
mod paste;
mod pattern;
mod runs;
mod samples;
mod shift;
mod tile;

use thiserror::Error;

use crate::{
    lattice::{Region, Samples, Shape},
    sample::Weight,
    simd::{Backend, Words},
};
pub use automaton::Rule;
pub use components::{Component, Components};
pub use connectivity::Connectivity;
pub use materials::MaterialGrid;
pub use mesh::BitMesher;
use samples::SignRows;
pub use tile::{Tile, TileGrid};

/// A grid of one bit for each lattice point.
///
/// Bits are kept in rows of 64-bit words along x: the point `[x, y, z]` is bit `x % 64` of word `x / 64` of row
/// `y + ny·z`. Each row starts with a new word; the unused bits of its last word are zero.
///
/// Constructors return an error if memory cannot hold the grid. Operations that return another grid of the same shape
/// abort if memory runs out, as vectors do. Their `…_into` forms write to an existing grid.
///
/// ```
/// use marchless::{Shape, bits::BitGrid};
///
/// let ball = BitGrid::from_fn(Shape::cube(100)?, |p| p.map(|v| (v as i32 - 50).pow(2)).iter().sum::<i32>() < 40 * 40)?;
/// assert!(ball.get([50, 50, 50]) && !ball.get([0, 0, 0]));
/// assert_eq!(ball.count(), ball.iter().count());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct BitGrid {
    shape: Shape,
    /// Words per row.
    row: usize,
    words: Words,
}

impl BitGrid {
    /// A grid of zeros.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold the grid.
    pub fn new(shape: Shape) -> Result<Self, BitsError> {
        Self::filled(shape, false)
    }

    /// A grid of zeros with the shape of an existing grid. Aborts if memory runs out.
    pub(crate) fn empty(shape: Shape) -> Self {
        let [nx, ny, nz] = shape.size().map(|size| size as usize);
        let row = nx.div_ceil(64);
        Self { shape, row, words: Words::zeros(row * ny * nz) }
    }

    /// A grid whose bits all have this value.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold the grid.
    pub fn filled(shape: Shape, value: bool) -> Result<Self, BitsError> {
        let [nx, ny, nz] = shape.size().map(|size| size as usize);
        let row = nx.div_ceil(64);
        let too_large = BitsError::TooLarge { shape };
        let len = ny.checked_mul(nz).and_then(|rows| rows.checked_mul(row)).ok_or(too_large)?;
        let words = Words::try_zeros(len).map_err(|_| too_large)?;
        let mut grid = Self { shape, row, words };
        if value {
            grid.words.fill(u64::MAX);
            grid.clear_unused();
        }
        Ok(grid)
    }

    /// A grid whose bits are what `is_set` returns for each point.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold the grid.
    pub fn from_fn(shape: Shape, mut is_set: impl FnMut([u32; 3]) -> bool) -> Result<Self, BitsError> {
        let mut grid = Self::new(shape)?;
        let [nx, ny, _] = shape.size();
        for (number, row) in grid.words.chunks_exact_mut(grid.row).enumerate() {
            let (y, z) = ((number % ny as usize) as u32, (number / ny as usize) as u32);
            for x in 0..nx {
                row[x as usize / 64] |= u64::from(is_set([x, y, z])) << (x % 64);
            }
        }
        Ok(grid)
    }

    /// A grid with a bit for each sample, set where the sample is inside: where its weight is below `isovalue`.
    ///
    /// `isovalue` is in voxels and must be finite. The padding of [padded](Samples::padded) samples is left out.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold the grid, [`BitsError::OnlyPadding`] if the samples are padding
    /// only, [`BitsError::IsovalueNotFinite`].
    pub fn from_samples<W: Weight>(samples: Samples<'_, W>, isovalue: f32) -> Result<Self, BitsError> {
        if !isovalue.is_finite() {
            return Err(BitsError::IsovalueNotFinite { isovalue });
        }
        let padding = u32::from(samples.is_padded());
        let given = samples.shape();
        let size = given.size().map(|size| size.saturating_sub(2 * padding));
        let shape = Shape::new(size).map_err(|_| BitsError::OnlyPadding { shape: given })?;
        let mut grid = Self::new(shape)?;
        SignRows { samples, padding: padding as usize, isovalue, grid: &mut grid }.pack(Backend::fastest());
        Ok(grid)
    }

    /// Points per axis.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// True if the bit of a point is set; false outside the grid.
    pub fn get(&self, position: [u32; 3]) -> bool {
        self.place_of(position).is_some_and(|(word, bit)| self.words[word] >> bit & 1 == 1)
    }

    /// Sets the bit of a point.
    ///
    /// # Errors
    /// [`BitsError::OutOfRange`] if the grid has no such point.
    pub fn set(&mut self, position: [u32; 3], value: bool) -> Result<(), BitsError> {
        let Some((word, bit)) = self.place_of(position) else {
            return Err(BitsError::OutOfRange { position, shape: self.shape });
        };
        self.words[word] = self.words[word] & !(1 << bit) | u64::from(value) << bit;
        Ok(())
    }

    /// The number of set bits.
    pub fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// True if no bit is set.
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// The points whose bit is set, in memory order: x fastest, z slowest.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let ny = self.shape.size()[1] as usize;
        self.words.iter().enumerate().flat_map(move |(index, &word)| {
            let (row, x) = (index / self.row, (index % self.row * 64) as u32);
            let (y, z) = ((row % ny) as u32, (row / ny) as u32);
            set_bits(word).map(move |bit| [x + bit, y, z])
        })
    }

    /// All words, row by row.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// The number of words per row.
    pub const fn words_per_row(&self) -> usize {
        self.row
    }

    /// The words of one row.
    pub(crate) fn row(&self, y: u32, z: u32) -> &[u64] {
        &self.words[self.row * (y as usize + self.shape.size()[1] as usize * z as usize)..][..self.row]
    }

    /// All words, mutable. Callers must keep the unused bits of each row's last word zero, or
    /// [clear](Self::clear_unused) them.
    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// The mask of the used bits of a row's last word.
    pub(crate) const fn last_word(&self) -> u64 {
        let nx = self.shape.size()[0] as usize;
        u64::MAX >> (64 * self.row - nx)
    }

    /// Clears the unused bits of each row's last word.
    pub(crate) fn clear_unused(&mut self) {
        let last = self.last_word();
        if last != u64::MAX {
            for row in self.words.chunks_exact_mut(self.row) {
                row[self.row - 1] &= last;
            }
        }
    }

    /// Checks that `other` has the same shape.
    ///
    /// # Errors
    /// [`BitsError::ShapesDiffer`] if it has another shape.
    pub(crate) fn same_shape(&self, other: &Self) -> Result<(), BitsError> {
        if self.shape == other.shape {
            return Ok(());
        }
        Err(BitsError::ShapesDiffer { expected: self.shape, found: other.shape })
    }

    /// The index of a point's word and the bit in that word; `None` outside the grid.
    fn place_of(&self, [x, y, z]: [u32; 3]) -> Option<(usize, u32)> {
        let [nx, ny, nz] = self.shape.size();
        (x < nx && y < ny && z < nz).then(|| {
            let row = y as usize + ny as usize * z as usize;
            (self.row * row + x as usize / 64, x % 64)
        })
    }
}

/// The indices of a word's set bits, lowest first.
pub(crate) fn set_bits(mut word: u64) -> impl Iterator<Item = u32> {
    core::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros());
        word &= word.wrapping_sub(1);
        bit
    })
}

/// The reason why an operation on bits was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BitsError {
    /// Memory cannot hold the grid.
    #[error("memory does not hold what a grid of {shape} bits takes")]
    TooLarge {
        /// The rejected shape.
        shape: Shape,
    },
    /// The padded samples consist of padding only.
    #[error("{shape} padded samples are nothing but padding: at least 3 per axis are needed")]
    OnlyPadding {
        /// The samples, padding included.
        shape: Shape,
    },
    /// The isovalue must be finite.
    #[error("the isovalue must be finite, but it is {isovalue}")]
    IsovalueNotFinite {
        /// The rejected isovalue.
        isovalue: f32,
    },
    /// A cell needs two points on each axis.
    #[error("a grid of {shape} bits has no cells: at least 2 per axis are needed")]
    TooSmall {
        /// The grid's shape.
        shape: Shape,
    },
    /// Two grids must have the same shape.
    #[error("a grid of {expected} bits was expected, but it has {found}")]
    ShapesDiffer {
        /// The shape of the grid operated on.
        expected: Shape,
        /// The shape of the other grid.
        found: Shape,
    },
    /// The grid has no such point.
    #[error("a grid of {shape} bits has no point {position:?}")]
    OutOfRange {
        /// The rejected position.
        position: [u32; 3],
        /// The grid's shape.
        shape: Shape,
    },
    /// The region is empty, or has more points than can be counted.
    #[error("no grid has the size of the region from {:?} to {:?}", .region.min, .region.max)]
    RegionSize {
        /// The rejected region.
        region: Region,
    },
    /// A point has 26 neighbours at most.
    #[error("a rule counts up to 26 neighbours, but {count} was given")]
    NeighbourCount {
        /// The rejected count.
        count: u8,
    },
    /// Materials take 2 to 8 planes.
    #[error("materials take 2 to 8 planes, but {found} were asked for")]
    PlanesOutOfRange {
        /// The rejected number of planes.
        found: u32,
    },
    /// The materials do not fill the grid.
    #[error("a grid of {shape} needs {expected} materials, but there are {found}")]
    MaterialsLength {
        /// The grid's shape.
        shape: Shape,
        /// The number of its points.
        expected: usize,
        /// The slice's length.
        found: usize,
    },
    /// A material's number has more bits than there are planes.
    #[error("{planes} planes hold materials below {}, but {material} was given for {position:?}", 1u32 << planes)]
    MaterialTooLarge {
        /// The rejected material.
        material: u8,
        /// The point that it was given for.
        position: [u32; 3],
        /// Bits per point.
        planes: u32,
    },
}
