//! A terrain follows its file while the game runs, and stays as it is if the file is bad.

use std::fs;
use std::io::{self, Write};
use std::sync::{Arc, Mutex, Once};

use crate::common::*;
use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::{AssetPlugin, AssetServer, Assets, Handle, LoadState};
use bevy_ecs::prelude::*;
use bevy_log::tracing_subscriber;
use bevy_marchless::file::{HeightMapDescription, TerrainFilePlugin};
use bevy_marchless::file::{SourceDescription, TerrainDescription};
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use bevy_math::{IVec3, UVec3, Vec3};
use bevy_mesh::MeshPlugin;
use bevy_transform::TransformPlugin;
use marchless::MeshBuffer;
use tempfile::TempDir;

/// A game with an asset folder of its own.
struct Game {
    app: App,
    folder: TempDir,
}

impl Game {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut app = App::new();
        let assets = AssetPlugin { file_path: folder.path().to_str().unwrap().to_owned(), ..AssetPlugin::default() };
        app.add_plugins((TaskPoolPlugin::default(), TransformPlugin, assets, MeshPlugin, MarchlessPlugins));
        Self { app, folder }
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.folder.path().join(name), bytes).unwrap();
    }

    fn server(&self) -> &AssetServer {
        self.app.world().resource::<AssetServer>()
    }

    /// Spawns a terrain with a terrain file, and waits until it is loaded and drawn.
    fn spawn(&mut self, name: &str) -> Entity {
        let handle = self.server().load(name.to_owned());
        let entity = self.app.world_mut().spawn(TerrainFile(handle)).id();
        self.loaded(entity);
        entity
    }

    fn handle(&self, entity: Entity) -> Handle<TerrainDescription> {
        self.app.world().get::<TerrainFile>(entity).unwrap().0.clone()
    }

    fn terrain(&self, entity: Entity) -> &Terrain {
        self.app.world().get::<Terrain>(entity).unwrap()
    }

    /// Updates until the terrain's file is loaded, applied and drawn.
    fn loaded(&mut self, entity: Entity) {
        let handle = self.handle(entity);
        update_until(&mut self.app, |app| app.world().resource::<AssetServer>().is_loaded(&handle));
        self.drawn(entity);
    }

    /// Updates until all changes are drawn.
    fn drawn(&mut self, entity: Entity) {
        for _ in 0..3 {
            self.app.update();
        }
        settle(&mut self.app, entity);
    }

    /// Writes the file again, reloads it, and waits until `done`.
    fn rewrite(&mut self, name: &str, bytes: impl AsRef<[u8]>, entity: Entity, done: impl Fn(&App) -> bool) {
        self.write(name, bytes);
        self.server().reload(name.to_owned());
        update_until(&mut self.app, done);
        self.drawn(entity);
    }

    /// Reloads the file and waits until the failure has been logged.
    fn fail(&mut self, name: &str, bytes: impl AsRef<[u8]>, entity: Entity) {
        let before = warnings(name).len();
        let handle = self.handle(entity);
        self.rewrite(name, bytes, entity, |app| {
            matches!(app.world().resource::<AssetServer>().load_state(&handle), LoadState::Failed(_))
                && warnings(name).len() > before
        });
        // A second attempt of the same reload may come later.
        for _ in 0..100 {
            self.app.update();
            std::thread::sleep(std::time::Duration::from_micros(500));
        }
        assert_eq!(warnings(name).len(), before + 1, "{:?}", warnings(name));
    }

    fn geometry(&mut self, entity: Entity) -> Vec<(IVec3, Arc<MeshBuffer>)> {
        geometry(&mut self.app, entity)
    }

    fn dig(&mut self, entity: Entity) {
        self.app.world_mut().write_message(Stamp::dig(entity, BrushShape::sphere(Vec3::splat(16.0), 6.0)));
        self.app.update();
        self.drawn(entity);
    }
}

