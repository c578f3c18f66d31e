//! Bad input gets one clear sentence and code 2, and leaves no file behind.

use crate::program::Folder;
use crate::readers;
use crate::volumes::{Volume, header, npy};

#[test]
fn bad_flags_are_refused() {
    let folder = Folder::new();
    folder.write("v.raw", &[0; 8]);
    for shape in ["1,2,2", "2,0,2", "2,2", "2,2,2,2", "-2,2,2", "a,b,c", "2.0,2,2", "4294967296,2,2", ","] {
        let because = ["three whole numbers from 2 to 4294967295", "--shape"];
        folder.assert_refused(&format!("v.raw --shape {shape} --type u8 -o o.ply"), 2, &because);
    }
    for spacing in ["0,1,1", "1,-1,1", "1,1", "1,1,1,1", "NaN,1,1", "1,inf,1", "x"] {
        let args = format!("v.raw --shape 2,2,2 --type u8 --spacing {spacing} -o o.ply");
        folder.assert_refused(&args, 2, &["three numbers above 0", "--spacing"]);
    }
    for spacing in ["1e38,1,1e39", "1,1,1e-40"] {
        let args = format!("v.raw --shape 2,2,2 --type u8 --spacing {spacing} -o o.ply");
        folder.assert_refused(&args, 2, &["a spacing of", "32-bit"]);
    }
    for origin in ["1,1", "1,1,1,1", "NaN,1,1", "1,-inf,1", "1,1,1e999", "x", ""] {
        let args = format!("v.raw --shape 2,2,2 --type u8 --origin={origin} -o o.ply");
        folder.assert_refused(&args, 2, &["three finite numbers", "--origin"]);
    }
    for origin in ["1e39,0,0", "0,-1e300,0", "0,0,3.4028234e38 --spacing 1,1,1e33"] {
        let args = format!("v.raw --shape 2,2,2 --type u8 --origin {origin} -o o.ply");
        folder.assert_refused(&args, 2, &["an origin of", "32-bit"]);
    }
    for skip in ["-1", "1.5", "1e3", "18446744073709551616", "x"] {
        let args = format!("v.raw --shape 2,2,2 --type u8 --skip {skip} -o o.ply");
        folder.assert_refused(&args, 2, &["a whole number of bytes from 0", "--skip"]);
    }
    folder.assert_refused("v.raw --shape 2,2,2 --type u8 --endian middle -o o.ply", 2, &["--endian", "little, big"]);
    for shape in ["4294967294,2,2", "2,2,4294967295"] {
        let because = ["2 × 2", "at most 4294967293"];
        folder.assert_refused(&format!("v.raw --shape {shape} --type u8 --close -o o.ply"), 2, &because);
    }
    for iso in ["NaN", "inf", "-inf", "-", "1e999", "high"] {
        folder.assert_refused(&format!("v.raw --shape 2,2,2 --type u8 --iso {iso} -o o.ply"), 2, &["finite number"]);
    }
    folder.assert_refused(
        "v.raw --shape 2,2,2 --type f16 -o o.ply",
        2,
        &["f16", "[possible values: bool, i8, u8, i16, u16, i32, u32, i64, u64, f32, f64]"],
    );
    folder.assert_refused("v.raw --shape 2,2,2 -o o.ply", 2, &["--type is needed"]);
    folder.assert_refused("v.raw --type u8 -o o.ply", 2, &["--shape is needed"]);
    folder.assert_refused("v.raw --shape 2,2,2 --type u8", 2, &["--output"]);
    folder.assert_refused("", 2, &["IN.{raw,npy}"]);
}

#[test]
fn isovalues_below_zero_need_no_tricks() {
    let folder = Folder::new();
    let volume = Volume::new([6, 6, 6], "i8", |[x, _, _]| x as f64 - 5.0);
    folder.write("v.raw", &volume.bytes());
    for iso in ["--iso -3", "--iso=-3", "--iso -3.0", "--iso -30e-1", "--iso=-3e0"] {
        folder.mesh(&format!("v.raw {} {iso} -o o.ply", volume.flags()));
        let mesh = readers::ply(&folder.read("o.ply"));
        // Samples of -3 lie on the surface, and so outside; crossings stay off them by 1/1024.
        assert!(mesh.positions.iter().all(|p| (p[0] - 2.0).abs() < 0.002), "{iso}: {:?}", mesh.positions[0]);
        assert_eq!((mesh.positions.len(), mesh.indices.len()), (36, 150));
        // A missing isovalue must not swallow the next flag.
        folder.assert_refused(&format!("v.raw {} --iso -o p.ply", volume.flags()), 2, &["p.ply"]);
    }
}

