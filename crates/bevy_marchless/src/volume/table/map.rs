//! [`ChunkMap`]: the entries of a chunk table, with the most frequent questions answered by bits.

use bevy_platform::collections::HashMap;
use marchless::Region;

use super::entry::Entry;
use crate::chunk::ChunkKey;

/// The facts about a chunk that are kept as bits, beside its entry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Marks {
    /// It has an entry.
    pub(super) is_loaded: bool,
    /// Its samples are resident.
    pub(super) is_filled: bool,
    /// It is a leaf that is up to date.
    pub(super) is_current: bool,
    /// It is a leaf that is out of date.
    pub(super) waits: bool,
}

/// The entries by chunk, in blocks of 4 × 4 × 4.
///
/// Chunks lie close together, so there are few blocks to search, and a few words tell the state of all chunks around
/// one. Growing copies pointers to blocks, not entries.
#[derive(Default)]
pub(super) struct ChunkMap {
    /// The blocks by their positions. No block is empty.
    blocks: HashMap<ChunkKey, Block>,
    len: usize,
}

/// By the index of an entry in the block: `x + 4·y + 16·z`.
struct Block {
    /// A word for each of the [`Marks`].
    loaded: u64,
    filled: u64,
    current: u64,
    waits: u64,
    entries: Box<[Option<Entry>; 64]>,
}

/// `[z][y]`, bit `x`.
type Window<const N: usize> = [[u8; N]; N];

impl ChunkMap {
    pub(super) const fn len(&self) -> usize {
        self.len
    }

