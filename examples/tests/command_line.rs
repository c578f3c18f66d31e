//! What `sculpt`, `ambiguous_cells`, `cellular_caves`, `falling_pieces` and `flyover` say and return: bad input gets
//! one clear sentence and code 2, the headless runs make meshes without defects, `ambiguous_cells` prints its figures,
//! what `falling_pieces` cuts loose comes to rest, and `flyover` counts what it loads. And the pictures of the pages of
//! documentation are of the programs on them.

mod common;

use std::fs;
use std::path::Path;
use std::process::Output;

use bevy_marchless::marchless::MeshReport;
use common::{example, folder_of_tests};

fn run(name: &str, args: &[&str]) -> Output {
    example(name)
        .args(args)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .expect("the example can be run")
}

#[track_caller]
fn assert_refused(args: &[&str], because: &str) {
    assert_refused_by("sculpt", args, because);
}

#[track_caller]
fn assert_refused_by(name: &str, args: &[&str], because: &str) {
    let output = run(name, args);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?} ended with {}:\n{errors}", output.status);
    assert!(errors.contains(because), "{args:?} said:\n{errors}");
    assert!(!errors.contains("panicked"), "{args:?} said:\n{errors}");
}

#[test]
fn bad_numbers_are_refused() {
    let map = ["--heightmap", "map.png", "--metres-per-pixel"];
    for pair in ["0,1", "1", "1,-2", "NaN,1", "1,inf", "a,b", ""] {
        assert_refused(&[&map[..], &[pair, "--metres-per-unit", "1"]].concat(), "two numbers above 0");
    }
    for number in ["0", "NaN", "-1", "inf", "one"] {
        for flag in ["--metres-per-unit", "--voxel-size", "--exaggerate"] {
            assert_refused(&[&map[..], &["1,1", &format!("{flag}={number}")]].concat(), "a number above 0");
        }
    }
    for size in ["0,100", "100", "9000,100", "1e2,1e2"] {
        assert_refused(&["--screenshot", "a.png", "--size", size], "whole numbers from 16 to 8192");
    }
    for place in ["0.5", "2,0", "0.5,0.5,NaN", "0.5,0.5,1000", "0.5,NaN"] {
        assert_refused(&["--screenshot", "a.png", "--dig", place], "two numbers from 0 to 1");
    }
    assert_refused(&["--heightmap", "map.png"], "--metres-per-pixel");
    assert_refused(&["--exaggerate", "2"], "--heightmap");
    assert_refused(&["--size", "640,360"], "--screenshot");
}

#[test]
fn bad_height_maps_are_refused() {
    let folder = folder_of_tests();
    let write = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).expect("the folder of tests can be written");
    };
    let picture = |color: png::ColorType, depth: png::BitDepth, bytes: usize| {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 64, 64);
        encoder.set_color(color);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().expect("a header");
        // Noise, so that it does not shrink to nothing.
        let noise = (0..bytes as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect::<Vec<_>>();
        writer.write_image_data(&noise).expect("as many samples as the header says");
        drop(writer);
        file
    };
    write("grey8.png", &picture(png::ColorType::Grayscale, png::BitDepth::Eight, 64 * 64));
    write("color.png", &picture(png::ColorType::Rgb, png::BitDepth::Sixteen, 64 * 64 * 6));
    let whole = picture(png::ColorType::Grayscale, png::BitDepth::Sixteen, 64 * 64 * 2);
    write("cut.png", &whole[..whole.len() / 2]);
    write("whole.png", &whole);
    write("text.png", b"elevation");
    write("empty.png", b"");

    let scale = ["--metres-per-pixel", "1,1", "--metres-per-unit", "1"];
    for (file, because) in [
        ("grey8.png", "16-bit grey"),
        ("color.png", "16-bit grey"),
        ("cut.png", "cut short"),
        ("text.png", "PNG"),
        ("empty.png", "PNG"),
        ("missing.png", "missing.png"),
    ] {
        assert_refused(&[&["--headless", "--heightmap", file], &scale[..]].concat(), because);
    }
    let tiny = [&["--headless", "--heightmap", "whole.png", "--voxel-size", "1e-6"], &scale[..]].concat();
    assert_refused(&tiny, "extent");
}

