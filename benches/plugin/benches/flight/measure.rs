//! Flying a route, and what it took.

use std::time::{Duration, Instant};

use bevy_app::{App, PostUpdate, TaskPoolPlugin};
use bevy_asset::AssetPlugin;
use bevy_diagnostic::{DiagnosticPath, DiagnosticsPlugin, DiagnosticsStore};
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::SingleThreadedExecutor;
use bevy_marchless::marchless::Chunk;
use bevy_marchless::prelude::*;
use bevy_math::{IVec3, Vec3};
use bevy_mesh::MeshPlugin;
use bevy_transform::{TransformPlugin, TransformSystems};

use crate::PACE;
use crate::clock::{resident_bytes, thread_time};
use crate::route::{ROUTES, Route, World};

/// How far a viewer sees: 8 chunks.
const RADIUS: f32 = 256.0;

/// The main thread's time in the plugin's systems.
#[derive(Resource, Default)]
struct Meter {
    start: Duration,
    last: Duration,
}

/// What a flight took.
pub(crate) struct Flight {
    /// CPU time of each update's systems, the shortest first.
    pub(crate) updates: Vec<Duration>,
    /// Updates until the first view was complete, and after each teleport; the last may not be complete.
    pub(crate) complete: Vec<u32>,
    /// The most leaves in range that waited, apart from teleports.
    pub(crate) waiting: usize,
    /// All it did after the first view, and in what time.
    pub(crate) stats: StreamStats,
    pub(crate) time: Duration,
    /// CPU time of the main thread in all.
    pub(crate) main_thread: Duration,
    /// Samples and geometry, by the plugin's own account.
    pub(crate) resident: f64,
    pub(crate) per_surface_chunk: f64,
}

impl Flight {
    /// Flies for so many updates. `paced`: sixty a second, and only after the first view is complete.
    pub(crate) fn fly(world: World, route: &Route, updates: u32, paced: bool) -> Self {
        let (mut app, terrain) = world_app(world);
        let viewers: Vec<_> = (0..route.viewers)
            .map(|viewer| app.world_mut().spawn((TerrainViewer::new(RADIUS), route.transform(0, viewer))).id())
            .collect();
        let mut complete = Vec::new();
        let mut times = Vec::new();
        if paced {
            for update in 1.. {
                paced_update(&mut app, paced);
                if is_settled(&app, terrain) || update == 20 * PACE {
                    complete.push(update);
                    break;
                }
            }
        }
        let (before, start) = (*app.world().resource::<StreamStats>(), Instant::now());
        let (mut waiting, mut waits_since) = (0, None);
        for update in 0..updates {
            for (number, viewer) in viewers.iter().enumerate() {
                app.world_mut().entity_mut(*viewer).insert(route.transform(update, number));
            }
            if let Some(every) = route.dig
                && update % every == 0
            {
                let ahead = route.transform(update, 0).translation + Vec3::X * 24.0;
                dig(&mut app, terrain, ahead);
            }
            if route.teleports(update) {
                complete.extend(waits_since.map(|since| update - since));
                waits_since = Some(update);
            }
            paced_update(&mut app, paced);
            times.push(app.world().resource::<Meter>().last);
            match waits_since {
                Some(since) if is_settled(&app, terrain) => {
                    complete.push(update + 1 - since);
                    waits_since = None;
                }
                Some(_) => {}
                None => waiting = waiting.max(volume(&app, terrain).coverage().waiting),
            }
        }
        complete.extend(waits_since.map(|since| updates - since));
        let stats = since(app.world().resource::<StreamStats>(), &before);
        let (time, main_thread) = (start.elapsed(), times.iter().sum());
        times.sort();
        // Memory is measured bit by bit.
        for _ in 0..1_000 {
            app.update();
        }
        let diagnostic = |path: &DiagnosticPath| {
            let store = app.world().resource::<DiagnosticsStore>();
            store.get(path).and_then(|diagnostic| diagnostic.value()).unwrap_or(f64::NAN)
        };
        Self {
            updates: times,
            complete,
            waiting,
            stats,
            time,
            main_thread,
            resident: diagnostic(&DebugPlugin::RESIDENT_BYTES),
            per_surface_chunk: diagnostic(&DebugPlugin::BYTES_PER_SURFACE_CHUNK),
        }
    }

    /// The main thread's time that so large a share of the updates does not exceed.
    pub(crate) fn quantile(&self, share: f64) -> Duration {
        let last = self.updates.len().saturating_sub(1);
        self.updates.get((last as f64 * share).round() as usize).copied().unwrap_or_default()
    }
}

