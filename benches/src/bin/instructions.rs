//! A performance gate without noise: the number of instructions that meshing takes, counted by valgrind's callgrind and
//! compared with a committed baseline. A count more than 3 % above the baseline fails.
//!
//! `cargo run --release -p marchless_benches --bin instructions` measures and judges. With `-- --renew` it writes
//! `benches/instructions.txt` instead: for a change that is worth its cost, for one that made things faster, or for a
//! new compiler. With a compiler other than the baseline's, counts are shown but not judged. If `CI` is set in the
//! environment, they fail, so that the gate does not lapse unnoticed.
//!
//! It meshes four fields of 35³ and 64³ `i16` samples, including padding, with normals, on the portable and the AVX2
//! backend, each forced, in both topologies, into warm buffers. It also runs operations on the bits of 128³ caves, on
//! AVX2 only: they choose the fastest backend themselves, and valgrind does not support AVX-512. The fields are sampled
//! before valgrind starts, since noise takes long under valgrind. Valgrind then runs this program again for each task
//! and file.

use core::{fmt, hint::black_box};
use std::{
    env,
    error::Error,
    fs, io,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use marchless::{
    Backend, MeshBuffer, MeshSettings, Mesher, Samples, Shape, Topology, Weight,
    bits::{BitGrid, BitsError, Connectivity},
};
use marchless_benches::Field;

const FIELDS: [Field; 4] = [Field::Sphere, Field::Terrain, Field::Caves, Field::WhiteNoise];
const SIZES: [u32; 2] = [35, 64];
const BACKENDS: [Backend; 2] = [Backend::Portable, Backend::Avx2];
/// The ends of the rows' names for each topology.
const TOPOLOGIES: [&str; 2] = ["", " trilinear"];
/// The operations on bits.
const OPERATIONS: [&str; 6] = ["case-masks", "shift", "and", "dilation", "flood", "components"];
/// The field of the bits and its samples per axis.
const BITS: (Field, u32) = (Field::Caves, 128);
/// The highest ratio of a count to its baseline.
const ALLOWED: f64 = 1.03;
const RENEW: &str = "cargo run --release -p marchless_benches --bin instructions -- --renew";

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match *arguments {
        [] => judge(),
        ["--renew"] => renew(),
        ["mesh", file, size, backend] => mesh(Path::new(file), size, backend, Topology::Separated),
        ["mesh", file, size, backend, "trilinear"] => mesh(Path::new(file), size, backend, Topology::Trilinear),
        ["bits", file, size, operation] => operate(Path::new(file), size, operation),
        _ => Err("expected no arguments, or `--renew`".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("instructions: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Measures, prints, and fails if a count is too far above the baseline's.
fn judge() -> Result<(), Box<dyn Error>> {
    let path = baseline_path();
    let text =
        fs::read_to_string(&path).map_err(|error| format!("{}: {error}; `{RENEW}` writes it", path.display()))?;
    let baseline = Counts::parse(&text)?;
    let counts = Counts::measure()?;
    let mut failures = Vec::new();
    for (what, count) in &counts.of {
        let Some(before) = baseline.of.iter().find_map(|(other, before)| (other == what).then_some(*before)) else {
            println!("{what:34} {count:>12}, no baseline");
            failures.push(format!("{what} has no baseline"));
            continue;
        };
        let change = (*count as f64 / before as f64 - 1.0) * 100.0;
        println!("{what:34} {count:>12}, baseline {before:>12}: {change:+.2} %");
        if *count as f64 > before as f64 * ALLOWED {
            failures.push(format!("{what} takes {change:.2} % more instructions"));
        }
    }
    for (what, _) in &baseline.of {
        if !counts.of.iter().any(|(other, _)| other == what) {
            failures.push(format!("{what} was not measured"));
        }
    }
    if counts.compiler != baseline.compiler {
        let compilers = format!("the baseline is of {}, this is {}", baseline.compiler, counts.compiler);
        if env::var_os("CI").is_some() {
            return Err(format!("{compilers}; `{RENEW}` makes a new baseline").into());
        }
        println!("not judged: {compilers}");
        return Ok(());
    }
    if failures.is_empty() {
        return Ok(());
    }
    let failures = failures.join("\n  ");
    Err(format!("at most 3 % above {} are allowed:\n  {failures}\nIf they are worth it: {RENEW}", path.display())
        .into())
}

fn renew() -> Result<(), Box<dyn Error>> {
    let (path, counts) = (baseline_path(), Counts::measure()?);
    fs::write(&path, counts.to_string()).map_err(|error| format!("{}: {error}", path.display()))?;
    println!("{counts}written to {}", path.display());
    Ok(())
}

fn baseline_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("instructions.txt")
}

/// The instructions of each task, and the compiler.
#[derive(Debug, PartialEq)]
struct Counts {
    compiler: String,
    /// "FIELD SIZE BACKEND TOPOLOGY", or "FIELD SIZE BACKEND bits OPERATION", and instructions.
    of: Vec<(String, u64)>,
}

impl Counts {
    /// Measures all tasks that this machine supports.
    fn measure() -> Result<Self, Box<dyn Error>> {
        let folder = env::temp_dir().join(format!("marchless-instructions-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        let of = measure_in(&folder);
        fs::remove_dir_all(&folder)?;
        Ok(Self { of: of?, compiler: compiler()? })
    }

    /// Parses the output of `Display`.
    fn parse(text: &str) -> Result<Self, Box<dyn Error>> {
        let mut compiler = None;
        let mut of = Vec::new();
        for line in text.lines().filter(|line| !line.is_empty()) {
            if let Some(comment) = line.strip_prefix('#') {
                let comment = comment.trim();
                compiler = compiler.or_else(|| comment.starts_with("rustc ").then(|| comment.to_owned()));
                continue;
            }
            let (what, count) = line.rsplit_once(' ').ok_or_else(|| format!("a baseline without a count: {line}"))?;
            let count = count.parse().map_err(|error| format!("the baseline's line \"{line}\": {error}"))?;
            of.push((what.trim_end().to_owned(), count));
        }
        Ok(Self { compiler: compiler.ok_or("the baseline names no compiler")?, of })
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "# Instructions of meshing once, as callgrind counts them: field, samples per axis, backend, topology, count."
        )?;
        writeln!(f, "# And of one operation on bits: field, points per axis, backend, bits, operation, count.")?;
        writeln!(f, "# Written by `{RENEW}` with")?;
        writeln!(f, "# {}", self.compiler)?;
        self.of.iter().try_for_each(|(what, count)| writeln!(f, "{what:34} {count}"))
    }
}

fn measure_in(folder: &Path) -> Result<Vec<(String, u64)>, Box<dyn Error>> {
    let mut counts = Vec::new();
    for field in FIELDS {
        for size in SIZES {
            let (name, file) = sampled(folder, field, size)?;
            for backend in BACKENDS {
                if !backend.is_available() {
                    println!("{name} {size} {}: skipped, this machine has no such instructions", backend.name());
                    continue;
                }
                for topology in TOPOLOGIES {
                    let what = format!("{name} {size} {}{topology}", backend.name());
                    let rest = format!("{size} {} {topology}", backend.name());
                    let count = count("mesh", &file, &rest).map_err(|error| format!("{what}: {error}"))?;
                    counts.push((what, count));
                }
            }
        }
    }
    if !Backend::Avx2.is_available() {
        println!("bits: skipped, this machine has no AVX2");
        return Ok(counts);
    }
    let (field, size) = BITS;
    let (name, file) = sampled(folder, field, size)?;
    for operation in OPERATIONS {
        let what = format!("{name} {size} {} bits {operation}", Backend::Avx2.name());
        let count = count("bits", &file, &format!("{size} {operation}")).map_err(|error| format!("{what}: {error}"))?;
        counts.push((what, count));
    }
    Ok(counts)
}

/// Samples a field. Returns its name in rows, and the file with its weights.
fn sampled(folder: &Path, field: Field, size: u32) -> io::Result<(String, PathBuf)> {
    let name = field.name().replace(' ', "-");
    let file = folder.join(format!("{name}-{size}.i16"));
    let weights = field.distances(size).into_iter().map(i16::from_voxels);
    fs::write(&file, weights.flat_map(i16::to_le_bytes).collect::<Vec<_>>())?;
    Ok((name, file))
}

/// Runs this program under callgrind, on one file.
fn count(task: &str, file: &Path, rest: &str) -> Result<u64, Box<dyn Error>> {
    let mut command = Command::new("valgrind");
    command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*_and_count*"]);
    command.arg(env::current_exe()?).arg(task).arg(file).args(rest.split_whitespace());
    let output = command.output().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => "valgrind is not installed".to_owned(),
        _ => format!("valgrind does not start: {error}"),
    })?;
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("valgrind: {}\n{said}", output.status).into());
    }
    let count = said.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse().ok());
    // Should the toggle not find its function, nothing is counted.
    count.filter(|&count| count > 0).ok_or_else(|| format!("valgrind counted nothing:\n{said}").into())
}

