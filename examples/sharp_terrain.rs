//! One terrain three times, side by side: a hut and a wall of stone on soft earth, meshed with marching cubes, with the
//! dual mesher and smoothing, and with stone kept sharp.
//!
//! Click to grab the mouse, then hold the left button to dig at the middle of the screen: in all three at once. 1 to 3
//! fly to one of them, R fills what was dug. W, A, S, D, Space and Shift fly, Esc frees the mouse.
//!
//! `--screenshot FILE.png` renders a picture and exits. `--headless` runs without any renderer: it digs the same holes
//! in all three and checks their meshes.

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::input::common_conditions::input_pressed;
use bevy::prelude::*;
use bevy_marchless::marchless::MeshUnion;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use clap::Parser;
use marchless_examples::camera::{FlyCamera, fly_camera, mouse_is_grabbed};
use marchless_examples::small::{app_with, picture_name, sun};

/// One terrain three times, each with another mesher.
#[derive(Parser)]
#[command(name = "sharp_terrain")]
struct Args {
    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png", value_parser = picture_name, conflicts_with = "headless")]
    screenshot: Option<PathBuf>,

    /// Run without any renderer: dig in all three terrains, and check their meshes.
    #[arg(long)]
    headless: bool,
}

const STONE: u8 = 2;

/// The meshers, from left to right.
fn meshers() -> [(&'static str, TerrainMesher); 3] {
    let smooth = DualMesher { smoothing: 3, ..default() };
    let sharp = DualMesher { sharp: SharpMaterials::Only(vec![STONE]), crease: Some(35.0), ..smooth.clone() };
    [
        ("marching cubes", TerrainMesher::Primal),
        ("smoothed", smooth.into()),
        ("smoothed, with sharp stone", sharp.into()),
    ]
}

/// From the middle of one terrain to that of the next.
const APART: f32 = 72.0;
/// What is looked at in a terrain, from its lowest corner.
const MIDDLE: Vec3 = Vec3::new(32.0, 16.0, 32.0);
/// [Units: voxels]
const RADIUS: f32 = 4.0;

fn main() -> ExitCode {
    let args = Args::parse();
    if args.headless {
        return run_headless();
    }
    let mut app = app_with("Marchless: one terrain, three meshers", args.screenshot.clone(), |plugins| plugins);
    app.add_plugins(MarchlessPlugins)
        .add_systems(Startup, setup)
        .add_systems(Update, (dig.run_if(mouse_is_grabbed).run_if(input_pressed(MouseButton::Left)), press_keys));
    if args.screenshot.is_some() {
        app.add_systems(PostStartup, dig_everywhere);
    }
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

/// Soft earth, a hut with a gabled roof, and a wall.
fn source() -> Sdf {
    let ground = Sdf::half_space(Vec3::new(32.0, 8.3, 32.0), Vec3::new(0.06, 1.0, -0.04));
    let hill = Sdf::sphere(Vec3::new(46.0, 0.0, 20.0), 16.0);
    let earth = ground.smooth_union(hill, 8.0).with_material(7);
    let gables = [Vec3::new(0.7, 0.7, 0.0), Vec3::new(-0.7, 0.7, 0.0)];
    let hut = turned_box(Vec3::new(21.0, 14.0, 36.0), Vec3::new(8.3, 12.0, 10.3), 0.45, &gables);
    let wall = turned_box(Vec3::new(45.0, 8.0, 41.0), Vec3::new(12.3, 7.2, 1.9), -0.3, &[]);
    earth.union(hut.union(wall).with_material(STONE))
}

/// A box that is turned around the vertical axis, and cut off by planes through the middle of its top.
fn turned_box(middle: Vec3, half_size: Vec3, angle: f32, cuts: &[Vec3]) -> Sdf {
    let turn = Quat::from_rotation_y(angle);
    let side = |normal: Vec3| (middle + turn * (normal * half_size), turn * normal);
    let sides = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(side);
    let cuts = cuts.iter().map(|normal| (middle + Vec3::Y * half_size, turn * *normal));
    let planes = sides.into_iter().chain(cuts).map(|(point, normal)| Sdf::half_space(point, normal));
    planes.reduce(Sdf::intersection).expect("six sides")
}

fn terrains() -> impl Iterator<Item = (Terrain, Transform)> {
    meshers().into_iter().enumerate().map(|(number, (_, mesher))| {
        let terrain = Terrain::new(source()).with_extent(UVec3::new(2, 1, 2)).with_mesher(mesher);
        (terrain, Transform::from_translation(corner(number)))
    })
}

/// The lowest corner of a terrain.
fn corner(number: usize) -> Vec3 {
    Vec3::X * (APART * (number as f32 - 1.0)) - MIDDLE
}

/// Where the camera sees one terrain.
fn view_of(number: usize) -> Transform {
    let middle = corner(number) + MIDDLE;
    Transform::from_translation(middle + Vec3::new(10.0, 45.0, 60.0)).looking_at(middle, Vec3::Y)
}

fn setup(mut commands: Commands) {
    terrains().for_each(|terrain| _ = commands.spawn(terrain));
    commands.spawn(fly_camera(Vec3::new(0.0, 80.0, 125.0), Vec3::new(0.0, -8.0, 0.0)));
    commands.spawn(sun(Vec3::new(-0.6, -1.0, -0.5)));
}

/// Digs at the same place of all terrains.
fn dig(
    camera: Single<&Transform, With<FlyCamera>>,
    queries: TerrainQuery,
    terrains: Query<Entity, With<Terrain>>,
    mut stamps: MessageWriter<Stamp>,
) {
    if let Some(hit) = queries.ray_cast(Ray3d::new(camera.translation, camera.forward()), 1000.0) {
        stamps.write_batch(terrains.iter().map(|terrain| Stamp::dig(terrain, BrushShape::sphere(hit.lattice, RADIUS))));
    }
}

/// The holes of the picture and of the headless run.
fn holes(terrain: Entity) -> [Stamp; 3] {
    let dig = |shape| Stamp::dig(terrain, shape);
    [
        dig(BrushShape::sphere(Vec3::new(36.0, 9.0, 52.0), 7.0)),
        dig(BrushShape::sphere(Vec3::new(48.0, 14.0, 40.0), 4.0)),
        dig(BrushShape::capsule(Vec3::new(10.0, 13.0, 50.0), Vec3::new(24.0, 13.0, 34.0), 3.0)),
    ]
}

fn dig_everywhere(terrains: Query<Entity, With<Terrain>>, mut stamps: MessageWriter<Stamp>) {
    terrains.iter().for_each(|terrain| _ = stamps.write_batch(holes(terrain)));
}

fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut terrains: Query<&mut Terrain>,
    mut camera: Single<&mut Transform, With<FlyCamera>>,
) {
    for (number, key) in [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3].into_iter().enumerate() {
        if keys.just_pressed(key) {
            **camera = view_of(number);
        }
    }
    if keys.just_pressed(KeyCode::KeyR) {
        terrains.iter_mut().for_each(|mut terrain| terrain.set_source(source()));
    }
}

/// Digs in all terrains without a renderer, and checks that their meshes are closed.
fn run_headless() -> ExitCode {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, MarchlessPlugins));
    let all: Vec<Entity> = terrains().map(|terrain| app.world_mut().spawn(terrain).id()).collect();
    app.finish();
    app.cleanup();
    let settle = |app: &mut App| {
        while !all
            .iter()
            .all(|terrain| app.world().get::<TerrainVolume>(*terrain).is_some_and(TerrainVolume::is_settled))
        {
            app.update();
        }
    };
    settle(&mut app);
    all.iter().for_each(|terrain| _ = app.world_mut().write_message_batch(holes(*terrain)));
    app.update();
    settle(&mut app);
    let mut is_sound = true;
    for (terrain, (name, _)) in all.iter().zip(meshers()) {
        let mut union = MeshUnion::new();
        let mut chunks = app.world_mut().query::<(&Chunk, &ChunkGeometry)>();
        for (chunk, geometry) in chunks.iter(app.world()).filter(|(chunk, _)| chunk.terrain == *terrain) {
            union.add(&geometry.mesh, (chunk.position * 32).to_array().map(i64::from), chunk.level);
        }
        let report = union.report();
        println!("{name}: {report}");
        is_sound &= report.triangles > 0 && report.is_closed();
    }
    if is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
