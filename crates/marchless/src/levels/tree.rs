//! The nodes of a [`LevelCover`], and how they are found.

use super::{LeafKey, LevelCover};

/// A chunk of a cover's octree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) key: LeafKey,
    pub(super) state: State,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum State {
    /// A leaf that may have a surface.
    Leaf,
    /// A leaf without a surface.
    Empty,
    /// Split into eight, of which the first has this index.
    Split { first: u32 },
    /// Outside the extent.
    Nowhere,
}

impl LevelCover {
    /// The smallest node that holds a chunk; `None` if it is not in view.
    pub(super) fn node_over(&self, key: LeafKey) -> Option<&Node> {
        Some(&self.nodes[self.index_over(key)? as usize])
    }

    /// The index of the smallest node that holds a chunk.
    pub(super) fn index_over(&self, key: LeafKey) -> Option<u32> {
        let up = self.top.checked_sub(key.level)?;
        let mut index = *self.roots.get(&key.position.map(|v| v >> up))?;
        for step in (0..up).rev() {
            let State::Split { first } = self.nodes[index as usize].state else { break };
            let [x, y, z] = key.position.map(|v| (v >> step & 1) as u32);
            index = first + x + 2 * y + 4 * z;
        }
        Some(index)
    }
}
