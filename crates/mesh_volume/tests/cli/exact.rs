//! `--exact`: the topology of the trilinear interpolant in cells where the default separates.

use std::collections::BTreeSet;

use marchless::MeshReport;

use crate::program::Folder;
use crate::readers::{self, Mesh};
use crate::volumes::{TYPES, Volume, random};

/// The program's meshes of a volume, by default and with `--exact`, each with its report in the volume's box.
fn both(volume: &Volume, iso: f64) -> [(Mesh, MeshReport); 2] {
    let folder = Folder::new();
    folder.write("v.raw", &volume.bytes());
    let last = volume.size.map(|samples| (samples - 1) as f32);
    ["", "--exact"].map(|flags| {
        folder.mesh(&format!("v.raw {} --iso {iso} --check {flags} -o o.ply", volume.flags()));
        let mesh = readers::ply(&folder.read("o.ply"));
        let report = MeshReport::in_box(&mesh.positions, &mesh.indices, [[0.0; 3], last]);
        (mesh, report)
    })
}

#[test]
fn corners_that_the_interpolant_joins_are_joined() {
    for kind in TYPES {
        // Diagonal on a face and far inside, among others that are hardly outside; and the other way round.
        for (deep, shallow, [default, exact]) in [(-100.0, 10.0, [2, 1]), (-10.0, 100.0, [2, 2])] {
            let iso = if kind.starts_with('u') { 128.0 } else { 0.0 };
            let volume = Volume::new([2, 2, 2], kind, |point| {
                iso + if matches!(point, [0, 0, 0] | [1, 1, 0]) { deep } else { shallow }
            });
            let reports = both(&volume, iso).map(|(_, report)| report);
            assert!(reports.iter().all(MeshReport::is_clean), "{kind}: {}; {}", reports[0], reports[1]);
            assert_eq!(reports.map(|report| report.components), [default, exact], "{kind}, {deep} and {shallow}");
        }
    }
}

#[test]
fn the_exact_surface_differs_only_within_cells() {
    let volume = Volume::new([20, 17, 19], "f32", |[x, y, z]| random(x + 100 * (y + 100 * z)) - 0.5);
    let [(default, report), (exact, exact_report)] = both(&volume, 0.0);
    assert!(report.is_clean() && exact_report.is_clean(), "{report}; {exact_report}");
    assert!(exact_report.euler != report.euler && exact.positions.len() > default.positions.len());
    let vertices = |mesh: &Mesh, on_edges: bool| -> BTreeSet<[[u32; 3]; 2]> {
        let vertices = mesh.positions.iter().zip(&mesh.normals);
        vertices
            .filter(|(position, _)| (position.iter().filter(|v| v.fract() != 0.0).count() == 1) == on_edges)
            .map(|(&position, &normal)| [position, normal].map(|vector| vector.map(f32::to_bits)))
            .collect()
    };
    assert_eq!(vertices(&exact, true), vertices(&default, true));
    assert!(vertices(&default, false).is_empty());
    let within = exact.positions.iter().filter(|position| position.iter().all(|v| v.fract() != 0.0)).count();
    assert_eq!(within, vertices(&exact, false).len());
    assert!(within > 0);
}
