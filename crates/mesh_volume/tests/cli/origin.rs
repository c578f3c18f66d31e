//! `--origin`: moves the mesh and changes nothing else.

use crate::program::Folder;
use crate::readers;
use crate::volumes::Volume;

#[test]
fn positions_begin_at_the_origin() {
    let folder = Folder::new();
    let volume = Volume::ball([15, 12, 17], "u8", 7.0, 20.0);
    folder.write("v.raw", &volume.bytes());
    folder.write("v.npy", &volume.npy_fortran());
    for input in [format!("v.raw {}", volume.flags()), "v.npy".to_owned()] {
        for flags in ["", "--invert", "--exact"] {
            let args = format!("{input} --iso 100 {flags}");
            folder.mesh(&format!("{args} -o plain.ply"));
            let plain = readers::ply(&folder.read("plain.ply"));
            // Far from 0, to the nearest 32-bit number.
            for origin in [[-3.5, 100.25, 7.0], [1e7, -1e-3, 0.1], [-1e30, 0.0, 1.0 / 3.0]] {
                for spacing in [[1.0; 3], [0.3, 2.0, 5.5]] {
                    let [[x, y, z], [dx, dy, dz]] = [origin, spacing];
                    let place = format!("--origin {x},{y},{z} --spacing {dx},{dy},{dz}");
                    folder.mesh(&format!("{args} {place} -o moved.ply"));
                    folder.mesh(&format!("{args} --spacing {dx},{dy},{dz} -o spaced.ply"));
                    let moved = readers::ply(&folder.read("moved.ply"));
                    let place = |position: &[f32; 3]| {
                        [0, 1, 2].map(|axis| (f64::from(position[axis]) * spacing[axis] + origin[axis]) as f32)
                    };
                    assert_eq!(moved.positions, plain.positions.iter().map(place).collect::<Vec<_>>());
                    assert_eq!(moved.normals, readers::ply(&folder.read("spaced.ply")).normals);
                    assert_eq!(moved.indices, plain.indices);
                }
            }
            for zero in ["0,0,0", "-0,0.0,-0e9"] {
                folder.mesh(&format!("{args} --origin {zero} -o zero.ply"));
                assert!(folder.read("zero.ply") == folder.read("plain.ply"));
            }
        }
    }
}

#[test]
fn chunks_are_checked_and_written_where_they_are() {
    let folder = Folder::new();
    // Noise, which leaves the volume all around.
    let volume = Volume::ball([15, 12, 17], "u8", 7.0, 150.0);
    folder.write("v.raw", &volume.bytes());
    for flags in ["", "--close"] {
        let args = format!("v.raw {} --iso 100 --check {flags}", volume.flags());
        for format in ["ply", "stl", "glb", "obj"] {
            folder.mesh(&format!("{args} --origin -3.5,100.25,7 -o whole.{format}"));
        }
        folder.mesh(&format!("{args} --chunk 5 -o o.ply"));
        folder.mesh(&format!("{args} --chunk 5 --origin -3.5,100.25,7 -o p.ply"));
        let names: Vec<_> = folder.names().into_iter().filter(|name| name.starts_with("o.")).collect();
        assert_eq!(names.len(), 3 * 3 * 4);
        let origin = [-3.5, 100.25, 7.0];
        for name in names {
            let (plain, moved) = (folder.read(&name), folder.read(&name.replace("o.", "p.")));
            let (plain, moved) = (readers::ply(&plain), readers::ply(&moved));
            let place = |position: &[f32; 3]| [0, 1, 2].map(|axis| (f64::from(position[axis]) + origin[axis]) as f32);
            assert_eq!(moved.positions, plain.positions.iter().map(place).collect::<Vec<_>>(), "{name}");
            assert_eq!((moved.normals, moved.indices), (plain.normals, plain.indices), "{name}");
        }
    }
}
