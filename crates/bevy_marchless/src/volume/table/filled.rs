//! [`FilledChunks`]: which chunks have their samples.

use bevy_platform::collections::HashMap;
use marchless::Region;

use crate::chunk::ChunkKey;

/// The chunks that have their samples, in bits: what is around a chunk is told from few words.
#[derive(Debug, Default)]
pub(super) struct FilledChunks {
    /// Blocks of 8 × 8 × 8 chunks, by their place in blocks: a word for each z, bit `x + 8·y`. None is empty.
    blocks: HashMap<ChunkKey, [u64; 8]>,
}

/// `[z][y]`, bit `x`.
type Window<const N: usize> = [[u8; N]; N];

impl FilledChunks {
    pub(super) fn set(&mut self, key: ChunkKey, is_filled: bool) {
        let (block, [x, y, z]) = place(key);
        let bit = 1 << (x + 8 * y);
        let words = self.blocks.entry(block).or_default();
        if is_filled {
            words[z] |= bit;
        } else {
            words[z] &= !bit;
            if *words == [0; 8] {
                self.blocks.remove(&block);
            }
        }
    }

    pub(super) fn clear(&mut self) {
        self.blocks.clear();
    }

    /// Whether the 3 × 3 × 3 chunks around one have their samples, as far as `extent` has them.
    pub(super) fn are_all_around(&self, key: ChunkKey, extent: &Region) -> bool {
        self.window::<3>(key, extent) == [[0b111; 3]; 3]
    }

    /// Of the 3 × 3 × 3 chunks around one, those [around which all](Self::are_all_around) have their samples.
    pub(super) fn surrounded_around(&self, key: ChunkKey, extent: &Region) -> impl Iterator<Item = ChunkKey> + use<> {
        let along_x = self.window::<5>(key, extent).map(|layer| layer.map(|row| row & row >> 1 & row >> 2));
        let along_y = along_x.map(|layer| [0, 1, 2].map(|y| layer[y] & layer[y + 1] & layer[y + 2]));
        let all = [0, 1, 2].map(|z| [0, 1, 2].map(|y| along_y[z][y] & along_y[z + 1][y] & along_y[z + 2][y]));
        key.around()
            .zip(0..)
            .filter(move |(_, index)| all[index / 9][index / 3 % 3] >> (index % 3) & 1 == 1)
            .map(|(near, _)| near)
    }

    /// The `N`³ chunks around one. Those beyond `extent` count as filled.
    fn window<const N: usize>(&self, key: ChunkKey, extent: &Region) -> Window<N> {
        let reach = N as i32 / 2;
        let corner = ChunkKey { position: key.position.map(|v| v.saturating_sub(reach)), ..key };
        let (block, [x, y, z]) = place(corner);
        // Of two blocks per axis, the second only where the window reaches into it.
        let ends = [x, y, z].map(|start| (start + N - 1) / 8);
        let mut words = [[[&[0; 8]; 2]; 2]; 2];
        for (block_z, words) in words.iter_mut().enumerate().take(ends[2] + 1) {
            for (block_y, words) in words.iter_mut().enumerate().take(ends[1] + 1) {
                for (block_x, words) in words.iter_mut().enumerate().take(ends[0] + 1) {
                    let step = [block_x as i32, block_y as i32, block_z as i32];
                    let position = [0, 1, 2].map(|axis| block.position[axis] + step[axis]);
                    *words = self.blocks.get(&ChunkKey { position, ..block }).unwrap_or(&[0; 8]);
                }
            }
        }
        let mut window = [[0; N]; N];
        for (row_z, layer) in window.iter_mut().enumerate() {
            for (row_y, row) in layer.iter_mut().enumerate() {
                let (z, y) = (z + row_z, y + row_y);
                let [low, high] = words[z / 8][y / 8].map(|words| words[z % 8] >> (8 * (y % 8)) & 0xff);
                *row = ((low | high << 8) >> x) as u8 & ((1 << N) - 1);
            }
        }
        let end = corner.position.map(|v| v.saturating_add(N as i32));
        if (0..3).any(|axis| corner.position[axis] < extent.min[axis] || end[axis] > extent.max[axis]) {
            fill_beyond(&mut window, corner.position, extent);
        }
        window
    }
}

/// Fills what of a window lies beyond an extent.
fn fill_beyond<const N: usize>(window: &mut Window<N>, corner: [i32; 3], extent: &Region) {
    let is_beyond = |axis: usize, index: usize| {
        let position = corner[axis].saturating_add(index as i32);
        position < extent.min[axis] || position >= extent.max[axis]
    };
    let columns = (0..N).filter(|x| is_beyond(0, *x)).fold(0, |columns, x| columns | 1 << x);
    for (z, layer) in window.iter_mut().enumerate() {
        for (y, row) in layer.iter_mut().enumerate() {
            *row |= if is_beyond(1, y) || is_beyond(2, z) { (1 << N) - 1 } else { columns };
        }
    }
}

/// The block that a chunk is in, and its place there.
fn place(key: ChunkKey) -> (ChunkKey, [usize; 3]) {
    let ChunkKey { level, position } = key;
    (ChunkKey { level, position: position.map(|v| v >> 3) }, position.map(|v| (v & 7) as usize))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_is_around_is_what_a_plain_set_has(
            changes in prop::collection::vec((prop::array::uniform3(-5..12i32), 0..4u8), 0..2_000),
            corner in prop::array::uniform3(-5..2i32),
            size in prop::array::uniform3(1..12i32),
        ) {
            let extent = Region::new(corner, [0, 1, 2].map(|axis| corner[axis] + size[axis]));
            let (mut filled, mut plain) = (FilledChunks::default(), BTreeSet::new());
            for (position, kind) in changes.into_iter().filter(|(position, _)| extent.contains(*position)) {
                let key = ChunkKey::finest(position);
                filled.set(key, kind > 0);
                if kind > 0 { plain.insert(key) } else { plain.remove(&key) };
            }
            for key in extent.points().map(ChunkKey::finest) {
                let is_surrounded = |key: ChunkKey| {
                    key.around().all(|near| plain.contains(&near) || !extent.contains(near.position))
                };
                prop_assert_eq!(filled.are_all_around(key, &extent), is_surrounded(key));
                let found: Vec<_> = filled.surrounded_around(key, &extent).collect();
                let expected: Vec<_> = key.around().filter(|near| is_surrounded(*near)).collect();
                prop_assert_eq!(found, expected);
            }
            for key in plain {
                filled.set(key, false);
            }
            prop_assert!(filled.blocks.is_empty());
        }
    }
}
