//! [`Brush`]: digs, adds and paints at the middle of the screen.

use core::time::Duration;

use bevy::input::mouse::AccumulatedMouseScroll;
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::math::DVec3;
use bevy::pbr::wireframe::NoWireframe;
use bevy::prelude::*;
use bevy::window::{CursorOptions, PrimaryWindow};
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_marchless::prelude::*;
use marchless_examples::camera::{FlyCamera, GrabMouse, mouse_is_grabbed};
use marchless_examples::look::MATERIALS;

use crate::world::World;

/// The brush, and what it is doing.
#[derive(Resource, Debug)]
pub(crate) struct Brush {
    /// [Units: voxels]
    pub(crate) radius: f32,
    /// How fast it digs and adds in its middle. [Units: voxels per second]
    pub(crate) rate: f32,
    /// What it adds and paints.
    pub(crate) material: u8,
    /// How far away it is where there is no surface. [Units: world]
    pub(crate) distance: f32,
    /// Where it is, in the terrain's voxels.
    pub(crate) place: Option<DVec3>,
    /// The stroke that goes on while a button is held.
    stroke: Option<Held>,
    /// How many strokes there were.
    strokes: u64,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    button: MouseButton,
    operation: BrushOperation,
    time: Duration,
}

/// The smallest and the largest brush. [Units: voxels]
pub(crate) const RADII: core::ops::RangeInclusive<f32> = 1.0..=32.0;

const BUTTONS: [(MouseButton, BrushOperation); 3] = [
    (MouseButton::Left, BrushOperation::Dig),
    (MouseButton::Right, BrushOperation::Add),
    (MouseButton::Middle, BrushOperation::Paint),
];

impl Default for Brush {
    fn default() -> Self {
        Self { radius: 6.0, rate: 12.0, material: 1, distance: 40.0, place: None, stroke: None, strokes: 0 }
    }
}

/// The translucent ball that shows the brush.
#[derive(Component)]
struct BrushBall;

pub(crate) fn plugin(app: &mut App) {
    app.init_resource::<Brush>()
        .configure_sets(Update, GrabMouse.run_if(not(egui_wants_any_pointer_input)))
        .add_systems(Startup, spawn_ball)
        .add_systems(
            Update,
            (
                press_keys.run_if(not(egui_wants_any_keyboard_input)),
                change_size.run_if(mouse_is_grabbed),
                aim,
                stroke,
                show_ball,
                draw_bounds,
            )
                .chain()
                // The click that grabs the mouse does not dig.
                .before(GrabMouse),
        );
}

fn spawn_ball(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        BrushBall,
        Mesh3d(meshes.add(Sphere::new(1.0).mesh().uv(48, 24))),
        MeshMaterial3d(materials.add(StandardMaterial {
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            fog_enabled: false,
            ..default()
        })),
        NotShadowCaster,
        NotShadowReceiver,
        NoWireframe,
    ));
}

fn press_keys(keys: Res<ButtonInput<KeyCode>>, mut brush: ResMut<Brush>, mut world: ResMut<World>) {
    let count = MATERIALS.len() as u8;
    if keys.just_pressed(KeyCode::KeyE) {
        brush.material = (brush.material + 1) % count;
    }
    if keys.just_pressed(KeyCode::KeyQ) {
        brush.material = (brush.material + count - 1) % count;
    }
    if keys.just_pressed(KeyCode::KeyR) {
        world.shuffle();
    }
    if keys.just_pressed(KeyCode::KeyC) {
        world.clear();
    }
}

fn change_size(scroll: Res<AccumulatedMouseScroll>, mut brush: ResMut<Brush>) {
    if scroll.delta.y != 0.0 {
        let lines = scroll.delta.y.clamp(-4.0, 4.0);
        brush.radius = (brush.radius * 1.1f32.powf(lines)).clamp(*RADII.start(), *RADII.end());
    }
}

