//! [`run`]: plays without a renderer, and checks the results.

use core::any::TypeId;
use core::time::Duration;
use std::process::ExitCode;
use std::time::Instant;

use bevy::camera::CameraPlugin;
use bevy::camera::visibility::VisibleEntities;
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::RunSystemOnce as _;
use bevy::light::NotShadowCaster;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy_marchless::prelude::*;
use marchless_examples::camera::FlyCamera;

use crate::dig::Drill;
use crate::game_plugin;
use crate::layers::MapCamera;
use crate::level::{Hills, Island, Wall};
use crate::pick::Picked;
use crate::save::Saved;

/// One step of `FixedUpdate` an update.
const UPDATE: Duration = Duration::from_micros(15_625);
/// How long a step may take before something must be wrong.
const PATIENCE: Duration = Duration::from_secs(120);
/// How long is drilled, in the game's time.
const DRILLED: Duration = Duration::from_millis(500);

type Checked<T = ()> = core::result::Result<T, String>;

/// Success where all is as it should be.
pub(crate) fn run() -> ExitCode {
    match Player::new().play() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("game_shell: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Presses keys and looks what happens.
struct Player {
    app: App,
    edits: MessageCursor<TerrainEdited>,
    /// How many chunks the level has at its start.
    chunks: usize,
    /// What edits have removed in all. [Units: cubic voxels]
    removed: u64,
}

impl Player {
    fn new() -> Self {
        let mut app = App::new();
        // What `DefaultPlugins` brings, as far as no renderer, no window and no keyboard are needed.
        app.add_plugins((MinimalPlugins, StatesPlugin, TransformPlugin, AssetPlugin::default(), MeshPlugin))
            .add_plugins((CameraPlugin, game_plugin))
            .init_resource::<ButtonInput<KeyCode>>()
            .insert_resource(TimeUpdateStrategy::ManualDuration(UPDATE));
        app.finish();
        app.cleanup();
        Self { app, edits: MessageCursor::default(), chunks: 0, removed: 0 }
    }

    fn play(&mut self) -> Checked {
        self.update();
        ensure(self.count::<Terrain>() == 0, "there is terrain in the menu")?;
        self.start()?;
        let drilled = self.drill("in real time")?;
        self.paused()?;
        self.pick()?;
        self.hidden()?;
        self.layers()?;
        self.saved()?;
        self.leave()?;

        self.start()?;
        self.press(KeyCode::KeyT);
        let slowly = self.drill("in slow motion")?;
        ensure(drilled == slowly, &format!("{drilled} cubic voxels were drilled, but {slowly} in slow motion"))?;
        // A level is left in the middle of a pause, too.
        self.press(KeyCode::KeyP);
        self.leave()
    }

    /// From the menu into the level.
    fn start(&mut self) -> Checked {
        self.press(KeyCode::Enter);
        self.update_until("the level is not ready", |world| {
            let mut volumes = world.query::<&TerrainVolume>();
            volumes.iter(world).count() == 3 && volumes.iter(world).all(TerrainVolume::is_settled)
        })?;
        // Cameras and rays see it from the next update on.
        self.update();
        self.chunks = self.count::<Chunk>();
        println!("The level has {} chunks.", self.chunks);
        Ok(())
    }

    /// From the level into the menu, where nothing is left of it.
    fn leave(&mut self) -> Checked {
        self.press(KeyCode::Backspace);
        (0..3).for_each(|_| self.update());
        let left = [self.count::<Terrain>(), self.count::<Chunk>(), self.count::<MapCamera>()];
        ensure(left == [0; 3], &format!("of the level terrains, chunks and cameras are left: {left:?}"))?;
        let meshes = self.app.world().resource::<Assets<Mesh>>().len();
        ensure(meshes == 0, &format!("{meshes} meshes are left of the level"))?;
        ensure(!self.app.world().resource::<Time<Virtual>>().is_paused(), "the menu is paused")?;
        println!("Left the level: no terrain, no chunk, no mesh.");
        Ok(())
    }

    /// Holds the drill; how much it has removed.
    fn drill(&mut self, how: &str) -> Checked<u64> {
        let before = self.removed;
        self.hold(KeyCode::KeyF);
        self.update_until("nothing is drilled", |world| world.resource::<Drill>().elapsed >= DRILLED)?;
        self.release(KeyCode::KeyF);
        self.settle()?;
        let drilled = self.removed - before;
        println!("Drilled {drilled} cubic voxels in half a second, {how}.");
        ensure(drilled > 0, "the drill has removed nothing")?;
        Ok(drilled)
    }

    /// Neither the drill nor stamps from elsewhere do anything in a pause; the stamps do after it.
    fn paused(&mut self) -> Checked {
        let (before, terrain) = (self.removed, self.only::<Hills>()?);
        self.press(KeyCode::KeyP);
        self.update();
        self.hold(KeyCode::KeyF);
        self.app.world_mut().write_message(Stamp::dig(terrain, BrushShape::sphere(Vec3::new(20.0, 40.0, 20.0), 12.0)));
        (0..20).for_each(|_| self.update());
        self.release(KeyCode::KeyF);
        ensure(self.removed == before, "something was dug in a pause")?;
        self.press(KeyCode::KeyP);
        self.update();
        self.settle()?;
        println!("A stamp waited for the end of a pause, then removed {} cubic voxels.", self.removed - before);
        ensure(self.removed > before, "the stamp of the pause is lost")
    }

    /// A mesh ray cast leads to a chunk, to its terrain, and to a hole.
    fn pick(&mut self) -> Checked {
        let (before, hills) = (self.removed, self.only::<Hills>()?);
        let place = self.ray_cast()?.position;
        self.press(KeyCode::KeyE);
        self.settle()?;
        let Some([chunk, terrain]) = self.app.world().resource::<Picked>().0 else {
            return Err("the mesh ray cast has hit no chunk".to_owned());
        };
        ensure(terrain == hills, "the mesh ray cast has hit another terrain")?;
        let world = self.app.world();
        let position = world.get::<Chunk>(chunk).map(|chunk| chunk.position).ok_or("the chunk is gone")?;
        let found = world.get::<TerrainVolume>(terrain).and_then(|volume| volume.chunk_entity(position));
        ensure(found == Some(chunk), "the terrain does not know its chunk")?;
        let behind = self.ray_cast()?.position;
        ensure(self.removed > before && behind.distance(place) > 1.0, "picking has dug nothing")?;
        println!("Picked chunk {position} by its mesh, and dug {} cubic voxels.", self.removed - before);
        Ok(())
    }

    /// Rays pass through what is hidden, the plugin's and Bevy's.
    fn hidden(&mut self) -> Checked {
        let (hills, wall) = (self.only::<Hills>()?, self.only::<Wall>()?);
        for expected in [hills, wall, hills] {
            ensure(self.ray_cast()?.terrain == expected, "a ray has hit what is hidden, or passed what is shown")?;
            self.press(KeyCode::KeyE);
            let picked = self.app.world().resource::<Picked>().0.map(|[_, terrain]| terrain);
            ensure(picked == Some(expected), "a mesh ray cast has hit what is hidden, or passed what is shown")?;
            self.settle()?;
            self.press(KeyCode::KeyH);
            self.update();
        }
        self.press(KeyCode::KeyH);
        self.update();
        println!("Rays pass through the wall while it is hidden.");
        Ok(())
    }

    /// The map sees the hills, the player all; only the island throws no shadow.
    fn layers(&mut self) -> Checked {
        let (hills, island) = (self.only::<Hills>()?, self.only::<Island>()?);
        let [by_player, on_map] = [self.seen::<FlyCamera>()?, self.seen::<MapCamera>()?];
        let count = |seen: &[Entity], terrain| seen.iter().filter(|seen| **seen == terrain).count();
        println!("The player sees {} chunks, the map {}.", by_player.len(), on_map.len());
        ensure(count(&by_player, hills) > 0 && count(&by_player, island) > 0, "the player does not see all terrains")?;
        ensure(!on_map.is_empty() && count(&on_map, hills) == on_map.len(), "the map sees not just the hills")?;
        let world = self.app.world_mut();
        let mut chunks = world.query::<(&Chunk, Has<NotShadowCaster>)>();
        let is_right = chunks.iter(world).all(|(chunk, casts_none)| casts_none == (chunk.terrain == island));
        ensure(is_right, "chunks do not throw shadows as their terrains say")
    }

    /// What was saved comes back: the same terrains in the same places, as they were before anybody dug.
    fn saved(&mut self) -> Checked {
        self.press(KeyCode::F5);
        let text = self.app.world().resource::<Saved>().0.clone().ok_or("nothing was saved")?;
        let former = self.only::<Hills>()?;
        self.press(KeyCode::F9);
        self.settle()?;
        self.update();
        let hills = self.only::<Hills>()?;
        ensure(hills != former && self.count::<Terrain>() == 3, "the terrains were not replaced")?;
        println!("Saved the level in {} bytes, and loaded it: {} chunks.", text.len(), self.count::<Chunk>());
        ensure(self.count::<Chunk>() == self.chunks, "the level has other chunks than at its start")?;
        ensure(self.ray_cast()?.terrain == hills, "the wall is not hidden")?;
        self.layers()
    }

    /// The terrains of all chunks that a camera sees.
    fn seen<C: Component>(&mut self) -> Checked<Vec<Entity>> {
        let camera = self.only::<C>()?;
        let world = self.app.world();
        let seen = world.get::<VisibleEntities>(camera).ok_or("a camera sees nothing")?;
        let chunks = seen.get(TypeId::of::<Mesh3d>()).iter().filter_map(|entity| world.get::<Chunk>(*entity));
        Ok(chunks.map(|chunk| chunk.terrain).collect())
    }

    /// What is hit in the middle of the screen.
    fn ray_cast(&mut self) -> Checked<TerrainHit> {
        let cast = |camera: Single<&Transform, With<FlyCamera>>, terrains: TerrainQuery| {
            terrains.ray_cast(Ray3d::new(camera.translation, camera.forward()), 1000.0)
        };
        let hit = self.app.world_mut().run_system_once(cast).map_err(|error| error.to_string())?;
        hit.ok_or_else(|| "a ray hits nothing".to_owned())
    }

    fn settle(&mut self) -> Checked {
        self.update();
        self.update_until("edits are not shown", |world| {
            world.query::<&TerrainVolume>().iter(world).all(TerrainVolume::is_settled)
        })
    }

    fn update_until(&mut self, otherwise: &str, done: impl Fn(&mut World) -> bool) -> Checked {
        let start = Instant::now();
        while !done(self.app.world_mut()) {
            if start.elapsed() > PATIENCE {
                return Err(format!("{otherwise} after two minutes"));
            }
            self.update();
        }
        Ok(())
    }

    fn update(&mut self) {
        self.app.update();
        self.app.world_mut().resource_mut::<ButtonInput<KeyCode>>().clear();
        let edits = self.edits.read(self.app.world().resource::<Messages<TerrainEdited>>());
        self.removed += edits.flat_map(|edit| edit.removed.values()).sum::<u64>();
    }

    fn press(&mut self, key: KeyCode) {
        self.hold(key);
        self.update();
        self.release(key);
    }

    fn hold(&mut self, key: KeyCode) {
        self.app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(key);
    }

    fn release(&mut self, key: KeyCode) {
        self.app.world_mut().resource_mut::<ButtonInput<KeyCode>>().release(key);
    }

    fn count<C: Component>(&mut self) -> usize {
        self.app.world_mut().query::<&C>().iter(self.app.world()).count()
    }

    /// The only entity with a component.
    fn only<C: Component>(&mut self) -> Checked<Entity> {
        let mut found = self.app.world_mut().query_filtered::<Entity, With<C>>();
        found.single(self.app.world()).map_err(|error| error.to_string())
    }
}

fn ensure(holds: bool, otherwise: &str) -> Checked {
    if holds { Ok(()) } else { Err(otherwise.to_owned()) }
}