/// The warnings about a terrain file, one per line.
fn warnings(name: &str) -> Vec<String> {
    static TEXT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
    static START: Once = Once::new();
    struct Log;
    impl Write for Log {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            TEXT.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    START.call_once(|| {
        let log = tracing_subscriber::fmt().with_ansi(false).with_writer(|| Log);
        log.with_max_level(tracing_subscriber::filter::LevelFilter::WARN).init();
    });
    let text = String::from_utf8_lossy(&TEXT.lock().unwrap()).into_owned();
    let of_file = text.lines().filter(|line| line.contains("WARN bevy_marchless::file") && line.contains(name));
    of_file.map(str::to_owned).collect()
}

/// A ball in 2 × 2 × 2 chunks.
fn ball_text(radius: f64, more: &str) -> String {
    format!(
        "(source: Sdf(Sphere(center: (30, 30, 30), radius: {radius})), extent: (x: (0, 2), y: (0, 2), z: (0, 2)), {more})"
    )
}

#[test]
fn a_terrain_file_is_loaded_and_followed() {
    let mut game = Game::new();
    let name = "followed.terrain.ron";
    game.write(name, ball_text(10.0, "voxel_size: 1.0"));
    let entity = game.spawn(name);
    assert_eq!(game.terrain(entity).extent, UVec3::splat(2).into());
    let small = game.geometry(entity);
    assert!(small.iter().any(|(_, mesh)| !mesh.is_empty()));
    assert_drawn(&mut game.app, entity);

    let source = game.terrain(entity).source.clone();
    game.rewrite(name, ball_text(12.0, "voxel_size: 1.0"), entity, |app| {
        app.world().get::<Terrain>(entity).unwrap().source != source
    });
    assert_ne!(game.geometry(entity), small);
    assert_drawn(&mut game.app, entity);

    game.rewrite(name, ball_text(10.0, "voxel_size: 2.0"), entity, |app| {
        app.world().get::<Terrain>(entity).unwrap().voxel_size == 2.0
    });
    assert_drawn(&mut game.app, entity);
    assert!(warnings(name).is_empty());
}

#[test]
fn only_what_differs_changes() {
    let mut game = Game::new();
    let name = "palette.terrain.ron";
    game.write(name, ball_text(12.0, ""));
    let entity = game.spawn(name);
    game.dig(entity);
    let dug = game.geometry(entity);
    let source = game.terrain(entity).source.clone();

    let palette = "palette: (colors: [Srgba(red: 1.0, green: 0.0, blue: 0.0, alpha: 1.0)])";
    game.rewrite(name, ball_text(12.0, palette), entity, |app| {
        app.world().get::<Terrain>(entity).unwrap().palette.colors.len() == 1
    });
    assert!(game.terrain(entity).source == source, "the source is the same");
    let positions =
        |chunks: &[(IVec3, Arc<MeshBuffer>)]| chunks.iter().map(|(_, mesh)| mesh.positions.clone()).collect::<Vec<_>>();
    assert_eq!(positions(&game.geometry(entity)), positions(&dug), "what was dug stays");

    // The same description in other words, and a change of the `Terrain` itself in a setting that the file does not
    // change.
    game.app.world_mut().get_mut::<Terrain>(entity).unwrap().voxel_size = 3.0;
    game.drawn(entity);
    game.dig(entity);
    let dug = game.geometry(entity);
    let again = format!("// Another text.\n{}", ball_text(12.0, palette));
    game.write(name, &again);
    let mut reader =
        game.app.world().resource::<Messages<bevy_asset::AssetEvent<TerrainDescription>>>().get_cursor_current();
    game.server().reload(name);
    let reader = Mutex::new(&mut reader);
    update_until(&mut game.app, |app| {
        let events = app.world().resource::<Messages<bevy_asset::AssetEvent<TerrainDescription>>>();
        reader.lock().unwrap().read(events).next().is_some()
    });
    game.drawn(entity);
    assert!(game.terrain(entity).source == source);
    assert_eq!(game.terrain(entity).voxel_size, 3.0);
    assert_eq!(game.geometry(entity), dug);
}

#[test]
fn a_file_that_is_no_good_changes_nothing_and_is_told_once() {
    let mut game = Game::new();
    let name = "broken.terrain.ron";
    let good = ball_text(12.0, "");
    game.write(name, &good);
    warnings(name);
    let entity = game.spawn(name);
    game.dig(entity);
    let dug = game.geometry(entity);

    game.fail(name, &good[..good.len() / 2], entity);
    assert!(warnings(name)[0].contains("cut short"), "{:?}", warnings(name));
    assert_eq!(game.geometry(entity), dug);
    game.dig(entity);
    let dug = game.geometry(entity);

    game.fail(name, "(source: Sdf(Sphere(center: (0, 0, 0), radius: -1)))", entity);
    assert!(warnings(name)[1].contains("line 1: a sphere's radius"), "{:?}", warnings(name));
    game.fail(name, [0xff, 0xfe, 0], entity);
    game.fail(name, "", entity);
    assert_eq!(game.geometry(entity), dug, "nothing is lost");

    // Repaired: the same description as before.
    game.rewrite(name, &good, entity, |app| {
        app.world().resource::<AssetServer>().is_loaded(&app.world().get::<TerrainFile>(entity).unwrap().0)
    });
    assert_eq!(game.geometry(entity), dug);
    // Changed, then broken in the way that was logged before.
    let source = game.terrain(entity).source.clone();
    game.rewrite(name, ball_text(10.0, ""), entity, |app| app.world().get::<Terrain>(entity).unwrap().source != source);
    assert_ne!(game.geometry(entity), dug);
    game.fail(name, "", entity);
    assert_eq!(warnings(name).len(), 5);
}

#[test]
fn a_file_that_is_not_there_is_told_and_may_come_later() {
    let mut game = Game::new();
    let name = "late.terrain.ron";
    warnings(name);
    let handle = game.server().load(name);
    let entity = game.app.world_mut().spawn((ground(), TerrainFile(handle))).id();
    settle(&mut game.app, entity);
    update_until(&mut game.app, |_| !warnings(name).is_empty());
    assert_drawn(&mut game.app, entity);
    assert_eq!(game.terrain(entity).chunk_cells, 16);
    game.rewrite(name, ball_text(10.0, ""), entity, |app| {
        app.world().get::<Terrain>(entity).unwrap().extent == UVec3::splat(2).into()
            && app.world().resource::<Assets<TerrainDescription>>().len() == 1
    });
    assert_eq!(game.terrain(entity).chunk_cells, 16, "settings that the file leaves out stay");
    assert_drawn(&mut game.app, entity);
    assert_eq!(warnings(name).len(), 1);
}

#[test]
fn a_terrain_outlives_its_file() {
    let mut game = Game::new();
    let name = "gone.terrain.ron";
    game.write(name, ball_text(12.0, ""));
    let entity = game.spawn(name);
    let other = game.spawn(name);
    game.dig(entity);
    let dug = game.geometry(entity);
    let handle = game.handle(entity);
    game.app.world_mut().resource_mut::<Assets<TerrainDescription>>().remove(&handle);
    game.drawn(entity);
    assert_eq!(game.geometry(entity), dug);
    game.app.world_mut().despawn(other);
    game.app.world_mut().entity_mut(entity).remove::<TerrainFile>();
    drop(handle);
    game.drawn(entity);
    assert_eq!(game.app.world().resource::<Assets<TerrainDescription>>().len(), 0);
    assert_eq!(game.geometry(entity), dug);
    assert!(warnings(name).is_empty());
}

#[test]
fn descriptions_can_be_changed_in_code() {
    let mut game = Game::new();
    let mut description = TerrainDescription::from_ron(&ball_text(12.0, "")).unwrap();
    let handle = game.app.world_mut().resource_mut::<Assets<TerrainDescription>>().add(description.clone());
    let entity = game.app.world_mut().spawn(TerrainFile(handle.clone())).id();
    game.drawn(entity);
    assert_drawn(&mut game.app, entity);
    let before = game.geometry(entity);
    assert!(before.iter().any(|(_, mesh)| !mesh.is_empty()));

    let change = |game: &mut Game, description: &TerrainDescription| {
        let mut descriptions = game.app.world_mut().resource_mut::<Assets<TerrainDescription>>();
        *descriptions.get_mut(&handle).unwrap() = description.clone();
        game.drawn(entity);
    };
    warnings("code");
    description.source = SourceDescription::Sdf(Sdf::sphere([30.0; 3], f64::NAN));
    change(&mut game, &description);
    description.source = SourceDescription::HeightMap(HeightMapDescription {
        picture: "code.png".into(),
        settings: HeightMapSettings::default(),
        map: None,
    });
    change(&mut game, &description);
    assert_eq!(warnings("code.png").len(), 1);
    assert_eq!(game.geometry(entity), before, "a bad description changes nothing");
    description.source = SourceDescription::Air;
    change(&mut game, &description);
    assert!(game.geometry(entity).iter().all(|(_, mesh)| mesh.is_empty()));
}

#[test]
fn a_height_map_is_read_with_its_file() {
    let mut game = Game::new();
    let name = "map.terrain.ron";
    let text = "(source: HeightMap(picture: \"heights.png\", settings: (metres_per_unit: 0.001, floor: 20.0)),
        extent: (x: (0, 1), y: (0, 2), z: (0, 1)))";
    warnings(name);
    game.write(name, text);
    game.write("heights.png", grey_png(16, 16, |x, z| (x * z * 100) as u16));
    let entity = game.spawn(name);
    assert_drawn(&mut game.app, entity);
    let before = game.geometry(entity);
    assert!(before.iter().any(|(_, mesh)| !mesh.is_empty()));

    // The file's text stays the same, but the picture changes.
    let source = game.terrain(entity).source.clone();
    game.write("heights.png", grey_png(16, 16, |x, z| ((x + z) * 400) as u16));
    game.rewrite(name, text, entity, |app| app.world().get::<Terrain>(entity).unwrap().source != source);
    let changed = game.geometry(entity);
    assert_ne!(changed, before);

    let picture = grey_png(16, 16, |_, _| 1);
    game.write("heights.png", &picture[..picture.len() / 2]);
    game.fail(name, text, entity);
    assert!(warnings(name)[0].contains("heights.png"), "{:?}", warnings(name));
    assert_eq!(game.geometry(entity), changed);
}

