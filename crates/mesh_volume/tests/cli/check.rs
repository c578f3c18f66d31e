//! `--check`: a report of the mesh, and no output if the mesh is not clean.

use crate::program::Folder;
use crate::readers;
use crate::volumes::Volume;

#[test]
fn a_clean_mesh_is_reported_and_written() {
    let folder = Folder::new();
    // A ball that the volume's border cuts, and a bubble in it.
    let volume = Volume::new([14, 18, 16], "i16", |[x, y, z]| {
        let distance = |middle: f64| [x, y, z].iter().map(|&v| (v as f64 - middle).powi(2)).sum::<f64>().sqrt();
        100.0 * (distance(7.0) - 8.0).max(3.0 - distance(7.0))
    });
    folder.write("v.raw", &volume.bytes());
    for (flags, box_flags) in [("", ""), ("--spacing 0.1,0.3,7", ""), ("--invert", ""), ("--exact", "--invert")] {
        for format in ["ply", "obj", "stl", "glb"] {
            let args = format!("v.raw {} {flags} {box_flags} -o o.{format}", volume.flags());
            let plain = folder.mesh(&args);
            let file = folder.read(&format!("o.{format}"));
            let said = folder.mesh(&format!("{args} --check"));
            let (report, rest) = said.split_once('\n').expect("two lines");
            assert!(report.starts_with(&format!("o.{format}: open, clean: ")), "{report}");
            assert!(report.contains("2 components, ") && report.contains(" boundary edges"), "{report}");
            let counts = |line: &str| line.split_once(';').map(|(counts, _)| counts.to_owned()).expect("times");
            assert_eq!(counts(rest), counts(&plain));
            assert!(folder.read(&format!("o.{format}")) == file);
        }
    }
}

/// A volume whose only surface, around a layer of samples that are barely inside, lies too far from the origin for the
/// resolution of 32-bit positions.
fn far() -> Volume {
    Volume::new([17002, 2, 2], "u8", |[x, _, _]| if x == 17000 { 0.0 } else { 255.0 })
}

#[test]
fn a_mesh_with_defects_is_refused() {
    let folder = Folder::new();
    let volume = far();
    folder.write("v.raw", &volume.bytes());
    let args = format!("v.raw {} --iso 0.001", volume.flags());
    folder.mesh(&format!("{args} -o o.ply"));
    let mesh = readers::ply(&folder.read("o.ply"));
    assert!(!mesh.report().is_clean(), "{}", mesh.report());
    for (flags, report) in [
        ("", "p.ply: open, with defects: 8 vertices, 4 triangles"),
        ("--chunk 6000", "p.0002.ply: open, with defects: 8 vertices, 4 triangles"),
    ] {
        folder.write("p.ply", b"old");
        folder.assert_refused(&format!("{args} {flags} --check -o p.ply"), 3, &["not clean; nothing has been written"]);
        assert_eq!(folder.read("p.ply"), b"old");
        let said = folder.run(&format!("{args} {flags} --check -o p.ply")).stdout;
        let said = String::from_utf8_lossy(&said);
        assert!(said.starts_with(report) && said.contains("4 duplicate vertices"), "{said}");
        assert_eq!(said.contains("meshes checked: 1, with defects: 1\n"), !flags.is_empty(), "{said}");
    }
}
