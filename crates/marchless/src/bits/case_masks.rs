//! The case index of every cell: eight bits that say which of its corners are set. Marching cubes looks them up in its
//! tables.
//!
//! Two known methods make many masks at once, without a look at each corner of each cell:
//!
//! - *Shifted copies* ("Marchless Cubes: Bitfield SIMD Voxel Meshing"). A shift down by one along an axis puts each bit
//!   where its neighbour was. So the grid and seven shifted copies hold the eight corners of a cell at one place. The
//!   bits of copy k are spread out, one to a byte, and go to bit k of the masks. This takes eight spreads and eight
//!   ors, whatever the bits are, but the grid must fit into registers. [`Tile`](super::Tile) is such a grid.
//! - *Word strides* (an article on building cell masks from rows of sign bits held in words along one axis). Four
//!   passes go over the rows, one for each edge of a cell that runs along them. A pass looks at each bit of a word.
//!   Where the bit is set, the pass sets one bit in the masks of the two cells that share that corner. Each row is read
//!   four times, masks are written up to four times, and each bit has a branch: words of zeros cost next to nothing,
//!   and noise costs most.
//!
//! This module takes the copies from the first and the words from the second. A row of cells has four rows of corners.
//! Their words are four of the eight copies. The other four are the same words shifted down by one, with the lowest bit
//! of the next word on top. A transposition of 8 × 64 bits turns these eight words into the 64 bytes of 64 cells. Each
//! mask is written once; the rows are short enough to be in the nearest cache when they are read again; no branch
//! depends on a bit. So the grid may have any size, and its content does not change the time.

use alloc::vec::Vec;

use super::{BitGrid, BitsError};
use crate::simd::{Backend, Job, Simd, dispatch};

impl BitGrid {
    /// The case index of every cell, `[(nx − 1)·(ny − 1)·(nz − 1)]`, x fastest: bit k of a cell's byte is its
    /// [`Corner`](crate::cell::Corner) k, as in [`CaseIndex`](crate::cell::CaseIndex).
    ///
    /// ```
    /// use marchless::{Shape, bits::BitGrid};
    ///
    /// let mut grid = BitGrid::new(Shape::cube(3)?)?;
    /// grid.set([1, 1, 1], true)?;
    /// assert_eq!(grid.case_masks()?, [1 << 7, 1 << 6, 1 << 5, 1 << 4, 1 << 3, 1 << 2, 1 << 1, 1]);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`BitsError::TooSmall`] below 2 points per axis, [`BitsError::TooLarge`] if memory cannot hold the masks.
    pub fn case_masks(&self) -> Result<Vec<u8>, BitsError> {
        let mut masks = Vec::new();
        self.case_masks_into(&mut masks)?;
        Ok(masks)
    }

    /// [`case_masks`](Self::case_masks) into an existing vector, whose content is replaced and whose memory is reused.
    /// On errors the vector is unchanged.
    ///
    /// # Errors
    /// Those of [`case_masks`](Self::case_masks).
    pub fn case_masks_into(&self, masks: &mut Vec<u8>) -> Result<(), BitsError> {
        self.case_masks_with(Backend::fastest(), masks)
    }

    fn case_masks_with(&self, backend: Backend, masks: &mut Vec<u8>) -> Result<(), BitsError> {
        let shape = self.shape;
        let cells = shape.size().map(|size| size as usize - 1);
        if cells.contains(&0) {
            return Err(BitsError::TooSmall { shape });
        }
        let len = cells.iter().product();
        resize(masks, len).map_err(|()| BitsError::TooLarge { shape })?;
        dispatch(backend, CaseMasks { grid: self, cells, masks });
        Ok(())
    }
}

/// Makes `masks` this long; its content is then arbitrary. If memory cannot hold that, `masks` is unchanged.
pub(super) fn resize(masks: &mut Vec<u8>, len: usize) -> Result<(), ()> {
    masks.try_reserve_exact(len.saturating_sub(masks.len())).map_err(|_| ())?;
    masks.resize(len, 0);
    Ok(())
}

/// The masks of all cells of a grid.
struct CaseMasks<'a> {
    grid: &'a BitGrid,
    cells: [usize; 3],
    masks: &'a mut [u8],
}

