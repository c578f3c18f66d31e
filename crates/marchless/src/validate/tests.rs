//! A mesh for each kind of defect, with this defect alone.

mod plain;
mod threads;

use super::*;
use alloc::{string::ToString, vec, vec::Vec};

type Mesh = (Vec<[f32; 3]>, Vec<u32>);

fn report((positions, indices): &Mesh) -> MeshReport {
    MeshReport::new(positions, indices)
}

fn tetrahedron() -> Mesh {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    (corners, vec![0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3])
}

/// A unit cube with its lowest corner at `origin`; the bits of `i` are the coordinates of corner `i`.
fn cube(origin: [f32; 3]) -> Mesh {
    let corner = |i: usize| core::array::from_fn(|axis| origin[axis] + (i >> axis & 1) as f32);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let indices = quads.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    ((0..8).map(corner).collect(), indices)
}

/// A torus of `n` × `m` quads.
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

/// Both meshes in one. `shared` lists the second's vertices that are replaced, each with the first's vertex.
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

/// A strip of `n` quads that closes on itself; with a twist it has one side only.
fn strip(n: u32, twisted: bool) -> Mesh {
    let positions = (0..2 * n).map(|v| {
        let angle = (v / 2) as f32 / n as f32 * 2.0 * core::f32::consts::PI;
        let lean = (v % 2) as f32 * if twisted { angle / 2.0 } else { 0.0 };
        let radius = 3.0 + libm::cosf(lean) * (v % 2) as f32;
        [radius * libm::cosf(angle), radius * libm::sinf(angle), libm::sinf(lean) * (v % 2) as f32]
    });
    let at = |i: u32, side: u32| 2 * (i % n) + if twisted && i == n { 1 - side } else { side };
    let quad = |i| [at(i, 0), at(i + 1, 0), at(i + 1, 1), at(i, 0), at(i + 1, 1), at(i, 1)];
    (positions.collect(), (0..n).flat_map(quad).collect())
}

/// Two surfaces sewn together along a triangle that both lose: the first one of `first`, the last one of `second`.
fn sewn(first: &Mesh, second: &Mesh) -> Mesh {
    let (mut first, mut second) = (first.clone(), second.clone());
    let rest = second.1.split_off(second.1.len() - 3);
    let rim: Vec<u32> = first.1.drain(..3).collect();
    // The second rim runs the other way round.
    joined(&first, &second, &[(rest[0], rim[0]), (rest[1], rim[2]), (rest[2], rim[1])])
}

#[test]
fn genus_counts_handles() {
    let without_one = |(positions, mut indices): Mesh| {
        indices.drain(..3);
        (positions, indices)
    };
    let (sphere, torus) = (cube([0.0; 3]), torus(7, 12));
    let two = joined(&torus, &torus, &[]);
    let double = sewn(&torus, &torus);
    let cases = [
        ("a sphere", sphere.clone(), Some(0), 1, 2),
        ("a torus", torus.clone(), Some(1), 1, 0),
        ("two tori", two.clone(), Some(2), 2, 0),
        ("a double torus", double.clone(), Some(2), 1, -2),
        ("a triple torus", sewn(&double, &torus), Some(3), 1, -4),
        ("a sphere sewn to a torus", sewn(&sphere, &torus), Some(1), 1, 0),
        ("a double torus and a sphere", joined(&double, &sphere, &[]), Some(2), 2, 0),
        ("a disc", without_one(sphere.clone()), Some(0), 1, 1),
        ("a torus with a hole", without_one(torus.clone()), Some(1), 1, -1),
        ("a ribbon", strip(9, false), Some(0), 1, 0),
        ("a Möbius strip", strip(9, true), None, 1, 0),
        ("spheres that share a vertex", joined(&sphere, &sphere, &[(0, 7)]), None, 1, 3),
        ("nothing", (vec![], vec![]), Some(0), 0, 0),
    ];
    for (name, mesh, genus, components, euler) in cases {
        let report = report(&mesh);
        assert_eq!((report.genus, report.components, report.euler), (genus, components, euler), "{name}: {report}");
    }
}

/// Checks that the mesh has these defects and no others.
#[track_caller]
fn has_only(report: &MeshReport, defects: &[(usize, &str)]) {
    let found: Vec<_> =
        report.defects().iter().filter(|defect| defect.0 > 0).map(|defect| (defect.0, defect.1)).collect();
    assert_eq!(found, defects, "{report}");
    assert_eq!(report.is_clean(), defects.is_empty());
    for &(count, one, several) in report.defects().iter().filter(|defect| defect.0 > 0) {
        assert!(report.to_string().contains(&alloc::format!(", {count} {}, ", if count == 1 { one } else { several })));
    }
}

