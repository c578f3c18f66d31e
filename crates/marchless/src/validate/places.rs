//! [`Places`]: which vertices lie in the same place.

use alloc::{vec, vec::Vec};

/// Which vertices lie in the same place as another one.
pub(super) struct Places {
    /// Vertices in the place of one before them.
    pub(super) repeated: usize,
    /// The first vertex in each vertex's place; empty where each is the first.
    first: Vec<u32>,
}

impl Places {
    /// `positions`: at most 2³² of them. They are the same where their bits are, but that −0 is 0.
    pub(super) fn of(positions: &[[f32; 3]]) -> Self {
        let mut vertices: Vec<([u32; 3], u32)> = positions
            .iter()
            .enumerate()
            .map(|(vertex, position)| (position.map(|v| (v + 0.0).to_bits()), vertex as u32))
            .collect();
        vertices.sort_unstable();
        let repeated = vertices.windows(2).filter(|pair| pair[0].0 == pair[1].0).count();
        let mut first = vec![];
        if repeated > 0 {
            first = vec![0; positions.len()];
            for place in vertices.chunk_by(|a, b| a.0 == b.0) {
                for &(_, vertex) in place {
                    first[vertex as usize] = place[0].1;
                }
            }
        }
        Self { repeated, first }
    }

    /// The vertex that stands for all those in the place of `vertex`.
    pub(super) fn first(&self, vertex: u32) -> u32 {
        self.first.get(vertex as usize).copied().unwrap_or(vertex)
    }
}
