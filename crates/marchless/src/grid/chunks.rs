//! [`Chunks`]: the chunks of a grid, and an index of the positions that hold one.

use alloc::collections::{BTreeMap, btree_map::Entry};

use super::GridChunk;
use super::occupancy::Occupancy;
use crate::lattice::Region;
use crate::sample::Weight;

/// A map from chunk positions to chunks. All positions lie within [`Grid::largest`](super::Grid::largest).
#[derive(Clone, Debug)]
pub(super) struct Chunks<W> {
    map: BTreeMap<[i32; 3], GridChunk<W>>,
    /// The set of the map's keys.
    occupancy: Occupancy,
}

impl<W: Weight> Chunks<W> {
    pub(super) fn new() -> Self {
        Self { map: BTreeMap::new(), occupancy: Occupancy::default() }
    }

    pub(super) fn get(&self, position: [i32; 3]) -> Option<&GridChunk<W>> {
        self.map.get(&position)
    }

    pub(super) fn get_mut(&mut self, position: [i32; 3]) -> Option<&mut GridChunk<W>> {
        self.map.get_mut(&position)
    }

    /// The chunk at `position`; an absent chunk is first inserted as air.
    pub(super) fn get_mut_or_air(&mut self, position: [i32; 3]) -> &mut GridChunk<W> {
        match self.map.entry(position) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                self.occupancy.insert(position);
                entry.insert(GridChunk::AIR)
            }
        }
    }

    pub(super) fn insert(&mut self, position: [i32; 3], chunk: GridChunk<W>) {
        if self.map.insert(position, chunk).is_none() {
            self.occupancy.insert(position);
        }
    }

    pub(super) fn remove(&mut self, position: [i32; 3]) -> Option<GridChunk<W>> {
        let chunk = self.map.remove(&position)?;
        self.occupancy.remove(position);
        Some(chunk)
    }

    /// All chunks, in order of position.
    pub(super) fn iter(&self) -> impl Iterator<Item = ([i32; 3], &GridChunk<W>)> {
        self.map.iter().map(|(position, chunk)| (*position, chunk))
    }

    /// The chunks at or after `position`, in order of position.
    pub(super) fn from(&self, position: [i32; 3]) -> impl Iterator<Item = ([i32; 3], &GridChunk<W>)> {
        self.map.range(position..).map(|(position, chunk)| (*position, chunk))
    }

    /// The positions within `region` that hold a chunk, in the order of [`Occupancy::positions_in`].
    pub(super) fn positions_in(&self, region: Region) -> impl Iterator<Item = [i32; 3]> {
        self.occupancy.positions_in(region)
    }

    pub(super) const fn occupancy(&self) -> &Occupancy {
        &self.occupancy
    }
}