#[test]
fn each_defect_is_told_from_all_others() {
    let base = cube([0.0; 3]);
    let with = |vertices: &[[f32; 3]], indices: &[u32]| {
        let (mut mesh, first) = (base.clone(), base.0.len() as u32);
        mesh.0.extend(vertices);
        mesh.1.extend(indices.iter().map(|&index| index + first));
        report(&mesh)
    };
    has_only(&report(&base), &[]);
    has_only(&with(&[], &[u32::MAX - 8, 0, 1]), &[(3, "index out of range")]);
    has_only(&with(&[], &[]), &[]);
    let mut stray = base.clone();
    stray.1.extend([0, 1]);
    has_only(&report(&stray), &[(2, "stray index")]);
    let mut repeated = base.clone();
    repeated.1.extend([0, 1, 1]);
    has_only(&report(&repeated), &[(1, "triangle with a repeated index")]);

    let apart = [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]];
    has_only(&with(&apart, &[0, 1, 2]), &[]);
    has_only(&with(&[[5.0; 3]], &[]), &[(1, "unused vertex")]);
    has_only(&with(&[apart[0], apart[1], [7.0, 0.0, 0.0]], &[0, 1, 2]), &[(1, "triangle of zero area")]);
    has_only(&with(&[apart[0], apart[1], [5.0, f32::NAN, 0.0]], &[0, 1, 2]), &[(1, "non-finite vertex")]);
    has_only(&with(&[apart[0], apart[1], [1.0, 1.0, 0.0]], &[0, 1, 2]), &[(1, "duplicate vertex")]);
    has_only(&with(&apart, &[0, 1, 2, 2, 1, 0]), &[(1, "duplicate triangle")]);
    has_only(
        &with(&[[0.5, 0.25, 0.5], [5.0, 0.25, 0.5], [5.0, 1.0, 0.5]], &[0, 1, 2]),
        &[(1, "pair of crossing triangles")],
    );
    let more = [apart[0], apart[1], apart[2], [6.0, 1.0, 0.0], [6.0, 1.0, 1.0], [5.0, 0.0, 1.0], [5.0, -1.0, 0.0]];
    has_only(&with(&more[..4], &[0, 1, 2, 1, 2, 3]), &[(1, "inconsistently oriented edge")]);
    has_only(&with(&[more[0], more[1], more[2], more[5], more[6]], &[0, 1, 2, 0, 3, 4]), &[(1, "non-manifold vertex")]);
    // A spine of three pages cannot be without the vertices at its ends.
    has_only(
        &with(&[more[0], more[1], more[2], more[5], more[6]], &[0, 1, 2, 1, 0, 3, 0, 1, 4]),
        &[(1, "non-manifold edge"), (2, "non-manifold vertex")],
    );
}

#[test]
fn areas_are_exact() {
    let area = |corners: [[f32; 3]; 3]| MeshReport::new(&corners, &[0, 1, 2]).zero_area_triangles == 0;
    let tiny = f32::from_bits(1);
    assert!(area([[0.0; 3], [tiny, 0.0, 0.0], [0.0, tiny, 0.0]]));
    assert!(area([[0.0; 3], [f32::MAX; 3], [1.0, 1.0, 1.0 + f32::EPSILON]]));
    assert!(area([[f32::MIN; 3], [f32::MAX; 3], [0.0, tiny, 0.0]]));
    assert!(area([[f32::MIN, 0.0, 0.0], [f32::MAX, 0.0, 0.0], [0.0, 0.0, tiny]]));
    assert!(!area([[f32::MIN; 3], [f32::MAX; 3], [tiny; 3]]));
    assert!(!area([[tiny; 3], [2.0 * tiny; 3], [5.0 * tiny; 3]]));
    assert!(!area([[1.0; 3], [1.0; 3], [0.0; 3]]));
    // Not in `f64`: the products need 48 and more bits, and cancel.
    let [a, b] = [1.0 + f32::EPSILON, 1.0 - f32::EPSILON];
    assert!(area([[0.0; 3], [a, 1.0, 0.0], [1.0, b, 0.0]]));
}

#[test]
fn rims_beside_the_box_are_cracks() {
    // A square within x from 0 to 2, y from 0 to 1, in the plane z = 0.5.
    let positions = [[0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [2.0, 1.0, 0.5], [-0.0, 1.0, 0.5]];
    let indices = [0, 1, 2, 0, 2, 3];
    let cracks = |min, max| MeshReport::in_box(&positions, &indices, [min, max]).cracks;
    assert_eq!(cracks([0.0; 3], [2.0, 1.0, 1.0]), 0);
    assert_eq!(cracks([0.0; 3], [2.0, 2.0, 1.0]), 1);
    assert_eq!(cracks([0.0; 3], [3.0, 2.0, 1.0]), 2);
    assert_eq!(cracks([-1.0; 3], [3.0; 3]), 4);
    assert_eq!(cracks([-1.0, -1.0, 0.5], [3.0; 3]), 0, "all of it lies on a face");
    assert_eq!(cracks([0.0; 3], [2.0, 0.5, 1.0]), 3, "half of it is beyond the box");
    assert_eq!(cracks([f32::NAN; 3], [f32::NAN; 3]), 4);
    let report = MeshReport::in_box(&positions, &indices, [[0.0; 3], [3.0, 1.0, 1.0]]);
    has_only(&report, &[(1, "crack")]);
    assert_eq!(report, MeshReport { cracks: 1, ..MeshReport::new(&positions, &indices) });
    // From one face to another.
    let positions = [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [1.0, 0.5, 0.5]];
    assert_eq!(MeshReport::in_box(&positions, &[0, 1, 2], [[0.0; 3], [1.0; 3]]).cracks, 3);
}