/// A 16-bit greyscale PNG picture.
fn grey_png(width: u32, height: u32, sample: impl Fn(u32, u32) -> u16) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let samples: Vec<u8> = (0..height)
        .flat_map(|z| (0..width).map(move |x| (x, z)))
        .flat_map(|(x, z)| sample(x, z).to_be_bytes())
        .collect();
    encoder.write_header().unwrap().write_image_data(&samples).unwrap();
    bytes
}

#[test]
fn the_plugin_does_nothing_without_assets_and_may_come_before_them() {
    let mut app = bare_app();
    let entity = app.world_mut().spawn((ground(), TerrainFile::default())).id();
    settle(&mut app, entity);
    let mut app = App::new();
    app.add_plugins(TerrainFilePlugin);
    app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default()));
    app.finish();
    assert!(app.world().contains_resource::<Assets<TerrainDescription>>());
}

#[test]
fn the_name_alone_tells_that_a_file_describes_a_terrain() {
    let mut game = Game::new();
    game.write("named.terrain.ron", ball_text(12.0, ""));
    let handle = game.server().load_builder().load_untyped("named.terrain.ron");
    update_until(&mut game.app, |app| app.world().resource::<AssetServer>().is_loaded(&handle));
    let descriptions = game.app.world().resource::<Assets<TerrainDescription>>();
    assert_eq!(descriptions.len(), 1);
}

