//! [`run`]: the flight without any renderer, a line of figures per update, and a summary.

use core::time::Duration;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use bevy::asset::AssetPlugin;
use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::{TimePlugin, TimeUpdateStrategy};
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_marchless::stream::Coverage;

use crate::args::Args;
use crate::{BAD_INPUT, flight};

/// The time that passes per update, in the world and on the clock: an update that takes longer is not made up for.
const STEP: Duration = Duration::from_nanos(1_000_000_000 / 60);

const COLUMNS: &str =
    "update,x,y,z,main_thread_ms,chunks_drawn,chunks_waiting,loaded,unloaded,filled,meshed,resident_bytes";

/// Flies as many updates as the command line asks for, in real time: 60 a second, as a game does.
pub(crate) fn run(args: &Args) -> ExitCode {
    let mut csv = match args.csv.as_deref().map(Csv::create).transpose() {
        Ok(csv) => csv,
        Err(error) => {
            eprintln!("flyover: {error}");
            return ExitCode::from(BAD_INPUT);
        }
    };
    match fly(args, csv.as_mut()) {
        Ok(summary) => {
            println!("{summary}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("flyover: {error}");
            ExitCode::FAILURE
        }
    }
}

fn fly(args: &Args, mut csv: Option<&mut Csv>) -> Result<String, String> {
    let world = args.world();
    let terrain = world.terrain().map_err(|error| error.to_string())?;
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TimePlugin, TransformPlugin, AssetPlugin::default(), MeshPlugin))
        .add_plugins(MarchlessPlugins)
        .insert_resource(TimeUpdateStrategy::ManualDuration(STEP))
        .insert_resource(args.flight())
        .add_systems(Update, flight::fly_on);
    let terrain = app.world_mut().spawn(terrain).id();
    let viewer = app.world_mut().spawn((flight::start(), world.viewer())).id();
    app.finish();
    app.cleanup();

    let mut before = TerrainStats::default();
    let mut times = Vec::new();
    let start = Instant::now();
    for update in 0..args.frames {
        let began = Instant::now();
        app.update();
        let stats = *app.world().resource::<TerrainStats>();
        times.push(stats.main_thread_last);
        if let Some(csv) = csv.as_deref_mut() {
            csv.write(&line(update, &app, terrain, viewer, &stats, &before))?;
        }
        before = stats;
        std::thread::sleep(STEP.saturating_sub(began.elapsed()));
    }
    if let Some(csv) = csv {
        csv.finish()?;
    }
    Ok(summary(&app, terrain, start.elapsed(), times))
}

/// One line of [`COLUMNS`].
fn line(
    update: u32,
    app: &App,
    terrain: Entity,
    viewer: Entity,
    stats: &TerrainStats,
    before: &TerrainStats,
) -> String {
    let place = app.world().get::<Transform>(viewer).map_or(Vec3::ZERO, |transform| transform.translation);
    let coverage = coverage(app, terrain);
    format!(
        "{update},{:.2},{:.2},{:.2},{:.4},{},{},{},{},{},{},{:.0}",
        place.x,
        place.y,
        place.z,
        milliseconds(stats.main_thread_last),
        coverage.drawn,
        coverage.waiting,
        stats.loaded - before.loaded,
        stats.unloaded - before.unloaded,
        stats.filled - before.filled,
        stats.meshed - before.meshed,
        diagnostic(app, &TerrainDiagnosticsPlugin::RESIDENT_BYTES).unwrap_or(0.0),
    )
}

fn summary(app: &App, terrain: Entity, elapsed: Duration, mut times: Vec<Duration>) -> String {
    times.sort_unstable();
    let rank = |share: f64| milliseconds(times[((times.len() - 1) as f64 * share).round() as usize]);
    let stats = app.world().resource::<TerrainStats>();
    let coverage = coverage(app, terrain);
    let bytes = diagnostic(app, &TerrainDiagnosticsPlugin::BYTES_PER_SURFACE_CHUNK);
    format!(
        "{} updates in {:.1} s; main thread p50 {:.3} ms, p99 {:.3} ms, max {:.3} ms; {:.0} chunks meshed per second; \
         {} bytes per surface chunk; {:.1} % of {} fills empty; {} chunks drawn, {} waiting",
        times.len(),
        elapsed.as_secs_f64(),
        rank(0.5),
        rank(0.99),
        rank(1.0),
        stats.meshed as f64 / elapsed.as_secs_f64(),
        bytes.map_or("unknown".to_owned(), |bytes| format!("{bytes:.0}")),
        100.0 * stats.filled_empty as f64 / stats.filled.max(1) as f64,
        stats.filled,
        coverage.drawn,
        coverage.waiting,
    )
}

fn coverage(app: &App, terrain: Entity) -> Coverage {
    app.world().get::<TerrainVolume>(terrain).map(TerrainVolume::coverage).unwrap_or_default()
}

fn diagnostic(app: &App, path: &DiagnosticPath) -> Option<f64> {
    app.world().resource::<DiagnosticsStore>().get(path)?.value()
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// A file of comma-separated values, written as the flight goes on.
struct Csv {
    name: String,
    file: BufWriter<File>,
}

impl Csv {
    /// Begins the file.
    ///
    /// # Errors
    /// A sentence, where it cannot be written.
    fn create(path: &Path) -> Result<Self, String> {
        let name = path.display().to_string();
        let file = File::create(path).map_err(|error| format!("{name} cannot be written: {error}"))?;
        let mut csv = Self { name, file: BufWriter::new(file) };
        csv.write(COLUMNS)?;
        Ok(csv)
    }

    fn write(&mut self, line: &str) -> Result<(), String> {
        writeln!(self.file, "{line}").map_err(|error| format!("{} cannot be written: {error}", self.name))
    }

    fn finish(&mut self) -> Result<(), String> {
        self.file.flush().map_err(|error| format!("{} cannot be written: {error}", self.name))
    }
}
