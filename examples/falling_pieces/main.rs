//! Dig through a pillar: a part that hangs free falls as a body of its own, until it meets the ground.
//!
//! Click to grab the mouse, Esc frees it. W, A, S, D, Space and Shift fly, Ctrl flies faster; the left button digs, R
//! builds everything anew. Cut the mushroom's stem, or both legs of the gate. The text says how large each island is.
//!
//! `--screenshot` renders a picture without a window; without a display, or with `--headless`, the stem is cut by
//! itself, and the island's volume and way are printed. See `--help`.

mod args;
mod bodies;
mod dig;
mod headless;
mod label;
mod picture;
mod scene;

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use bevy_marchless::material::TerrainMaterialPlugin;
use bevy_marchless::prelude::*;
use clap::Parser as _;
use marchless_examples::camera::FlyCameraPlugin;
use marchless_examples::graphics;
use marchless_examples::ground::GroundMaterial;
use marchless_examples::look::LookPlugin;
use marchless_examples::picture::{picture_plugins, window_plugins};

use args::Args;

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// A picture was asked for, but there is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

fn main() -> ExitCode {
    let args = Args::parse();
    if let Err(error) = args.check_files() {
        eprintln!("falling_pieces: {error}");
        return ExitCode::from(BAD_INPUT);
    }
    if args.headless {
        return headless::run();
    }
    if args.screenshot.is_some() {
        return match graphics::build(|app| picture_app(app, &args)) {
            Ok(app) => finish(app),
            Err(reason) => {
                eprintln!("falling_pieces: no picture can be rendered, since {reason}");
                ExitCode::from(NO_GRAPHICS)
            }
        };
    }
    match graphics::build(window_app) {
        Ok(app) => finish(app),
        Err(reason) => {
            println!("Since {reason}, this is the headless run.");
            headless::run()
        }
    }
}

fn finish(mut app: App) -> ExitCode {
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn window_app(app: &mut App) {
    app.add_plugins(window_plugins("Marchless: falling pieces")).add_plugins((
        EguiPlugin::default(),
        shown_plugin,
        FlyCameraPlugin,
        dig::plugin,
    ));
}

fn picture_app(app: &mut App, args: &Args) {
    app.add_plugins(picture_plugins()).add_plugins((
        EguiPlugin::default(),
        shown_plugin,
        picture::MomentPlugin::new(args),
    ));
}

/// What window and picture have in common.
fn shown_plugin(app: &mut App) {
    app.add_plugins((MarchlessPlugins, TerrainMaterialPlugin::<GroundMaterial>::default(), LookPlugin)).add_plugins((
        bodies::plugin,
        scene::plugin,
        label::plugin,
    ));
}
