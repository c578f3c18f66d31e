//! The report: a table of all flights, printed, and written down if asked.

use std::{env, fs, path::Path, process::Command, process::ExitCode, thread, time::Duration};

use marchless_benches::aligned;

use crate::measure::Flight;

/// Prints the table, and writes it to `benches/record/` where `MARCHLESS_RECORD=1` asks for it.
pub(crate) fn report(flights: &[(String, Flight)]) -> ExitCode {
    let processor = processor();
    let report = text(&processor, flights);
    println!("\n{report}");
    if env::var_os("MARCHLESS_RECORD").is_none_or(|value| value != "1") {
        return ExitCode::SUCCESS;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../record");
    let path = folder.join(format!("{}-flight.md", slug(&processor)));
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

fn text(processor: &str, flights: &[(String, Flight)]) -> String {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    format!(
        "# Flights on {processor}\n\n\
         {cores} cores, {}, bevy_marchless {}; `cargo bench -p marchless_plugin_benches --bench flight`.\n\n\
         A headless app with mesh assets, 60 updates a second, chunks of 32 cells, viewers that see 8 chunks far in all \
         directions; the first view is complete before a flight starts. Main thread: CPU time of the plugin's systems \
         and their commands in an update. Complete: updates until all in range was drawn, for the first view and after \
         each teleport. Waiting: the most chunks in range that were not drawn yet in an update, teleports left out. \
         Meshed: chunks a second. Empty: how many of the chunks that were sampled had no surface. Per chunk: main thread \
         and meshing, without sampling, for each chunk meshed; meshing is measured on the wall.\n\n{}\n{}",
        compiler(),
        env!("CARGO_PKG_VERSION"),
        aligned(&main_thread(flights)),
        aligned(&work(flights)),
    )
}

fn main_thread(flights: &[(String, Flight)]) -> Vec<Vec<String>> {
    let head = ["flight", "updates", "p50", "p99", "max", "complete", "waiting", "per chunk"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, flight) in flights {
        let per_chunk = (flight.main_thread + flight.stats.mesh_time).div_f64(flight.stats.meshed.max(1) as f64);
        let complete: Vec<_> = flight.complete.iter().map(u32::to_string).collect();
        rows.push(vec![
            name.clone(),
            flight.updates.len().to_string(),
            milliseconds(flight.quantile(0.5)),
            milliseconds(flight.quantile(0.99)),
            milliseconds(flight.quantile(1.0)),
            complete.join(", "),
            flight.waiting.to_string(),
            milliseconds(per_chunk),
        ]);
    }
    rows
}

fn work(flights: &[(String, Flight)]) -> Vec<Vec<String>> {
    let head =
        ["flight", "loaded", "by bound", "sampled", "empty", "meshed", "meshed/s", "sampling", "MB", "kB a surface"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, flight) in flights {
        let stats = &flight.stats;
        rows.push(vec![
            name.clone(),
            stats.loaded.to_string(),
            stats.bounded.to_string(),
            stats.filled.to_string(),
            format!("{:.1} %", 100.0 * stats.filled_empty as f64 / stats.filled.max(1) as f64),
            stats.meshed.to_string(),
            format!("{:.0}", stats.meshed as f64 / flight.time.as_secs_f64()),
            milliseconds(stats.fill_time.div_f64(stats.filled.max(1) as f64)),
            format!("{:.1}", flight.resident / 1e6),
            format!("{:.0}", flight.per_surface_chunk / 1e3),
        ]);
    }
    rows
}

fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1e3)
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
