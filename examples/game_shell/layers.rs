//! A map in the corner: a second camera that sees the hills, but not what floats above them.

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{ScalingMode, Viewport};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use marchless_examples::small::sun;

use crate::shell::Screen;

/// What the map shows. Layer 0 is what all cameras see that have no layers of their own.
const ON_MAP: usize = 1;

/// The map's camera.
#[derive(Component)]
pub(crate) struct MapCamera;

pub(crate) fn plugin(app: &mut App) {
    app.add_systems(OnEnter(Screen::Level), spawn_map_and_sun);
}

/// What only an app with a window needs.
pub(crate) fn window_plugin(app: &mut App) {
    app.add_systems(Update, place_map);
}

/// Chunks have the layers of their terrain.
pub(crate) fn of_hills() -> RenderLayers {
    RenderLayers::from_layers(&[0, ON_MAP])
}

fn spawn_map_and_sun(mut commands: Commands) {
    let view = OrthographicProjection {
        scaling_mode: ScalingMode::Fixed { width: 128.0, height: 128.0 },
        ..OrthographicProjection::default_3d()
    };
    commands.spawn((
        Camera3d::default(),
        Camera { order: 1, clear_color: ClearColorConfig::Custom(Color::BLACK), ..default() },
        Projection::from(view),
        Transform::from_xyz(64.0, 200.0, 64.0).looking_to(Dir3::NEG_Y, Dir3::NEG_Z),
        RenderLayers::layer(ON_MAP),
        MapCamera,
        DespawnOnExit(Screen::Level),
    ));
    // A light shines on what cameras see that share a layer with it.
    let layers = RenderLayers::from_layers(&[0, ON_MAP]);
    commands.spawn((sun(Vec3::new(-0.6, -0.6, -0.4)), layers, DespawnOnExit(Screen::Level)));
}

fn place_map(window: Single<&Window, With<PrimaryWindow>>, mut maps: Query<&mut Camera, With<MapCamera>>) {
    let side = window.physical_height() / 4;
    let position = UVec2::new(window.physical_width().saturating_sub(side), 0);
    for mut camera in &mut maps {
        let is_there = camera.viewport.as_ref().is_some_and(|viewport| viewport.physical_position == position);
        if side > 0 && !is_there {
            let physical_size = UVec2::splat(side);
            camera.viewport = Some(Viewport { physical_position: position, physical_size, ..default() });
        }
    }
}
