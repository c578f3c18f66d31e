//! Conditions of the system: files that replace others, a full disk, `Ctrl-C`, little memory.

use crate::program::Folder;
use crate::readers;
use crate::volumes::Volume;

#[test]
fn no_surface_is_an_empty_mesh() {
    let folder = Folder::new();
    let volume = Volume::ball([6, 6, 6], "u16", 2.0, 0.0);
    folder.write("v.raw", &volume.bytes());
    for format in ["ply", "obj", "stl", "glb"] {
        let output = folder.run(&format!("v.raw {} --iso 1e6 -o o.{format}", volume.flags()));
        assert!(output.status.success());
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("0 vertices, 0 triangles"), "{said}");
        let note = String::from_utf8_lossy(&output.stderr);
        assert!(note.starts_with("note: ") && note.contains("1000000"), "{note}");
    }
    assert!(readers::ply(&folder.read("o.ply")).positions.is_empty());
    assert!(readers::obj(&folder.read("o.obj")).positions.is_empty());
    assert!(readers::stl(&folder.read("o.stl")).0.is_empty());
    assert_eq!(readers::glb(&folder.read("o.glb")), None);
}

#[test]
fn an_old_file_is_replaced_and_the_input_stays() {
    let folder = Folder::new();
    let volume = Volume::ball([9, 9, 9], "u8", 3.0, 0.0);
    folder.write("v.raw", &volume.bytes());
    folder.write("o.ply", &[7; 1 << 20]);
    folder.mesh(&format!("v.raw {} --iso 100 -o o.ply", volume.flags()));
    assert!(readers::ply(&folder.read("o.ply")).report().is_closed());
    assert_eq!(folder.read("v.raw"), volume.bytes());
    assert_eq!(folder.names(), ["o.ply", "v.raw"]);
}

#[cfg(unix)]
mod unix {
    use std::fs::File;
    use std::os::unix::fs::{FileExt as _, PermissionsExt as _};
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    use super::*;
    use crate::program::PROGRAM;

    /// Runs the program under a shell's limits.
    fn limited(folder: &Folder, limits: &str, args: &str) -> std::process::Output {
        let line = format!("{limits}; exec \"$0\" \"$@\"");
        let mut command = Command::new("sh");
        command.current_dir(folder.path("")).arg("-c").arg(line).arg(PROGRAM).args(args.split_whitespace());
        command.output().expect("there is a shell")
    }

    #[test]
    fn others_may_read_the_mesh() {
        let folder = Folder::new();
        let volume = Volume::ball([9, 9, 9], "u8", 3.0, 0.0);
        folder.write("v.raw", &volume.bytes());
        let output = limited(&folder, "umask 022", &format!("v.raw {} --iso 100 -o o.ply", volume.flags()));
        assert!(output.status.success());
        let mode = folder.path("o.ply").metadata().expect("it is there").permissions().mode();
        assert_eq!(mode & 0o777, 0o644, "{mode:o}");
    }

    #[test]
    fn a_full_disk_leaves_nothing_behind() {
        let folder = Folder::new();
        let volume = Volume::ball([24, 24, 24], "u8", 9.0, 60.0);
        folder.write("v.raw", &volume.bytes());
        for format in ["ply", "obj", "stl", "glb"] {
            let (name, args) = (format!("o.{format}"), format!("v.raw {} --iso 100 -o o.{format}", volume.flags()));
            folder.mesh(&args);
            let whole = folder.read(&name);
            // From no room at all to all but the last 512 bytes; a program that ignores the signal is told of its full
            // file.
            let last = (whole.len() as u64 - 1) / 512;
            for blocks in [0, 1, last / 4, last / 2, last * 3 / 4, last] {
                folder.write(&name, b"old");
                let output = limited(&folder, &format!("trap '' XFSZ; ulimit -f {blocks}"), &args);
                let errors = String::from_utf8_lossy(&output.stderr);
                assert_eq!(output.status.code(), Some(1), "{format}, {blocks} blocks: {errors}");
                assert!(errors.contains(&format!("{name} cannot be written: ")), "{errors}");
                assert_eq!(folder.read(&name), b"old");
                assert!(folder.names().iter().all(|name| name.starts_with(['o', 'v'])), "{:?}", folder.names());
            }
        }
    }

