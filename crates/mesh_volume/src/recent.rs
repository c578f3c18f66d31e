//! [`Recent`]: the vertices that the triangles of a slab may have.

use std::collections::{TryReserveError, VecDeque};

/// A piece is what a slab adds: triangles between it and the slab before it, which have no other vertices than the two
/// slabs.
const PIECES: usize = 2;

/// Something of each of the latest vertices, by the indices that count all vertices since the first.
pub(crate) struct Recent<T> {
    vertices: VecDeque<T>,
    /// How many came before those.
    gone: usize,
    /// How many there were before each of the latest pieces.
    pieces: VecDeque<usize>,
}

impl<T> Recent<T> {
    pub(crate) const fn new() -> Self {
        Self { vertices: VecDeque::new(), gone: 0, pieces: VecDeque::new() }
    }

    /// Takes in a piece's vertices, and lets go of those that later pieces have nothing to do with.
    pub(crate) fn extend(&mut self, piece: impl ExactSizeIterator<Item = T>) -> Result<(), TryReserveError> {
        self.pieces.push_back(self.gone + self.vertices.len());
        if self.pieces.len() > PIECES
            && let Some(first) = self.pieces.pop_front()
        {
            self.vertices.drain(..first - self.gone);
            self.gone = first;
        }
        self.vertices.try_reserve(piece.len())?;
        self.vertices.extend(piece);
        Ok(())
    }

    pub(crate) fn get(&self, index: u32) -> Option<&T> {
        self.vertices.get((index as usize).checked_sub(self.gone)?)
    }

    pub(crate) fn get_mut(&mut self, index: u32) -> Option<&mut T> {
        self.vertices.get_mut((index as usize).checked_sub(self.gone)?)
    }
}
