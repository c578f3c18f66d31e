//! [`app`] and [`sun`]: what the small examples stand on, in a window or as a picture.

use std::path::PathBuf;

use bevy::app::PluginGroupBuilder;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy_marchless::prelude::TerrainVolume;
use clap::Parser;

use crate::camera::FlyCameraPlugin;
use crate::graphics;
use crate::picture::{PicturePlugin, PictureReady, check_picture_name, picture_plugins, window_plugins};

#[derive(Parser)]
#[command(about = None)]
struct Arguments {
    /// Renders one picture to this PNG file, without a window, and exits
    #[arg(long, value_name = "FILE.png", value_parser = picture_name)]
    screenshot: Option<PathBuf>,
}

/// An app with Bevy's default plugins, the plugin of [`fly_camera`](crate::camera::fly_camera), a blue sky and the
/// light that comes from it, in a window of that title.
///
/// With `--screenshot FILE.png` it has no window, renders one picture as soon as all terrains are drawn, and exits.
/// Where there is no screen or no graphics adapter it says so and exits with code 1.
pub fn app(title: &str) -> App {
    app_with(title, Arguments::parse().screenshot, |plugins| plugins)
}

/// The same for examples with flags of their own. `plugins`: changes Bevy's default plugins.
pub fn app_with(
    title: &str,
    screenshot: Option<PathBuf>,
    plugins: impl Fn(PluginGroupBuilder) -> PluginGroupBuilder,
) -> App {
    let built = graphics::build(|app| match screenshot {
        None => {
            app.add_plugins((plugins(window_plugins(title)), FlyCameraPlugin));
        }
        Some(path) => {
            app.add_plugins((plugins(picture_plugins()), PicturePlugin { path, size: UVec2::new(640, 360) }))
                .add_systems(PreUpdate, wait_for_terrains);
        }
    });
    let mut app = built.unwrap_or_else(|missing| {
        eprintln!("This example needs a screen, but {missing}.");
        std::process::exit(1)
    });
    app.insert_resource(ClearColor(Color::srgb(0.55, 0.7, 0.85)))
        .insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
    app
}

/// A sun that shines in that direction, with shadows as far as a small terrain reaches.
pub fn sun(direction: Vec3) -> impl Bundle {
    (
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { maximum_distance: 600.0, first_cascade_far_bound: 150.0, ..default() }.build(),
        Transform::default().looking_to(direction, Vec3::Y),
    )
}

/// The name of a picture file, as the command line gives it.
///
/// # Errors
/// A sentence, where it does not end in .png.
pub fn picture_name(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    check_picture_name(&path)?;
    Ok(path)
}

fn wait_for_terrains(terrains: Query<&TerrainVolume>, mut ready: ResMut<PictureReady>) {
    ready.0 = !terrains.is_empty() && terrains.iter().all(TerrainVolume::is_settled);
}
