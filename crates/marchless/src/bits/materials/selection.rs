//! Selects the points that have one of a set of materials, by a decision diagram over the planes. The diagram is
//! evaluated for a block of words at a time.

use alloc::{vec, vec::Vec};

use crate::{
    bits::BitGrid,
    material::MaterialSet,
    simd::{Job, Simd},
};

/// The number of words that are made at once. The words of all nodes then stay in the cache.
const BLOCK: usize = 32;
/// The slot of zeros.
const ZEROS: usize = 0;
/// The slot of ones.
const ONES: usize = 1;

/// A node of the diagram: each bit of a plane chooses between the bits of two slots.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Node {
    plane: usize,
    where_zero: usize,
    where_one: usize,
}

/// The job that selects the points of a set of materials.
pub(super) struct Selection<'a> {
    /// Node `k` fills slot `2 + k` and refers to earlier slots only. No two nodes are equal.
    nodes: Vec<Node>,
    /// The slot of the selected points.
    result: usize,
    planes: &'a [BitGrid],
    out: &'a mut [u64],
}

impl<'a> Selection<'a> {
    /// `out` has as many words as each plane. The unused bits of its rows are arbitrary afterwards.
    pub(super) fn new(set: &MaterialSet, planes: &'a [BitGrid], out: &'a mut [u64]) -> Self {
        let mut nodes = Vec::new();
        let result = slot_of(set, 0, planes.len(), &mut nodes);
        Self { nodes, result, planes, out }
    }
}

/// The slot that selects the materials of the set among the `2^planes` materials from `first` on. The lowest `planes`
/// planes tell these materials apart. Adds the nodes that are missing.
fn slot_of(set: &MaterialSet, first: usize, planes: usize, nodes: &mut Vec<Node>) -> usize {
    let Some(plane) = planes.checked_sub(1) else {
        return if set.contains(first as u8) { ONES } else { ZEROS };
    };
    let where_zero = slot_of(set, first, plane, nodes);
    let where_one = slot_of(set, first + (1 << plane), plane, nodes);
    if where_zero == where_one {
        return where_zero;
    }
    let node = Node { plane, where_zero, where_one };
    let number = nodes.iter().position(|&other| other == node).unwrap_or_else(|| {
        nodes.push(node);
        nodes.len() - 1
    });
    2 + number
}

impl Job for Selection<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { nodes, result, planes, out } = self;
        let mut slots = vec![[0; BLOCK]; 2 + nodes.len()];
        slots[ONES] = [u64::MAX; BLOCK];
        for (number, out) in out.chunks_mut(BLOCK).enumerate() {
            for (index, node) in nodes.iter().enumerate() {
                let words = &planes[node.plane].words[BLOCK * number..][..out.len()];
                let (before, from) = slots.split_at_mut(2 + index);
                let (zero, one) = (&before[node.where_zero], &before[node.where_one]);
                for (((made, word), zero), one) in from[0].iter_mut().zip(words).zip(zero).zip(one) {
                    *made = zero ^ word & (zero ^ one);
                }
            }
            out.copy_from_slice(&slots[result][..out.len()]);
        }
    }
}