#[test]
fn files_that_cannot_be_written_are_refused() {
    let missing = "missing_folder/a";
    assert_refused(&["--headless", "--out", &format!("{missing}.glb")], "no folder missing_folder");
    assert_refused(&["--screenshot", &format!("{missing}.png")], "no folder missing_folder");
    assert_refused(&["--headless", "--out", "."], "folder");
    assert_refused(&["--screenshot", "a.jpg"], ".png");
}

#[test]
fn without_a_display_it_runs_headless_and_writes_a_closed_mesh() {
    let path = folder_of_tests().join("tunnel.glb");
    let _ = fs::remove_file(&path);
    let output = run("sculpt", &["--out", "tunnel.glb"]);
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}:\n{said}{errors}", output.status);
    assert!(said.contains("this is the headless run"), "{said}");

    let file = fs::read(&path).expect("the mesh was written");
    let mut gltf = gltf::Gltf::from_slice(&file).expect("it is valid glTF");
    let bytes = gltf.blob.take().expect("it holds the mesh");
    let primitive = gltf.meshes().next().and_then(|mesh| mesh.primitives().next()).expect("there is a mesh");
    let reader = primitive.reader(|_| Some(&bytes));
    let positions: Vec<[f32; 3]> = reader.read_positions().expect("positions").collect();
    let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
    let normals = reader.read_normals().expect("normals").count();
    let report = MeshReport::new(&positions, &indices);
    assert!(report.triangles > 10_000 && report.is_closed() && report.is_clean(), "{report}");
    assert_eq!(normals, positions.len());
    // The tunnel goes through: the surface has a hole.
    assert!(report.euler <= 2 * report.components as i64 - 2, "{report}");
}

#[test]
fn bad_cells_are_refused() {
    let refused = |args: &[&str], because| assert_refused_by("ambiguous_cells", args, because);
    for weights in
        ["", "1", "0,0,0,0,0,0,0", "0,0,0,0,0,0,0,0,0", "0,0,0,0,0,0,0,a", "0,0,0,0,0,0,0,NaN", "-2,0,0,0,0,0,0,0"]
    {
        refused(&["--weights", weights], "eight numbers from -1 to 1");
    }
    for isovalue in ["", "2", "NaN", "-inf", "none"] {
        refused(&["--isovalue", isovalue], "a number from -1 to 1");
    }
    refused(&["--size", "640,360"], "--screenshot");
    refused(&["--screenshot", "a.png", "--size", "1,1"], "whole numbers from 16 to 8192");
    refused(&["--screenshot", "a.jpg"], ".png");
    refused(&["--screenshot", "missing_folder/a.png"], "no folder missing_folder");
}

