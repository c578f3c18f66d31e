//! Hills that you can dig: the least that a game needs.
//!
//! Click to grab the mouse, then click to dig at the middle of the screen. W, A, S, D, Space and Shift fly, Esc frees
//! the mouse. `--screenshot FILE.png` renders a picture and exits.

use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::{fly_camera, mouse_is_grabbed};
use marchless_examples::small::sun;

fn main() -> AppExit {
    // In a game: App::new().add_plugins(DefaultPlugins)
    marchless_examples::small::app("Marchless: quickstart")
        .add_plugins(MarchlessPlugins)
        .add_systems(Startup, setup)
        .add_systems(Update, dig.run_if(mouse_is_grabbed).run_if(input_just_pressed(MouseButton::Left)))
        .run()
}

fn setup(mut commands: Commands) {
    commands.spawn(Terrain::new(NoiseHeights::from_seed(7)));

    commands.spawn(fly_camera(Vec3::new(128.0, 150.0, 330.0), Vec3::new(128.0, 40.0, 128.0)));
    commands.spawn(sun(Vec3::new(-0.6, -0.6, -0.4)));
}

fn dig(camera: Single<&Transform, With<Camera3d>>, terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
    let ray = Ray3d::new(camera.translation, camera.forward());
    if let Some(hit) = terrains.ray_cast(ray, 1000.0) {
        stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, 8.0)));
    }
}
