//! Ten million voxels from the origin, and nothing shakes: terrain in a big space, chunk by chunk in its cells.
//!
//! Click to grab the mouse, then click to dig at the middle of the screen. W, A, S, D, Space and Shift fly, Esc frees
//! the mouse. `--voxels N` goes so many voxels away along x and z; it looks the same anywhere. `--screenshot FILE.png`
//! renders a picture and exits.

use std::f64::consts::TAU;
use std::path::PathBuf;

use bevy::input::common_conditions::input_just_pressed;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use big_space::prelude::*;
use clap::Parser;
use marchless_examples::camera::{fly_camera, mouse_is_grabbed};
use marchless_examples::small::{app_with, picture_name, sun};

#[derive(Parser, Resource, Clone)]
#[command(about = None)]
struct Arguments {
    /// How far away from the origin, along x and along z; rounded to a multiple of 16,000
    #[arg(long, default_value_t = 10_000_000, value_parser = clap::value_parser!(i32).range(-1_000_000_000..=1_000_000_000))]
    voxels: i32,
    /// Renders one picture to this PNG file, without a window, and exits
    #[arg(long, value_name = "FILE.png", value_parser = picture_name)]
    screenshot: Option<PathBuf>,
}

/// The hills are the same again after so many voxels.
const PERIOD: i32 = 128;
/// The edge of a cell, in voxels, each of which is a world unit.
const EDGE: i32 = 2_000;
/// So many voxels are whole periods, whole cells and whole chunks of 32 voxels.
const STEP: i32 = 16_000;

fn main() -> AppExit {
    let arguments = Arguments::parse();
    // The big space takes the place of Bevy's propagation.
    app_with("Marchless: far away", arguments.screenshot.clone(), |plugins| plugins.disable::<TransformPlugin>())
        .add_plugins((BigSpaceDefaultPlugins, MarchlessPlugins))
        .insert_resource(arguments)
        .add_systems(Startup, setup)
        .add_systems(Update, dig.run_if(mouse_is_grabbed).run_if(input_just_pressed(MouseButton::Left)))
        .run()
}

fn setup(mut commands: Commands, arguments: Res<Arguments>, mut stamps: MessageWriter<Stamp>) {
    let far = IVec3::new(1, 0, 1) * (arguments.voxels / STEP * STEP);

    // The terrain is a grid in a big space; what belongs to it is in the grid's cells.
    let space = commands.spawn(BigSpaceRootBundle::default()).id();
    let extent = Extent::new(far / 32 - IVec3::new(4, 0, 4), far / 32 + IVec3::new(4, 3, 4));
    let terrain = Terrain::new(hills).with_extent(extent);
    let grid = Grid::new(EDGE as f32, 100.0);
    let terrain = commands.spawn((terrain, grid, CellCoord::ZERO, ChildOf(space))).id();
    let camera = fly_camera(Vec3::new(0.0, 90.0, 140.0), Vec3::new(0.0, 30.0, 10.0));
    commands.spawn((camera, FloatingOrigin, CellCoord::ZERO + far / EDGE, ChildOf(terrain)));

    let hole = far.as_dvec3() + DVec3::new(-25.25, 46.5, 55.75);
    stamps.write(Stamp::dig(terrain, BrushShape::sphere(hole, 16.0)));
    let ball = far.as_dvec3() + DVec3::new(28.25, 33.5, 40.75);
    stamps.write(Stamp::add(terrain, BrushShape::sphere(ball, 12.0), 5));

    commands.spawn(sun(Vec3::new(-0.6, -0.6, -0.4)));
}

/// Hills that repeat along x and z.
fn hills([x, y, z]: [f64; 3]) -> f64 {
    let [x, z] = [x, z].map(|v| v.rem_euclid(f64::from(PERIOD)) / f64::from(PERIOD) * TAU);
    let height = 36.0 + 9.0 * x.sin() * z.cos() + 4.0 * (2.0 * x + z).sin() + 1.5 * (5.0 * z - 3.0 * x).cos();
    y - height
}

fn dig(camera: Single<&GlobalTransform, With<Camera3d>>, terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
    // Both are relative to the floating origin.
    let ray = Ray3d::new(camera.translation(), camera.forward());
    if let Some(hit) = terrains.ray_cast(ray, 1000.0) {
        stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, 8.0)));
    }
}
