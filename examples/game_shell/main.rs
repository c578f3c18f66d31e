//! What a game does around its terrain: a menu, pausing, slow motion, a level that is hidden, Bevy's own picking, a map
//! that sees only some terrains, and digging in `FixedUpdate`. One idea a file.
//!
//! Enter starts the level, Backspace goes back to the menu, and all of the level is gone. In the level: click to grab
//! the mouse, Esc frees it; W, A, S, D, Space and Shift fly. E digs where Bevy's mesh ray cast hits a chunk, F held
//! drills, H shows and hides a wall in front of the camera, P pauses, T slows time down; F5 saves the terrains as a
//! scene, F9 loads them.
//!
//! Without a display, or with `--headless`, it presses these keys by itself and checks what comes of it; the exit code
//! is 1 where something is not as it should be.

mod dig;
mod headless;
mod layers;
mod level;
mod pick;
mod save;
mod shell;
mod text;

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use bevy_marchless::prelude::*;
use clap::Parser;
use marchless_examples::camera::FlyCameraPlugin;
use marchless_examples::graphics;
use marchless_examples::picture::window_plugins;

/// What a game does around its terrain: menu, pause, picking, layers.
#[derive(Parser)]
#[command(name = "game_shell")]
struct Args {
    /// Run without any renderer: play by itself, and check what comes of it.
    #[arg(long)]
    headless: bool,
}

fn main() -> ExitCode {
    if Args::parse().headless {
        return headless::run();
    }
    match graphics::build(window_app) {
        Ok(mut app) => match app.run() {
            AppExit::Success => ExitCode::SUCCESS,
            AppExit::Error(code) => ExitCode::from(code.get()),
        },
        Err(reason) => {
            println!("Since {reason}, this is the headless run.");
            headless::run()
        }
    }
}

fn window_app(app: &mut App) {
    app.add_plugins(window_plugins("Marchless: game shell"))
        .add_plugins((EguiPlugin::default(), FlyCameraPlugin, game_plugin, layers::window_plugin, text::plugin))
        .insert_resource(ClearColor(Color::srgb(0.55, 0.7, 0.85)))
        .insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
}

/// The game itself, the same in a window and without.
fn game_plugin(app: &mut App) {
    app.add_plugins(MarchlessPlugins).add_plugins((
        shell::plugin,
        level::plugin,
        layers::plugin,
        pick::plugin,
        dig::plugin,
        save::plugin,
    ));
}
