//! The report: a table of all flights, printed, and recorded on request.

use std::process::ExitCode;

use marchless_benches::aligned;
use marchless_plugin_benches::{machine, milliseconds, print_and_record, processor};

use crate::edits::FarEdits;
use crate::measure::Flight;

/// Prints the table, and writes it to `benches/record/` if `MARCHLESS_RECORD=1`.
pub(crate) fn report(flights: &[(String, Flight)], edits: &[FarEdits]) -> ExitCode {
    print_and_record("flight", &text(flights, edits))
}

fn text(flights: &[(String, Flight)], edits: &[FarEdits]) -> String {
    format!(
        "# Flights on {}\n\n\
         {}\n\n\
         A headless app with mesh assets, 60 updates a second, chunks of 32 cells, viewers that see 8 chunks far in all \
         directions, or 4,096 voxels with six levels of detail; the first view is complete before a flight starts. Main \
         thread: CPU time of the plugin's systems and their commands in an update. Complete: updates until all in range \
         was drawn, for the first view and after each teleport. Close: the same for all within 128 voxels. Waiting: the \
         most chunks in range that were not drawn yet in an update, teleports left out. Stopped: updates after the flight \
         until all in range was drawn. Meshed: chunks a second. Empty: how many of the chunks that were sampled had no \
         surface. Per chunk: main thread and meshing, without sampling, for each chunk meshed; meshing is measured on \
         the wall.\n\n{}\n{}\n\
         Digs into hills seen 4,096 voxels far: the time of the update that reads the stamp, and how many updates later \
         the hole is there.\n\n{}",
        processor(),
        machine("flight"),
        aligned(&main_thread(flights)),
        aligned(&work(flights)),
        aligned(&far_edits(edits)),
    )
}

fn main_thread(flights: &[(String, Flight)]) -> Vec<Vec<String>> {
    let head = ["flight", "updates", "p50", "p99", "max", "complete", "close", "waiting", "stopped", "per chunk"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, flight) in flights {
        let per_chunk = (flight.updates.total() + flight.stats.mesh_time).div_f64(flight.stats.meshed.max(1) as f64);
        let list = |updates: &[u32]| updates.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        rows.push(vec![
            name.clone(),
            flight.updates.count().to_string(),
            milliseconds(flight.updates.quantile(0.5)),
            milliseconds(flight.updates.quantile(0.99)),
            milliseconds(flight.updates.max()),
            list(&flight.complete),
            list(&flight.close),
            flight.waiting.to_string(),
            flight.stopped.to_string(),
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

fn far_edits(edits: &[FarEdits]) -> Vec<Vec<String>> {
    let head = ["radius", "distance", "levels", "digs", "p50", "p99", "max", "late p50", "late p99", "late max"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for edits in edits {
        let FarEdits { radius, distance, levels: [low, high], updates, late } = edits;
        let late = |share: f64| {
            let index = (late.len().saturating_sub(1) as f64 * share).round() as usize;
            late.get(index).map_or_else(|| "none".to_owned(), u32::to_string)
        };
        rows.push(vec![
            radius.to_string(),
            distance.to_string(),
            format!("{low} to {high}"),
            updates.count().to_string(),
            milliseconds(updates.quantile(0.5)),
            milliseconds(updates.quantile(0.99)),
            milliseconds(updates.max()),
            late(0.5),
            late(0.99),
            late(1.0),
        ]);
    }
    rows
}
