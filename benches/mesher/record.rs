//! The report: the table with the machine's name, printed, and recorded on request.

use std::{env, fs, path::Path, process::Command, process::ExitCode, thread};

use marchless::Backend;

use crate::{results::Results, threads::Threads};

/// Prints the table, and writes it to `record/` if `MARCHLESS_RECORD=1`.
pub(crate) fn report(results: &Results, threads: Option<&Threads>) -> ExitCode {
    let processor = processor();
    let report = text(&processor, results, threads);
    println!("\n{report}");
    if env::var_os("MARCHLESS_RECORD").is_none_or(|value| value != "1") {
        return ExitCode::SUCCESS;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("record");
    let path = folder.join(format!("{}.md", slug(&processor)));
    match fs::create_dir_all(&folder).and_then(|()| fs::write(&path, report)) {
        Ok(()) => {
            println!("written to {}", path.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("could not write {}: {error}", path.display());
            ExitCode::FAILURE
        }
    }
}

fn text(processor: &str, results: &Results, threads: Option<&Threads>) -> String {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let mut text = format!(
        "# {processor}\n\n\
         {cores} cores, {}, marchless {} on its {} backend; `cargo bench -p marchless_benches --bench mesher`.\n\n\
         One thread; times are the least of 20 samples (10 from 128³ on). Columns after the triangles per second tell \
         by what factor each peer takes longer on the same cells of the same `f32` samples: nets is fast-surface-nets \
         0.2.1, as it is and with its normals normalised; isosurface is 0.0.4, isomesh 0.0.14. The last column tells by \
         what factor `Topology::Trilinear` takes longer than the default, and how long `MeshReport` takes on all cores. \
         The samples include one of padding on each side.\n\n{}",
        compiler(),
        env!("CARGO_PKG_VERSION"),
        Backend::fastest().name(),
        results.table(),
    );
    if let Some(threads) = threads {
        text += &format!("\n{threads}\n");
    }
    text
}

/// The processor's name, as Linux tells it; "unknown" elsewhere.
fn processor() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| "unknown processor".to_owned(), |(_, name)| name.trim().to_owned())
}

fn compiler() -> String {
    let output = Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())).arg("--version").output();
    output
        .map_or_else(|_| "unknown rustc".to_owned(), |output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Lower-case letters and digits, with single hyphens between words.
fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-").to_ascii_lowercase()
}
