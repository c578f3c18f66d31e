//! Many terrains side by side: asteroids that turn, and that can be dug while they do.
//!
//! Click to grab the mouse, then hold the left button to dig at the middle of the screen. W, A, S, D, Space and Shift
//! fly, Esc frees the mouse. `--screenshot FILE.png` renders a picture and exits.

use bevy::input::common_conditions::input_pressed;
use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use marchless_examples::camera::{fly_camera, mouse_is_grabbed};
use marchless_examples::small::sun;

/// Turns by so many radians per second around each axis.
#[derive(Component)]
struct Turning(Vec3);

fn main() -> AppExit {
    marchless_examples::small::app("Marchless: many terrains")
        .add_plugins(MarchlessPlugins)
        .add_systems(Startup, setup)
        .add_systems(Update, (turn, dig.run_if(mouse_is_grabbed).run_if(input_pressed(MouseButton::Left))))
        .run()
}

/// A ball with bumps and craters, in the middle of a box of 64 voxels per axis.
fn asteroid(number: u32) -> Sdf {
    let toward = |index: u32| {
        let [a, b] = [2.4, 1.7].map(|step| (index * 7 + number * 3) as f32 * step);
        Vec3::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos())
    };
    let middle = Vec3::splat(32.0);
    let core = Sdf::sphere(middle, 18.0).with_material(2);
    let bump = |index| Sdf::sphere(middle + toward(index) * 14.0, 5.0 + f64::from(index % 4)).with_material(6);
    let crater = |index| Sdf::sphere(middle + toward(index) * 22.0, 4.0 + f64::from(index % 5));
    let bumpy = (0..8).map(bump).fold(core, |all, bump| all.smooth_union(bump, 3.0));
    (8..20).map(crater).fold(bumpy, Sdf::subtraction)
}

fn setup(mut commands: Commands) {
    for number in 0..12 {
        let [column, row] = [number % 4, number / 4].map(|v| v as f32);
        // A terrain turns around its lowest corner; a parent in its middle turns it around that.
        let place = Vec3::new(column * 60.0 - 90.0, row * 45.0 - 45.0, (column - row).sin() * 30.0);
        let turning = Turning(Vec3::new(0.1 + 0.05 * row, 0.3 - 0.07 * column, 0.1));
        let size = Vec3::splat(0.6 + 0.1 * (number % 3) as f32);
        commands
            .spawn((Transform::from_translation(place).with_scale(size), Visibility::default(), turning))
            .with_child((
                Terrain::new(asteroid(number)).with_extent(UVec3::splat(2)),
                Transform::from_xyz(-32.0, -32.0, -32.0),
            ));
    }
    commands.spawn(fly_camera(Vec3::new(0.0, 20.0, 190.0), Vec3::ZERO));
    commands.spawn(sun(Vec3::new(-1.0, -0.5, -0.6)));
    commands.insert_resource(ClearColor(Color::BLACK));
    commands.insert_resource(GlobalAmbientLight { brightness: 100.0, ..default() });
}

fn turn(time: Res<Time>, mut asteroids: Query<(&mut Transform, &Turning)>) {
    for (mut transform, Turning(speed)) in &mut asteroids {
        transform.rotate_local(Quat::from_scaled_axis(*speed * time.delta_secs()));
    }
}

fn dig(camera: Single<&Transform, With<Camera3d>>, terrains: TerrainQuery, mut stamps: MessageWriter<Stamp>) {
    if let Some(hit) = terrains.ray_cast(Ray3d::new(camera.translation, camera.forward()), 1000.0) {
        stamps.write(Stamp::dig(hit.terrain, BrushShape::sphere(hit.lattice, 3.0)));
    }
}
