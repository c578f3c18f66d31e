//! `--close`: the mesh of the volume with a layer of outside samples around it.

use std::collections::BTreeMap;

use marchless::MeshReport;
use proptest::prelude::*;

use crate::program::Folder;
use crate::readers::{self, Mesh};
use crate::volumes::{TYPES, Volume, random};

/// All types.
const KINDS: [&str; 11] = ["bool", "i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "f32", "f64"];

/// The volume with that layer around it, as differences to the isovalue. Each sample of the layer is as far from the
/// isovalue as the nearest one of the volume, but outside.
fn padded(volume: &Volume, iso: f64, invert: bool) -> Volume {
    Volume::new(volume.size.map(|samples| samples + 2), "f32", |point| {
        let nearest = [0, 1, 2].map(|axis| point[axis].saturating_sub(1).min(volume.size[axis] - 1));
        let weight = (volume.at(nearest) - iso) as f32;
        let is_within = (0..3).all(|axis| point[axis] == nearest[axis] + 1);
        // The mesher sees NaN as the largest number; what lies on the isovalue is not below it.
        f64::from(match (is_within, invert) {
            (true, _) => weight,
            (false, _) if weight.is_nan() => {
                if invert {
                    f32::MIN
                } else {
                    f32::MAX
                }
            }
            (false, true) if weight == 0.0 => -f32::from_bits(1),
            (false, true) => -weight.abs(),
            (false, false) => weight.abs(),
        })
    })
}

#[test]
fn closed_is_padded_by_hand() {
    let folder = Folder::new();
    for (index, kind) in KINDS.into_iter().enumerate() {
        // Numbers that leave a difference to the isovalue without rounding, and some that are none.
        let (iso, scale) = if kind == "bool" { (0.5, 1.0) } else { (10.5, 20.0) };
        let mut volume = Volume::new([7, 6, 8], kind, |[x, y, z]| (scale * random(x + 10 * (y + 10 * z))).round());
        if kind.starts_with('f') {
            for (place, sample) in
                [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, iso, 1e-30, 3e38].into_iter().enumerate()
            {
                volume.samples.iter_mut().skip(3 * place).step_by(29).for_each(|old| *old = sample);
            }
        }
        for (invert, flags) in [(false, ""), (true, "--invert"), (false, "--exact"), (true, "--exact --invert")] {
            let padded = padded(&volume, iso, invert);
            for (file, hand, bytes, by_hand) in [
                ("v.npy", "hand.npy", volume.npy(1), padded.npy(1)),
                ("f.npy", "g.npy", volume.npy_fortran(), padded.npy_fortran()),
            ] {
                folder.write(file, &bytes);
                folder.write(hand, &by_hand);
                let format = ["ply", "obj", "stl", "glb"][index % 4];
                for (origin, hand_origin) in [("0,0,0", "-1,-2,-0.5"), ("4,5,-6", "3,3,-6.5")] {
                    let place = format!("--spacing 1,2,0.5 {flags}");
                    folder.mesh(&format!("{file} --iso {iso} --close --origin {origin} {place} -o o.{format}"));
                    folder.mesh(&format!("{hand} --iso 0 --origin {hand_origin} {place} -o p.{format}"));
                    assert!(
                        folder.read(&format!("o.{format}")) == folder.read(&format!("p.{format}")),
                        "{kind} {flags}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_full_volume_is_a_box() {
    let folder = Folder::new();
    for kind in KINDS {
        for (sample, flags) in [(0.0, "--iso 0.5"), (1.0, "--iso 0.5 --invert"), (1.0, "--iso 1 --invert")] {
            let volume = Volume::new([4, 5, 6], kind, |_| sample);
            folder.write("v.raw", &volume.bytes());
            let args = format!("v.raw {} {flags} --check -o o.ply", volume.flags());
            assert!(folder.mesh_noting(&args).contains("there is no surface"));
            let said = folder.mesh(&format!("{args} --close"));
            assert!(said.starts_with("o.ply: closed, clean: "), "{said}");
            let mesh = readers::ply(&folder.read("o.ply"));
            assert_eq!((mesh.report().components, mesh.report().euler), (1, 2));
            // Half a sample beyond the outermost samples, and near those that lie on the isovalue.
            let beyond = if flags.contains('1') { 1.0 / 1024.0 } else { 0.5 };
            for axis in 0..3 {
                let along = || mesh.positions.iter().map(|position| position[axis]);
                let last = (volume.size[axis] - 1) as f32;
                assert_eq!(along().reduce(f32::min), Some(-beyond), "{kind} {flags}");
                assert_eq!(along().reduce(f32::max), Some(last + beyond), "{kind} {flags}");
            }
            let [x, y, z] = [3.0, 4.0, 5.0].map(|side| side + 2.0 * f64::from(beyond));
            assert!(mesh.volume() < x * y * z && mesh.volume() > 0.9 * x * y * z, "{} in {kind}", mesh.volume());
            // On a wall away from its edges, normals are the wall's.
            for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
                let is_inner = |axis: usize| position[axis] >= 1.0 && position[axis] <= (volume.size[axis] - 2) as f32;
                if is_inner(1) && is_inner(2) {
                    assert_eq!(*normal, [position[0].signum(), 0.0, 0.0], "{kind} {flags}");
                }
            }
        }
    }
}

#[test]
fn an_empty_volume_stays_empty() {
    let folder = Folder::new();
    for kind in KINDS {
        for (sample, flags) in [(1.0, "--iso 0.5"), (1.0, "--iso 1"), (0.0, "--iso 0.5 --invert")] {
            let volume = Volume::new([4, 2, 3], kind, |_| sample);
            folder.write("v.raw", &volume.bytes());
            let note = folder.mesh_noting(&format!("v.raw {} {flags} --close --check -o o.ply", volume.flags()));
            assert!(note.contains("there is no surface"), "{note}");
        }
    }
}

/// The lattice edges that the surface crosses, and where, for edges within the volume.
fn within(mesh: &Mesh, size: [usize; 3]) -> BTreeMap<([i32; 3], usize), f32> {
    let vertices = mesh.positions.iter().filter_map(|position| {
        let is_within = (0..3).all(|axis| position[axis] >= 0.0 && position[axis] <= (size[axis] - 1) as f32);
        let axis = (0..3).find(|&axis| position[axis].fract() != 0.0)?;
        is_within.then(|| ((position.map(|v| v.floor() as i32), axis), position[axis]))
    });
    vertices.collect()
}

#[test]
fn the_surface_within_stays_where_it_is() {
    let folder = Folder::new();
    for kind in TYPES {
        let volume = Volume::ball([9, 8, 7], kind, 5.0, 60.0);
        folder.write("v.raw", &volume.bytes());
        folder.mesh(&format!("v.raw {} --iso 100.25 -o open.ply", volume.flags()));
        folder.mesh(&format!("v.raw {} --iso 100.25 --close -o closed.ply", volume.flags()));
        let [open, closed] = ["open.ply", "closed.ply"].map(|name| readers::ply(&folder.read(name)));
        assert!(!open.report().is_closed() && closed.report().is_closed(), "{kind}");
        let [open, closed] = [open, closed].map(|mesh| within(&mesh, volume.size));
        assert!(open.keys().eq(closed.keys()) && open.len() > 100, "{kind}");
        assert!(open.values().zip(closed.values()).all(|(a, b)| (a - b).abs() < 1e-5), "{kind}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn the_mesh_is_closed_and_clean(
        size in prop::array::uniform3(2usize..9),
        kind in prop::sample::select(&KINDS[..]),
        seed in 0usize..1000,
        share in 0.0..1.0f64,
        (fortran, invert, exact) in any::<(bool, bool, bool)>(),
        cells in 2usize..5,
        iso in prop::sample::select(&[0.5, 1.0][..]),
    ) {
        // A few numbers, of which many are equal; those that are none, too.
        let numbers = [0.0, 1.0, 2.0, 5.0, 1.0, 7.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e-300];
        let count = if kind.starts_with('f') { numbers.len() } else { 6 };
        let volume = Volume::new(size, kind, |[x, y, z]| {
            let place = seed + 1000 * (x + 10 * (y + 10 * z));
            if random(place) < share { 0.0 } else { numbers[(random(place + 500_000) * count as f64) as usize] }
        });
        let folder = Folder::new();
        folder.write("v.npy", &if fortran { volume.npy_fortran() } else { volume.npy(1) });
        let mut args = format!("v.npy --iso {iso} --close --check");
        for flag in [(invert, " --invert"), (exact, " --exact")] {
            args += if flag.0 { flag.1 } else { "" };
        }
        let output = folder.run(&format!("{args} -o o.ply"));
        let errors = String::from_utf8_lossy(&output.stderr);
        let said = String::from_utf8_lossy(&output.stdout);
        prop_assert!(output.status.success(), "{errors}{said}");
        prop_assert!(said.starts_with("o.ply: closed, clean: "), "{said}");
        let mesh = readers::ply(&folder.read("o.ply"));
        let solid = volume.samples.iter().filter(|&&sample| (sample < iso) != invert).count();
        prop_assert_eq!(mesh.volume() > 0.0, solid > 0);
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let length = normal.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
            prop_assert!((length - 1.0).abs() < 1e-5, "{normal:?}");
            for axis in 0..3 {
                let last = (size[axis] - 1) as f32;
                prop_assert!(position[axis] >= -0.5 && position[axis] <= last + 0.5, "{position:?}");
            }
        }

        // All chunks together have every triangle.
        let output = folder.run(&format!("{args} --chunk {cells} -o c.ply"));
        prop_assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let chunks = folder.names().into_iter().filter(|name| name.starts_with("c."));
        let mut facets: Vec<_> = chunks.flat_map(|name| readers::ply(&folder.read(&name)).corners()).collect();
        let welded = readers::welded(&facets);
        let report = MeshReport::new(&welded.positions, &welded.indices);
        prop_assert!(report.is_closed() && report.is_clean(), "{report}");
        let mut expected = mesh.corners();
        for facets in [&mut facets, &mut expected] {
            facets.sort_by_key(|facet| facet.map(|corner| corner.map(f32::to_bits)));
        }
        prop_assert_eq!(facets, expected);
    }
}