#[test]
fn bad_files_are_refused() {
    let folder = Folder::new();
    folder.write("v.raw", &[0; 8]);
    folder.write("v.dat", &[0; 8]);
    folder.write("empty.raw", &[]);
    std::fs::create_dir(folder.path("folder.raw")).expect("the folder of tests can be written");
    std::fs::create_dir(folder.path("folder.ply")).expect("the folder of tests can be written");
    let flags = "--shape 2,2,2 --type u8";
    for (args, because) in [
        (format!("missing.raw {flags} -o o.ply"), &["missing.raw cannot be read"][..]),
        (format!("folder.raw {flags} -o o.ply"), &["folder.raw", "not a file"]),
        (format!("v.dat {flags} -o o.ply"), &["v.dat", ".raw or .npy"]),
        (format!("v.raw {flags} -o o.pny"), &["o.pny", ".ply, .obj, .stl or .glb"]),
        (format!("v.raw {flags} -o o"), &["o cannot be written", ".ply, .obj, .stl or .glb"]),
        (format!("v.raw {flags} -o missing/o.ply"), &["no folder missing"]),
        (format!("v.raw {flags} -o folder.ply"), &["folder.ply", "not a file"]),
        (format!("v.raw {flags} -o v.raw"), &["both the input and the output"]),
        (format!("v.raw {flags} -o folder.ply/../v.raw"), &["both the input and the output"]),
        (format!("empty.raw {flags} -o o.ply"), &["8 bytes", "has 0"]),
        ("v.raw --shape 2,2,3 --type u8 -o o.ply".into(), &["12 bytes", "2 × 2 × 3", "u8", "has 8"]),
        (format!("v.raw {flags} --skip 4 -o o.ply"), &["12 bytes", "4 bytes to --skip and 2 × 2 × 2", "u8", "has 8"]),
        ("v.raw --shape 2,2,2 --type i16 --skip 3 -o o.ply".into(), &["19 bytes", "3 bytes to --skip", "i16", "has 8"]),
        ("v.raw --shape 3,2,2 --type u8 -o o.ply".into(), &["12 bytes", "0 bytes to --skip", "has 8"]),
        (
            format!("v.raw {flags} --skip 18446744073709551615 -o o.ply"),
            &["15 bytes to --skip", "more bytes than any file"],
        ),
        (format!("v.raw {flags} --skip 18446744073709551607 -o o.ply"), &["18446744073709551615 bytes", "has 8"]),
        ("v.raw --shape 2,2,2 --type f64 -o o.ply".into(), &["64 bytes", "f64", "has 8"]),
        ("v.raw --shape 4294967295,4294967295,4294967295 --type u8 -o o.ply".into(), &["more bytes than any file"]),
        ("v.raw --shape 4294967295,2147483647,2 --type u8 -o o.ply".into(), &["18446744060824649730 bytes", "has 8"]),
        ("v.raw --shape 4294967295,1073741824,4 --type i16 -o o.ply".into(), &["more bytes than any file"]),
    ] {
        folder.assert_refused(&args, 2, because);
    }
}

