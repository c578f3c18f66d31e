//! A landscape to dig: the main example.
//!
//! Click to grab the mouse, Esc frees it. W, A, S, D, Space and Shift fly, Ctrl flies faster. The left button digs, the
//! right one adds, the middle one paints; the wheel sizes the brush, Q and E change the material. R makes a new world,
//! C clears it to air.
//!
//! `--heightmap` loads real elevation, `--screenshot` renders a picture without a window, and `--headless` runs without
//! any renderer; see `--help`.

mod args;
mod brush;
mod headless;
mod panel;
mod picture;
mod world;

use std::error::Error;
use std::process::ExitCode;

use bevy::diagnostic::FrameTimeDiagnosticsPlugin;
use bevy::pbr::wireframe::WireframePlugin;
use bevy::prelude::*;
use bevy_marchless::material::TerrainMaterialPlugin;
use bevy_marchless::prelude::*;
use clap::Parser as _;
use marchless_examples::camera::FlyCameraPlugin;
use marchless_examples::graphics;
use marchless_examples::ground::GroundMaterial;
use marchless_examples::look::LookPlugin;
use marchless_examples::picture::{picture_plugins, window_plugins};

use args::Args;
use world::World;

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// A picture was asked for, but there is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

fn main() -> ExitCode {
    run(&Args::parse()).unwrap_or_else(|error| {
        eprintln!("sculpt: {error}");
        ExitCode::from(BAD_INPUT)
    })
}

fn run(args: &Args) -> Result<ExitCode, Box<dyn Error>> {
    args.check_files()?;
    let world = World::new(args)?;
    if args.headless {
        return Ok(headless::run(&world, &args.out));
    }
    if args.screenshot.is_some() {
        return Ok(match graphics::build(|app| picture_app(app, args, world)) {
            Ok(app) => finish(app),
            Err(reason) => {
                eprintln!("sculpt: no picture can be rendered, since {reason}");
                ExitCode::from(NO_GRAPHICS)
            }
        });
    }
    Ok(match graphics::build(|app| window_app(app, world.clone())) {
        Ok(app) => finish(app),
        Err(reason) => {
            println!("Since {reason}, this is the headless run.");
            headless::run(&world, &args.out)
        }
    })
}

fn finish(mut app: App) -> ExitCode {
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn window_app(app: &mut App, world: World) {
    app.add_plugins(window_plugins("Marchless: sculpt"))
        .add_plugins((scene_plugin, FlyCameraPlugin, brush::plugin, panel::plugin))
        .add_plugins((WireframePlugin::default(), FrameTimeDiagnosticsPlugin::default()))
        .insert_resource(world);
}

fn picture_app(app: &mut App, args: &Args, world: World) {
    app.add_plugins(picture_plugins())
        .add_plugins((scene_plugin, picture::SculptPicturePlugin::new(args)))
        .insert_resource(world);
}

/// What window and picture have in common.
fn scene_plugin(app: &mut App) {
    app.add_plugins((MarchlessPlugins, TerrainMaterialPlugin::<GroundMaterial>::default(), LookPlugin, world::plugin));
}
