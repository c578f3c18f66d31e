//! The program on the command line: every type of sample in every format gives the mesh of the whole volume, and the
//! surface lies between the right samples, judged by the file's own numbers.

mod check;
mod chunks;
mod close;
mod dual;
mod exact;
mod layouts;
mod origin;
mod program;
mod readers;
mod refusals;
mod system;
mod volumes;

use std::collections::BTreeSet;

use marchless::{DualSettings, MeshBuffer, MeshSettings, Mesher, Samples, Shape, Weight};
use program::Folder;
use readers::Mesh;
use volumes::{TYPES, Volume, random};

/// The mesh of the whole volume at once, for numbers that fit the core's weights.
fn whole(volume: &Volume, iso: f64) -> Mesh {
    whole_by(volume, iso, None)
}

/// The mesh of the whole volume at once; with settings of the dual mesher, by that one.
fn whole_by(volume: &Volume, iso: f64, dual: Option<DualSettings>) -> Mesh {
    fn mesh<W: Weight>(volume: &Volume, isovalue: f64, dual: Option<DualSettings>, weight: impl Fn(f64) -> W) -> Mesh {
        let shape = Shape::new(volume.size.map(|n| n as u32)).expect("a small shape");
        let weights: Vec<W> = volume.samples.iter().map(|&sample| weight(sample)).collect();
        let (isovalue, mut out) = (isovalue as f32 / W::SCALE, MeshBuffer::new());
        let samples = Samples::new(shape, &weights).expect("one weight a sample");
        let meshed = match dual {
            None => {
                let settings = MeshSettings { isovalue, ..MeshSettings::default() };
                Mesher::new().mesh(samples, &settings, &mut out)
            }
            Some(settings) => Mesher::new().mesh_dual(samples, &DualSettings { isovalue, ..settings }, &mut out),
        };
        meshed.expect("it can be meshed");
        Mesh { positions: out.positions, normals: out.normals, indices: out.indices }
    }
    match volume.kind {
        "i8" => mesh(volume, iso, dual, |sample| sample as i8),
        "u8" => mesh(volume, iso - 128.0, dual, |sample| (sample - 128.0) as i8),
        "i16" => mesh(volume, iso, dual, |sample| sample as i16),
        "u16" => mesh(volume, iso - 32768.0, dual, |sample| (sample - 32768.0) as i16),
        _ => mesh(volume, 0.0, dual, |sample| (sample - iso) as f32),
    }
}

#[test]
fn every_type_in_every_format_is_the_mesh_of_the_whole_volume() {
    let folder = Folder::new();
    for (index, kind) in TYPES.into_iter().enumerate() {
        for (size, noise, iso) in [([21, 18, 16], 4.0, 100.0), ([70, 5, 9], 120.0, 101.5)] {
            let volume = Volume::ball(size, kind, [7.0, 50.0][usize::from(noise > 100.0)], noise);
            let expected = whole(&volume, iso);
            assert!(expected.positions.len() > 300 && expected.report().is_clean(), "{}", expected.report());
            let name = format!("{kind}.{}", ["raw", "RAW"][index % 2]);
            folder.write(&name, &volume.bytes());
            for format in ["ply", "obj", "stl", "glb"] {
                let said = folder.mesh(&format!("{name} {} --iso {iso} -o out.{format}", volume.flags()));
                let [x, y, z] = size;
                let (vertices, triangles) = (expected.positions.len(), expected.indices.len() / 3);
                let start = format!(
                    "out.{format}: {x} × {y} × {z} {kind}, {vertices} vertices, {triangles} triangles; read in "
                );
                assert!(said.starts_with(&start) && said.lines().count() == 1, "{said}");
            }
            assert_eq!(readers::ply(&folder.read("out.ply")), expected, "{kind}");
            assert_eq!(readers::obj(&folder.read("out.obj")), expected, "{kind}");
            assert_eq!(readers::glb(&folder.read("out.glb")).as_ref(), Some(&expected), "{kind}");
            let (facets, normals) = readers::stl(&folder.read("out.stl"));
            assert_eq!(facets, expected.corners(), "{kind}");
            for (facet, normal) in facets.iter().zip(&normals) {
                assert_is_normal_of(*normal, *facet);
            }
            let report = readers::welded(&facets).report();
            assert!(report.is_clean() && report.triangles == facets.len(), "{kind}: {report}");
        }
    }
}

/// Asserts that a facet's normal has length 1, is perpendicular to the facet, and points to the side from which the
/// corners run counter-clockwise.
#[track_caller]
fn assert_is_normal_of(normal: [f32; 3], facet: [[f32; 3]; 3]) {
    let normal = normal.map(f64::from);
    let [a, b, c] = facet.map(|corner| corner.map(f64::from));
    let [u, v] = [b, c].map(|end| [0, 1, 2].map(|axis| end[axis] - a[axis]));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    assert!((dot(normal, normal) - 1.0).abs() < 1e-6, "{normal:?}");
    assert!((dot(normal, cross) / dot(cross, cross).sqrt() - 1.0).abs() < 1e-6, "{normal:?} of {facet:?}");
}

