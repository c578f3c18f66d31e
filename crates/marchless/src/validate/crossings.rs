//! Triangles that cross each other, found with a tree of boxes.
//!
//! Each node of the tree halves its triangles along the axis on which their middles are spread the most, so that the
//! tree is as deep for a heap or for a single vertex far out as for an even surface, and its size is that of the mesh.
//! (Refused: a uniform grid, which is faster on even surfaces, but where one vertex lies at 10³⁰ has everything in one
//! of its cells; and a sweep along one axis, of which a plane across it is the worst case.)

use alloc::vec::Vec;

use super::{
    MeshReport, is_finite,
    places::Places,
    predicates::{cross, has_no_area},
};

/// Triangles in a leaf of the tree, at most.
const LEAF: usize = 4;

/// How many of the triangles have no area, and how many pairs of the others cross.
pub(super) fn count(
    positions: &[[f32; 3]],
    mut triangles: Vec<[u32; 3]>,
    places: &Places,
    duplicates: bool,
) -> (usize, usize) {
    triangles.retain(|triangle| triangle.iter().all(|&vertex| is_finite(positions[vertex as usize])));
    let mut flat = 0;
    triangles.retain(|triangle| {
        let none = has_no_area(&triangle.map(|vertex| positions[vertex as usize]));
        flat += usize::from(none);
        !none
    });
    if duplicates {
        triangles.iter_mut().for_each(|triangle| triangle.sort_unstable());
        triangles.sort_unstable();
        triangles.dedup();
    }
    let mut items: Vec<Item> = triangles.into_iter().map(|triangle| Item::new(positions, triangle, places)).collect();
    let mut tree = Tree { positions, nodes: Vec::with_capacity(items.len().div_ceil(LEAF) * 2), found: 0 };
    if !items.is_empty() {
        tree.grow(&mut items, 0);
        tree.within(&items, 0);
    }
    (flat, tree.found)
}

/// A triangle and its box.
struct Item {
    bounds: Bounds,
    vertices: [u32; 3],
}

impl Item {
    fn new(positions: &[[f32; 3]], vertices: [u32; 3], places: &Places) -> Self {
        let mut bounds = Bounds::NONE;
        for vertex in vertices {
            bounds.include(&Bounds { min: positions[vertex as usize], max: positions[vertex as usize] });
        }
        Self { bounds, vertices: vertices.map(|vertex| places.first(vertex)) }
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    min: [f32; 3],
    max: [f32; 3],
}

impl Bounds {
    const NONE: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    fn include(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    fn meets(&self, other: &Self) -> bool {
        let mut meets = true;
        for axis in 0..3 {
            meets &= (self.min[axis] <= other.max[axis]) & (other.min[axis] <= self.max[axis]);
        }
        meets
    }

    fn middle(&self, axis: usize) -> f32 {
        self.min[axis] * 0.5 + self.max[axis] * 0.5
    }
}

/// A part of the items, next to each other.
#[derive(Clone, Copy)]
struct Node {
    bounds: Bounds,
    first: usize,
    len: usize,
    /// The node of the second half; that of the first is the next one. 0 where the items are not halved.
    second: usize,
}

struct Tree<'a> {
    positions: &'a [[f32; 3]],
    nodes: Vec<Node>,
    /// Crossings.
    found: usize,
}

impl Tree<'_> {
    /// Adds a node for `items`, which are at `first` among all.
    fn grow(&mut self, items: &mut [Item], first: usize) -> usize {
        let (mut bounds, mut middles) = (Bounds::NONE, Bounds::NONE);
        for item in &*items {
            bounds.include(&item.bounds);
            let middle = [0, 1, 2].map(|axis| item.bounds.middle(axis));
            middles.include(&Bounds { min: middle, max: middle });
        }
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, first, len: items.len(), second: 0 });
        if items.len() > LEAF {
            let spread = |axis: usize| middles.max[axis] - middles.min[axis];
            let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |a, b| a.bounds.middle(axis).total_cmp(&b.bounds.middle(axis)));
            let (low, high) = items.split_at_mut(half);
            self.grow(low, first);
            self.nodes[node].second = self.grow(high, first + half);
        }
        node
    }

    /// Looks at all pairs of a node's items.
    fn within(&mut self, items: &[Item], node: usize) {
        let Node { first, len, second, .. } = self.nodes[node];
        if second == 0 {
            for i in first..first + len {
                for j in i + 1..first + len {
                    self.compare(&items[i], &items[j]);
                }
            }
        } else {
            self.within(items, node + 1);
            self.within(items, second);
            self.between(items, node + 1, second);
        }
    }

    /// Looks at all pairs of an item of one node and one of the other.
    fn between(&mut self, items: &[Item], a: usize, b: usize) {
        let (node_a, node_b) = (self.nodes[a], self.nodes[b]);
        if !node_a.bounds.meets(&node_b.bounds) || self.found >= MeshReport::MOST_CROSSINGS {
            return;
        }
        if node_a.second == 0 && node_b.second == 0 {
            for item in &items[node_a.first..][..node_a.len] {
                if item.bounds.meets(&node_b.bounds) {
                    for other in &items[node_b.first..][..node_b.len] {
                        self.compare(item, other);
                    }
                }
            }
        } else if node_a.len >= node_b.len {
            self.between(items, a + 1, b);
            self.between(items, node_a.second, b);
        } else {
            self.between(items, a, b + 1);
            self.between(items, a, node_b.second);
        }
    }

    fn compare(&mut self, a: &Item, b: &Item) {
        if !a.bounds.meets(&b.bounds) || self.found >= MeshReport::MOST_CROSSINGS {
            return;
        }
        // Brings what they have in common to the front of both.
        let (mut a, mut b, mut common) = (a.vertices, b.vertices, 0);
        for i in 0..3 {
            if let Some(j) = (common..3).find(|&j| b[j] == a[i]) {
                b.swap(common, j);
                a.swap(common, i);
                common += 1;
            }
        }
        let [a, b] = [a, b].map(|vertices| vertices.map(|vertex| self.positions[vertex as usize]));
        self.found += usize::from(cross(&a, &b, common));
    }
}
