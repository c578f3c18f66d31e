//! [`Game`]: a headless app with a terrain, at the pace of a game.

use std::thread::sleep;
use std::time::{Duration, Instant};

use bevy_app::{App, PostUpdate, TaskPoolPlugin};
use bevy_asset::AssetPlugin;
use bevy_diagnostic::DiagnosticsPlugin;
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::SingleThreadedExecutor;
use bevy_marchless::prelude::*;
use bevy_math::{DVec3, Vec3};
use bevy_mesh::MeshPlugin;
use bevy_transform::components::Transform;
use bevy_transform::{TransformPlugin, TransformSystems};

use crate::clock::thread_time;
use crate::times::Times;

/// Updates a second.
pub const PACE: u32 = 60;

/// A headless app with mesh assets and a terrain; each update returns the time that the plugin took on the main thread.
///
/// This is the thread's CPU time in the plugin's systems, including their commands. Their schedule has a
/// single-threaded executor. Other processes disturb this time less than wall-clock time.
pub struct Game {
    /// The app.
    pub app: App,
    /// The terrain's entity.
    pub terrain: Entity,
    /// True if an update sleeps for the rest of its sixtieth of a second, while jobs run on their threads.
    paced: bool,
}

/// The start of the plugin's systems, and the time that they took.
#[derive(Resource, Default)]
struct Meter {
    start: Duration,
    last: Duration,
}

impl Game {
    /// A game with `terrain` and no viewer.
    pub fn new(terrain: Terrain, paced: bool) -> Self {
        let mut app = App::new();
        app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, AssetPlugin::default(), MeshPlugin));
        app.add_plugins((DiagnosticsPlugin, MarchlessPlugins));
        app.init_resource::<Meter>();
        app.add_systems(
            PostUpdate,
            (
                start_meter.before(MarchlessSystems::ReadStamps),
                stop_meter.after(MarchlessSystems::Work).before(TransformSystems::Propagate),
            ),
        );
        app.edit_schedule(PostUpdate, |schedule| {
            schedule.set_executor(SingleThreadedExecutor::new());
        });
        let terrain = app.world_mut().spawn(terrain).id();
        Self { app, terrain, paced }
    }

    /// Adds a viewer.
    pub fn spawn_viewer(&mut self, viewer: TerrainViewer, place: Transform) -> Entity {
        self.app.world_mut().spawn((viewer, place)).id()
    }

    /// Moves an entity.
    pub fn place(&mut self, entity: Entity, place: Transform) {
        self.app.world_mut().entity_mut(entity).insert(place);
    }

    /// Changes the terrain's settings.
    pub fn change_terrain(&mut self, change: impl FnOnce(&mut Terrain)) {
        let mut terrain = self.app.world_mut().get_mut::<Terrain>(self.terrain).expect("the terrain is there");
        change(&mut terrain);
    }

    /// Writes a stamp that digs a ball, in voxels.
    pub fn dig(&mut self, center: impl Into<DVec3>, radius: f32) {
        self.app.world_mut().write_message(Stamp::dig(self.terrain, BrushShape::sphere(center, radius)));
    }

    /// Runs one update, and returns the time of the plugin's systems.
    pub fn update(&mut self) -> Duration {
        let start = Instant::now();
        self.app.update();
        if self.paced {
            sleep((Duration::from_secs(1) / PACE).saturating_sub(start.elapsed()));
        }
        self.app.world().resource::<Meter>().last
    }

    /// Runs updates, each after a change that gets its number.
    pub fn updates(&mut self, count: u32, mut change: impl FnMut(&mut Self, u32)) -> Times {
        let update = |number| {
            change(self, number);
            self.update()
        };
        (0..count).map(update).collect()
    }

    /// Runs updates until the terrain has settled, at most `most`. Also returns whether it has settled.
    pub fn settle(&mut self, most: u32) -> (Times, bool) {
        let mut times = Vec::new();
        let mut settled = false;
        while !settled && times.len() < most as usize {
            times.push(self.update());
            settled = self.is_settled();
        }
        (times.into_iter().collect(), settled)
    }

    /// The terrain's volume.
    pub fn volume(&self) -> &TerrainVolume {
        self.app.world().get::<TerrainVolume>(self.terrain).expect("a terrain has a volume")
    }

    /// True if the terrain has settled: everything requested is drawn.
    pub fn is_settled(&self) -> bool {
        self.volume().is_settled()
    }

    /// The surface at most 200 voxels below a place, in voxels; `None` if there is none or its samples are not loaded.
    pub fn ground_below(&self, place: Vec3) -> Option<DVec3> {
        let origin = place.as_dvec3().to_array();
        self.volume().grid().ray_cast(0.0, origin, [0.0, -1.0, 0.0], 200.0).map(|hit| hit.position.into())
    }
}

fn start_meter(mut meter: ResMut<Meter>) {
    meter.start = thread_time();
}

fn stop_meter(mut meter: ResMut<Meter>) {
    meter.last = thread_time() - meter.start;
}
