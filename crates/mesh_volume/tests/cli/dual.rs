//! `--dual`, `--smooth`, `--sharp` and `--crease`: the dual mesher's mesh of the whole volume.

use marchless::{DualSettings, MaterialSet};

use crate::program::Folder;
use crate::readers;
use crate::volumes::{TYPES, Volume};
use crate::whole_by;

#[test]
fn every_type_is_the_dual_mesh_of_the_whole_volume() {
    for kind in TYPES {
        let folder = Folder::new();
        let volume = Volume::ball([21, 18, 16], kind, 7.0, 4.0);
        folder.write("v.raw", &volume.bytes());
        let smooth = |smoothing| DualSettings { smoothing, ..DualSettings::default() };
        let sharp = |crease| DualSettings { sharp: MaterialSet::ALL, crease, ..smooth(1) };
        for (flags, settings) in [
            ("--dual", smooth(0)),
            ("--dual --smooth 3", smooth(3)),
            ("--dual --smooth 1 --sharp", sharp(None)),
            ("--dual --smooth 1 --sharp --crease 20", sharp(Some(20f32.to_radians()))),
        ] {
            let expected = whole_by(&volume, 100.0, Some(settings));
            assert!(expected.positions.len() > 300, "{}", expected.report());
            // Sharp triangles may cross each other.
            assert!(!settings.sharp.is_empty() || expected.report().is_clean(), "{}", expected.report());
            folder.mesh(&format!("v.raw {} --iso 100 {flags} -o o.ply", volume.flags()));
            assert_eq!(readers::ply(&folder.read("o.ply")), expected, "{kind}, {flags}");
        }
    }
}

#[test]
fn smoothing_takes_away_the_steps_of_a_mask() {
    let folder = Folder::new();
    let radius = |p: &[f64; 3]| p.iter().map(|v| (v - 9.5) * (v - 9.5)).sum::<f64>().sqrt();
    // A ball of ones, up to the border of the volume.
    let volume = Volume::new([20; 3], "u8", |p| f64::from(u8::from(radius(&p.map(|v| v as f64)) < 9.6)));
    folder.write("mask.raw", &volume.bytes());
    let spread = |flags: &str| {
        let said =
            folder.mesh(&format!("mask.raw {} --iso 0.5 --invert --close --check {flags} -o o.ply", volume.flags()));
        assert!(said.contains("o.ply"), "{said}");
        let mesh = readers::ply(&folder.read("o.ply"));
        assert!(mesh.report().is_clean(), "{flags}: {}", mesh.report());
        let radii: Vec<f64> = mesh.positions.iter().map(|p| radius(&p.map(f64::from))).collect();
        let middle = radii.iter().sum::<f64>() / radii.len() as f64;
        (radii.iter().map(|radius| (radius - middle).powi(2)).sum::<f64>() / radii.len() as f64).sqrt()
    };
    let [primal, smooth] = ["", "--dual --smooth 8"].map(spread);
    assert!(smooth < 0.5 * primal, "{smooth} and {primal} samples from a ball");
}

#[test]
fn flags_that_do_not_go_together_are_refused() {
    let folder = Folder::new();
    folder.write("v.raw", &[0; 8]);
    for (flags, because) in [
        ("--smooth 2", "--dual"),
        ("--dual --smooth 9", "0 to 8"),
        ("--dual --smooth=-1", "0 to 8"),
        ("--sharp", "--dual"),
        ("--dual --crease 30", "--sharp"),
        ("--dual --sharp --crease 181", "0 to 180"),
        ("--dual --sharp --crease NaN", "0 to 180"),
        ("--dual --sharp --crease 30 --close --check", "--check"),
        ("--dual --exact", "--exact"),
        ("--dual --chunk 4", "--chunk"),
        ("--dual --check", "--close"),
    ] {
        folder.assert_refused(&format!("v.raw --shape 2,2,2 --type u8 {flags} -o o.ply"), 2, &[because]);
    }
}
