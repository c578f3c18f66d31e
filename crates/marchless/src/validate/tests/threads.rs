//! The report is the same on any number of threads, and the work can be cancelled anywhere.

use super::*;
use proptest::prelude::*;

fn on_threads(mesh: &Mesh, threads: usize) -> MeshReport {
    let mut progress = |_| ControlFlow::Continue(());
    let mut work = Work::new(threads, &mut progress);
    MeshReport::examine(&mesh.0, &mesh.1, Some([[0.0; 3], [100.0; 3]]), &mut work).expect("nobody cancels")
}

/// A mesh of a row of tori with random damage: it has every kind of defect many times.
fn flawed(tori: u32, seed: u64) -> Mesh {
    let mut state = seed;
    let mut random = |below: u32| {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (((state >> 32) * u64::from(below)) >> 32) as u32
    };
    let mut mesh: Mesh = (vec![], vec![]);
    for i in 0..tori {
        let (positions, indices) = torus(24, 40);
        let first = mesh.0.len() as u32;
        mesh.0.extend(positions.iter().map(|&[x, y, z]| [x + 7.0 * i as f32, y, z]));
        mesh.1.extend(indices.iter().map(|&index| index + first));
    }
    let [vertices, corners] = [mesh.0.len(), mesh.1.len()].map(|len| len as u32);
    for _ in 0..5 * tori {
        let [vertex, other] = [random(vertices), random(vertices)].map(|vertex| vertex as usize);
        let triangle = 3 * random(corners / 3) as usize;
        match random(9) {
            0 => mesh.0[vertex] = mesh.0[(vertex + 1) % vertices as usize],
            1 => mesh.0[vertex][1] = f32::NAN,
            2 => mesh.0[vertex][0] += 3.0,
            3 => mesh.0[vertex] = [f32::MAX; 3],
            4 => mesh.1[triangle] = mesh.1[triangle + 1],
            5 => mesh.1[triangle] = vertices + 7,
            6 => mesh.1.swap(triangle, triangle + 1),
            7 => mesh.1[triangle] = other as u32,
            _ => mesh.1.extend_from_within(triangle..triangle + 3),
        }
    }
    mesh.0.push([-1.0; 3]);
    mesh.1.push(0);
    mesh
}

#[test]
fn a_large_flawed_mesh_has_one_report() {
    // More than one block of each step.
    let mesh = flawed(80, 1);
    assert!(mesh.1.len() / 3 > 150_000);
    let report = on_threads(&mesh, 1);
    assert!(report.defects().iter().all(|&(count, _, _)| count > 0), "{report}");
    for threads in [2, 3, 7] {
        assert_eq!(on_threads(&mesh, threads), report, "{threads} threads");
    }
}

#[test]
fn progress_rises_to_the_end_and_can_cancel() {
    let mesh = flawed(5, 2);
    let mut told = vec![];
    let report = MeshReport::with_progress(&mesh.0, &mesh.1, |done| {
        told.push(done);
        ControlFlow::Continue(())
    });
    assert_eq!(report, Some(report_of(&mesh)));
    assert!(told.is_sorted() && told.first() > Some(&0.0), "{told:?}");
    assert!(told.last().is_some_and(|&last| (0.99..=1.0).contains(&last)), "{told:?}");
    for threads in [1, 2] {
        for last in (0..told.len()).step_by(told.len() / 5 + 1) {
            let mut calls = 0;
            let mut progress = |_| {
                calls += 1;
                if calls > last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let report = MeshReport::examine(&mesh.0, &mesh.1, None, &mut Work::new(threads, &mut progress));
            // With two threads, the caller's may have fewer parts than there are.
            assert!(report.is_none() || threads == 2);
        }
    }
}

fn report_of(mesh: &Mesh) -> MeshReport {
    MeshReport::new(&mesh.0, &mesh.1)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn threads_make_no_difference(tori in 1u32..4, seed: u64) {
        let mesh = flawed(tori, seed);
        let report = on_threads(&mesh, 1);
        prop_assert_eq!(&on_threads(&mesh, 2), &report);
        prop_assert_eq!(&on_threads(&mesh, 3), &report);
    }
}