    #[test]
    fn a_full_disk_leaves_no_chunk_behind() {
        let folder = Folder::new();
        let volume = Volume::ball([24, 24, 24], "u8", 9.0, 60.0);
        folder.write("v.raw", &volume.bytes());
        for format in ["ply", "obj", "stl", "glb"] {
            let args = format!("v.raw {} --iso 100 --chunk 7 -o o.{format}", volume.flags());
            folder.mesh(&args);
            let names: Vec<_> = folder.names().into_iter().filter(|name| name.starts_with("o.")).collect();
            let largest = names.iter().map(|name| folder.read(name).len()).max().expect("a chunk");
            // The first chunks fit, but the largest one does not.
            for blocks in [0, (largest as u64 - 1) / 512] {
                for name in &names {
                    folder.write(name, b"old");
                }
                let output = limited(&folder, &format!("trap '' XFSZ; ulimit -f {blocks}"), &args);
                let errors = String::from_utf8_lossy(&output.stderr);
                assert_eq!(output.status.code(), Some(1), "{format}, {blocks} blocks: {errors}");
                assert!(errors.contains(&format!(".{format} cannot be written: ")), "{errors}");
                assert!(names.iter().all(|name| folder.read(name) == b"old"));
                assert_eq!(folder.names().len(), names.len() + 1, "{:?}", folder.names());
            }
            for name in names {
                std::fs::remove_file(folder.path(&name)).expect("it is there");
            }
        }
    }

    #[test]
    fn links_in_the_place_of_chunks_stay_links() {
        let folder = Folder::new();
        let volume = Volume::ball([17, 17, 17], "u8", 6.0, 0.0);
        folder.write("v.raw", &volume.bytes());
        folder.write("elsewhere", b"old");
        let link = |to: &str, name: &str| {
            std::os::unix::fs::symlink(to, folder.path(name)).expect("the folder of tests can be written");
        };
        link("elsewhere", "o.0003.ply");
        let args = format!("v.raw {} --iso 100 --chunk 8 -o o.ply", volume.flags());
        folder.mesh(&args);
        assert!(folder.path("o.0003.ply").is_symlink());
        assert!(readers::ply(&folder.read("elsewhere")).report().is_clean());
        // The input must be neither replaced nor removed.
        link("v.raw", "o.0000.obj");
        folder.assert_refused(&args.replace("ply", "obj"), 2, &["o.0000.obj", "both the input and the output"]);
        assert_eq!(folder.read("v.raw"), volume.bytes());
    }

    #[test]
    fn chunks_take_their_places_together_or_not_at_all() {
        let folder = Folder::new();
        sparse_ball(&folder, [256, 256, 4096], 20);
        let mut command = folder.command();
        command.args("v.raw --shape 256,256,4096 --type u8 --iso 128 --chunk 128 -o o.ply".split(' '));
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
        let since = Instant::now();
        // The ball is around the corner of eight chunks. Something comes in the way of the last of them once the first
        // are there, long before the end of the volume.
        while folder.names().len() < 2 {
            assert!(since.elapsed() < Duration::from_secs(60), "it has not begun");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::fs::create_dir(folder.path("o.0007.ply")).expect("the folder of tests can be written");
        let output = child.wait_with_output().expect("it ends");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(errors.contains("o.0007.ply cannot be written: "), "{errors}");
        assert_eq!(folder.names(), ["o.0007.ply", "v.raw"]);
    }

    #[test]
    fn an_interruption_leaves_nothing_behind() {
        let folder = Folder::new();
        // Enough samples for many seconds of work, in a sparse file.
        let file = File::create(folder.path("v.raw")).expect("the folder of tests can be written");
        file.set_len(1 << 37).expect("files may have holes");
        // One sample differs near its beginning, so that the first chunk has a surface.
        file.write_all_at(&[1], 256 * 256 * 3 + 256 * 3 + 3).expect("there is room for a byte");
        let whole = "v.raw --shape 2048,2048,32768 --type u8 --iso 1 -o o.ply";
        let chunks = "v.raw --shape 256,256,2097152 --type u8 --iso 1 --chunk 128 -o o.ply";
        for (signal, args) in [("INT", whole), ("TERM", whole), ("INT", chunks), ("TERM", chunks)] {
            let mut command = folder.command();
            command.args(args.split(' '));
            let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
            let since = Instant::now();
            while folder.names().len() < 2 {
                assert!(since.elapsed() < Duration::from_secs(60), "it has not begun");
                std::thread::sleep(Duration::from_millis(5));
            }
            std::thread::sleep(Duration::from_millis(100));
            let killed = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status();
            assert!(killed.is_ok_and(|status| status.success()));
            let output = child.wait_with_output().expect("it ends");
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(130), "{errors}");
            assert!(errors.contains("interrupted"), "{errors}");
            assert_eq!(folder.names(), ["v.raw"]);
        }
    }

