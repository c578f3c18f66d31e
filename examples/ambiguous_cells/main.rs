//! One cell, its eight weights on sliders, and the surface that each topology makes of it, side by side.
//!
//! Three cubes stand for the same cell: meshed with `Topology::Separated`, with `Topology::Trilinear`, and the
//! trilinear interpolant itself, sampled 32 times as fine. Corners inside are orange, corners outside blue, the larger
//! the farther from the isovalue; the surface has the colour of the corners that it faces. Vertices on edges are white,
//! those in the cell's interior magenta. Where a face's corners alternate, the first two cubes may differ, and the
//! second agrees with the third.
//!
//! Drag to turn the cubes, the wheel zooms, R makes random ambiguous weights, F flips all signs.
//!
//! `--weights` and `--isovalue` choose the cell, `--screenshot` renders a picture without a window; without a display
//! the figures are printed. See `--help`.

mod args;
mod cell;
mod labels;
mod panel;
mod presets;
mod scene;

use std::error::Error;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use clap::Parser as _;
use marchless_examples::graphics;
use marchless_examples::picture::{PicturePlugin, PictureReady, picture_plugins, window_plugins};

use args::Args;
use cell::{Cell, View};

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// A picture was asked for, but there is no graphics adapter.
const NO_GRAPHICS: u8 = 3;

fn main() -> ExitCode {
    run(&Args::parse()).unwrap_or_else(|error| {
        eprintln!("ambiguous_cells: {error}");
        ExitCode::from(BAD_INPUT)
    })
}

fn run(args: &Args) -> Result<ExitCode, Box<dyn Error + Send + Sync>> {
    args.check_files()?;
    let cell = args.cell();
    if let Some(path) = &args.screenshot {
        let picture = PicturePlugin { path: path.clone(), size: args.size };
        return Ok(match graphics::build(|app| picture_app(app, picture, cell.clone())) {
            Ok(app) => {
                print_figures(&cell)?;
                finish(app)
            }
            Err(reason) => {
                eprintln!("ambiguous_cells: no picture can be rendered, since {reason}");
                ExitCode::from(NO_GRAPHICS)
            }
        });
    }
    Ok(match graphics::build(|app| window_app(app, cell.clone())) {
        Ok(app) => finish(app),
        Err(reason) => {
            println!("Since {reason}, these are the figures alone.");
            print_figures(&cell)?;
            ExitCode::SUCCESS
        }
    })
}

fn finish(mut app: App) -> ExitCode {
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn print_figures(cell: &Cell) -> Result<(), Box<dyn Error + Send + Sync>> {
    for view in View::ALL {
        println!("{}: {}", view.name(), cell.surface(view)?.figures().join(", "));
    }
    Ok(())
}

fn window_app(app: &mut App, cell: Cell) {
    app.add_plugins((window_plugins("Marchless: ambiguous cells"), EguiPlugin::default()))
        .insert_resource(cell)
        .add_plugins((scene::plugin, labels::plugin, panel::plugin));
}

fn picture_app(app: &mut App, picture: PicturePlugin, cell: Cell) {
    app.add_plugins((picture_plugins(), EguiPlugin::default(), picture))
        .insert_resource(cell)
        .add_plugins((scene::plugin, labels::plugin))
        .add_systems(Update, be_ready);
}

/// The labels' fonts come with the first updates.
fn be_ready(mut updates: Local<u32>, mut ready: ResMut<PictureReady>) {
    *updates += 1;
    ready.0 = *updates > 3;
}
