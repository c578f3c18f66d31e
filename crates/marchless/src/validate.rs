//! [`MeshReport`]: what is sound and what is not in an indexed triangle mesh, whoever made it.
//!
//! Edges are found by sorting; the fans of triangles around each vertex, and the pieces of the whole, by union–find.
//! That takes about a microsecond a triangle.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

/// The defects of an indexed triangle mesh, counted, and what kind of surface it is.
///
/// Triangles that name a vertex which does not exist, or the same vertex twice, are counted as such and left out of
/// everything else. Positions matter only to [`degenerate_triangles`](Self::degenerate_triangles),
/// [`duplicate_vertices`](Self::duplicate_vertices) and [`non_finite_vertices`](Self::non_finite_vertices); whether
/// triangles cross each other in space is not looked at.
///
/// ```
/// use marchless::MeshReport;
///
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let tetrahedron = MeshReport::new(&corners, &[0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]);
/// assert!(tetrahedron.is_closed() && tetrahedron.is_clean());
/// assert_eq!(tetrahedron.to_string(), "closed, clean: 4 vertices, 4 triangles, 1 component, Euler characteristic 2");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshReport {
    /// All vertices.
    pub vertices: usize,
    /// All whole triples of indices.
    pub triangles: usize,
    /// Edges of one triangle only: the rim of an open surface.
    pub boundary_edges: usize,
    /// Edges of three or more triangles.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles are neither one fan nor one ring around them.
    pub non_manifold_vertices: usize,
    /// Edges along which triangles do not run in opposite directions, pair by pair (at a non-manifold edge one may
    /// be left over).
    pub inconsistent_edges: usize,
    /// Triangles with the same vertex twice, or of no area (exact for coordinates of about the same magnitude).
    pub degenerate_triangles: usize,
    /// Triangles with the same three vertices as another one before them, whichever way round.
    pub duplicate_triangles: usize,
    /// Vertices in the same place as another one before them, to the last bit (−0 is 0).
    pub duplicate_vertices: usize,
    /// Vertices of no triangle.
    pub unused_vertices: usize,
    /// Vertices with a coordinate that is infinite or NaN.
    pub non_finite_vertices: usize,
    /// Indices that name no vertex.
    pub out_of_range_indices: usize,
    /// Indices left over after the last whole triangle: 0, 1 or 2.
    pub stray_indices: usize,
    /// Pieces that share no vertex with each other.
    pub components: usize,
    /// Vertices − edges + triangles of the surface: 2 for a sphere, 0 for a torus, 1 for a disc; summed over the
    /// components.
    pub euler: i64,
}

impl MeshReport {
    /// Examines a mesh, in O(n log n) time.
    ///
    /// `indices`: three a triangle; any values and any number of them.
    pub fn new(positions: &[[f32; 3]], indices: &[u32]) -> Self {
        let mut report = Self {
            vertices: positions.len(),
            triangles: indices.len() / 3,
            duplicate_vertices: count_repeated(positions.iter().map(|p| p.map(|v| (v + 0.0).to_bits())).collect()),
            non_finite_vertices: positions.iter().filter(|p| !p.iter().all(|v| v.is_finite())).count(),
            out_of_range_indices: indices.iter().filter(|&&i| i as usize >= positions.len()).count(),
            stray_indices: indices.len() % 3,
            ..Self::default()
        };

        // The triangles that the surface is made of.
        let mut triangles = Vec::with_capacity(report.triangles);
        for triangle in indices.chunks_exact(3) {
            let [a, b, c] = [triangle[0], triangle[1], triangle[2]];
            if triangle.iter().any(|&i| i as usize >= positions.len()) {
                continue;
            }
            if a == b || b == c || c == a {
                report.degenerate_triangles += 1;
                continue;
            }
            if has_no_area([a, b, c].map(|i| positions[i as usize])) {
                report.degenerate_triangles += 1;
            }
            triangles.push([a, b, c]);
        }
        report.duplicate_triangles = count_repeated(
            triangles
                .iter()
                .map(|&(mut triangle)| {
                    triangle.sort_unstable();
                    triangle
                })
                .collect(),
        );
        report.examine_surface(&triangles);
        report
    }