impl Job for CaseMasks<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { grid, cells: [nx, ny, nz], mut masks } = self;
        for z in 0..nz as u32 {
            for y in 0..ny as u32 {
                let rows = [grid.row(y, z), grid.row(y + 1, z), grid.row(y, z + 1), grid.row(y + 1, z + 1)];
                row_masks::<S>(rows, nx, masks);
                masks = &mut masks[nx..];
            }
        }
    }
}

/// Writes the masks of one row of cells to the start of `masks`. The masks of later rows follow there; they may be
/// overwritten.
#[inline(always)]
fn row_masks<S: Simd>(rows: [&[u64]; 4], cells: usize, masks: &mut [u8]) {
    let bytes = |word: usize| {
        let low = rows.map(|row| row[word]);
        let next = rows.map(|row| row.get(word + 1).copied().unwrap_or(0));
        S::case_bytes(corners(low, next))
    };
    let words = cells.div_ceil(64);
    let (blocks, rest) = masks.as_chunks_mut::<64>();
    for (word, block) in blocks.iter_mut().take(words).enumerate() {
        *block = bytes(word);
    }
    // Only in the grid's last rows: no whole block is left for the last masks.
    if blocks.len() < words {
        rest.copy_from_slice(&bytes(words - 1)[..rest.len()]);
    }
}

/// The words of the eight corners of 64 cells, from a word of each of the four rows of corners and the next word of
/// each.
#[inline(always)]
fn corners(low: [u64; 4], next: [u64; 4]) -> [u64; 8] {
    let [a, b, c, d] = low;
    let [at_a, at_b, at_c, at_d] = core::array::from_fn(|row| low[row] >> 1 | next[row] << 63);
    [a, at_a, b, at_b, c, at_c, d, at_d]
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::Shape;
    use crate::cell::Corner;

    /// A grid of random bits.
    fn grid(size: [u32; 3]) -> BitGrid {
        let mut rng = fastrand::Rng::with_seed(1);
        BitGrid::from_fn(Shape::new(size).expect("no size is 0"), |_| rng.bool()).expect("it is small")
    }

    /// The case masks, corner by corner.
    fn plain(grid: &BitGrid) -> Vec<u8> {
        let [nx, ny, nz] = grid.shape().size();
        let cells = (0..nz - 1).flat_map(|z| (0..ny - 1).flat_map(move |y| (0..nx - 1).map(move |x| [x, y, z])));
        let mask = |cell: [u32; 3]| {
            let set = |corner: &Corner| grid.get([0, 1, 2].map(|axis| cell[axis] + u32::from(corner.offset()[axis])));
            Corner::ALL.iter().filter(|corner| set(corner)).map(|corner| 1 << corner.index()).sum()
        };
        cells.map(mask).collect()
    }

    #[test]
    fn every_backend_gives_the_same_masks() {
        for nx in [2, 3, 8, 31, 32, 33, 63, 64, 65, 66, 127, 128, 129, 130, 193] {
            for [ny, nz] in [[2, 2], [3, 2], [2, 4], [4, 3]] {
                let grid = grid([nx, ny, nz]);
                let expected = plain(&grid);
                for &backend in Backend::ALL {
                    let mut masks = vec![0xA5; 7];
                    grid.case_masks_with(backend, &mut masks).expect("it has cells");
                    assert!(masks == expected, "{nx} × {ny} × {nz} on {}", backend.name());
                }
            }
        }
    }

    /// All cases, at all places of a block and beside different neighbours.
    #[test]
    fn case_bytes_transposes_64_cells() {
        struct Bytes([u64; 8]);
        impl Job for Bytes {
            type Output = [u8; 64];
            #[inline(always)]
            fn run<S: Simd>(self) -> [u8; 64] {
                S::case_bytes(self.0)
            }
        }
        for first in 0..=255u8 {
            let expected: [u8; 64] = core::array::from_fn(|cell| first.wrapping_add((cell * cell * 7 + cell) as u8));
            let corners = core::array::from_fn(|corner| {
                (0..64).map(|cell| u64::from(expected[cell] >> corner & 1) << cell).sum()
            });
            for &backend in Backend::ALL {
                assert_eq!(dispatch(backend, Bytes(corners)), expected, "{}", backend.name());
            }
        }
    }
}
