//! A plain oracle for the counts that depend on indices alone: it compares everything with everything.

use super::*;
use proptest::prelude::*;

/// Boundary, non-manifold and inconsistent edges, non-manifold vertices, duplicate triangles and components.
fn plainly(vertices: u32, indices: &[u32]) -> [usize; 6] {
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
    let sorted = |triangle: &[u32]| {
        let mut sorted = triangle.to_vec();
        sorted.sort_unstable();
        sorted
    };
    let is_repeated = |i: usize| triangles[..i].iter().any(|other| sorted(other) == sorted(triangles[i]));
    let duplicates = (0..triangles.len()).filter(|&i| is_repeated(i)).count();
    let mut pieces: Vec<Vec<u32>> = vec![];
    for triangle in &triangles {
        let (touched, mut others): (Vec<_>, Vec<_>) =
            pieces.into_iter().partition(|piece| triangle.iter().any(|v| piece.contains(v)));
        others.push([touched.concat(), triangle.to_vec()].concat());
        pieces = others;
    }
    [boundary, crowded, oriented_wrong, pinched, duplicates, pieces.len()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn counts_equal_the_plain_ones(
        indices in (2..=8u32).prop_flat_map(|limit| proptest::collection::vec(0..limit, 0..50)),
    ) {
        let positions: Vec<[f32; 3]> = (0..7).map(|i| [i as f32, (i * i) as f32, (i * i * i) as f32]).collect();
        let report = MeshReport::new(&positions, &indices);
        let found = [
            report.boundary_edges, report.non_manifold_edges, report.inconsistent_edges, report.non_manifold_vertices,
            report.duplicate_triangles, report.components,
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
