//! Flights through endless worlds at the pace of a game: the cost of streaming on the main thread, update by update.
//!
//! Viewers see 8 chunks of 32 voxels far in all directions, or 4,096 voxels with six levels of detail, in a headless
//! app with mesh assets. Updates run as in a game, sixty times a second, and sleep for the rest of their time, while
//! jobs sample and mesh on their threads. The bench measures the CPU time of the main thread in the plugin's systems,
//! including their commands, with a single-threaded executor for their schedule. Other processes disturb this time less
//! than wall-clock time. Digs into a far view are measured, too.
//!
//! ```text
//! cargo bench -p marchless_plugin_benches --bench flight                       # each flight for 20 seconds
//! cargo bench -p marchless_plugin_benches --bench flight -- --seconds 5 caves  # only those with this word in their names
//! cargo bench -p marchless_plugin_benches --bench flight -- --minutes 10       # one long flight: does memory grow?
//! ```
//! With `MARCHLESS_RECORD=1` the table is written to `benches/record/`.

mod edits;
mod measure;
mod record;
mod route;

use std::process::ExitCode;

use marchless_plugin_benches::{PACE, Request, World};

use edits::FarEdits;
use measure::{Flight, Sight};
use route::ROUTES;

/// The name of the digs near and far.
const FAR_EDITS: &str = "edits in hills to 4,096 voxels";

fn main() -> ExitCode {
    let request = match Request::parse(std::env::args().skip(1), &["--seconds", "--minutes"]) {
        Ok(request) => request,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    if let Some(minutes) = request.number("--minutes") {
        println!("{}", measure::long_flight(minutes));
        return ExitCode::SUCCESS;
    }
    let updates = if request.test { 20 } else { request.number("--seconds").unwrap_or(20) * PACE };
    let mut flights = Vec::new();
    for world in World::ALL {
        for sight in [Sight::Near, Sight::Far] {
            for route in &ROUTES {
                let name = format!("{}{}, {}", world.name(), sight.name(), route.name);
                if request.includes(&name) {
                    eprintln!("{name}");
                    flights.push((name, Flight::fly(world, sight, route, updates, !request.test)));
                }
            }
        }
    }
    let edits = if request.includes(FAR_EDITS) {
        eprintln!("{FAR_EDITS}");
        FarEdits::measure(if request.test { 2 } else { 300 }, !request.test)
    } else {
        Vec::new()
    };
    record::report(&flights, &edits)
}
