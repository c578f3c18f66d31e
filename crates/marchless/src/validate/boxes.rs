//! [`BoxTree`]: the triangles' bounding boxes, in leaves of 16, and which leaves may overlap.
//!
//! Leaves are consecutive triangles in an order in which those are close to each other. Above them stands a binary tree
//! of boxes that halves the number of leaves, so that its depth is the same for any mesh. A leaf's boxes are kept by
//! coordinates: one box is compared with all 16 at once, without a branch.
//!
//! Refused: a uniform grid, which has everything in one of its cells if one vertex lies at 10³⁰, and needs a second
//! structure if one triangle is as large as all others together; a sweep along one axis, whose worst case is a plane
//! across that axis.

use alloc::{vec, vec::Vec};
use core::ops::Range;

use super::aabb::Aabb;

/// Boxes in a leaf, at most.
pub(super) const LEAF: usize = 16;

/// Up to [`LEAF`] bounding boxes, by coordinates, and the box around them.
pub(super) struct Leaf {
    pub(super) aabb: Aabb,
    min: [[f32; LEAF]; 3],
    max: [[f32; LEAF]; 3],
}

impl Leaf {
    pub(super) fn of(boxes: impl IntoIterator<Item = Aabb>) -> Self {
        let mut leaf = Self { aabb: Aabb::EMPTY, min: [[f32::INFINITY; LEAF]; 3], max: [[f32::NEG_INFINITY; LEAF]; 3] };
        for (lane, aabb) in boxes.into_iter().take(LEAF).enumerate() {
            leaf.aabb = leaf.aabb.union(&aabb);
            for axis in 0..3 {
                (leaf.min[axis][lane], leaf.max[axis][lane]) = (aabb.min[axis], aabb.max[axis]);
            }
        }
        leaf
    }

    /// One of the boxes.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> Aabb {
        Aabb { min: [0, 1, 2].map(|axis| self.min[axis][lane]), max: [0, 1, 2].map(|axis| self.max[axis][lane]) }
    }

    /// Which boxes overlap another box, a bit each.
    // Compiled by itself, all lanes are compared at once.
    #[inline(never)]
    pub(super) fn overlapping(&self, other: &Aabb) -> u32 {
        let mut bits = 0;
        for lane in 0..LEAF {
            let below = |axis: usize| self.min[axis][lane] <= other.max[axis];
            let above = |axis: usize| self.max[axis][lane] >= other.min[axis];
            let overlaps = below(0) & above(0) & below(1) & above(1) & below(2) & above(2);
            bits |= u32::from(overlaps) << lane;
        }
        bits
    }
}

/// A binary tree over leaves.
pub(super) struct BoxTree {
    /// Each node, then all nodes of its first half, then those of its second half.
    nodes: Vec<Node>,
    /// The node of each leaf.
    node_of: Vec<u32>,
}

/// The box around some consecutive leaves.
struct Node {
    aabb: Aabb,
    /// The first node that is not below this one.
    next: u32,
    /// The leaf, or [`INNER`].
    leaf: u32,
}

/// Instead of a leaf.
const INNER: u32 = u32::MAX;

impl BoxTree {
    /// `leaves`: the boxes around them; fewer than 2²⁸.
    pub(super) fn of(leaves: &[Aabb]) -> Self {
        let mut tree = Self { nodes: Vec::with_capacity(leaves.len() * 2), node_of: vec![0; leaves.len()] };
        if !leaves.is_empty() {
            tree.add(leaves, 0..leaves.len());
        }
        tree
    }

    fn add(&mut self, leaves: &[Aabb], range: Range<usize>) -> Aabb {
        let node = self.nodes.len();
        let (start, len) = (range.start, range.len());
        let mut aabb = leaves[start];
        let next = (node + 2 * len - 1) as u32;
        let leaf = if len == 1 { start as u32 } else { INNER };
        self.nodes.push(Node { aabb, next, leaf });
        if len == 1 {
            self.node_of[start] = node as u32;
        } else {
            let middle = start + len / 2;
            aabb = self.add(leaves, start..middle);
            aabb = aabb.union(&self.add(leaves, middle..range.end));
            self.nodes[node].aabb = aabb;
        }
        aabb
    }

    /// The leaves after `leaf` whose boxes overlap `aabb`.
    pub(super) fn later(&self, leaf: usize, aabb: &Aabb) -> impl Iterator<Item = usize> {
        let mut at = self.node_of[leaf] as usize + 1;
        core::iter::from_fn(move || {
            while let Some(node) = self.nodes.get(at) {
                if !node.aabb.overlaps(aabb) {
                    at = node.next as usize;
                    continue;
                }
                at += 1;
                if node.leaf != INNER {
                    return Some(node.leaf as usize);
                }
            }
            None
        })
    }
}
