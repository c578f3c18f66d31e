//! An endless world: fly to the horizon, at any speed, and dig on the way.
//!
//! It flies on by itself; F stops and starts that, the keys 1 to 9 set the speed. Click to grab the mouse, Esc frees
//! it. W, A, S, D, Space and Shift fly, Ctrl flies faster, a click digs. G shows the chunks: drawn ones blue, waiting
//! ones orange, empty ones as small grey cubes. L shows them in the colours of their levels of detail, T all triangles
//! in these colours. The panel tells what loading costs.
//!
//! `--screenshot` renders a picture without a window; `--headless`, or no display, flies without any renderer, one line
//! of figures an update. See `--help`.

mod args;
mod dig;
mod figures;
mod flight;
mod headless;
mod panel;
mod picture;
mod triangles;
mod world;

use std::process::ExitCode;

use bevy::diagnostic::FrameTimeDiagnosticsPlugin;
use bevy::prelude::*;
use bevy_marchless::material::TerrainMaterialPlugin;
use bevy_marchless::prelude::*;
use clap::Parser as _;
use marchless_examples::camera::FlyCameraPlugin;
use marchless_examples::graphics;
use marchless_examples::ground::GroundMaterial;
use marchless_examples::look::LookPlugin;
use marchless_examples::picture::{FewColors, picture_plugins, window_plugins};

use args::Args;

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// A picture was asked for, but there is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

fn main() -> ExitCode {
    let args = Args::parse();
    if let Err(error) = args.check_files() {
        eprintln!("flyover: {error}");
        return ExitCode::from(BAD_INPUT);
    }
    if args.headless {
        return headless::run(&args);
    }
    if args.screenshot.is_some() {
        return match graphics::build(|app| picture_app(app, &args)) {
            Ok(app) => finish(app),
            Err(reason) => {
                eprintln!("flyover: no picture can be rendered, since {reason}");
                ExitCode::from(NO_GRAPHICS)
            }
        };
    }
    match graphics::build(|app| window_app(app, &args)) {
        Ok(app) => finish(app),
        Err(reason) => {
            println!("Since {reason}, this is the headless run.");
            headless::run(&args)
        }
    }
}

fn finish(mut app: App) -> ExitCode {
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn window_app(app: &mut App, args: &Args) {
    app.add_plugins((window_plugins("Marchless: flyover"), FrameTimeDiagnosticsPlugin::default()))
        .insert_resource(args.flight())
        .insert_resource(args.world())
        .add_plugins((shown_plugin, FlyCameraPlugin, flight::plugin, dig::plugin, panel::plugin))
        .add_systems(Startup, (flight::spawn_camera, triangles::show_if(args.triangles)));
}

fn picture_app(app: &mut App, args: &Args) {
    app.add_plugins(picture_plugins())
        .insert_resource(args.world())
        .add_plugins((shown_plugin, picture::HillPicturePlugin::new(args)))
        .add_systems(Startup, triangles::show_if(args.triangles));
    if args.triangles {
        // A picture of lines is large, and has few colours.
        app.insert_resource(FewColors);
    }
}

/// What window and picture have in common.
fn shown_plugin(app: &mut App) {
    app.add_plugins((MarchlessPlugins, TerrainMaterialPlugin::<GroundMaterial>::default(), LookPlugin))
        .add_plugins((world::plugin, triangles::plugin));
}
