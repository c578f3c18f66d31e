//! [`Links`]: edges, fans, rims and components, from the triangles around each vertex.
//!
//! The link of a vertex consists of the sides opposite to it in its triangles: a segment each, from the corner after
//! the vertex to the one before it. A counting sort gathers the links of all vertices in one array. Each edge is then a
//! vertex and an end of a segment in its link. In the interior of a sound surface the link is a ring, and a few
//! comparisons show it; only other links are sorted.

use alloc::{vec, vec::Vec};
use core::ops::Range;

use super::work::Work;

/// What the indices alone say about a surface.
#[derive(Default)]
pub(super) struct Links {
    /// The edges of one triangle only, as it runs along them.
    pub(super) boundary: Vec<[u32; 2]>,
    pub(super) edges: usize,
    pub(super) non_manifold_edges: usize,
    pub(super) non_manifold_vertices: usize,
    pub(super) inconsistent_edges: usize,
    pub(super) duplicate_triangles: usize,
    pub(super) used_vertices: usize,
    pub(super) components: usize,
}

/// The two other corners of a vertex's triangle, the next one first.
type Segment = [u32; 2];

impl Links {
    /// `triangles`: three different ones of `vertices` vertices each. `None` if the caller cancels.
    pub(super) fn of(triangles: &[[u32; 3]], vertices: usize, share: f32, work: &mut Work<'_>) -> Option<Self> {
        // The last part joins vertices to components; each of the others judges the vertices of a range.
        let ranges = work.threads();
        let start_of = |range: usize| (vertices as u64 * range as u64 / ranges as u64) as usize;
        let mut parts = work.map(share, 0..ranges + 1, |part| match part {
            part if part == ranges => Self { components: joins(triangles, vertices), ..Self::default() },
            range => Self::around(start_of(range)..start_of(range + 1), triangles),
        })?;
        let joins = parts.pop().map_or(0, |part| part.components);
        let mut links = parts.into_iter().reduce(Self::plus).unwrap_or_default();
        links.components = links.used_vertices - joins;
        Some(links)
    }

    /// What the links of some vertices show. The components are left out.
    fn around(vertices: Range<usize>, triangles: &[[u32; 3]]) -> Self {
        let mut links = Self::default();
        let mut scratch = Scratch::default();
        let (mut segments, ends) = gathered(triangles, vertices.clone());
        let mut start = 0;
        for (vertex, end) in vertices.zip(ends) {
            let link = &mut segments[start..end];
            start = end;
            if link.is_empty() {
                continue;
            }
            links.used_vertices += 1;
            if is_ring(link) {
                links.edges += link.iter().filter(|segment| segment[0] as usize > vertex).count();
            } else {
                links.add(vertex as u32, link, &mut scratch);
            }
        }
        links
    }

    /// The sums of both.
    fn plus(mut self, other: Self) -> Self {
        self.boundary.extend_from_slice(&other.boundary);
        Self {
            boundary: self.boundary,
            edges: self.edges + other.edges,
            non_manifold_edges: self.non_manifold_edges + other.non_manifold_edges,
            non_manifold_vertices: self.non_manifold_vertices + other.non_manifold_vertices,
            inconsistent_edges: self.inconsistent_edges + other.inconsistent_edges,
            duplicate_triangles: self.duplicate_triangles + other.duplicate_triangles,
            used_vertices: self.used_vertices + other.used_vertices,
            components: self.components + other.components,
        }
    }

    /// The number of handles, from the Euler characteristic, which is 2·components − 2·genus − rims; `None` if the
    /// surface is not a consistently oriented manifold.
    pub(super) fn genus(&self, euler: i64) -> Option<u64> {
        if self.non_manifold_edges + self.non_manifold_vertices + self.inconsistent_edges > 0 {
            return None;
        }
        let twice = 2 * self.components as i64 - self.rims() as i64 - euler;
        (twice % 2 == 0).then(|| u64::try_from(twice / 2).ok()).flatten()
    }

    /// The number of closed lines that the boundary edges of a consistently oriented manifold form.
    fn rims(&self) -> usize {
        let mut edges = self.boundary.clone();
        edges.sort_unstable();
        let mut seen = vec![false; edges.len()];
        let mut rims = 0;
        for first in 0..edges.len() {
            let mut at = first;
            rims += usize::from(!seen[first]);
            while !seen[at] {
                seen[at] = true;
                let next = edges.binary_search_by_key(&edges[at][1], |edge| edge[0]);
                at = next.unwrap_or(at);
            }
        }
        rims
    }

