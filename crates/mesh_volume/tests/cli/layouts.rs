//! Equal samples in different bytes give the same mesh: big-endian, after a header, as bool and as 64-bit integers.

use crate::program::Folder;
use crate::volumes::{TYPES, Volume, header, npy, numpy_type, random};

/// NumPy's name for a type in the given byte order.
fn ordered(kind: &str, order: char) -> String {
    format!("{order}{}", &numpy_type(kind)[1..])
}

#[test]
fn big_endian_files_are_the_same_volumes() {
    let folder = Folder::new();
    for kind in TYPES {
        let volume = Volume::ball([13, 11, 9], kind, 4.0, 30.0);
        let [x, y, z] = volume.size;
        folder.write("v.raw", &volume.bytes());
        folder.mesh(&format!("v.raw {} --endian little --iso 100.25 -o little.ply", volume.flags()));
        folder.mesh(&format!("v.raw {} --iso 100.25 -o o.ply", volume.flags()));
        let expected = folder.read("o.ply");
        assert!(folder.read("little.ply") == expected && expected.len() > 10_000, "{kind}");

        folder.write("big.raw", &volume.big_endian_bytes());
        folder.mesh(&format!("big.raw {} --endian big --iso 100.25 -o big.ply", volume.flags()));
        assert!(folder.read("big.ply") == expected, "{kind}");
        let native = if cfg!(target_endian = "big") { volume.big_endian_bytes() } else { volume.bytes() };
        for (order, bytes) in [('>', volume.big_endian_bytes()), ('=', native), ('<', volume.bytes())] {
            folder.write("v.npy", &npy(1, &header(&ordered(kind, order), false, &[z, y, x]), &bytes));
            folder.mesh("v.npy --iso 100.25 -o npy.ply");
            assert!(folder.read("npy.ply") == expected, "{order}, {kind}");
        }

        folder.write("fortran.npy", &volume.npy_fortran());
        folder.mesh("fortran.npy --iso 100.25 -o fortran.ply");
        // The array with the axes reversed, in C order, is the same memory.
        let memory = Volume::new([z, y, x], kind, |[z, y, x]| volume.at([x, y, z])).big_endian_bytes();
        folder.write("big.npy", &npy(1, &header(&ordered(kind, '>'), true, &[z, y, x]), &memory));
        folder.mesh("big.npy --endian big --iso 100.25 -o big.ply");
        assert!(folder.read("big.ply") == folder.read("fortran.ply"), "{kind}");
    }
    // A single byte has no order to disagree with.
    let volume = Volume::ball([5, 4, 3], "u8", 2.0, 0.0);
    folder.write("v.npy", &volume.npy(1));
    folder.mesh("v.npy --endian big --iso 100 -o o.ply");
}

#[test]
fn bytes_before_the_samples_are_skipped() {
    let folder = Folder::new();
    let volume = Volume::ball([13, 11, 9], "i16", 4.0, 30.0);
    folder.write("v.raw", &volume.bytes());
    folder.mesh(&format!("v.raw {} --iso 100 -o o.ply", volume.flags()));
    let expected = folder.read("o.ply");
    for skip in [0, 1, 37, 5000] {
        let junk: Vec<u8> = (0..skip).map(|byte| byte as u8).collect();
        for (order, bytes) in [("little", volume.bytes()), ("big", volume.big_endian_bytes())] {
            folder.write("behind.raw", &[&junk[..], &bytes].concat());
            let args = format!("behind.raw {} --endian {order} --iso 100", volume.flags());
            folder.mesh(&format!("{args} --skip {skip} -o skipped.ply"));
            assert!(folder.read("skipped.ply") == expected, "{skip}, {order}");
            for wrong in [skip + 1, skip + 2] {
                let (length, expected) = (skip + bytes.len(), wrong + bytes.len());
                let because =
                    [&*format!("{expected} bytes long ({wrong} bytes to --skip and"), &format!("has {length}")];
                folder.assert_refused(&format!("{args} --skip {wrong} -o skipped.ply"), 2, &because);
            }
        }
    }
}

#[test]
fn bools_are_0_and_1() {
    let folder = Folder::new();
    let mask = |kind| Volume::new([9, 8, 7], kind, |[x, y, z]| random(x + 10 * (y + 10 * z)).round());
    let numbers = mask("i8");
    folder.write("v.raw", &numbers.bytes());
    folder.write("v.npy", &mask("bool").npy(1));
    folder.write("fortran.npy", &mask("bool").npy_fortran());
    folder.write("numbers.npy", &numbers.npy_fortran());
    // Whatever is not 0 is true.
    let bytes = numbers.samples.iter().enumerate().map(|(index, &sample)| sample as u8 * (1 + index as u8 % 255));
    folder.write("bool.raw", &bytes.collect::<Vec<_>>());
    for iso in [0.5, 0.3, 1.0, 1e-20] {
        folder.mesh(&format!("v.raw {} --iso {iso:e} -o o.ply", numbers.flags()));
        folder.mesh(&format!("v.npy --iso {iso:e} -o npy.ply"));
        folder.mesh(&format!("bool.raw --shape 9,8,7 --type bool --iso {iso:e} -o raw.ply"));
        let expected = folder.read("o.ply");
        assert!(folder.read("npy.ply") == expected && folder.read("raw.ply") == expected, "{iso:e}");
        folder.mesh(&format!("numbers.npy --iso {iso:e} -o o.ply"));
        folder.mesh(&format!("fortran.npy --iso {iso:e} -o npy.ply"));
        assert!(folder.read("npy.ply") == folder.read("o.ply"), "{iso:e}");
    }
    for iso in ["0", "1.1"] {
        let note = folder.mesh_noting(&format!("v.npy --iso {iso} -o o.ply"));
        assert!(note.contains("there is no surface") && note.contains("--iso 0.5 lies between them"), "{note}");
    }
}

#[test]
fn integers_beyond_the_digits_of_floats_are_told_apart() {
    let folder = Folder::new();
    let volume = Volume::new([9, 5, 4], "i32", |[x, y, z]| x as f64 - 4.0 + (y * z % 3) as f64);
    folder.write("v.raw", &volume.bytes());
    for (kind, base) in [("i64", 1 << 62), ("i64", -(1 << 62)), ("u64", 3 << 62)] {
        let bytes = volume.samples.iter().flat_map(|&sample| (base + sample as i128).to_le_bytes()[..8].to_vec());
        folder.write("long.raw", &bytes.collect::<Vec<_>>());
        // Around the base, neighbouring samples are the same number as an f64.
        folder.mesh(&format!("v.raw {} --iso 0 -o o.ply", volume.flags()));
        folder.mesh(&format!("long.raw --shape 9,5,4 --type {kind} --iso {base} -o long.ply"));
        assert!(folder.read("long.ply") == folder.read("o.ply"), "{kind} around {base}");
    }
}
