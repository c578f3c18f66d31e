//! The nodes of a [`LevelCover`], and how they are found.

use alloc::vec::Vec;

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
        self.index_below(*self.roots.get(&key.position.map(|v| v >> up))?, key)
    }

    /// A search for chunks near one, which mostly share its root.
    pub(super) fn near(&self, key: LeafKey) -> Near<'_> {
        let home = key.position.map(|v| v >> (self.top - key.level));
        Near { cover: self, home, root: self.roots.get(&home).copied() }
    }

    /// The index of the smallest node below a root that holds a chunk.
    fn index_below(&self, root: u32, key: LeafKey) -> Option<u32> {
        let up = self.top.checked_sub(key.level)?;
        let mut index = root;
        for step in (0..up).rev() {
            let State::Split { first } = self.nodes[index as usize].state else { break };
            let [x, y, z] = key.position.map(|v| (v >> step & 1) as u32);
            index = first + x + 2 * y + 4 * z;
        }
        Some(index)
    }

    /// The nodes that can be reached from the roots, in order.
    pub(super) fn reachable(&self) -> impl Iterator<Item = &Node> + '_ {
        let mut to_visit: Vec<u32> = self.roots.values().rev().copied().collect();
        core::iter::from_fn(move || {
            let node = &self.nodes[to_visit.pop()? as usize];
            if let State::Split { first } = node.state {
                to_visit.extend((first..first + 8).rev());
            }
            Some(node)
        })
    }

    /// Drops the nodes that cannot be reached any more, once there may be as many as others.
    pub(super) fn compact(&mut self) {
        if self.nodes.len() < self.compact_at.max(64) {
            return;
        }
        let former = core::mem::take(&mut self.nodes);
        let mut to_copy = Vec::new();
        for root in self.roots.values_mut() {
            let copy = self.nodes.len() as u32;
            to_copy.push((core::mem::replace(root, copy), copy));
            self.nodes.push(former[to_copy[to_copy.len() - 1].0 as usize]);
            while let Some((from, to)) = to_copy.pop() {
                let State::Split { first } = former[from as usize].state else { continue };
                let copied = self.nodes.len() as u32;
                self.nodes.extend_from_slice(&former[first as usize..][..8]);
                self.nodes[to as usize].state = State::Split { first: copied };
                to_copy.extend((0..8).map(|child| (first + child, copied + child)));
            }
        }
        self.compact_at = 2 * self.nodes.len();
    }
}

/// A search for nodes near a chunk.
pub(super) struct Near<'a> {
    cover: &'a LevelCover,
    /// The position of the chunk's root, and its index.
    home: [i32; 3],
    root: Option<u32>,
}

impl Near<'_> {
    /// The smallest node that holds a chunk, and its index; `None` if it is not in view.
    pub(super) fn node_over(&self, key: LeafKey) -> Option<(u32, &Node)> {
        let up = self.cover.top.checked_sub(key.level)?;
        let root = key.position.map(|v| v >> up);
        let root = if root == self.home { self.root? } else { *self.cover.roots.get(&root)? };
        let index = self.cover.index_below(root, key)?;
        Some((index, &self.cover.nodes[index as usize]))
    }
}
