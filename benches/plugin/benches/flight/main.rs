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

mod clock;
mod measure;
mod record;
mod route;

use std::process::ExitCode;

use measure::Flight;
use route::{ROUTES, World};

/// Updates a second.
const PACE: u32 = 60;

/// What the command line asks for.
struct Request {
    seconds: u32,
    minutes: Option<u32>,
    /// Whether all is only to be tried out.
    test: bool,
    word: Option<String>,
}

fn main() -> ExitCode {
    let request = match request(std::env::args().skip(1)) {
        Ok(request) => request,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    if let Some(minutes) = request.minutes {
        println!("{}", measure::long_flight(minutes));
        return ExitCode::SUCCESS;
    }
    let updates = if request.test { 20 } else { request.seconds * PACE };
    let mut flights = Vec::new();
    for world in World::ALL {
        for route in &ROUTES {
            let name = format!("{}, {}", world.name(), route.name);
            if request.word.as_ref().is_none_or(|word| name.contains(word)) {
                eprintln!("{name}");
                flights.push((name, Flight::fly(world, route, updates, !request.test)));
            }
        }
    }
    record::report(&flights)
}

fn request(arguments: impl Iterator<Item = String>) -> Result<Request, String> {
    // As criterion does: without `cargo bench`, only whether it runs.
    let mut request = Request { seconds: 20, minutes: None, test: true, word: None };
    let mut arguments = arguments.peekable();
    while let Some(argument) = arguments.next() {
        let mut number = || {
            let value = arguments.next().unwrap_or_default();
            value.parse::<u32>().map_err(|_| format!("{argument} needs a number, but it is followed by {value:?}"))
        };
        match argument.as_str() {
            "--seconds" => request.seconds = number()?.max(1),
            "--minutes" => request.minutes = Some(number()?.max(1)),
            "--test" => request.test = true,
            "--bench" => request.test = false,
            word if !word.starts_with('-') => request.word = Some(word.to_owned()),
            _ => return Err(format!("unknown: {argument}; there are --seconds N, --minutes N, --test and a word")),
        }
    }
    Ok(request)
}