#[test]
fn spacing_moves_positions_and_turns_normals() {
    let folder = Folder::new();
    let volume = Volume::ball([15, 18, 21], "f32", 6.0, 0.0);
    let plain = whole(&volume, 100.0);
    folder.write("ball.raw", &volume.bytes());
    let spacing = [0.5f64, 3.0, 1.25];
    folder.mesh(&format!("ball.raw {} --iso 100 --spacing 0.5,3,1.25 -o wide.ply", volume.flags()));
    let wide = readers::ply(&folder.read("wide.ply"));
    let moved = |position: &[f32; 3]| [0, 1, 2].map(|axis| (f64::from(position[axis]) * spacing[axis]) as f32);
    assert_eq!(wide.positions, plain.positions.iter().map(moved).collect::<Vec<_>>());
    assert_eq!(wide.indices, plain.indices);
    for (position, normal) in wide.positions.iter().zip(&wide.normals) {
        // The ball has become an ellipsoid: Σ (p − middle)² / spacing² = r².
        let middle = [7.0, 8.5, 10.0];
        let gradient = [0, 1, 2].map(|axis| (f64::from(position[axis]) / spacing[axis] - middle[axis]) / spacing[axis]);
        let length = gradient.iter().map(|v| v * v).sum::<f64>().sqrt();
        let cosine: f64 = (0..3).map(|axis| gradient[axis] / length * f64::from(normal[axis])).sum();
        let own_length = normal.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
        assert!((own_length - 1.0).abs() < 1e-6 && cosine > 0.995, "{normal:?}, {gradient:?}");
    }

    // Twice the same everywhere: the same normals, to the last bit.
    folder.mesh(&format!("ball.raw {} --iso 100 --spacing 2,2.0,2e0 -o twice.ply", volume.flags()));
    let twice = readers::ply(&folder.read("twice.ply"));
    assert_eq!(twice.normals, plain.normals);
    assert_eq!(twice.positions, plain.positions.iter().map(|p| p.map(|v| 2.0 * v)).collect::<Vec<_>>());
}

#[test]
fn normals_and_triangles_look_to_larger_values_or_smaller_ones() {
    let folder = Folder::new();
    let volume = Volume::ball([18, 20, 22], "u8", 7.0, 0.0);
    folder.write("ball.raw", &volume.bytes());
    folder.write("fortran.npy", &volume.npy_fortran());
    for (file, flags) in [("ball.raw", volume.flags()), ("fortran.npy", String::new())] {
        for (invert, sign) in [("", 1.0), ("--invert", -1.0)] {
            let args = format!("{file} {flags} --iso 100 {invert} --spacing 1,1,2");
            folder.mesh(&format!("{args} -o out.ply"));
            let mesh = readers::ply(&folder.read("out.ply"));
            let report = mesh.report();
            assert!(report.is_closed() && report.is_clean() && report.euler == 2, "{report}");
            // The volume of an ellipsoid, less what flat triangles cut off.
            let exact = 4.0 / 3.0 * std::f64::consts::PI * 7.0f64.powi(3) * 2.0;
            assert!((mesh.volume() * sign / exact - 1.0).abs() < 0.04, "{} of {exact}", mesh.volume());
            for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
                let out = [position[0] - 8.5, position[1] - 9.5, position[2] - 21.0];
                let along: f32 = (0..3).map(|axis| out[axis] * normal[axis]).sum();
                assert!(f64::from(along) * sign > 0.0, "{normal:?} at {position:?}");
            }
            folder.mesh(&format!("{args} -o out.stl"));
            let (facets, normals) = readers::stl(&folder.read("out.stl"));
            assert_eq!(facets, mesh.corners());
            for (facet, normal) in facets.iter().zip(&normals) {
                assert_is_normal_of(*normal, *facet);
            }
        }
    }
}

