//! [`Tile`]: 8 × 8 × 8 bits in one cache line; and [`TileGrid`]: a grid of tiles.
//!
//! "Marchless Cubes: Bitfield SIMD Voxel Meshing" shifts such a tile as a whole. `case_masks.rs` compares its case
//! masks with those made from rows.

use alloc::vec::Vec;
use core::ops::Range;

use super::{BitGrid, BitsError, case_masks::resize};
use crate::{
    cell::Face,
    lattice::Shape,
    simd::{Backend, Job, Simd, dispatch},
};

/// The bits with x = 0.
const LOW_X: u64 = 0x0101_0101_0101_0101;

/// 8 × 8 × 8 bits in one cache line: the point `[x, y, z]` is bit `x` of byte `y` of word `z`.
///
/// ```
/// use marchless::{bits::Tile, cell::Face};
///
/// let mut tile = Tile::default();
/// tile.set([6, 0, 3], true)?;
/// let to_the_right = tile.shifted(Face::new(1));
/// assert!(to_the_right.get([7, 0, 3]) && to_the_right.shifted(Face::new(1)) == Tile::default());
/// # Ok::<(), marchless::bits::BitsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(align(64))]
pub struct Tile([u64; 8]);

impl Tile {
    /// Points per axis.
    pub const SIZE: u32 = 8;

    /// The tile of these words, one for each z.
    pub const fn from_words(words: [u64; 8]) -> Self {
        Self(words)
    }

    /// The words, one for each z; byte `y` of a word is a row along x.
    pub const fn words(&self) -> &[u64; 8] {
        &self.0
    }

    /// True if the bit of a point is set; false outside the tile.
    pub fn get(&self, position: [u32; 3]) -> bool {
        let [x, y, z] = position;
        position.iter().all(|&v| v < Self::SIZE) && self.0[z as usize] >> (x + 8 * y) & 1 == 1
    }

    /// Sets the bit of a point.
    ///
    /// # Errors
    /// [`BitsError::OutOfRange`] if a coordinate is above 7.
    pub fn set(&mut self, position: [u32; 3], value: bool) -> Result<(), BitsError> {
        const SHAPE: Shape = match Shape::cube(Tile::SIZE) {
            Ok(shape) => shape,
            Err(_) => unreachable!(),
        };
        if position.iter().any(|&v| v >= Self::SIZE) {
            return Err(BitsError::OutOfRange { position, shape: SHAPE });
        }
        let [x, y, z] = position;
        let (word, bit) = (&mut self.0[z as usize], x + 8 * y);
        *word = *word & !(1 << bit) | u64::from(value) << bit;
        Ok(())
    }

    /// The tile with all points moved by one towards a face. The points at that face are lost; zeros come in at the
    /// opposite face.
    pub fn shifted(self, towards: Face) -> Self {
        let mut words = self.0;
        match (towards.axis(), towards.is_high()) {
            (0, false) => words = words.map(|word| word >> 1 & !(LOW_X << 7)),
            (0, true) => words = words.map(|word| word << 1 & !LOW_X),
            (1, false) => words = words.map(|word| word >> 8),
            (1, true) => words = words.map(|word| word << 8),
            (_, false) => {
                words.rotate_left(1);
                words[7] = 0;
            }
            (_, true) => {
                words.rotate_right(1);
                words[0] = 0;
            }
        }
        Self(words)
    }

    /// The case indices of the cells whose first corner lies in the tile, `[8·8·8]`, x fastest: bit k of a cell's byte
    /// is its [`Corner`](crate::cell::Corner) k. Corners beyond the tile count as zero.
    pub fn case_masks(&self) -> [u8; 512] {
        dispatch(Backend::fastest(), OneTile([self, &NONE, &NONE, &NONE, &NONE, &NONE, &NONE, &NONE]))
    }
}

/// An empty tile: the neighbour of the last tiles.
static NONE: Tile = Tile([0; 8]);

/// A grid of any size, cut into [tiles](Tile). The bits of the last tiles that lie beyond the grid are zero.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TileGrid {
    shape: Shape,
    /// x fastest.
    tiles: Vec<Tile>,
}

impl TileGrid {
    /// The tiles of a grid.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold them.
    pub fn from_bits(grid: &BitGrid) -> Result<Self, BitsError> {
        let shape = grid.shape();
        let too_large = BitsError::TooLarge { shape };
        let [nx, ny, nz] = per_axis(shape);
        let len = nx.checked_mul(ny).and_then(|layer| layer.checked_mul(nz)).ok_or(too_large)?;
        let mut tiles = Vec::new();
        tiles.try_reserve_exact(len).map_err(|_| too_large)?;
        tiles.resize(len, NONE);
        for (number, row) in grid.words().chunks_exact(grid.words_per_row()).enumerate() {
            let (range, word, shift) = place_of_row(shape, number);
            for (tile, byte) in tiles[range].iter_mut().zip(row.iter().flat_map(|word| word.to_le_bytes())) {
                tile.0[word] |= u64::from(byte) << shift;
            }
        }
        Ok(Self { shape, tiles })
    }

    /// The grid that the tiles were cut from.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold it.
    pub fn to_bits(&self) -> Result<BitGrid, BitsError> {
        let mut grid = BitGrid::new(self.shape)?;
        let words_per_row = grid.words_per_row();
        for (number, row) in grid.words_mut().chunks_exact_mut(words_per_row).enumerate() {
            let (range, word, shift) = place_of_row(self.shape, number);
            for (to, tiles) in row.iter_mut().zip(self.tiles[range].chunks(8)) {
                *to = tiles.iter().enumerate().map(|(x, tile)| (tile.0[word] >> shift & 0xFF) << (8 * x)).sum();
            }
        }
        Ok(grid)
    }

