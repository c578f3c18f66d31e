//! Flights through endless worlds, at the pace of a game: what streaming costs the main thread, update by update.
//!
//! Viewers see 8 chunks of 32 voxels far in all directions, in a headless app with mesh assets. Each update runs as a
//! game's would, sixty times a second, and sleeps for the rest of its time, while jobs sample and mesh on their
//! threads. What is measured is the CPU time of the main thread in the plugin's systems, commands included, with a
//! single-threaded executor for their schedule: other processes disturb it less than a clock on the wall.
//!
//! ```text
//! cargo bench -p marchless_plugin_benches --bench flight                       # each flight for 20 seconds
//! cargo bench -p marchless_plugin_benches --bench flight -- --seconds 5 caves  # only those with this word in their names
//! cargo bench -p marchless_plugin_benches --bench flight -- --minutes 10       # one long flight: does memory grow?
//! ```
//! With `MARCHLESS_RECORD=1` the table is written to `benches/record/`.

mod measure;
mod record;
mod route;

use std::process::ExitCode;

use marchless_plugin_benches::{PACE, Request, World};

use measure::Flight;
use route::ROUTES;

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
        for route in &ROUTES {
            let name = format!("{}, {}", world.name(), route.name);
            if request.includes(&name) {
                eprintln!("{name}");
                flights.push((name, Flight::fly(world, route, updates, !request.test)));
            }
        }
    }
    record::report(&flights)
}
