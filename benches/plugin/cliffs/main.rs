//! Situations in which a cost could grow with the number of loaded chunks, of pending chunks, or of edits.
//!
//! Each runs in a headless app with mesh assets and default settings, at sixty updates a second, while jobs sample and
//! mesh on their threads. The bench measures the CPU time of the main thread in the plugin's systems, including their
//! commands, with a single-threaded executor for their schedule.
//!
//! ```text
//! cargo bench -p marchless_plugin_benches --bench cliffs             # all of them, six minutes or more
//! cargo bench -p marchless_plugin_benches --bench cliffs -- palette  # only those with this word in their names
//! ```
//! With `MARCHLESS_RECORD=1` the table is written to `benches/record/`.

mod crowd;
mod edits;
mod rays;
mod settings;
mod situation;
mod views;

use std::process::ExitCode;

use marchless_benches::aligned;
use marchless_plugin_benches::{Request, machine, print_and_record, processor};

use situation::{Bench, Row};

/// All situations by name; each returns one or more rows.
const SITUATIONS: [(&str, fn(&Bench) -> Vec<Row>); 8] = [
    ("32 viewers come and go", crowd::coming_and_going),
    ("32 viewers walk", crowd::walking),
    ("400 idle terrains", crowd::idle_terrains),
    ("digs where nothing is loaded", edits::far_away),
    ("rays without an end", rays::endless_rays),
    ("a view that fills", views::filling),
    ("a viewer that jumps to and fro", views::jumping),
    ("palette and isovalue", settings::changes),
];

fn main() -> ExitCode {
    let request = match Request::parse(std::env::args().skip(1), &[]) {
        Ok(request) => request,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    let bench = Bench { test: request.test };
    let mut rows = vec![Row::head()];
    for (name, run) in SITUATIONS {
        if request.includes(name) {
            eprintln!("{name}");
            for row in run(&bench) {
                eprintln!("  {row}");
                rows.push(row.cells());
            }
        }
    }
    let report = format!(
        "# Cliffs on {}\n\n\
         {}\n\n\
         A headless app with mesh assets, default settings, 60 updates a second; endless worlds are the default hills. \
         Mean, p99 and max: CPU time of the main thread in the plugin's systems and their commands in an update; for rays, \
         in a ray. A figure with \">\" means that it had not come so far when the measurement ended.\n\n{}",
        processor(),
        machine("cliffs"),
        aligned(&rows),
    );
    print_and_record("cliffs", &report)
}