    /// The memory that the map takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.blocks.len() * (size_of::<(ChunkKey, Block)>() + size_of::<[Option<Entry>; 64]>())
    }

    pub(super) fn marks(&self, key: ChunkKey) -> Marks {
        let (block, place) = place(key);
        self.blocks.get(&block).map_or(Marks::default(), |block| {
            let is_set = |word: u64| word >> index(place) & 1 == 1;
            Marks {
                is_loaded: is_set(block.loaded),
                is_filled: is_set(block.filled),
                is_current: is_set(block.current),
                waits: is_set(block.waits),
            }
        })
    }

    pub(super) fn get(&self, key: ChunkKey) -> Option<&Entry> {
        let (block, place) = place(key);
        self.blocks.get(&block)?.entries[index(place)].as_ref()
    }

    /// Changes an entry, if there is one.
    pub(super) fn change<T>(&mut self, key: ChunkKey, change: impl FnOnce(&mut Entry) -> T) -> Option<T> {
        let (block, place) = place(key);
        let block = self.blocks.get_mut(&block)?;
        let entry = block.entries[index(place)].as_mut()?;
        let result = change(entry);
        let marks = entry.marks();
        block.mark(index(place), marks);
        Some(result)
    }

    /// Changes all entries.
    pub(super) fn change_all(&mut self, mut change: impl FnMut(&mut Entry)) {
        for block in self.blocks.values_mut() {
            for index in 0..64 {
                if let Some(entry) = &mut block.entries[index] {
                    change(entry);
                    let marks = entry.marks();
                    block.mark(index, marks);
                }
            }
        }
    }

    /// Adds an entry, and returns the former one, if any.
    pub(super) fn insert(&mut self, key: ChunkKey, entry: Entry) -> Option<Entry> {
        let (block, place) = place(key);
        let new = || Block { loaded: 0, filled: 0, current: 0, waits: 0, entries: Box::new([const { None }; 64]) };
        let block = self.blocks.entry(block).or_insert_with(new);
        block.mark(index(place), entry.marks());
        let former = block.entries[index(place)].replace(entry);
        self.len += usize::from(former.is_none());
        former
    }

    pub(super) fn remove(&mut self, key: ChunkKey) -> Option<Entry> {
        let (block_key, place) = place(key);
        let block = self.blocks.get_mut(&block_key)?;
        let entry = block.entries[index(place)].take()?;
        block.mark(index(place), Marks::default());
        if block.loaded == 0 {
            self.blocks.remove(&block_key);
        }
        self.len -= 1;
        Some(entry)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (ChunkKey, &Entry)> + '_ {
        self.blocks.iter().flat_map(|(block, Block { entries, .. })| {
            let key = |index: i32| {
                let place = [index % 4, index / 4 % 4, index / 16];
                ChunkKey { position: [0, 1, 2].map(|axis| block.position[axis] * 4 + place[axis]), ..*block }
            };
            (0..).zip(&entries[..]).filter_map(move |(index, entry)| Some((key(index), entry.as_ref()?)))
        })
    }

    /// Whether the 3 × 3 × 3 chunks around one are filled, as far as they lie in `extent`.
    pub(super) fn is_surrounded(&self, key: ChunkKey, extent: &Region) -> bool {
        self.window::<3>(key, extent) == [[0b111; 3]; 3]
    }

    /// The chunks of the 3 × 3 × 3 around one that are [surrounded](Self::is_surrounded).
    pub(super) fn surrounded_around(&self, key: ChunkKey, extent: &Region) -> impl Iterator<Item = ChunkKey> + use<> {
        let along_x = self.window::<5>(key, extent).map(|layer| layer.map(|row| row & row >> 1 & row >> 2));
        let along_y = along_x.map(|layer| [0, 1, 2].map(|y| layer[y] & layer[y + 1] & layer[y + 2]));
        let all = [0, 1, 2].map(|z| [0, 1, 2].map(|y| along_y[z][y] & along_y[z + 1][y] & along_y[z + 2][y]));
        let is_surrounded = move |index: usize| all[index / 9][index / 3 % 3] >> (index % 3) & 1 == 1;
        key.around().zip(0..).filter(move |(_, index)| is_surrounded(*index)).map(|(near, _)| near)
    }

    /// The filled ones of the `N`³ chunks around one; `N` is at most 5. Chunks beyond `extent` count as filled.
    fn window<const N: usize>(&self, key: ChunkKey, extent: &Region) -> Window<N> {
        let corner = ChunkKey { position: key.position.map(|v| v.saturating_sub(N as i32 / 2)), ..key };
        let (block, [x, y, z]) = place(corner);
        // Each axis has two blocks; the second is read only if the window reaches into it.
        let ends = [x, y, z].map(|start| (start + N - 1) / 4);
        let mut words = [[[0; 2]; 2]; 2];
        for (block_z, words) in words.iter_mut().enumerate().take(ends[2] + 1) {
            for (block_y, words) in words.iter_mut().enumerate().take(ends[1] + 1) {
                for (block_x, word) in words.iter_mut().enumerate().take(ends[0] + 1) {
                    let step = [block_x as i32, block_y as i32, block_z as i32];
                    let position = [0, 1, 2].map(|axis| block.position[axis] + step[axis]);
                    let block = self.blocks.get(&ChunkKey { position, ..block });
                    *word = block.map_or(0, |block| block.filled);
                }
            }
        }
        let mut window = [[0; N]; N];
        for (row_z, layer) in window.iter_mut().enumerate() {
            for (row_y, row) in layer.iter_mut().enumerate() {
                let (z, y) = (z + row_z, y + row_y);
                let [low, high] = words[z / 4][y / 4].map(|word: u64| word >> index([0, y % 4, z % 4]) & 0xf);
                *row = ((low | high << 4) >> x) as u8 & ((1 << N) - 1);
            }
        }
        let end = corner.position.map(|v| v.saturating_add(N as i32));
        if (0..3).any(|axis| corner.position[axis] < extent.min[axis] || end[axis] > extent.max[axis]) {
            fill_beyond(&mut window, corner.position, extent);
        }
        window
    }
}

impl Block {
    fn mark(&mut self, index: usize, marks: Marks) {
        let set = |word: &mut u64, mark: bool| *word = *word & !(1 << index) | u64::from(mark) << index;
        set(&mut self.loaded, marks.is_loaded);
        set(&mut self.filled, marks.is_filled);
        set(&mut self.current, marks.is_current);
        set(&mut self.waits, marks.waits);
    }
}