#[test]
fn without_a_display_a_cell_s_figures_are_printed() {
    let output = run("ambiguous_cells", &["--weights", "-1,1,1,1,1,1,1,0.5", "--isovalue", "-0.25"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}:\n{said}{}", output.status, String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("these are the figures alone"), "{said}");
    let corner = "1 triangle, 1 component, Euler characteristic 1, 0 interior vertices";
    for topology in ["Separated", "Trilinear"] {
        assert!(said.contains(&format!("Topology::{topology}: {corner}\n")), "{said}");
    }
    assert!(said.contains("1 component, Euler characteristic 1\n"), "the interpolant is one disc, too:\n{said}");
}

/// Case 4: opposite corners inside, which only a tunnel can join.
#[test]
fn the_topologies_of_a_cell_with_a_tunnel_differ() {
    let output = run("ambiguous_cells", &["--weights", "-1,0.1,0.3,0.3,0.3,0.1,0.1,-1"]);
    let said = String::from_utf8_lossy(&output.stdout);
    for (view, topology) in [
        ("Topology::Separated", "2 components, Euler characteristic 2,"),
        ("Topology::Trilinear", "1 component, Euler characteristic 0,"),
        ("trilinear interpolant, refined", "1 component, Euler characteristic 0"),
    ] {
        let line = said.lines().find(|line| line.starts_with(view)).unwrap_or_default();
        assert!(line.contains(topology), "{said}");
    }
}

#[test]
fn bad_caves_are_refused() {
    let refused = |args: &[&str], because| assert_refused_by("cellular_caves", args, because);
    for flag in ["--fill", "--cut"] {
        for share in ["", "2", "NaN", "-0.1", "half"] {
            refused(&[&format!("{flag}={share}")], "a number from 0 to 1");
        }
    }
    refused(&["--birth", "28"], "0..=27");
    refused(&["--survival=-1"], "0..=27");
    refused(&["--steps", "31"], "0..=30");
    for edge in ["15", "257"] {
        refused(&["--edge", edge], "16..=256");
    }
    refused(&["--size", "640,360"], "--screenshot");
    refused(&["--headless", "--out", "missing_folder/a.glb"], "no folder missing_folder");
    refused(&["--screenshot", "a.jpg"], ".png");
}

#[test]
fn without_a_display_caves_grow_the_same_from_the_same_seed() {
    let grow = |seed: &str, file: &str| {
        let path = folder_of_tests().join(file);
        let _ = fs::remove_file(&path);
        let output = run("cellular_caves", &["--edge", "33", "--cut", "0", "--caves", "--seed", seed, "--out", file]);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{}:\n{said}{}", output.status, String::from_utf8_lossy(&output.stderr));
        assert!(said.contains("this is the headless run"), "{said}");
        // All but the largest cave are filled.
        assert!(said.contains("mesh: closed, clean") && said.contains(" triangles, 1 component,"), "{said}");
        fs::read(path).expect("the mesh was written")
    };
    let caves = grow("3", "caves_3.glb");
    assert!(caves == grow("3", "caves_3_again.glb"), "the same seed makes other caves");
    assert!(caves != grow("4", "caves_4.glb"), "another seed makes the same caves");
}

/// Where nothing survives there is no rock to see, and where nothing dies no cave.
#[test]
fn caves_may_be_all_or_nothing() {
    let air = |args: &[&str]| {
        let args = [&["--headless", "--edge", "16", "--out", "nothing.glb"], args].concat();
        let output = run("cellular_caves", &args);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{}:\n{said}{}", output.status, String::from_utf8_lossy(&output.stderr));
        said.lines().find(|line| line.starts_with("air: ")).expect("the share of air").to_owned()
    };
    assert_eq!(air(&["--birth", "27", "--survival", "27"]), "air: 100.00 %, of which 100.00 % are the largest cave");
    assert_eq!(air(&["--birth", "0"]), "air: 0.00 %, of which 0.00 % are the largest cave");
    assert_eq!(air(&["--fill", "1", "--survival", "0"]), "air: 0.00 %, of which 0.00 % are the largest cave");
}

#[test]
fn the_pictures_of_bits_are_of_the_page_s_functions() {
    assert_drawn("../crates/marchless/docs/bits.md", "bits_pictures/snippets.rs", 5);
}

#[test]
fn the_pictures_of_sources_are_of_the_page_s_functions() {
    assert_drawn("../crates/bevy_marchless/docs/sources.md", "source_pictures/snippets.rs", 9);
}

/// What stands before `fn main` in the page's programs, but for `use`, stands in the same words in what is drawn.
#[track_caller]
fn assert_drawn(page: &str, snippets: &str, programs: usize) {
    let read = |path: &str| fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect("it is there");
    let page = read(page);
    let drawn = read(snippets).replace("pub(crate) fn ", "fn ");
    let found: Vec<&str> = page.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert_eq!(found.len(), programs);
    for program in found {
        let (functions, _) = program.split_once("fn main()").expect("a program");
        let (_, functions) = functions.split_once("\n\n").expect("`use` lines come first");
        assert!(drawn.contains(functions.trim_end()), "these are not in {snippets}:\n{functions}");
    }
}

#[test]
fn pictures_of_the_pages_refuse_what_they_do_not_know() {
    for name in ["bits_pictures", "source_pictures"] {
        assert_refused_by(name, &["rubbish", "a.png"], "possible values");
        assert_refused_by(name, &["caves", "a.jpg"], ".png");
        assert_refused_by(name, &["caves", "missing_folder/a.png"], "no folder missing_folder");
    }
}

#[test]
fn falling_pieces_refuses_what_it_does_not_know() {
    let refused = |args: &[&str], because| assert_refused_by("falling_pieces", args, because);
    refused(&["--screenshot", "a.png", "--moment", "never"], "before, falling, rest");
    refused(&["--moment", "rest"], "--screenshot");
    refused(&["--headless", "--screenshot", "a.png"], "--headless");
    refused(&["--screenshot", "a.jpg"], ".png");
    refused(&["--screenshot", "missing_folder/a.png"], "no folder missing_folder");
}

#[test]
fn without_a_display_a_piece_falls_and_comes_to_rest() {
    let output = run("falling_pieces", &[]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}:\n{said}{}", output.status, String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("this is the headless run"), "{said}");
    let number = |line: &str, before: &str| -> Option<u32> {
        let (_, rest) = said.lines().find(|said| said.contains(line))?.split_once(before)?;
        rest.split(' ').next()?.parse().ok()
    };
    let [free, at_rest] = ["hangs free", "is at rest"].map(|line| number(line, "island of "));
    assert!(free.is_some_and(|volume| volume > 5_000) && free == at_rest, "{said}");
    // As far as the gap is high.
    let steps = number("is at rest", "at rest, ");
    assert!(steps.is_some_and(|steps| (4..=20).contains(&steps)), "{said}");
}

#[test]
fn bad_flights_are_refused() {
    let refused = |args: &[&str], because| assert_refused_by("flyover", args, because);
    for radius in ["", "0", "63", "4097", "-100", "NaN", "inf", "far"] {
        refused(&[&format!("--radius={radius}")], "a number from 64 to 4096");
    }
    for speed in ["", "-1", "NaN", "1e9", "fast"] {
        refused(&[&format!("--speed={speed}")], "a number from 0 to 100000");
    }
    for frames in ["", "0", "-1", "1.5", "10000001", "many"] {
        refused(&["--headless", &format!("--frames={frames}")], "--frames");
    }
    refused(&["--look", "6"], "--look");
    refused(&["--size", "640,360"], "--screenshot");
    refused(&["--moment", "back"], "--screenshot");
    refused(&["--screenshot", "a.png", "--moment", "never"], "arrived, dug, back");
    refused(&["--headless", "--screenshot", "a.png"], "--headless");
    refused(&["--headless", "--triangles"], "--triangles");
    refused(&["--screenshot", "a.jpg"], ".png");
    refused(&["--headless", "--csv", "missing_folder/a.csv"], "no folder missing_folder");
    refused(&["--headless", "--csv", "."], "folder");
}

#[test]
fn without_a_display_a_flight_writes_a_line_per_update_and_a_summary() {
    let path = folder_of_tests().join("flight.csv");
    let _ = fs::remove_file(&path);
    let flags = ["--radius", "96", "--speed", "60", "--frames", "300", "--csv", "flight.csv"];
    let output = run("flyover", &flags);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}:\n{said}{}", output.status, String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("this is the headless run"), "{said}");
    let summary = said.lines().last().expect("a summary");
    assert!(summary.starts_with("300 updates in "), "{said}");
    for part in ["p50", "p99", "max", "chunks meshed per second", "bytes per surface chunk", "fills empty"] {
        assert!(summary.contains(part), "{summary}");
    }

    let table = fs::read_to_string(&path).expect("the table was written");
    let mut lines = table.lines();
    let columns: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let lines: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|number| number.parse().expect("a number")).collect()).collect();
    assert_eq!(lines.len(), 300);
    assert!(lines.iter().all(|line| line.len() == columns.len() && line.iter().all(|number| number.is_finite())));
    let column = |name: &str| {
        let index = columns.iter().position(|column| *column == name).unwrap_or_else(|| panic!("no column {name}"));
        lines.iter().map(|line| line[index]).collect::<Vec<_>>()
    };
    assert!(column("update").iter().zip(0..).all(|(number, update)| *number == f64::from(update)));
    // A voxel an update, from the first to the last of 300.
    let way = |name: &str| column(name)[299] - column(name)[0];
    let distance = way("x").hypot(way("z"));
    assert!((distance - 299.0).abs() < 3.0, "flown {distance} voxels");
    // It draws what it flies over, and what it left behind is gone.
    let sum = |name: &str| column(name).iter().sum::<f64>();
    for name in ["loaded", "unloaded", "filled", "meshed", "main_thread_ms"] {
        assert!(sum(name) > 0.0, "nothing in column {name}:\n{summary}");
    }
    assert!(column("chunks_drawn")[299] > 0.0 && column("resident_bytes")[299] > 1e5, "{summary}");
}