    /// Whether the surface has no rim. An empty mesh is closed.
    pub const fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether there is no defect: open or closed, the mesh is a consistently oriented 2-manifold without degenerate
    /// or duplicate parts and without indices or vertices that lead nowhere.
    pub fn is_clean(&self) -> bool {
        self.defects().iter().all(|&(count, _, _)| count == 0)
    }

    /// Fills in what concerns edges, fans and components.
    ///
    /// `triangles`: vertices that exist, three different ones each.
    fn examine_surface(&mut self, triangles: &[[u32; 3]]) {
        let corners = triangles.as_flattened();
        let mut uses: Vec<EdgeUse> = (0..corners.len())
            .map(|corner| {
                let (start, end) = (corners[corner], corners[next_corner(corner)]);
                EdgeUse { low: start.min(end), high: start.max(end), corner }
            })
            .collect();
        uses.sort_unstable_by_key(|edge| (edge.low, edge.high));

        let mut fans = UnionFind::new(corners.len());
        let mut pieces = UnionFind::new(self.vertices);
        // Fans around each vertex; 2 stands for any that are not right.
        let mut fan_counts = vec![0u8; self.vertices];
        let mut edges = 0;
        for edge in uses.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
            let [low, high] = [edge[0].low as usize, edge[0].high as usize];
            edges += 1;
            pieces.join(low, high);
            for pair in edge.windows(2) {
                let ([low_a, high_a], [low_b, high_b]) = (pair[0].ends(corners), pair[1].ends(corners));
                fans.join(low_a, low_b);
                fans.join(high_a, high_b);
            }
            match edge.len() {
                1 => self.boundary_edges += 1,
                2 => {}
                _ => {
                    self.non_manifold_edges += 1;
                    (fan_counts[low], fan_counts[high]) = (2, 2);
                }
            }
            let upward = edge.iter().filter(|side| corners[side.corner] == side.low).count();
            if upward.abs_diff(edge.len() - upward) > 1 {
                self.inconsistent_edges += 1;
            }
        }

        for corner in 0..corners.len() {
            if fans.is_root(corner) {
                let count = &mut fan_counts[corners[corner] as usize];
                *count = count.saturating_add(1);
            }
        }
        self.non_manifold_vertices = fan_counts.iter().filter(|&&count| count > 1).count();
        self.unused_vertices = fan_counts.iter().filter(|&&count| count == 0).count();
        self.components = (0..self.vertices).filter(|&v| fan_counts[v] > 0 && pieces.is_root(v)).count();
        self.euler = (self.vertices - self.unused_vertices) as i64 - edges + triangles.len() as i64;
    }

    /// Every kind of defect: how many, and the word for one and for several.
    const fn defects(&self) -> [(usize, &'static str, &'static str); 10] {
        [
            (self.non_manifold_edges, "non-manifold edge", "non-manifold edges"),
            (self.non_manifold_vertices, "non-manifold vertex", "non-manifold vertices"),
            (self.inconsistent_edges, "inconsistently oriented edge", "inconsistently oriented edges"),
            (self.degenerate_triangles, "degenerate triangle", "degenerate triangles"),
            (self.duplicate_triangles, "duplicate triangle", "duplicate triangles"),
            (self.duplicate_vertices, "duplicate vertex", "duplicate vertices"),
            (self.unused_vertices, "unused vertex", "unused vertices"),
            (self.non_finite_vertices, "non-finite vertex", "non-finite vertices"),
            (self.out_of_range_indices, "index out of range", "indices out of range"),
            (self.stray_indices, "stray index", "stray indices"),
        ]
    }
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_closed() { "closed" } else { "open" })?;
        f.write_str(if self.is_clean() { ", clean: " } else { ", with defects: " })?;
        let mut counted = |count: usize, one: &str, several: &str| {
            let word = if count == 1 { one } else { several };
            write!(f, "{count} {word}, ")
        };
        counted(self.vertices, "vertex", "vertices")?;
        counted(self.triangles, "triangle", "triangles")?;
        counted(self.components, "component", "components")?;
        if !self.is_closed() {
            counted(self.boundary_edges, "boundary edge", "boundary edges")?;
        }
        for (count, one, several) in self.defects() {
            if count > 0 {
                counted(count, one, several)?;
            }
        }
        write!(f, "Euler characteristic {}", self.euler)
    }
}

