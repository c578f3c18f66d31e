//! [`app`]: what the small examples stand on, in a window or as a picture.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_marchless::prelude::TerrainVolume;
use clap::Parser;

use crate::camera::FlyCameraPlugin;
use crate::graphics;
use crate::picture::{PicturePlugin, PictureReady, picture_plugins, window_plugins};

#[derive(Parser)]
#[command(about = None)]
struct Arguments {
    /// Renders one picture to this PNG file, without a window, and exits
    #[arg(long, value_name = "FILE.png")]
    screenshot: Option<PathBuf>,
}

/// An app with Bevy's default plugins and a camera to fly with, in a window of that title.
///
/// With `--screenshot FILE.png` it has no window, renders one picture as soon as all terrains are drawn, and exits. Where there
/// is no screen or no graphics adapter it says so and exits with code 1.
pub fn app(title: &str) -> App {
    let Arguments { screenshot } = Arguments::parse();
    let built = graphics::build(|app| match screenshot {
        None => {
            app.add_plugins((window_plugins(title), FlyCameraPlugin));
        }
        Some(path) => {
            app.add_plugins((picture_plugins(), PicturePlugin { path, size: UVec2::new(640, 360) }))
                .add_systems(PreUpdate, wait_for_terrains);
        }
    });
    built.unwrap_or_else(|missing| {
        eprintln!("This example needs a screen, but {missing}.");
        std::process::exit(1)
    })
}

fn wait_for_terrains(terrains: Query<&TerrainVolume>, mut ready: ResMut<PictureReady>) {
    ready.0 = !terrains.is_empty() && terrains.iter().all(TerrainVolume::is_settled);
}
