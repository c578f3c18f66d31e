//! A mesh for every kind of defect, which has that one and no other; and a plain count of everything.

use super::*;
use alloc::{string::ToString, vec};
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
    assert_eq!(
        report.to_string(),
        "closed, clean: 0 vertices, 0 triangles, 0 components, Euler characteristic 0, genus 0"
    );
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
    assert_eq!(MeshReport::new(&positions, &[0, 1, 2]).zero_area_triangles, 1);
    assert_eq!(MeshReport::new(&positions, &[0, 1, 3]).zero_area_triangles, 0);
    let repeated = MeshReport::new(&positions, &[0, 1, 1]);
    assert_eq!((repeated.repeated_index_triangles, repeated.zero_area_triangles), (1, 0));
    assert_eq!((repeated.boundary_edges, repeated.unused_vertices), (0, 4));
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
        genus: Some(0),
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
            let runs =
                |from, to| triangles.iter().filter(|t| (0..3).any(|i| t[i] == from && t[(i + 1) % 3] == to)).count();
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
