//! Case masks of rows and of tiles, against the corners of each cell.

use marchless::{
    Shape,
    bits::{BitGrid, BitsError, Tile, TileGrid},
    cell::{Corner, Face},
};
use proptest::prelude::*;

use crate::support::{points, random};

/// Sizes around those of tiles, words and vector registers.
const SIZES: [u32; 13] = [1, 2, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 130];

fn shapes() -> impl Strategy<Value = Shape> {
    (proptest::sample::select(&SIZES[..]), 1..11u32, 1..5u32, 0..3usize).prop_map(|(long, a, b, turn)| {
        let mut size = [long, a, b];
        size.rotate_right(turn);
        Shape::new(size).expect("no size is 0")
    })
}

/// A random bit for each point, set with a chance of `share` in 256.
fn coin(seed: u64, share: u8, point: [u32; 3]) -> bool {
    random(seed, point) as u8 <= share
}

fn random_grid(shape: Shape, seed: u64, share: u8) -> BitGrid {
    BitGrid::from_fn(shape, |point| coin(seed, share, point)).expect("it is small")
}

/// The case mask of a cell, corner by corner.
fn plain(cell: [u32; 3], is_set: impl Fn([u32; 3]) -> bool) -> u8 {
    let mut mask = 0;
    for corner in Corner::ALL {
        let [x, y, z] = corner.offset().map(u32::from);
        mask |= u8::from(is_set([cell[0] + x, cell[1] + y, cell[2] + z])) << corner.index();
    }
    mask
}

fn random_tile(seed: u64) -> Tile {
    Tile::from_words(core::array::from_fn(|z| {
        points([8, 8, 1]).map(|[x, y, _]| u64::from(coin(seed, 100, [x, y, z as u32])) << (x + 8 * y)).sum()
    }))
}

proptest! {
    #[test]
    fn rows_agree_with_corners(shape in shapes(), seed: u64, share: u8) {
        let grid = random_grid(shape, seed, share);
        let mut masks = vec![3; 100];
        if shape.size().contains(&1) {
            prop_assert_eq!(grid.case_masks(), Err(BitsError::TooSmall { shape }));
            prop_assert_eq!(grid.case_masks_into(&mut masks), Err(BitsError::TooSmall { shape }));
            prop_assert_eq!(masks, vec![3; 100], "an error leaves them");
            return Ok(());
        }
        grid.case_masks_into(&mut masks).expect("it has cells");
        let cells = shape.size().map(|size| size - 1);
        prop_assert_eq!(masks.len(), cells.iter().product::<u32>() as usize);
        for (cell, &mask) in points(cells).zip(&masks) {
            prop_assert_eq!(mask, plain(cell, |point| grid.get(point)), "cell {:?}", cell);
        }
        prop_assert!(grid.case_masks().as_ref() == Ok(&masks));
    }

    #[test]
    fn tiles_agree_with_corners(shape in shapes(), seed: u64, share: u8) {
        let grid = random_grid(shape, seed, share);
        let cut = TileGrid::from_bits(&grid).expect("it is small");
        let mut all = vec![3; 100];
        cut.case_masks_into(&mut all).expect("it is small");
        prop_assert_eq!(all.len(), 512 * cut.tiles().len());
        for ((position, masks), tile) in points(cut.tiles_per_axis()).zip(all.chunks_exact(512)).zip(cut.tiles()) {
            prop_assert_eq!(cut.tile(position), Some(tile));
            prop_assert!(cut.case_masks(position).is_some_and(|one| one == masks), "tile {:?}", position);
            let alone = tile.case_masks();
            for (at, point) in points([8; 3]).enumerate() {
                let cell = core::array::from_fn(|axis| 8 * position[axis] + point[axis]);
                prop_assert_eq!(masks[at], plain(cell, |point| grid.get(point)), "cell {:?}", cell);
                prop_assert_eq!(alone[at], plain(point, |point| tile.get(point)), "alone, {:?}", point);
                prop_assert_eq!(tile.get(point), grid.get(cell), "point {:?}", cell);
            }
        }
        let beyond = cut.tiles_per_axis();
        for axis in 0..3 {
            let mut position = [0; 3];
            position[axis] = beyond[axis];
            prop_assert!(cut.tile(position).is_none() && cut.case_masks(position).is_none());
        }
        prop_assert!(cut.to_bits().as_ref() == Ok(&grid), "cut and back");
    }

    #[test]
    fn a_shift_moves_every_point_of_a_tile(seed: u64, face in 0..6u8) {
        let (tile, face) = (random_tile(seed), Face::new(face));
        let shifted = tile.shifted(face);
        for point in points([8; 3]) {
            let mut from = point;
            from[face.axis()] = if face.is_high() { from[face.axis()].wrapping_sub(1) } else { from[face.axis()] + 1 };
            prop_assert_eq!(shifted.get(point), tile.get(from), "{:?} from {:?}", point, from);
        }
    }

    /// The shifted copies of "Marchless Cubes: Bitfield SIMD Voxel Meshing" give the same masks.
    #[test]
    fn masks_of_a_tile_are_eight_shifted_copies(seed: u64) {
        let tile = random_tile(seed);
        let masks = tile.case_masks();
        for corner in Corner::ALL {
            let mut copy = tile;
            for (axis, &offset) in corner.offset().iter().enumerate() {
                if offset == 1 {
                    copy = copy.shifted(Face::new(2 * axis as u8));
                }
            }
            for (at, point) in points([8; 3]).enumerate() {
                prop_assert_eq!(masks[at] >> corner.index() & 1 == 1, copy.get(point), "{:?} of {:?}", corner, point);
            }
        }
    }
}

#[test]
fn unused_bits_of_words_and_tiles_stay_zero() {
    let full = BitGrid::filled(Shape::cube(9).expect("it is small"), true).expect("it is small");
    assert!(full.case_masks().expect("it has cells").iter().all(|&mask| mask == 255));
    let cut = TileGrid::from_bits(&full).expect("it is small");
    assert_eq!(cut.tiles_per_axis(), [2; 3]);
    assert_eq!(cut.tile([1, 1, 1]).map(|tile| *tile.words()), Some([1, 0, 0, 0, 0, 0, 0, 0]));
}

#[test]
fn bits_of_a_tile_are_set_one_by_one() {
    let mut tile = Tile::default();
    for point in points([8; 3]) {
        tile.set(point, true).expect("it lies in the tile");
        assert!(tile.get(point) && tile.words().iter().map(|word| word.count_ones()).sum::<u32>() == 1, "{point:?}");
        tile.set(point, false).expect("it lies in the tile");
        assert_eq!(tile, Tile::default());
    }
    for outside in [[8, 0, 0], [0, 8, 0], [0, 0, 8], [u32::MAX; 3]] {
        assert!(!tile.get(outside));
        let shape = Shape::cube(8).expect("it is small");
        assert_eq!(tile.set(outside, true), Err(BitsError::OutOfRange { position: outside, shape }));
    }
    assert_eq!((size_of::<Tile>(), align_of::<Tile>()), (64, 64));
}