    /// Points per axis.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// All tiles, x fastest; [`tiles_per_axis`](Self::tiles_per_axis) of them.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// The number of tiles per axis. The last one of an axis may be filled in part.
    pub fn tiles_per_axis(&self) -> [u32; 3] {
        per_axis(self.shape).map(|count| count as u32)
    }

    /// The tile whose first point is `8·position`; `None` outside the grid.
    pub fn tile(&self, position: [u32; 3]) -> Option<&Tile> {
        let ([nx, ny, nz], [x, y, z]) = (per_axis(self.shape), position.map(|v| v as usize));
        (x < nx && y < ny && z < nz).then(|| &self.tiles[x + nx * (y + ny * z)])
    }

    /// The case indices of the cells whose first corner lies in a tile, `[8·8·8]`, x fastest: bit k of a cell's byte is
    /// its [`Corner`](crate::cell::Corner) k, which may lie in a neighbouring tile. Corners beyond the grid count as
    /// zero. `None` if there is no such tile.
    pub fn case_masks(&self, position: [u32; 3]) -> Option<[u8; 512]> {
        self.tile(position)?;
        Some(dispatch(Backend::fastest(), OneTile(self.around(position))))
    }

    /// Writes the [case masks](Self::case_masks) of all tiles, one tile after another, `[512·tiles]`, to a vector,
    /// whose content is replaced and whose memory is reused.
    ///
    /// # Errors
    /// [`BitsError::TooLarge`] if memory cannot hold them; the vector is then unchanged.
    pub fn case_masks_into(&self, masks: &mut Vec<u8>) -> Result<(), BitsError> {
        let too_large = BitsError::TooLarge { shape: self.shape };
        let len = self.tiles.len().checked_mul(512).ok_or(too_large)?;
        resize(masks, len).map_err(|()| too_large)?;
        dispatch(Backend::fastest(), AllTiles { grid: self, masks });
        Ok(())
    }

    /// The tile at `position` and its neighbours at +x, +y and +z, in the order of a cell's corners.
    #[inline(always)]
    fn around(&self, [x, y, z]: [u32; 3]) -> [&Tile; 8] {
        core::array::from_fn(|corner| {
            let corner = corner as u32;
            self.tile([x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)]).unwrap_or(&NONE)
        })
    }
}

/// Tiles per axis.
fn per_axis(shape: Shape) -> [usize; 3] {
    shape.size().map(|size| size.div_ceil(Tile::SIZE) as usize)
}

/// Where a row of points lies: the range of its tiles, its word in each of them, and its lowest bit in that word.
fn place_of_row(shape: Shape, number: usize) -> (Range<usize>, usize, usize) {
    let ([nx, ny, _], points_y) = (per_axis(shape), shape.size()[1] as usize);
    let (y, z) = (number % points_y, number / points_y);
    let first = nx * (y / 8 + ny * (z / 8));
    (first..first + nx, z % 8, 8 * (y % 8))
}

/// The masks of the first of these tiles. The others are its neighbours, in the order of a cell's corners.
struct OneTile<'a>([&'a Tile; 8]);

impl Job for OneTile<'_> {
    type Output = [u8; 512];

    #[inline(always)]
    fn run<S: Simd>(self) -> [u8; 512] {
        let mut masks = [0; 512];
        tile_masks::<S>(self.0, &mut masks);
        masks
    }
}

/// The masks of all tiles.
struct AllTiles<'a> {
    grid: &'a TileGrid,
    masks: &'a mut [u8],
}

impl Job for AllTiles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let [nx, ny, nz] = self.grid.tiles_per_axis();
        let tiles = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        for (position, masks) in tiles.zip(self.masks.as_chunks_mut::<512>().0) {
            tile_masks::<S>(self.grid.around(position), masks);
        }
    }
}

/// Makes the eight shifted copies, two layers along z at a time, and spreads their bits into bytes.
#[inline(always)]
fn tile_masks<S: Simd>(tiles: [&Tile; 8], masks: &mut [u8; 512]) {
    let [below @ .., a, b, c, d] = tiles;
    let above = [a, b, c, d].map(|tile| tile.0[0]);
    let mut low = layer(below.map(|tile| tile.0[0]));
    for (z, masks) in masks.as_chunks_mut::<64>().0.iter_mut().enumerate() {
        let high = layer(if z < 7 { below.map(|tile| tile.0[(z + 1) % 8]) } else { above });
        let ([a, b, c, d], [e, f, g, h]) = (low, high);
        *masks = S::case_bytes([a, b, c, d, e, f, g, h]);
        low = high;
    }
}

/// Four copies of a tile's layer: unchanged, and moved down by one along x, along y and along both. The bits that come
/// in are from the same layer of the neighbouring tiles at +x, at +y and at both.
#[inline(always)]
fn layer([here, behind_x, behind_y, behind_both]: [u64; 4]) -> [u64; 4] {
    let along_x = |word: u64, behind: u64| word >> 1 & !(LOW_X << 7) | (behind & LOW_X) << 7;
    let along_y = |word: u64, behind: u64| word >> 8 | behind << 56;
    let (at_y, behind_x_at_y) = (along_y(here, behind_y), along_y(behind_x, behind_both));
    [here, along_x(here, behind_x), at_y, along_x(at_y, behind_x_at_y)]
}
