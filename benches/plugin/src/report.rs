//! Reports, printed, and recorded on request.

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::Duration;
use std::{env, fs, thread};

/// Prints a report, and writes it to `benches/record/PROCESSOR-NAME.md` if `MARCHLESS_RECORD=1` asks for it.
pub fn print_and_record(name: &str, report: &str) -> ExitCode {
    println!("\n{report}");
    if env::var_os("MARCHLESS_RECORD").is_none_or(|value| value != "1") {
        return ExitCode::SUCCESS;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../record");
    let path = folder.join(format!("{}-{name}.md", slug(&processor())));
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

/// A sentence about the machine that a bench ran on, and the command that runs it again.
pub fn machine(bench: &str) -> String {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    format!(
        "{cores} cores, {}, bevy_marchless {}; `cargo bench -p marchless_plugin_benches --bench {bench}`.",
        compiler(),
        env!("CARGO_PKG_VERSION"),
    )
}

/// A time in milliseconds, to the microsecond.
pub fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1e3)
}

/// The processor's name, as Linux tells it; "unknown processor" elsewhere.
pub fn processor() -> String {
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
