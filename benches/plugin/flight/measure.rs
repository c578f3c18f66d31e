//! [`Flight`]: flies a route and measures it.

use std::time::{Duration, Instant};

use bevy_diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy_marchless::diagnostics::TerrainDiagnosticsPlugin;
use bevy_marchless::marchless::{GridChunk, Region};
use bevy_marchless::prelude::*;
use bevy_marchless::stats::TerrainStats;
use bevy_marchless::stream::LeafState;
use bevy_math::{IVec3, Vec3};
use marchless_plugin_benches::{Game, PACE, Times, World, resident_bytes};

use crate::route::{ROUTES, Route};

/// How far viewers see.
#[derive(Clone, Copy)]
pub(crate) enum Sight {
    /// 8 chunks, at one level of detail.
    Near,
    /// 4,096 voxels, at six levels.
    Far,
}

/// Within this distance the ground is to be complete soon after a teleport. [Units: voxels]
const CLOSE: i32 = 128;

impl Sight {
    /// What it adds to the name of a flight.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Near => "",
            Self::Far => " to 4,096 voxels",
        }
    }

    pub(crate) fn viewer(self) -> TerrainViewer {
        TerrainViewer::new(match self {
            Self::Near => 256.0,
            Self::Far => 4_096.0,
        })
    }

    pub(crate) fn terrain(self, world: World) -> Terrain {
        match self {
            Self::Near => world.terrain(),
            Self::Far => world.terrain().with_levels(6),
        }
    }
}

/// The measurements of a flight.
pub(crate) struct Flight {
    /// CPU time of each update's systems.
    pub(crate) updates: Times,
    /// Updates until the first view was complete, and after each teleport; the last may not be complete.
    pub(crate) complete: Vec<u32>,
    /// The same for everything within [`CLOSE`] voxels.
    pub(crate) close: Vec<u32>,
    /// The most leaves in range that were pending at once, except after teleports.
    pub(crate) waiting: usize,
    /// Updates until everything in range was drawn after the end of the flight.
    pub(crate) stopped: u32,
    /// The work done after the first view was complete.
    pub(crate) stats: TerrainStats,
    /// The time that this work took.
    pub(crate) time: Duration,
    /// The memory of samples and geometry, as the plugin counts it.
    pub(crate) resident: f64,
    pub(crate) per_surface_chunk: f64,
}

impl Flight {
    /// Flies for so many updates. If `paced`, the flight runs at sixty updates a second and starts when the first view
    /// is complete.
    pub(crate) fn fly(world: World, sight: Sight, route: &Route, updates: u32, paced: bool) -> Self {
        let mut game = Game::new(sight.terrain(world), paced);
        let viewers: Vec<_> =
            (0..route.viewers).map(|viewer| game.spawn_viewer(sight.viewer(), route.transform(0, viewer))).collect();
        let (mut complete, mut close) = (Vec::new(), Vec::new());
        if paced {
            let (times, _) = game.settle(20 * PACE);
            complete.push(times.count() as u32);
        }
        let (before, start) = (stats(&game), Instant::now());
        let (mut times, mut waiting, mut waits_since, mut close_since) = (Vec::new(), 0, None, None);
        for update in 0..updates {
            for (number, viewer) in viewers.iter().enumerate() {
                game.place(*viewer, route.transform(update, number));
            }
            if route.dig.is_some_and(|every| update % every == 0) {
                dig_ahead(&mut game, route, update);
            }
            if route.teleports(update) {
                complete.extend(waits_since.map(|since| update - since));
                (waits_since, close_since) = (Some(update), Some(update));
            }
            times.push(game.update());
            if let Some(since) = close_since
                && is_drawn_around(&game, route.transform(update, 0).translation)
            {
                close.push(update + 1 - since);
                close_since = None;
            }
            match waits_since {
                Some(since) if game.is_settled() => {
                    complete.push(update + 1 - since);
                    waits_since = None;
                }
                Some(_) => {}
                None => waiting = waiting.max(game.volume().coverage().waiting),
            }
        }
        complete.extend(waits_since.map(|since| updates - since));
        let (stats, time) = (since(&stats(&game), &before), start.elapsed());
        let stopped = if paced { game.settle(20 * PACE).0.count() as u32 } else { 0 };
        // Memory is measured bit by bit.
        for _ in 0..1_000 {
            game.app.update();
        }
        let diagnostic = |path: &DiagnosticPath| {
            let store = game.app.world().resource::<DiagnosticsStore>();
            store.get(path).and_then(|diagnostic| diagnostic.value()).unwrap_or(f64::NAN)
        };
        Self {
            updates: times.into_iter().collect(),
            complete,
            close,
            waiting,
            stopped,
            stats,
            time,
            resident: diagnostic(&TerrainDiagnosticsPlugin::RESIDENT_BYTES),
            per_surface_chunk: diagnostic(&TerrainDiagnosticsPlugin::BYTES_PER_SURFACE_CHUNK),
        }
    }
}

