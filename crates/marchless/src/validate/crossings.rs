//! Triangles that cross each other: bounding boxes find pairs, planes and projections rule most of them out in `f64`
//! with error bounds, exact predicates judge the rest.

use alloc::vec::Vec;
use core::ops::Range;

use super::{
    MeshReport,
    aabb::Aabb,
    boxes::{BoxTree, LEAF, Leaf},
    coincident::Coincident,
    is_finite,
    order::{self, Item},
    predicates::{Corners, has_no_area},
    triangle::Triangle,
    work::Work,
};

/// Triangles that are prepared as one part.
const BLOCK: usize = LEAF << BLOCK_BITS;
/// The number of a block's leaves, as bits.
const BLOCK_BITS: usize = 12;
/// Leaves that are compared with later ones as one part.
const STEP: usize = 128;

/// The triangles that can cross others, as a caller of [`count`] gives them.
pub(super) struct Mesh<'a> {
    pub(super) positions: &'a [[f32; 3]],
    /// Three different vertices each.
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) coincident: &'a Coincident,
}

/// How many triangles have zero area, and how many pairs of the others cross; `None` if the caller cancels.
///
/// `has_duplicates`: whether some triangles have the same vertices.
pub(super) fn count(mesh: &Mesh<'_>, has_duplicates: bool, share: f32, work: &mut Work<'_>) -> Option<(usize, usize)> {
    let (items, zero_area) = mesh.solid(share * 0.1, work)?;
    if !has_duplicates {
        return Some((zero_area, mesh.crossings(items, share * 0.9, work)?));
    }
    let mut distinct = mesh.triangles.to_vec();
    distinct.iter_mut().for_each(|triangle| triangle.sort_unstable());
    distinct.sort_unstable();
    distinct.dedup();
    let mesh = Mesh { triangles: &distinct, ..*mesh };
    let (items, _) = mesh.solid(share * 0.1, work)?;
    Some((zero_area, mesh.crossings(items, share * 0.8, work)?))
}

impl Mesh<'_> {
    fn corners(&self, triangle: [u32; 3]) -> Corners {
        triangle.map(|vertex| self.positions[vertex as usize])
    }

    /// The middles of the triangles with an area, at most 2³¹ of them, and how many triangles have none. Both leave out
    /// triangles with a corner that is not finite.
    fn solid(&self, share: f32, work: &mut Work<'_>) -> Option<(Vec<Item>, usize)> {
        let solid = |block: usize| {
            let (mut items, mut zero_area) = (Vec::with_capacity(BLOCK), 0);
            let start = block * BLOCK;
            let end = self.triangles.len().min(start + BLOCK);
            for (&triangle, index) in self.triangles[start..end].iter().zip(start..) {
                let corners = self.corners(triangle);
                if !corners.into_iter().all(is_finite) {
                    continue;
                }
                if has_no_area(&corners) {
                    zero_area += 1;
                } else {
                    items.push(Item { point: Aabb::around(corners).middle(), index: index as u32 });
                }
            }
            (items, zero_area)
        };
        let blocks = work.map(share, 0..self.triangles.len().div_ceil(BLOCK), solid)?;
        let zero_area = blocks.iter().map(|(_, zero_area)| zero_area).sum();
        let mut items = Vec::with_capacity(blocks.iter().map(|(items, _)| items.len()).sum());
        for (block, _) in blocks {
            items.extend_from_slice(&block);
        }
        items.truncate(i32::MAX as usize);
        Some((items, zero_area))
    }

    /// How many pairs of triangles cross. `items`: the middles of those that count.
    fn crossings(&self, items: Vec<Item>, share: f32, work: &mut Work<'_>) -> Option<usize> {
        let items = order::spatial(items, share * 0.2, work)?;
        let blocks = items.chunks(BLOCK);
        let blocks = work.map(share * 0.2, blocks, |items| Block::of(self, items))?;
        drop(items);
        let leaves: Vec<Aabb> = blocks.iter().flat_map(|block| block.leaves.iter().map(|leaf| leaf.aabb)).collect();
        let pairs = Pairs { blocks, tree: BoxTree::of(&leaves) };
        let steps = leaves.len().div_ceil(STEP);
        let step = |step: usize| pairs.crossing(step * STEP..leaves.len().min((step + 1) * STEP));
        let mut sum = 0;
        let counts = work.map_while(share * 0.6, 0..steps, step, |count| {
            sum += count;
            sum < MeshReport::MOST_CROSSINGS
        })?;
        Some(counts.iter().sum::<usize>().min(MeshReport::MOST_CROSSINGS))
    }
}

/// Some triangles that are close to each other, in leaves.
struct Block {
    leaves: Vec<Leaf>,
    triangles: Vec<Triangle>,
}

impl Block {
    fn of(mesh: &Mesh<'_>, items: &[Item]) -> Self {
        let mut block =
            Self { leaves: Vec::with_capacity(items.len().div_ceil(LEAF)), triangles: Vec::with_capacity(items.len()) };
        for items in items.chunks(LEAF) {
            block.leaves.push(Leaf::of(items.iter().map(|item| {
                let vertices = mesh.triangles[item.index as usize];
                let corners = mesh.corners(vertices);
                let aabb = Aabb::around(corners);
                let vertices = vertices.map(|vertex| mesh.coincident.first(vertex));
                block.triangles.push(Triangle::new(corners, vertices, &aabb));
                aabb
            })));
        }
        block
    }
}

/// Finds pairs of triangles.
struct Pairs {
    blocks: Vec<Block>,
    tree: BoxTree,
}

impl Pairs {
    /// How many pairs cross whose first triangle is in one of these leaves; it counts no further than
    /// [`MeshReport::MOST_CROSSINGS`] and some.
    fn crossing(&self, leaves: Range<usize>) -> usize {
        let mut found = 0;
        for first in leaves {
            let (leaf, triangles) = self.leaf(first);
            for (lane, triangle) in triangles.iter().enumerate() {
                let later = !1 << lane;
                found += crossing(triangle, triangles, leaf.overlapping(&leaf.get(lane)) & later);
            }
            for second in self.tree.later(first, &leaf.aabb) {
                let (other, others) = self.leaf(second);
                let near = other.overlapping(&leaf.aabb);
                if near == 0 {
                    continue;
                }
                for lane in lanes(leaf.overlapping(&other.aabb)) {
                    found += crossing(&triangles[lane], others, other.overlapping(&leaf.get(lane)) & near);
                }
                if found >= MeshReport::MOST_CROSSINGS {
                    return found;
                }
            }
        }
        found
    }

    /// A leaf and its triangles.
    #[inline(always)]
    fn leaf(&self, leaf: usize) -> (&Leaf, &[Triangle]) {
        let (block, leaf) = (&self.blocks[leaf >> BLOCK_BITS], leaf & ((1 << BLOCK_BITS) - 1));
        let end = block.triangles.len().min((leaf + 1) * LEAF);
        (&block.leaves[leaf], &block.triangles[leaf * LEAF..end])
    }
}

/// How many of some triangles, a bit each, cross another one.
#[inline(always)]
fn crossing(triangle: &Triangle, others: &[Triangle], bits: u32) -> usize {
    lanes(bits).filter(|&lane| triangle.crosses(&others[lane])).count()
}

/// The numbers of the bits that are set.
#[inline(always)]
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lane = bits.trailing_zeros();
        let is_set = bits != 0;
        bits &= bits.wrapping_sub(1);
        is_set.then_some(lane as usize)
    })
}
