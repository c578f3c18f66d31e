//! The topology of dual meshes is that of the primal mesher, where no cell takes the loops of its complement.

use marchless::{DualSettings, MaterialSet, MeshBuffer, MeshReport, MeshSettings, Mesher, Samples, Shape};

use super::{block, reference::Volume};
use crate::support::points;

fn reports(shape: Shape, weights: &[i16]) -> Vec<MeshReport> {
    let samples = Samples::new(shape, weights).expect("one weight a sample");
    let (mut mesher, mut mesh) = (Mesher::new(), MeshBuffer::new());
    mesher.mesh(samples, &MeshSettings::default(), &mut mesh).expect("there are cells");
    let mut reports = vec![MeshReport::new(&mesh.positions, &mesh.indices)];
    for (sharp, smoothing) in [(MaterialSet::EMPTY, 0), (MaterialSet::EMPTY, 3), (MaterialSet::ALL, 0)] {
        let settings = DualSettings { sharp, smoothing, ..DualSettings::default() };
        mesher.mesh_dual(samples, &settings, &mut mesh).expect("there are cells");
        reports.push(MeshReport::new(&mesh.positions, &mesh.indices));
    }
    reports
}

#[test]
fn noise_has_the_topology_of_the_primal_mesh() {
    let (mut compared, mut handles) = (0, 0);
    for seed in 0..300 {
        let (shape, weights, materials) = block(seed, [0; 3], 6 + (seed % 2) as i32, 0, [0, 5]);
        let volume = Volume {
            size: shape.size(),
            weights: &weights,
            materials: &materials,
            isovalue: 0.0,
            padded: false,
            smoothing: 0,
            sharp: MaterialSet::EMPTY,
            crease: None,
        };
        let cells = points(shape.size().map(|n| n - 1)).map(|cell| cell.map(i64::from));
        if cells.into_iter().any(|cell| volume.is_complemented(cell)) {
            continue;
        }
        let reports = reports(shape, &weights);
        for report in &reports {
            assert!(report.is_closed(), "seed {seed}: {report}");
            assert_eq!((report.components, report.euler), (reports[0].components, reports[0].euler), "seed {seed}");
        }
        compared += 1;
        handles += reports[0].genus.unwrap_or_default();
    }
    assert!(compared > 100 && handles > 20, "{compared} fields with {handles} handles");
}

#[test]
fn shapes_larger_than_cells_have_their_components_and_handles() {
    let shape = Shape::cube(32).expect("a small shape");
    let two_rings_and_a_box = |[x, y, z]: [u32; 3]| {
        let [x, y, z] = [x, y, z].map(|v| v as f32 - 15.5);
        let ring = |x: f32, y: f32, z: f32| ((x * x + y * y).sqrt() - 6.0).hypot(z) - 2.2;
        let hollow = (x.abs().max(y.abs()).max(z.abs()) - 14.0).max(12.0 - x.abs().max(y.abs()).max(z.abs()));
        ring(x + 3.0, y, z + 1.0).min(ring(x - 3.0, z + 1.0, y)).min(hollow)
    };
    let weights: Vec<i16> =
        points(shape.size()).map(|point| <i16 as marchless::Weight>::from_voxels(two_rings_and_a_box(point))).collect();
    for report in reports(shape, &weights) {
        assert_eq!((report.components, report.euler, report.genus), (4, 4, Some(2)), "{report}");
    }
}