    /// A sparse file of so many bytes per axis, with a ball of 255 in the middle of its first cube. The rest is holes,
    /// which read as 0.
    fn sparse_ball(folder: &Folder, [size, depth, slabs]: [u64; 3], radius: i64) {
        let file = File::create(folder.path("v.raw")).expect("the folder of tests can be written");
        file.set_len(size * depth * slabs).expect("files may have holes");
        let middle = size as i64 / 2;
        for z in -radius..=radius {
            for y in -radius..=radius {
                let row: Vec<u8> = (-radius..=radius)
                    .map(|x| {
                        let distance = ((x * x + y * y + z * z) as f64).sqrt();
                        (128.0 + 30.0 * (radius as f64 - 2.0 - distance)).clamp(0.0, 255.0) as u8
                    })
                    .collect();
                let at = (middle - radius) as u64 + size * ((middle + y) as u64 + size * (middle + z) as u64);
                file.write_all_at(&row, at).expect("there is room for the ball");
            }
        }
    }

    /// Meshes such a ball in a process whose address space is limited to `mebibytes`.
    #[cfg(target_os = "linux")]
    fn mesh_in(mebibytes: u64, size: u64, radius: i64) {
        let folder = Folder::new();
        sparse_ball(&folder, [size; 3], radius);
        for format in ["ply", "stl", "glb"] {
            let args = format!("v.raw --shape {size},{size},{size} --type u8 --iso 128 --invert -o o.{format}");
            let output = limited(&folder, &format!("ulimit -v {}", 1024 * mebibytes), &args);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}: {errors}", output.status);
            println!("{}", String::from_utf8_lossy(&output.stdout));
        }
        for flags in ["--check", "--chunk 64 --check", "--close --chunk 64 --check"] {
            let args = format!("v.raw --shape {size},{size},{size} --type u8 --iso 128 --invert {flags} -o c.ply");
            let output = limited(&folder, &format!("ulimit -v {}", 1024 * mebibytes), &args);
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success() && said.contains("clean"), "{}: {said}", output.status);
            println!("{said}");
        }
        let (facets, _) = readers::stl(&folder.read("o.stl"));
        let mesh = readers::ply(&folder.read("o.ply"));
        let report = mesh.report();
        assert!(report.is_closed() && report.is_clean() && report.euler == 2, "{report}");
        assert!(facets == mesh.corners());
        assert_eq!(readers::glb(&folder.read("o.glb")), Some(mesh.clone()));
        let exact = 4.0 / 3.0 * std::f64::consts::PI * (radius as f64 - 2.0).powi(3);
        assert!((mesh.volume() / exact - 1.0).abs() < 0.02, "{} of {exact}", mesh.volume());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_mesh_that_does_not_fit_in_memory_leaves_nothing_behind() {
        let folder = Folder::new();
        // A million triangles.
        let volume = Volume::ball([70, 70, 70], "u8", 30.0, 4000.0);
        folder.write("v.raw", &volume.bytes());
        for (flags, code) in [("", 0), ("--check", 1), ("--chunk 8 --check", 0)] {
            let args = format!("v.raw {} --iso 100 {flags} -o o.ply", volume.flags());
            let output = limited(&folder, "ulimit -v 65536", &args);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(code), "{flags}: {errors}");
            assert!(code == 0 || errors.contains("the mesh does not fit in memory"), "{flags}: {errors}");
            assert!(folder.names().iter().all(|name| !name.starts_with('.')), "{flags}: {:?}", folder.names());
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_volume_may_be_larger_than_memory() {
        mesh_in(64, 512, 20);
    }

    #[test]
    #[cfg(target_os = "linux")]
    #[ignore = "reads 24 GiB of holes: cargo test --release --package mesh_volume -- --ignored gibibyte"]
    fn a_volume_of_8_gib_needs_less_than_a_gibibyte() {
        mesh_in(1024, 2048, 100);
    }
}