/// Flies straight for minutes over the hills, digging, and tells how memory grows.
pub(crate) fn long_flight(minutes: u32) -> String {
    let route = &ROUTES[0];
    let (mut app, terrain) = world_app(World::Hills);
    let viewer = app.world_mut().spawn((TerrainViewer::new(RADIUS), route.transform(0, 0))).id();
    let mut text = String::from(
        "| minute | resident MB | of it edits | p99 ms | max ms | chunks loaded |\n|---|---|---|---|---|---|\n",
    );
    let mut times = Vec::new();
    for update in 0..minutes * 60 * PACE {
        app.world_mut().entity_mut(viewer).insert(route.transform(update, 0));
        if update % 60 == 0 {
            let ahead = route.transform(update, 0).translation + Vec3::X * 24.0;
            dig(&mut app, terrain, ahead);
        }
        paced_update(&mut app, true);
        times.push(app.world().resource::<Meter>().last);
        if (update + 1) % (60 * PACE) == 0 {
            times.sort();
            let row = format!(
                "| {} | {:.1} | {:.1} | {:.3} | {:.3} | {} |",
                (update + 1) / (60 * PACE),
                resident_bytes() as f64 / 1e6,
                edited_bytes(volume(&app, terrain)) as f64 / 1e6,
                times[times.len() * 99 / 100].as_secs_f64() * 1e3,
                times[times.len() - 1].as_secs_f64() * 1e3,
                app.world().resource::<StreamStats>().loaded,
            );
            eprintln!("{row}");
            text += &row;
            text.push('\n');
            times.clear();
        }
    }
    text
}

/// How many bytes the samples of chunks take that are kept for their edits alone.
fn edited_bytes(volume: &TerrainVolume) -> usize {
    let kept = volume.grid().chunks().filter(|(position, _)| volume.leaf_at(IVec3::from(*position)).is_none());
    kept.map(|(_, chunk)| match chunk {
        Chunk::Uniform(_) => 0,
        Chunk::Samples(samples) => 2 * samples.weights.len() + samples.materials.len(),
    })
    .sum()
}

fn world_app(world: World) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, AssetPlugin::default(), MeshPlugin));
    app.add_plugins((DiagnosticsPlugin, MarchlessPlugins));
    app.init_resource::<Meter>();
    let start = |mut meter: ResMut<Meter>| meter.start = thread_time();
    let end = |mut meter: ResMut<Meter>| meter.last = thread_time() - meter.start;
    app.add_systems(
        PostUpdate,
        (
            start.before(MarchlessSystems::ReadStamps),
            end.after(MarchlessSystems::Work).before(TransformSystems::Propagate),
        ),
    );
    app.edit_schedule(PostUpdate, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    let terrain = app.world_mut().spawn(world.terrain()).id();
    (app, terrain)
}

/// One update; then, where it is paced, what is left of its sixtieth of a second.
fn paced_update(app: &mut App, paced: bool) {
    let start = Instant::now();
    app.update();
    if paced {
        std::thread::sleep((Duration::from_secs(1) / PACE).saturating_sub(start.elapsed()));
    }
}

fn volume(app: &App, terrain: Entity) -> &TerrainVolume {
    app.world().get::<TerrainVolume>(terrain).expect("a terrain has a volume")
}

fn is_settled(app: &App, terrain: Entity) -> bool {
    volume(app, terrain).is_settled()
}

/// Digs into the ground below a place, where its samples are there.
fn dig(app: &mut App, terrain: Entity, place: Vec3) {
    let down = [0.0, -1.0, 0.0];
    let origin = place.as_dvec3().to_array();
    let hit = bevy_marchless::marchless::ray_cast(volume(app, terrain).grid(), 0.0, origin, down, 200.0);
    if let Some(hit) = hit {
        app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(hit.position, 5.0)));
    }
}

fn since(now: &StreamStats, before: &StreamStats) -> StreamStats {
    StreamStats {
        loaded: now.loaded - before.loaded,
        unloaded: now.unloaded - before.unloaded,
        bounded: now.bounded - before.bounded,
        filled: now.filled - before.filled,
        filled_empty: now.filled_empty - before.filled_empty,
        meshed: now.meshed - before.meshed,
        fill_time: now.fill_time - before.fill_time,
        mesh_time: now.mesh_time - before.mesh_time,
        main_thread: now.main_thread - before.main_thread,
        main_thread_last: now.main_thread_last,
    }
}
