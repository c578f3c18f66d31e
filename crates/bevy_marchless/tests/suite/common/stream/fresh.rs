//! A fresh terrain to compare with: sampled chunk by chunk, with the same stamps in the same order.

use std::collections::{HashMap, HashSet};

use bevy_marchless::prelude::*;
use marchless::{Grid, GridChunk, MeshBuffer, Mesher, Region, SamplePool};

/// A terrain made with the core only, without entities and tasks.
pub struct Fresh {
    terrain: Terrain,
    grid: Grid<i16>,
    /// The stamps that touch a chunk that has not been sampled yet, in order.
    stamps: HashMap<[i32; 3], Vec<marchless::QuantisedStamp>>,
    /// All chunks that stamps have touched.
    edited: HashSet<[i32; 3]>,
    mesher: Mesher,
}

impl Fresh {
    pub fn new(terrain: &Terrain) -> Self {
        let extent = Region::new(terrain.extent.min.to_array(), terrain.extent.max.to_array())
            .intersection(&Grid::<i16>::largest(terrain.chunk_cells));
        let grid = Grid::bounded(terrain.chunk_cells, extent).expect("a good extent");
        Self { terrain: terrain.clone(), grid, stamps: HashMap::new(), edited: HashSet::new(), mesher: Mesher::new() }
    }

    /// The chunks in the terrain's extent.
    pub fn extent(&self) -> Region {
        self.grid.bounds().expect("bounded")
    }

    pub fn stamp(&mut self, stamp: &marchless::QuantisedStamp) {
        let touched = stamp.region();
        let (low, high) = (self.grid.chunk_of(touched.min), self.grid.chunk_of(touched.max.map(|v| v - 1)));
        for position in Region::new(low, high.map(|v| v + 1)).intersection(&self.extent()).points() {
            self.edited.insert(position);
            if self.grid.chunk(position).is_some() {
                self.grid.apply_to_chunk(position, stamp, &mut SamplePool::new());
            } else {
                self.stamps.entry(position).or_default().push(*stamp);
            }
        }
    }

    /// Whether any stamp has touched the chunk or one of those around it.
    pub fn is_edited(&self, position: [i32; 3]) -> bool {
        around(position).points().any(|position| self.edited.contains(&position))
    }

    /// The number of chunks that stamps have touched.
    pub fn edited_chunks(&self) -> usize {
        self.edited.len()
    }

    /// The samples of a chunk.
    pub fn chunk(&mut self, position: [i32; 3]) -> &GridChunk<i16> {
        if self.grid.chunk(position).is_none() {
            let source = self.terrain.source.get().clone();
            let spacing = f64::from(self.terrain.voxel_size);
            let chunk = GridChunk::from_source(source.as_ref(), position, self.terrain.chunk_cells, spacing);
            self.grid.insert_clean(position, chunk).expect("a chunk of the extent");
            for stamp in self.stamps.remove(&position).unwrap_or_default() {
                self.grid.apply_to_chunk(position, &stamp, &mut SamplePool::new());
            }
        }
        self.grid.chunk(position).expect("it has just been put there")
    }

    /// The mesh of a chunk.
    pub fn mesh(&mut self, position: [i32; 3]) -> MeshBuffer {
        for neighbour in around(position).intersection(&self.extent()).points() {
            self.chunk(neighbour);
        }
        let method = self.terrain.mesher.method(self.terrain.isovalue).with_normals(self.terrain.normals);
        let mut mesh = MeshBuffer::new();
        self.grid.mesh_chunk(position, &mut self.mesher, method, &mut mesh).expect("samples of a chunk");
        mesh
    }
}

/// The 3 × 3 × 3 chunks around one.
fn around(position: [i32; 3]) -> Region {
    Region::new(position.map(|v| v.saturating_sub(1)), position.map(|v| v.saturating_add(2)))
}