/// One triangle's side, along an edge that other triangles may have too.
struct EdgeUse {
    low: u32,
    high: u32,
    /// Where the side starts, in the list of all triangles' corners.
    corner: usize,
}

impl EdgeUse {
    /// The triangle's corners at the edge's low and high vertex.
    fn ends(&self, corners: &[u32]) -> [usize; 2] {
        let (start, end) = (self.corner, next_corner(self.corner));
        if corners[start] == self.low { [start, end] } else { [end, start] }
    }
}

/// The corner after this one in its triangle.
const fn next_corner(corner: usize) -> usize {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// Whether the cross product of two sides is zero; false where a coordinate is not finite.
fn has_no_area(positions: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = positions.map(|p| p.map(f64::from));
    let [u, v]: [[f64; 3]; 2] = [b, c].map(|end| core::array::from_fn(|axis| end[axis] - a[axis]));
    (0..3).all(|axis| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        u[i] * v[j] == u[j] * v[i]
    })
}

/// How many keys equal another one before them.
fn count_repeated(mut keys: Vec<[u32; 3]>) -> usize {
    keys.sort_unstable();
    keys.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

/// Disjoint sets of the numbers below a length.
struct UnionFind {
    parents: Vec<usize>,
}

impl UnionFind {
    /// Every number on its own.
    fn new(len: usize) -> Self {
        Self { parents: (0..len).collect() }
    }

    /// The number that stands for the set of `item`; halves the path to it.
    fn root(&mut self, mut item: usize) -> usize {
        while self.parents[item] != item {
            self.parents[item] = self.parents[self.parents[item]];
            item = self.parents[item];
        }
        item
    }

    /// Makes one set of two. The higher root always goes below the lower one: with the halving, that is O(log n).
    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b);
    }

    /// Whether `item` stands for its set; one item of each set does.
    fn is_root(&self, item: usize) -> bool {
        self.parents[item] == item
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use proptest::prelude::*;

    type Mesh = (Vec<[f32; 3]>, Vec<u32>);

    fn report((positions, indices): &Mesh) -> MeshReport {
        MeshReport::new(positions, indices)
    }

    fn tetrahedron() -> Mesh {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        (corners, vec![0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3])
    }

    /// A unit cube with its lowest corner at `origin`; corner `i` at the bits of `i`.
    fn cube(origin: [f32; 3]) -> Mesh {
        let corner = |i: usize| core::array::from_fn(|axis| origin[axis] + (i >> axis & 1) as f32);
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let indices = quads.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
        ((0..8).map(corner).collect(), indices)
    }

    /// A grid of `n` × `m` quads that closes on itself both ways.
    fn torus(n: u32, m: u32) -> Mesh {
        let at = |i: u32, j: u32| (j % m) * n + i % n;
        let positions = (0..n * m)
            .map(|v| {
                let [u, w] =
                    [(v % n) as f32 / n as f32, (v / n) as f32 / m as f32].map(|t| t * 2.0 * core::f32::consts::PI);
                let radius = 3.0 + libm::cosf(u);
                [radius * libm::cosf(w), radius * libm::sinf(w), libm::sinf(u)]
            })
            .collect();
        let quad = |i, j| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)];
        let indices = (0..m).flat_map(|j| (0..n).flat_map(move |i| quad(i, j))).collect();
        (positions, indices)
    }

    /// Both meshes in one, with vertices of the second replaced where `shared` says (second's, first's).
    fn joined(first: &Mesh, second: &Mesh, shared: &[(u32, u32)]) -> Mesh {
        let (mut positions, mut indices) = first.clone();
        let mut names = vec![0; second.0.len()];
        for (v, &position) in second.0.iter().enumerate() {
            names[v] = shared.iter().find(|pair| pair.0 as usize == v).map_or(positions.len() as u32, |pair| pair.1);
            if names[v] as usize == positions.len() {
                positions.push(position);
            }
        }
        indices.extend(second.1.iter().map(|&v| names[v as usize]));
        (positions, indices)
    }

    #[test]
    fn closed_surfaces_are_clean() {
        for (mesh, euler) in [(tetrahedron(), 2), (cube([0.0; 3]), 2), (torus(7, 12), 0)] {
            let report = report(&mesh);
            assert!(report.is_closed() && report.is_clean(), "{report}");
            assert_eq!((report.components, report.euler), (1, euler));
            assert_eq!((report.vertices, report.triangles), (mesh.0.len(), mesh.1.len() / 3));
        }
        let two = report(&joined(&cube([0.0; 3]), &cube([5.0; 3]), &[]));
        assert!(two.is_closed() && two.is_clean());
        assert_eq!((two.components, two.euler), (2, 4));
    }

    #[test]
    fn an_empty_mesh_is_closed_and_clean() {
        let report = MeshReport::new(&[], &[]);
        assert!(report.is_closed() && report.is_clean());
        assert_eq!(report.to_string(), "closed, clean: 0 vertices, 0 triangles, 0 components, Euler characteristic 0");
    }

    #[test]
    fn an_open_disc_has_a_rim_and_no_defect() {
        // Six triangles around vertex 0.
        let mut positions = vec![[0.0; 3]];
        positions.extend((0..6).map(|i| [libm::cosf(i as f32), libm::sinf(i as f32), 0.0]));
        let indices = (0..6).flat_map(|i| [0, i + 1, (i + 1) % 6 + 1]).collect();
        let report = report(&(positions, indices));
        assert_eq!((report.boundary_edges, report.euler, report.components), (6, 1, 1));
        assert!(!report.is_closed() && report.is_clean(), "{report}");
        assert!(report.to_string().contains("6 boundary edges"), "{report}");
    }

    #[test]
    fn a_flipped_triangle_shows_on_its_three_edges() {
        let (positions, mut indices) = cube([0.0; 3]);
        indices.swap(0, 1);
        let report = MeshReport::new(&positions, &indices);
        let expected = MeshReport {
            vertices: 8,
            triangles: 12,
            inconsistent_edges: 3,
            components: 1,
            euler: 2,
            ..MeshReport::default()
        };
        assert_eq!(report, expected);
        assert!(report.is_closed() && !report.is_clean());
    }

    #[test]
    fn a_bow_tie_pinches_its_middle() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]];
        let report = MeshReport::new(&positions, &[0, 1, 2, 0, 3, 4]);
        let expected = MeshReport {
            vertices: 5,
            triangles: 2,
            boundary_edges: 6,
            non_manifold_vertices: 1,
            components: 1,
            euler: 1,
            ..MeshReport::default()
        };
        assert_eq!(report, expected);
    }

    #[test]
    fn cubes_that_share_a_vertex_are_not_a_manifold() {
        let report = report(&joined(&cube([0.0; 3]), &cube([1.0; 3]), &[(0, 7)]));
        let expected = MeshReport {
            vertices: 15,
            triangles: 24,
            non_manifold_vertices: 1,
            components: 1,
            euler: 3,
            ..MeshReport::default()
        };
        assert_eq!(report, expected);
    }

    #[test]
    fn cubes_that_share_an_edge_are_not_a_manifold() {
        let report = report(&joined(&cube([0.0; 3]), &cube([1.0, 1.0, 0.0]), &[(0, 3), (4, 7)]));
        let expected = MeshReport {
            vertices: 14,
            triangles: 24,
            non_manifold_edges: 1,
            non_manifold_vertices: 2,
            components: 1,
            euler: 14 - 35 + 24,
            ..MeshReport::default()
        };
        assert_eq!(report, expected);
    }

    #[test]
    fn three_pages_on_one_spine_are_consistent_but_not_a_manifold() {
        let positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let book = MeshReport::new(&positions, &[0, 1, 2, 1, 0, 3, 0, 1, 4]);
        assert_eq!((book.non_manifold_edges, book.non_manifold_vertices, book.inconsistent_edges), (1, 2, 0));
        assert_eq!((book.boundary_edges, book.euler), (6, 1));
        let all_one_way = MeshReport::new(&positions, &[0, 1, 2, 0, 1, 3, 0, 1, 4]);
        assert_eq!(all_one_way.inconsistent_edges, 1);
    }

    #[test]
    fn degenerate_triangles_are_found_by_index_and_by_area() {
        let positions = [[0.1, 0.1, 0.1], [0.3, 0.3, 0.3], [0.7, 0.7, 0.7], [0.3, 0.3, 0.4]];
        assert_eq!(MeshReport::new(&positions, &[0, 1, 2]).degenerate_triangles, 1);
        assert_eq!(MeshReport::new(&positions, &[0, 1, 3]).degenerate_triangles, 0);
        let repeated = MeshReport::new(&positions, &[0, 1, 1]);
        assert_eq!((repeated.degenerate_triangles, repeated.boundary_edges, repeated.unused_vertices), (1, 0, 4));
    }

    #[test]
    fn duplicates_and_loose_ends_are_counted() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0], [f32::NAN, 0.0, 0.0]];
        let report = MeshReport::new(&positions, &[0, 1, 2, 2, 1, 0, 0, 1, 9, 7, 3]);
        let expected = MeshReport {
            vertices: 5,
            triangles: 3,
            duplicate_triangles: 1,
            duplicate_vertices: 1,
            unused_vertices: 2,
            non_finite_vertices: 1,
            out_of_range_indices: 2,
            stray_indices: 2,
            components: 1,
            euler: 2,
            ..MeshReport::default()
        };
        assert_eq!(report, expected);
        let text = report.to_string();
        assert!(text.starts_with("closed, with defects: 5 vertices, 3 triangles, 1 component, "), "{text}");
        assert!(text.contains("1 duplicate vertex, 2 unused vertices, 1 non-finite vertex, 2 indices"), "{text}");
    }

    /// The same counts by comparing everything with everything.
    fn plainly(vertices: u32, indices: &[u32]) -> [usize; 4] {
        let triangles: Vec<_> = indices
            .chunks_exact(3)
            .filter(|t| t.iter().all(|&v| v < vertices) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect();
        let (mut boundary, mut crowded, mut oriented_wrong) = (0, 0, 0);
        for a in 0..vertices {
            for b in a + 1..vertices {
                let runs = |from, to| {
                    triangles.iter().filter(|t| (0..3).any(|i| t[i] == from && t[(i + 1) % 3] == to)).count()
                };
                let (up, down) = (runs(a, b), runs(b, a));
                boundary += usize::from(up + down == 1);
                crowded += usize::from(up + down > 2);
                oriented_wrong += usize::from(up.abs_diff(down) >= 2);
            }
        }
        let mut pinched = 0;
        for v in 0..vertices {
            // The link of a vertex: one segment a triangle. It must be one path or one ring.
            let link: Vec<[u32; 2]> = triangles
                .iter()
                .filter_map(|t| (0..3).find(|&i| t[i] == v).map(|i| [t[(i + 1) % 3], t[(i + 2) % 3]]))
                .collect();
            let crowded = (0..vertices).any(|w| link.iter().flatten().filter(|&&end| end == w).count() > 2);
            let mut reached: Vec<u32> = link.first().map_or(vec![], |segment| segment.to_vec());
            for _ in &link {
                for segment in &link {
                    if segment.iter().any(|end| reached.contains(end)) {
                        reached.extend(segment);
                    }
                }
            }
            pinched += usize::from(crowded || !link.iter().flatten().all(|end| reached.contains(end)));
        }
        [boundary, crowded, oriented_wrong, pinched]
    }

    proptest! {
        #[test]
        fn counts_equal_the_plain_ones(indices in proptest::collection::vec(0u32..8, 0..40)) {
            let positions: Vec<[f32; 3]> = (0..7).map(|i| [i as f32, (i * i) as f32, (i * i * i) as f32]).collect();
            let report = MeshReport::new(&positions, &indices);
            let found = [
                report.boundary_edges, report.non_manifold_edges, report.inconsistent_edges, report.non_manifold_vertices,
            ];
            prop_assert_eq!(found, plainly(7, &indices));
        }

        #[test]
        fn nothing_panics(
            positions in proptest::collection::vec(proptest::array::uniform3(proptest::num::f32::ANY), 0..6),
            indices in proptest::collection::vec(prop_oneof![0u32..6, any::<u32>()], 0..30),
        ) {
            let _ = MeshReport::new(&positions, &indices).to_string();
        }
    }
}