    /// Adds the counts of a link of any shape.
    fn add(&mut self, vertex: u32, link: &[Segment], scratch: &mut Scratch) {
        let Scratch { ends, fans, triangles } = scratch;
        ends.clear();
        for (segment, &[next, previous]) in (0..).zip(link) {
            ends.push(End { neighbour: next, segment, leaves: true });
            ends.push(End { neighbour: previous, segment, leaves: false });
        }
        ends.sort_unstable_by_key(|end| end.neighbour);
        fans.clear();
        fans.extend(0..link.len() as u32);
        let (mut fan_count, mut crowded) = (link.len(), false);
        for edge in ends.chunk_by(|a, b| a.neighbour == b.neighbour) {
            for pair in edge.windows(2) {
                fan_count -= usize::from(join(fans, pair[0].segment, pair[1].segment));
            }
            crowded |= edge.len() > 2;
            let neighbour = edge[0].neighbour;
            if neighbour < vertex {
                continue;
            }
            self.edges += 1;
            self.non_manifold_edges += usize::from(edge.len() > 2);
            let leaving = edge.iter().filter(|end| end.leaves).count();
            self.inconsistent_edges += usize::from(leaving.abs_diff(edge.len() - leaving) > 1);
            if edge.len() == 1 {
                self.boundary.push(if leaving == 1 { [vertex, neighbour] } else { [neighbour, vertex] });
            }
        }
        self.non_manifold_vertices += usize::from(crowded || fan_count > 1);

        // Each triangle counts at its lowest vertex.
        triangles.clear();
        triangles.extend(link.iter().map(|&[a, b]| [a.min(b), a.max(b)]).filter(|&[low, _]| low > vertex));
        triangles.sort_unstable();
        self.duplicate_triangles += triangles.windows(2).filter(|pair| pair[0] == pair[1]).count();
    }
}

/// Memory that [`Links::add`] reuses.
#[derive(Default)]
struct Scratch {
    ends: Vec<End>,
    /// Disjoint sets: the segments of each fan.
    fans: Vec<u32>,
    triangles: Vec<Segment>,
}

/// An end of a segment: one triangle's edge between the vertex and a neighbour.
struct End {
    neighbour: u32,
    segment: u32,
    /// Whether the triangle runs from the vertex to the neighbour.
    leaves: bool,
}

/// The links of some vertices, one after the other, and where each ends.
fn gathered(triangles: &[[u32; 3]], vertices: Range<usize>) -> (Vec<Segment>, Vec<usize>) {
    let local = |vertex: u32| (vertex as usize).wrapping_sub(vertices.start);
    let mut ends = vec![0usize; vertices.len()];
    for &corner in triangles.as_flattened() {
        if let Some(end) = ends.get_mut(local(corner)) {
            *end += 1;
        }
    }
    let mut sum = 0;
    for end in &mut ends {
        // The start, until the link is filled.
        (*end, sum) = (sum, sum + *end);
    }
    let mut segments = vec![[0; 2]; sum];
    for &[a, b, c] in triangles {
        for (corner, segment) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            if let Some(end) = ends.get_mut(local(corner)) {
                segments[*end] = segment;
                *end += 1;
            }
        }
    }
    (segments, ends)
}

/// Whether a link is one ring of 3 to 16 segments, each of which ends where the next one starts. Puts them into that
/// order as far as it gets.
fn is_ring(link: &mut [Segment]) -> bool {
    if !(3..=16).contains(&link.len()) {
        return false;
    }
    let mut end = link[0][1];
    for place in 1..link.len() {
        let (before, after) = link.split_at(place);
        // If a segment before starts there, the ring closes too early or touches itself.
        if before.iter().any(|segment| segment[0] == end) {
            return false;
        }
        let Some(next) = after.iter().position(|segment| segment[0] == end) else { return false };
        link.swap(place, place + next);
        end = link[place][1];
    }
    end == link[0][0]
}

/// How often two sets become one when the vertices of each triangle are joined.
fn joins(triangles: &[[u32; 3]], vertices: usize) -> usize {
    let mut sets: Vec<u32> = (0..vertices).map(|vertex| vertex as u32).collect();
    let mut joined = 0;
    for &[a, b, c] in triangles {
        joined += usize::from(join(&mut sets, a, b)) + usize::from(join(&mut sets, b, c));
    }
    joined
}

/// Unites the sets of `a` and `b`, and returns whether they were two sets.
///
/// `sets`: the parent of each item in its set's tree; a root is its own parent. The root with the lower number stays
/// the root. Path halving keeps this at O(log n).
fn join(sets: &mut [u32], a: u32, b: u32) -> bool {
    let (a, b) = (root(sets, a), root(sets, b));
    sets[a.max(b) as usize] = a.min(b);
    a != b
}

/// The root of an item's tree.
fn root(sets: &mut [u32], mut item: u32) -> u32 {
    loop {
        let parent = sets[item as usize];
        if parent == item {
            return item;
        }
        let next = sets[parent as usize];
        sets[item as usize] = next;
        item = next;
    }
}
