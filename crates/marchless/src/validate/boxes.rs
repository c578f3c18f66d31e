//! [`BoxTree`]: finds all pairs of boxes that meet.
//!
//! Each node of the tree parts its boxes along the axis on which their middles are spread the most: in the middle, or by
//! their number where almost all of them would come to lie on one side. So the tree is not much deeper for a heap in one
//! spot, or with a single box far out, than for an even surface, and its size is that of the mesh.
//!
//! Refused: a uniform grid, which has everything in one of its cells where one vertex lies at 10³⁰, and needs much memory
//! or a second structure where one triangle is as large as all the others together; a sweep along one axis, of which a
//! plane across it is the worst case.

use alloc::{vec, vec::Vec};
use core::ops::ControlFlow;

/// Boxes in a leaf, at most.
const LEAF: usize = 6;

/// An axis-aligned box; its faces belong to it.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

impl Bounds {
    /// Holds nothing.
    const NONE: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    pub(super) fn of(corners: &[[f32; 3]; 3]) -> Self {
        corners.iter().fold(Self::NONE, |bounds, &corner| bounds.with(&Self { min: corner, max: corner }))
    }

    #[inline(always)]
    fn with(&self, other: &Self) -> Self {
        let least = |a: f32, b: f32| if a < b { a } else { b };
        let most = |a: f32, b: f32| if a > b { a } else { b };
        Self {
            min: [0, 1, 2].map(|axis| least(self.min[axis], other.min[axis])),
            max: [0, 1, 2].map(|axis| most(self.max[axis], other.max[axis])),
        }
    }

    #[inline(always)]
    fn meets(&self, other: &Self) -> bool {
        let [low, high] = [(self, other), (other, self)]
            .map(|(a, b)| (a.min[0] <= b.max[0]) & (a.min[1] <= b.max[1]) & (a.min[2] <= b.max[2]));
        low & high
    }

    /// The longest side. Does not overflow.
    pub(super) fn size(&self) -> f64 {
        (0..3).map(|axis| f64::from(self.max[axis]) - f64::from(self.min[axis])).fold(0.0, f64::max)
    }
}

/// Boxes, sorted by where they lie.
pub(super) struct BoxTree {
    boxes: Vec<Bounds>,
    /// A node, then all nodes of its first part, then those of its second part.
    nodes: Vec<Node>,
}

/// Boxes next to each other in the list, and a box around them.
struct Node {
    bounds: Bounds,
    first: u32,
    len: u32,
    /// The node of the second part; that of the first is the next one. 0 where there are no parts.
    second: u32,
}

/// What the boxes are sorted by.
struct Middle {
    at: [f32; 3],
    index: u32,
}

impl BoxTree {
    /// Sorts boxes, and says in which order they are now: the former index of each.
    ///
    /// `boxes`: finite, fewer than 2³¹ of them.
    pub(super) fn of(boxes: &[Bounds]) -> (Self, impl Iterator<Item = usize>) {
        let middle = |bounds: &Bounds| [0, 1, 2].map(|axis| bounds.min[axis] * 0.5 + bounds.max[axis] * 0.5);
        let mut middles: Vec<Middle> =
            boxes.iter().zip(0..).map(|(bounds, index)| Middle { at: middle(bounds), index }).collect();
        let mut tree = Self { boxes: vec![], nodes: Vec::with_capacity(boxes.len()) };
        if !middles.is_empty() {
            tree.grow(boxes, &mut middles);
        }
        tree.nodes.shrink_to_fit();
        (tree, middles.into_iter().map(|middle| middle.index as usize))
    }