#[test]
fn bad_numpy_files_are_refused() {
    let folder = Folder::new();
    let good = header("<i2", false, &[3, 4, 5]);
    let data = [0; 120];
    let assert_refused = |file: &[u8], because: &[&str]| {
        folder.write("v.npy", file);
        folder.assert_refused("v.npy -o o.ply", 2, &[because, &["v.npy"]].concat());
    };
    let file = npy(1, &good, &data);
    assert_refused(b"", &["does not begin as a .npy file"]);
    assert_refused(&file[..7], &["does not begin as a .npy file"]);
    assert_refused(b"\x93NUMPX\x01\x00 and more", &["does not begin as a .npy file"]);
    assert_refused(&file[..8], &["ends within its .npy header", "2 more bytes", "0 came"]);
    assert_refused(&file[..50], &["ends within its .npy header", "118 more bytes", "40 came"]);
    assert_refused(&file[..247], &["248 bytes", "has 247", "5 × 4 × 3", "i16", "128 bytes of header"]);
    assert_refused(&[&file[..], &[0]].concat(), &["248 bytes", "has 249"]);
    for version in [0, 4, 255] {
        assert_refused(&[b"\x93NUMPY", &[version, 0][..], &[0; 90]].concat(), &["version", "1.0, 2.0 and 3.0"]);
    }
    assert_refused(&[b"\x93NUMPY\x02\x00", &[255; 9][..]].concat(), &["4294967295 bytes long"]);

    let assert_header_refused = |text: &str, because: &[&str]| assert_refused(&npy(1, text, &data), because);
    for shape in ["0, 4, 5", "3, 1, 5", "3, 4, 4294967296"] {
        let shape = good.replace("3, 4, 5", shape);
        assert_header_refused(&shape, &["at least 2", "along x, y and z"]);
    }
    assert_header_refused(&good.replace("3, 4, 5", "0, 4, 7"), &["7 × 4 × 0"]);
    assert_header_refused(&good.replace("3, 4, 5", "3, 4, 18446744073709551616"), &["a length of up to 64 bits"]);
    assert_header_refused(&good.replace("3, 4, 5", "3, -4, 5"), &["a length of up to 64 bits", "-4"]);
    assert_header_refused(
        &good.replace("3, 4, 5", "4294967295, 4294967295, 4294967295"),
        &["more bytes than any file"],
    );
    for (shape, axes) in [("", "0 axes"), ("60,", "1 axes"), ("12, 5", "2 axes"), ("3, 2, 2, 5", "4 axes")] {
        assert_header_refused(&good.replace("3, 4, 5", shape), &[axes, "a volume has 3"]);
    }
    for found in ["<f2", ">f2", "<b2", "<c8", "|O", "<U3", "i2", "", "<", "|i2", "|f8", "+i2", "é"] {
        assert_header_refused(&good.replace("<i2", found), &["its "]);
    }
    assert_header_refused(&good.replace("<i2", "<c16"), &["<c16", "b1, i1, u1, i2, u2, i4, u4, i8, u8, f4 and f8"]);
    assert_header_refused(&good.replace("'<i2'", "[('a', '<i2')]"), &["a record"]);
    for text in [
        "",
        "{",
        "}",
        "{}",
        "((((((((((",
        "{'descr': '<i2'",
        "{'descr': '<i2', 'fortran_order': False}",
        "{'descr': '<i2', 'shape': (3, 4, 5)}",
        "{'fortran_order': False, 'shape': (3, 4, 5)}",
        &good.replace("False", "false"),
        &good.replace("False", "0"),
        &good.replace("'shape'", "'Shape'"),
        &good.replace("'shape'", "shape"),
        &good.replace('{', "{'more': 1, "),
        &good.replace('{', "{'descr': '<i2', "),
        &good.replace(')', ""),
        &good.replace('(', "["),
        &good.replace(", '", "; '"),
        &good.replace("descr", "de\\x73cr"),
        &format!("{good} {good}"),
        &format!("{good}é"),
    ] {
        assert_header_refused(text, &["its .npy header"]);
    }
    // Damage to any byte of the header must not cause a panic.
    for at in 0..file.len() - data.len() {
        for byte in [0, b'\'', b'9', 0xff] {
            let mut damaged = file.clone();
            damaged[at] = byte;
            folder.write("damaged.npy", &damaged);
            let code = folder.run("damaged.npy -o damaged.ply").status.code();
            assert!(matches!(code, Some(0 | 2)), "byte {at} as {byte}: {code:?}");
        }
    }
}

#[test]
fn flags_and_headers_must_agree() {
    let folder = Folder::new();
    let volume = Volume::ball([5, 4, 3], "i16", 2.0, 0.0);
    folder.write("v.npy", &volume.npy(1));
    folder.assert_refused("v.npy --shape 3,4,5 -o o.ply", 2, &["5 × 4 × 3", "3,4,5"]);
    folder.assert_refused("v.npy --type u16 -o o.ply", 2, &["i16", "u16"]);
    folder.assert_refused("v.npy --endian big -o o.ply", 2, &["v.npy", "little-endian", "--endian says big"]);
    folder.assert_refused("v.npy --skip 10 -o o.ply", 2, &["v.npy", "128 bytes before", "--skip says 10"]);
    folder.assert_refused("v.npy --skip 0 -o o.ply", 2, &["128 bytes before", "--skip says 0"]);
    folder.mesh("v.npy --shape 5,4,3 --type i16 --endian little --skip 128 --iso 100 -o o.ply");
    // Python 2's, and any spaces.
    let old = header("<i2", false, &[3, 4, 5]).replace("(3, 4, 5)", "( 3L ,4L,\n5L )").replace('\'', "\"");
    folder.write("old.npy", &npy(1, &old, &volume.bytes()));
    folder.mesh("old.npy --shape 5,4,3 --type i16 --iso 100 -o old.ply");
    assert!(folder.read("old.ply") == folder.read("o.ply"));
}