/// Sets the bits of a window that lie beyond an extent.
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

/// The block of a chunk, and the chunk's place in it.
fn place(key: ChunkKey) -> (ChunkKey, [usize; 3]) {
    let ChunkKey { level, position } = key;
    (ChunkKey { level, position: position.map(|v| v >> 2) }, position.map(|v| (v & 3) as usize))
}

/// The index of a place in a block.
const fn index([x, y, z]: [usize; 3]) -> usize {
    x + 4 * y + 16 * z
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::super::entry::{Fill, Role};
    use super::*;
    use crate::volume::KnownSigns;

    fn entry(is_filled: bool) -> Entry {
        let fill = if is_filled { Fill::Resident } else { Fill::Queued };
        Entry { role: Role::Support, fill, signs: KnownSigns::UNKNOWN, is_outdated: false }
    }

    #[derive(Clone, Copy, Debug)]
    enum Change {
        Insert,
        Fill(bool),
        Remove,
    }

    fn change() -> impl Strategy<Value = Change> {
        prop_oneof![
            2 => Just(Change::Insert),
            4 => prop::bool::weighted(0.9).prop_map(Change::Fill),
            1 => Just(Change::Remove),
        ]
    }

    proptest! {
        #[test]
        fn it_has_what_a_plain_map_has(
            changes in prop::collection::vec((prop::array::uniform3(-5..8i32), change()), 0..3_000),
            corner in prop::array::uniform3(-5..2i32),
            size in prop::array::uniform3(1..8i32),
            all_at_first: bool,
        ) {
            let extent = Region::new(corner, [0, 1, 2].map(|axis| corner[axis] + size[axis]));
            let (mut map, mut plain) = (ChunkMap::default(), BTreeMap::new());
            if all_at_first {
                for key in extent.points().map(ChunkKey::finest) {
                    map.insert(key, entry(true));
                    plain.insert(key, true);
                }
            }
            for (position, change) in changes.into_iter().filter(|(position, _)| extent.contains(*position)) {
                let key = ChunkKey::finest(position);
                let (former, expected) = match change {
                    Change::Insert => (map.insert(key, entry(false)), plain.insert(key, false)),
                    Change::Remove => (map.remove(key), plain.remove(&key)),
                    Change::Fill(is_filled) => {
                        let former = map.change(key, |former| core::mem::replace(former, entry(is_filled)));
                        (former, plain.get_mut(&key).map(|former| core::mem::replace(former, is_filled)))
                    }
                };
                prop_assert_eq!(former.map(|entry| entry.is_filled()), expected);
            }
            let found: BTreeMap<_, _> = map.iter().map(|(key, entry)| (key, entry.is_filled())).collect();
            prop_assert_eq!(map.len(), plain.len());
            prop_assert_eq!(&found, &plain);
            for key in extent.grown(2, 2).points().map(ChunkKey::finest) {
                prop_assert_eq!(map.get(key).map(Entry::is_filled), plain.get(&key).copied());
                prop_assert_eq!(map.marks(key).is_loaded, plain.contains_key(&key));
                prop_assert_eq!(map.marks(key).is_filled, plain.get(&key) == Some(&true));
            }
            for key in extent.points().map(ChunkKey::finest) {
                let is_there = |near: ChunkKey| plain.get(&near) == Some(&true) || !extent.contains(near.position);
                let is_surrounded = |key: &ChunkKey| key.around().all(is_there);
                prop_assert_eq!(map.is_surrounded(key, &extent), is_surrounded(&key));
                let found: Vec<_> = map.surrounded_around(key, &extent).collect();
                prop_assert_eq!(found, key.around().filter(is_surrounded).collect::<Vec<_>>());
            }
            plain.into_keys().for_each(|key| _ = map.remove(key));
            prop_assert!(map.blocks.is_empty() && map.len() == 0);
        }
    }
}
