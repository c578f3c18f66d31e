//! Exports fields for programs in other languages, and times our mesher on the same files.
//!
//! `fields export FOLDER SIZE…` writes `FIELD-SIZE.f32` for sphere, terrain, caves and white noise: `[size³]` distances
//! as little-endian `f32`, x fastest. `fields time FILE SIZE RUNS` meshes all samples of such a file with normals and
//! without padding. After one run to warm up, it prints the least and the median seconds of the others, the vertices
//! and the triangles.

use std::{env, error::Error, fs, hint::black_box, path::Path, process::ExitCode, time::Instant};

use marchless::{MeshBuffer, MeshSettings, Mesher, Samples, Shape};
use marchless_benches::Field;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match *arguments {
        ["export", folder, ref sizes @ ..] => export(Path::new(folder), sizes),
        ["time", file, size, runs] => time(Path::new(file), size, runs),
        _ => Err("expected `export FOLDER SIZE…` or `time FILE SIZE RUNS`".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("fields: {error}");
            ExitCode::FAILURE
        }
    }
}

fn export(folder: &Path, sizes: &[&str]) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    for size in sizes {
        for field in [Field::Sphere, Field::Terrain, Field::Caves, Field::WhiteNoise] {
            let bytes: Vec<u8> =
                field.distances(size.parse()?).iter().flat_map(|distance| distance.to_le_bytes()).collect();
            fs::write(folder.join(format!("{}-{size}.f32", field.name().replace(' ', "-"))), bytes)?;
        }
    }
    Ok(())
}

fn time(file: &Path, size: &str, runs: &str) -> Result<(), Box<dyn Error>> {
    let runs: usize = runs.parse()?;
    let bytes = fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    let distances: Vec<f32> = bytes.as_chunks().0.iter().map(|&chunk| f32::from_le_bytes(chunk)).collect();
    let samples = Samples::new(Shape::cube(size.parse()?)?, &distances)?;
    let (mut mesher, mut mesh, settings) = (Mesher::new(), MeshBuffer::new(), MeshSettings::default());
    mesher.mesh(samples, &settings, &mut mesh)?;
    let mut times = Vec::with_capacity(runs);
    for _ in 0..runs {
        let start = Instant::now();
        mesher.mesh(black_box(samples), &settings, &mut mesh)?;
        times.push(start.elapsed().as_secs_f64());
        black_box(&mesh);
    }
    times.sort_unstable_by(f64::total_cmp);
    let (Some(least), Some(median)) = (times.first(), times.get(runs / 2)) else { return Err("no runs".into()) };
    println!("{least} {median} {} {}", mesh.positions.len(), mesh.triangle_count());
    Ok(())
}