    /// Adds a node for boxes that come next, and puts them into order.
    fn grow(&mut self, boxes: &[Bounds], middles: &mut [Middle]) -> Bounds {
        let node = self.nodes.len();
        let (first, len) = (self.boxes.len() as u32, middles.len() as u32);
        self.nodes.push(Node { bounds: Bounds::NONE, first, len, second: 0 });
        let bounds = if middles.len() <= LEAF {
            self.boxes.extend(middles.iter().map(|middle| boxes[middle.index as usize]));
            self.boxes[first as usize..].iter().fold(Bounds::NONE, |bounds, other| bounds.with(other))
        } else {
            let border = parted(middles);
            let (low, high) = middles.split_at_mut(border);
            let bounds = self.grow(boxes, low);
            self.nodes[node].second = self.nodes.len() as u32;
            bounds.with(&self.grow(boxes, high))
        };
        self.nodes[node].bounds = bounds;
        bounds
    }

    /// Calls `visit` with all pairs of boxes that meet, each once, as long as it goes on.
    pub(super) fn visit_pairs(&self, visit: &mut impl FnMut(usize, usize) -> ControlFlow<()>) -> ControlFlow<()> {
        if self.nodes.is_empty() { ControlFlow::Continue(()) } else { self.within(0, visit) }
    }

    /// The pairs of a node's boxes.
    fn within(&self, node: usize, visit: &mut impl FnMut(usize, usize) -> ControlFlow<()>) -> ControlFlow<()> {
        let Node { second, .. } = self.nodes[node];
        if second == 0 {
            let boxes = self.nodes[node].boxes();
            return boxes.clone().try_for_each(|a| self.visit_meeting(a, a + 1..boxes.end, visit));
        }
        self.within(node + 1, visit)?;
        self.within(second as usize, visit)?;
        self.between(node + 1, second as usize, visit)
    }

    /// The pairs of a box of one node and one of the other.
    fn between(&self, a: usize, b: usize, visit: &mut impl FnMut(usize, usize) -> ControlFlow<()>) -> ControlFlow<()> {
        let (node_a, node_b) = (&self.nodes[a], &self.nodes[b]);
        if !node_a.bounds.meets(&node_b.bounds) {
            return ControlFlow::Continue(());
        }
        if node_a.second == 0 && node_b.second == 0 {
            return node_a
                .boxes()
                .filter(|&a| self.boxes[a].meets(&node_b.bounds))
                .try_for_each(|a| self.visit_meeting(a, node_b.boxes(), visit));
        }
        // The larger one is parted; a leaf cannot be.
        if node_b.second == 0 || (node_a.second != 0 && node_a.len >= node_b.len) {
            self.between(a + 1, b, visit)?;
            self.between(node_a.second as usize, b, visit)
        } else {
            self.between(a, b + 1, visit)?;
            self.between(a, node_b.second as usize, visit)
        }
    }

    #[inline(always)]
    fn visit_meeting(
        &self,
        a: usize,
        others: core::ops::Range<usize>,
        visit: &mut impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let bounds = &self.boxes[a];
        for (b, other) in others.clone().zip(&self.boxes[others]) {
            if bounds.meets(other) {
                visit(a, b)?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl Node {
    fn boxes(&self) -> core::ops::Range<usize> {
        self.first as usize..(self.first + self.len) as usize
    }
}

/// Parts the middles, and says how many are in the first part: neither none nor all.
fn parted(middles: &mut [Middle]) -> usize {
    let spread =
        middles.iter().fold(Bounds::NONE, |spread, middle| spread.with(&Bounds { min: middle.at, max: middle.at }));
    let extent = |axis: usize| spread.max[axis] - spread.min[axis];
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let border = spread.min[axis] * 0.5 + spread.max[axis] * 0.5;
    let mut low = 0;
    for at in 0..middles.len() {
        // Without a branch that nobody could predict.
        let is_low = middles[at].at[axis] < border;
        middles.swap(low, at);
        low += usize::from(is_low);
    }
    if low.min(middles.len() - low) * 8 < middles.len() {
        low = middles.len() / 2;
        middles.select_nth_unstable_by(low, |a, b| a.at[axis].total_cmp(&b.at[axis]));
    }
    low
}
