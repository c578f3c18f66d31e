//! Caves grown by a cellular automaton from noise, in a block of rock that is cut open.
//!
//! Every point of the block begins as rock or air by chance. In each step a point turns to rock where enough of its 26
//! neighbours are rock, and stays rock where enough of them are. Then all air that is not connected to the largest cave
//! is filled, and what is left is meshed. Sliders change all of it; growing runs beside the drawing. Cut faces are
//! light, caves the bluer the deeper; V shows the largest cave as a body instead.
//!
//! Click beside the panel to grab the mouse, Esc frees it. W, A, S, D, Space and Shift fly, Ctrl flies faster. R takes
//! another seed, V turns rock into caves and back.
//!
//! `--screenshot` renders a picture without a window; `--headless`, or no display, prints the figures, checks the mesh
//! and writes it. See `--help`.

mod args;
mod caves;
mod panel;
mod scene;

use std::error::Error;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use clap::Parser as _;
use marchless::MeshReport;
use marchless_examples::camera::FlyCameraPlugin;
use marchless_examples::picture::{PicturePlugin, picture_plugins, window_plugins};
use marchless_examples::{glb, graphics};

use args::Args;
use caves::Caves;

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// A picture was asked for, but there is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

fn main() -> ExitCode {
    run(&Args::parse()).unwrap_or_else(|error| {
        eprintln!("cellular_caves: {error}");
        ExitCode::from(BAD_INPUT)
    })
}

fn run(args: &Args) -> Result<ExitCode, Box<dyn Error>> {
    args.check_files()?;
    if args.headless {
        return Ok(headless(args));
    }
    if let Some(path) = &args.screenshot {
        let picture = PicturePlugin { path: path.clone(), size: args.size };
        return Ok(match graphics::build(|app| picture_app(app, picture, args)) {
            Ok(app) => finish(app),
            Err(reason) => {
                eprintln!("cellular_caves: no picture can be rendered, since {reason}");
                ExitCode::from(NO_GRAPHICS)
            }
        });
    }
    Ok(match graphics::build(|app| window_app(app, args)) {
        Ok(app) => finish(app),
        Err(reason) => {
            println!("Since {reason}, this is the headless run.");
            headless(args)
        }
    })
}

fn finish(mut app: App) -> ExitCode {
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn headless(args: &Args) -> ExitCode {
    match try_headless(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cellular_caves: {error}");
            ExitCode::FAILURE
        }
    }
}

fn try_headless(args: &Args) -> Result<(), Box<dyn Error + Send + Sync>> {
    let caves = Caves::grow(&args.settings())?;
    for (name, value) in caves.figures.lines() {
        println!("{name}: {value}");
    }
    let report = MeshReport::new(&caves.midpoints, &caves.solid.mesh.indices);
    println!("mesh: {report}");
    if !report.is_closed() || !report.is_clean() {
        return Err("the mesh is not as it should be".into());
    }
    let file = caves.solid.to_file(|position, _, _| caves.color(position));
    glb::write(&args.out, &file).map_err(|error| format!("{} cannot be written: {error}", args.out.display()))?;
    println!("Wrote {}.", args.out.display());
    Ok(())
}

fn window_app(app: &mut App, args: &Args) {
    app.add_plugins((window_plugins("Marchless: cellular caves"), EguiPlugin::default(), FlyCameraPlugin))
        .insert_resource(args.settings())
        .add_plugins((scene::plugin, panel::plugin));
}

fn picture_app(app: &mut App, picture: PicturePlugin, args: &Args) {
    app.add_plugins((picture_plugins(), picture))
        .insert_resource(args.settings())
        .add_plugins(scene::plugin)
        .add_systems(Update, scene::be_ready);
}