#[test]
fn stamps_wait_for_a_file_that_is_being_read() {
    let description =
        TerrainDescription::new(SourceDescription::Sdf(Sdf::cuboid([32.0, 0.0, 32.0], [99.0, 14.5, 99.0])));
    let description = TerrainDescription { extent: UVec3::splat(2).into(), ..description };
    let mut game = Game::new();
    game.write("a.terrain.ron", description.to_ron().unwrap());
    game.write("bad.terrain.ron", "(");
    let at = Vec3::new(20.0, 14.0, 20.0);
    let dig = |terrain| Stamp::dig(terrain, BrushShape::sphere(at, 5.0));
    // A new terrain, and a terrain that gets another file.
    let former = game.app.world_mut().spawn(ground_of_rock()).id();
    settle(&mut game.app, former);
    for entity in [game.app.world_mut().spawn_empty().id(), former] {
        let handle = game.server().load("a.terrain.ron");
        game.app.world_mut().entity_mut(entity).insert(TerrainFile(handle));
        game.app.world_mut().write_message(dig(entity));
        game.app.update();
        assert!(!volume(&game.app, entity).is_settled());
        game.loaded(entity);
        assert_as_new(&mut game.app, entity, &[dig(entity)]);
    }
    // Neither a bad file nor a removed one makes a terrain wait for ever.
    let handle = game.server().load("bad.terrain.ron");
    game.app.world_mut().entity_mut(former).insert(TerrainFile(handle));
    game.app.world_mut().write_message(Stamp::add(former, BrushShape::sphere(at, 5.0), 2));
    update_until(&mut game.app, |app| volume(app, former).is_settled());
    assert_as_new(&mut game.app, former, &[dig(former), Stamp::add(former, BrushShape::sphere(at, 5.0), 2)]);
    let handle = game.server().load("b.terrain.ron");
    game.app.world_mut().entity_mut(former).insert(TerrainFile(handle)).remove::<TerrainFile>();
    game.app.world_mut().write_message(dig(former));
    update_until(&mut game.app, |app| volume(app, former).is_settled());
}

/// All rock.
fn ground_of_rock() -> Terrain {
    small(Terrain::new(|_: [f64; 3]| -9.0))
}