/// The weights of a file.
fn weights(file: &Path) -> io::Result<Vec<i16>> {
    Ok(fs::read(file)?.as_chunks().0.iter().map(|&chunk| i16::from_le_bytes(chunk)).collect())
}

/// The task under callgrind: meshes a file twice; the second time is counted.
fn mesh(file: &Path, size: &str, backend: &str, topology: Topology) -> Result<(), Box<dyn Error>> {
    let weights = weights(file)?;
    let samples = Samples::new(Shape::cube(size.parse()?)?, &weights)?.padded();
    let backend = BACKENDS.into_iter().find(|known| known.name() == backend).ok_or("no such backend")?;
    if !backend.is_available() {
        return Err("valgrind hides the instructions of this backend".into());
    }
    let (mut mesher, mut mesh, settings) =
        (Mesher::with_backend(backend), MeshBuffer::new(), MeshSettings { topology, ..MeshSettings::default() });
    mesher.mesh(samples, &settings, &mut mesh)?;
    mesh_and_count(&mut mesher, black_box(samples), &settings, &mut mesh);
    if black_box(&mesh).indices.is_empty() { Err("there is no surface".into()) } else { Ok(()) }
}

/// Callgrind collects inside of this function alone.
#[inline(never)]
fn mesh_and_count(mesher: &mut Mesher, samples: Samples<'_, i16>, settings: &MeshSettings, mesh: &mut MeshBuffer) {
    mesher.mesh(samples, settings, mesh).expect("it went well the first time");
}