#[test]
fn numpy_arrays_are_the_same_volumes() {
    let folder = Folder::new();
    for kind in TYPES {
        let volume = Volume::ball([17, 13, 11], kind, 5.0, 30.0);
        folder.write("volume.raw", &volume.bytes());
        folder.mesh(&format!("volume.raw {} --iso 100.25 -o raw.ply", volume.flags()));
        let raw = folder.read("raw.ply");
        for version in 1..=3 {
            folder.write("volume.npy", &volume.npy(version));
            folder.mesh("volume.npy --iso 100.25 -o npy.ply");
            assert!(folder.read("npy.ply") == raw, "{kind}, version {version}");
        }
        // What is known may be said once more.
        folder.mesh(&format!("volume.npy {} --iso 100.25 -o npy.ply", volume.flags()));
        assert!(folder.read("npy.ply") == raw, "{kind}");

        // The same array in another order is the same surface, if not in the same order.
        folder.write("fortran.npy", &volume.npy_fortran());
        folder.mesh(&format!("fortran.npy {} --iso 100.25 -o fortran.ply", volume.flags()));
        let (raw, fortran) = (readers::ply(&raw), readers::ply(&folder.read("fortran.ply")));
        assert!(fortran.report().is_clean(), "{}", fortran.report());
        assert_eq!(fortran.indices.len(), raw.indices.len());
        assert!((fortran.volume() / raw.volume() - 1.0).abs() < 0.05, "{} and {}", fortran.volume(), raw.volume());
        let [sorted_raw, sorted_fortran] = [&raw, &fortran].map(|mesh| {
            let mut vertices: Vec<_> = mesh.positions.iter().zip(&mesh.normals).collect();
            vertices.sort_by_key(|(position, _)| position.map(f32::to_bits));
            vertices
        });
        assert_eq!(sorted_fortran.len(), sorted_raw.len());
        for (one, other) in sorted_fortran.iter().zip(&sorted_raw) {
            assert_eq!(one.0, other.0, "{kind}");
            assert!((0..3).all(|axis| (one.1[axis] - other.1[axis]).abs() < 1e-5), "{kind}: {one:?}, {other:?}");
        }
    }
}

/// The edges of the lattice whose ends lie on different sides, by the plain rule: the lower end and the axis.
fn crossed(volume: &Volume, iso: f64) -> BTreeSet<([usize; 3], usize)> {
    let mut edges = BTreeSet::new();
    for z in 0..volume.size[2] {
        for y in 0..volume.size[1] {
            for x in 0..volume.size[0] {
                for axis in 0..3 {
                    let mut end = [x, y, z];
                    end[axis] += 1;
                    if end[axis] < volume.size[axis] && (volume.at([x, y, z]) < iso) != (volume.at(end) < iso) {
                        edges.insert(([x, y, z], axis));
                    }
                }
            }
        }
    }
    edges
}

#[test]
fn the_surface_lies_between_the_same_samples_in_every_type() {
    let folder = Folder::new();
    for kind in TYPES {
        let (least, most) = match kind {
            "i8" => (-128.0, 127.0),
            "u8" => (0.0, 255.0),
            "i16" => (-32768.0, 32767.0),
            "u16" => (0.0, 65535.0),
            "i32" => (-2147483648.0, 2147483647.0),
            "u32" => (0.0, 4294967295.0),
            // The largest that an f64 holds, too.
            "i64" => (-9223372036854775808.0, 9223372036854774784.0),
            "u64" => (0.0, 18446744073709549568.0),
            "f32" => (f64::from(f32::MIN), f64::from(f32::MAX)),
            _ => (f64::MIN, f64::MAX),
        };
        let mut samples = vec![least, least, least + 1.0, -1.0, 0.0, 1.0, 2.0, 100.0, 101.0, most - 1.0, most, most];
        if matches!(kind, "f32" | "f64") {
            samples.extend([f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1e-45, -1e-45, 1e-310, -1e-310, 100.1]);
        }
        let volume = Volume::new([9, 4, 5], kind, |[x, y, z]| {
            samples[(random(x + 10 * y + 100 * z) * samples.len() as f64) as usize]
        });
        folder.write("mixed.raw", &volume.bytes());
        let near = [0.0, 1e-300, 1e-20, -1e-20, 0.5, 1.0, 1.0 + 1e-10, 1.0 - 1e-10, 100.1, -0.5];
        let far = [least - 1.0, least, least + 0.25, most - 0.25, most, most + 0.25, most + 1.0, 1e300, -1e300];
        for iso in near.into_iter().chain(far).filter(|iso| iso.is_finite()) {
            let output = folder.run(&format!("mixed.raw {} --iso {iso:e} -o mixed.ply", volume.flags()));
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{kind} at {iso:e}: {errors}");
            let mesh = readers::ply(&folder.read("mixed.ply"));
            let edges = mesh.positions.iter().map(|position| {
                let axis = (0..3).find(|&axis| position[axis].fract() != 0.0).expect("vertices lie on edges");
                (position.map(|v| v as usize), axis)
            });
            let edges: BTreeSet<_> = edges.collect();
            assert_eq!(edges.len(), mesh.positions.len());
            assert_eq!(edges, crossed(&volume, iso), "{kind} at {iso:e}");
            assert!(mesh.report().is_clean(), "{kind} at {iso:e}: {}", mesh.report());
            assert_eq!(errors.contains("note: there is no surface"), edges.is_empty(), "{kind} at {iso:e}: {errors}");
        }
    }
}