/// Finds the surface under the crosshair, or a place at a fixed distance where there is none.
fn aim(
    mut brush: ResMut<Brush>,
    camera: Single<&Transform, With<FlyCamera>>,
    terrain: Single<Entity, With<Terrain>>,
    query: TerrainQuery,
) {
    let ray = Ray3d::new(camera.translation, camera.forward());
    let hit = query.ray_cast_terrain(*terrain, ray, 4096.0);
    let free = || query.to_lattice(*terrain, ray.get_point(brush.distance + brush.radius));
    brush.place = hit.map(|hit| hit.lattice).or_else(free);
}

/// A button that is held works on, by as much as time has passed: the same at any frame rate.
fn stroke(
    time: Res<Time>,
    buttons: Res<ButtonInput<MouseButton>>,
    terrain: Single<Entity, With<Terrain>>,
    cursor: Query<&CursorOptions, With<PrimaryWindow>>,
    mut brush: ResMut<Brush>,
    mut stamps: MessageWriter<Stamp>,
) {
    let grabbed = mouse_is_grabbed(cursor);
    if brush.stroke.is_some_and(|held| !buttons.pressed(held.button)) || !grabbed {
        brush.stroke = None;
    }
    let pressed = BUTTONS.iter().find(|(button, _)| buttons.just_pressed(*button));
    if let (None, Some(&(button, operation)), true) = (brush.stroke, pressed, grabbed) {
        brush.strokes += 1;
        brush.stroke = Some(Held { button, operation, time: Duration::ZERO });
    }
    let (Some(held), Some(place)) = (brush.stroke, brush.place) else { return };

    let shape = BrushShape::sphere(place, brush.radius);
    let end = held.time + time.delta();
    let timed = Stroke { id: brush.strokes, rate: brush.rate, falloff: brush.radius, start: held.time, end };
    stamps.write(match held.operation {
        BrushOperation::Dig => Stamp::dig(*terrain, shape).with_stroke(timed),
        BrushOperation::Add => Stamp::add(*terrain, shape, brush.material).with_stroke(timed),
        BrushOperation::Paint => Stamp::paint(*terrain, shape, brush.material),
    });
    brush.stroke = Some(Held { time: end, ..held });
}

fn show_ball(
    brush: Res<Brush>,
    terrain: Single<(Entity, &Terrain)>,
    query: TerrainQuery,
    ball: Single<(&mut Transform, &mut Visibility, &MeshMaterial3d<StandardMaterial>), With<BrushBall>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let (terrain, settings) = *terrain;
    let (mut transform, mut visibility, material) = ball.into_inner();
    let place = brush.place.and_then(|place| query.to_world(terrain, place));
    visibility.set_if_neq(if place.is_some() { Visibility::Inherited } else { Visibility::Hidden });
    // A voxel is a world unit.
    *transform = Transform::from_translation(place.unwrap_or_default()).with_scale(Vec3::splat(brush.radius));
    // Brighter than white, so that it shows on snow as well.
    let own = settings.palette.color(brush.material).to_linear();
    let color = Color::from(match brush.stroke.map(|held| held.operation) {
        Some(BrushOperation::Dig) => LinearRgba::new(2.5, 0.5, 0.2, 0.4),
        Some(_) => (own * 2.0).with_alpha(0.5),
        None => (own + LinearRgba::WHITE * 1.5).with_alpha(0.35),
    });
    // Not touched where it stays as it is, so that it is not uploaded every frame.
    if materials.get(material).is_some_and(|material| material.base_color != color)
        && let Some(mut material) = materials.get_mut(material)
    {
        material.base_color = color;
    }
}

/// Draws the bounds of the world.
fn draw_bounds(terrain: Single<&Terrain>, mut gizmos: Gizmos) {
    let size = terrain.size_in_voxels().as_vec3();
    let bounds = Transform::from_translation(0.5 * size).with_scale(size);
    gizmos.cube(bounds, Color::srgba(1.0, 1.0, 1.0, 0.35));
}
