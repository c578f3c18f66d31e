//! [`Recent`]: data of the latest vertices, which the triangles of a slab may use.

use std::collections::{TryReserveError, VecDeque};

/// The number of latest pieces that are kept. A slab adds a piece: triangles between it and the slab before it, with
/// vertices of these two slabs only.
const PIECES: usize = 2;

/// An item for each of the latest vertices, by the index that counts all vertices since the first.
pub(crate) struct Recent<T> {
    vertices: VecDeque<T>,
    /// The number of vertices that are no longer kept.
    gone: usize,
    /// The number of vertices before each of the latest pieces.
    pieces: VecDeque<usize>,
}

impl<T> Recent<T> {
    pub(crate) const fn new() -> Self {
        Self { vertices: VecDeque::new(), gone: 0, pieces: VecDeque::new() }
    }

    /// Adds a piece's vertices, and drops those that later pieces cannot use.
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