/// Whether the finest level is drawn, or known to be empty, around a place.
fn is_drawn_around(game: &Game, place: Vec3) -> bool {
    let [low, high] = [-CLOSE, CLOSE].map(|by| ((place.as_ivec3() + by).as_vec3() / 32.0).floor().as_ivec3());
    let chunks = Region::new(low.to_array(), (high + 1).to_array());
    let is_near = |chunk: [i32; 3]| {
        let low = IVec3::from(chunk).as_vec3() * 32.0;
        place.clamp(low, low + 32.0).distance(place) < CLOSE as f32
    };
    chunks.points().filter(|chunk| is_near(*chunk)).all(|chunk| {
        let leaf = game.volume().leaf_at(chunk.into());
        leaf.is_some_and(|leaf| leaf.state == LeafState::Empty || leaf.state == LeafState::Drawn && leaf.level == 0)
    })
}

/// Flies straight for minutes over the hills, digging, and tells how memory grows.
pub(crate) fn long_flight(minutes: u32) -> String {
    let route = &ROUTES[0];
    let mut game = Game::new(World::Hills.terrain(), true);
    let viewer = game.spawn_viewer(Sight::Near.viewer(), route.transform(0, 0));
    let mut text = String::from(
        "| minute | resident MB | of it edits | p99 ms | max ms | chunks loaded |\n|---|---|---|---|---|---|\n",
    );
    for minute in 0..minutes {
        let fly = |game: &mut Game, update: u32| {
            let update = minute * 60 * PACE + update;
            game.place(viewer, route.transform(update, 0));
            if update.is_multiple_of(60) {
                dig_ahead(game, route, update);
            }
        };
        let times = game.updates(60 * PACE, fly);
        let row = format!(
            "| {} | {:.1} | {:.1} | {:.3} | {:.3} | {} |",
            minute + 1,
            resident_bytes() as f64 / 1e6,
            edited_bytes(game.volume()) as f64 / 1e6,
            times.quantile(0.99).as_secs_f64() * 1e3,
            times.max().as_secs_f64() * 1e3,
            stats(&game).loaded,
        );
        eprintln!("{row}");
        text += &row;
        text.push('\n');
    }
    text
}

/// The bytes of samples of chunks that are kept for their edits alone.
fn edited_bytes(volume: &TerrainVolume) -> usize {
    let kept = volume.grid().chunks().filter(|(position, _)| volume.leaf_at(IVec3::from(*position)).is_none());
    kept.map(|(_, chunk)| match chunk {
        GridChunk::Uniform(_) => 0,
        GridChunk::Samples(samples) => 2 * samples.weights.len() + samples.materials.len(),
    })
    .sum()
}

/// Digs into the ground in front of a route's first viewer, if its samples are loaded.
fn dig_ahead(game: &mut Game, route: &Route, update: u32) {
    if let Some(ground) = game.ground_below(route.transform(update, 0).translation + Vec3::X * 24.0) {
        game.dig(ground, 5.0);
    }
}

fn stats(game: &Game) -> TerrainStats {
    *game.app.world().resource::<TerrainStats>()
}

fn since(now: &TerrainStats, before: &TerrainStats) -> TerrainStats {
    TerrainStats {
        loaded: now.loaded - before.loaded,
        unloaded: now.unloaded - before.unloaded,
        bounded: now.bounded - before.bounded,
        filled: now.filled - before.filled,
        filled_empty: now.filled_empty - before.filled_empty,
        meshed: now.meshed - before.meshed,
        fill_time: now.fill_time - before.fill_time,
        mesh_time: now.mesh_time - before.mesh_time,
        main_thread: now.main_thread - before.main_thread,
        ..*now
    }
}