/// The task under callgrind: runs an operation on the bits of a file twice; the second time is counted.
fn operate(file: &Path, size: &str, operation: &str) -> Result<(), Box<dyn Error>> {
    if Backend::fastest() != Backend::Avx2 {
        return Err("valgrind shows other instructions than AVX2".into());
    }
    let weights = weights(file)?;
    let grid = BitGrid::from_samples(Samples::new(Shape::cube(size.parse()?)?, &weights)?, 0.0)?;
    let components = grid.components(Connectivity::Six);
    let largest = components.largest().and_then(|index| components.get(index)).ok_or("there is nothing")?;
    let mut bits = Bits { out: grid.shifted([1, 2, 3]), grid, masks: Vec::new(), seed: largest.first };
    bits.operate(operation)?;
    let result = bits_and_count(black_box(&mut bits), operation)?;
    if black_box(result) == 0 { Err("nothing came out".into()) } else { Ok(()) }
}

/// Callgrind collects inside of this function alone.
#[inline(never)]
fn bits_and_count(bits: &mut Bits, operation: &str) -> Result<usize, BitsError> {
    bits.operate(operation)
}

/// The grids and buffers that operations read and write.
struct Bits {
    grid: BitGrid,
    out: BitGrid,
    masks: Vec<u8>,
    seed: [u32; 3],
}

impl Bits {
    /// Runs an operation, and returns a number that depends on its result.
    fn operate(&mut self, operation: &str) -> Result<usize, BitsError> {
        match operation {
            "case-masks" => self.grid.case_masks_into(&mut self.masks)?,
            "shift" => self.grid.shift_into([1, 2, 3], &mut self.out)?,
            "and" => self.out.and_with(&self.grid)?,
            "dilation" => self.grid.dilate_into(Connectivity::Six, &mut self.out)?,
            "flood" => self.out = self.grid.flood(&[self.seed], Connectivity::Six)?,
            "components" => return Ok(self.grid.components(Connectivity::Six).len()),
            _ => return Ok(0),
        }
        Ok(self.masks.len() + self.out.words().len())
    }
}

/// The compiler's version and target, in one line.
fn compiler() -> Result<String, Box<dyn Error>> {
    let mut command = Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
    let output = command.arg("-vV").output().map_err(|error| format!("rustc does not start: {error}"))?;
    let said = String::from_utf8(output.stdout)?;
    let mut lines = said.lines();
    let version = lines.next().ok_or("rustc says no version")?;
    let host = lines.find_map(|line| line.strip_prefix("host: ")).ok_or("rustc says no host")?;
    Ok(format!("{version} {host}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn baselines_are_read_as_they_were_written() {
        let of = vec![("terrain 35 portable".to_owned(), 123_456), ("white-noise 64 avx2".to_owned(), 7)];
        let counts = Counts { compiler: "rustc 1.2.3 (abc) x86_64-unknown-linux-gnu".to_owned(), of };
        assert_eq!(Counts::parse(&counts.to_string()).expect("it is whole"), counts);
    }

    #[test]
    fn broken_baselines_are_refused() {
        assert!(Counts::parse("terrain 35 portable 12\n").is_err(), "no compiler");
        assert!(Counts::parse("# rustc 1.2.3\nterrain 35 portable many\n").is_err(), "no number");
    }
}
