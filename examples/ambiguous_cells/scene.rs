//! The cubes, the camera before them, and turning them.

use core::f32::consts::FRAC_PI_2;

use bevy::asset::RenderAssetUsages;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll};
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_egui::input::egui_wants_any_pointer_input;
use marchless::MeshBuffer;
use marchless::cell::Corner;

use crate::cell::{Cell, Surface, View, is_interior};

/// A cube that shows a cell. Its origin is the cell's middle.
#[derive(Component)]
#[require(Transform, Visibility)]
pub(crate) struct Cube {
    pub(crate) view: View,
    pub(crate) surface: Surface,
}

/// How the cubes are turned and how large they are.
#[derive(Resource)]
struct Pose {
    /// [Units: radians]
    yaw: f32,
    /// [Units: radians]
    pitch: f32,
    zoom: f32,
}

/// How much of the window's lower end the panel covers. [Units: logical pixels]
#[derive(Resource, Default)]
pub(crate) struct Covered(pub(crate) f32);

/// From one cube's middle to the next one's. [Units: cells]
const SPACING: f32 = 2.2;
/// What the camera shows at least: the cubes and their labels. [Units: cells]
const STAGE: Vec2 = Vec2::new(3.0 * SPACING, 2.85);
/// The camera's vertical angle of view, small so that all cubes look alike. [Units: radians]
const ANGLE: f32 = 0.2;

const BACKGROUND: Color = Color::srgb(0.085, 0.095, 0.115);
const INSIDE: Color = Color::srgb(1.0, 0.58, 0.16);
const OUTSIDE: Color = Color::srgb(0.34, 0.62, 1.0);
const ON_EDGE: Color = Color::srgb(0.95, 0.95, 0.95);
const IN_INTERIOR: Color = Color::srgb(1.0, 0.15, 0.75);
const CUBE_EDGES: Color = Color::srgb(0.5, 0.53, 0.58);
const TRIANGLE_EDGES: Color = Color::srgb(0.04, 0.05, 0.07);

pub(crate) fn plugin(app: &mut App) {
    app.insert_resource(Pose { yaw: -0.5, pitch: 0.35, zoom: 1.0 })
        .insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 450.0, ..default() })
        .init_resource::<Covered>()
        .init_resource::<Balls>()
        .add_systems(Startup, (set_up, configure_lines))
        .add_systems(
            Update,
            (turn.run_if(not(egui_wants_any_pointer_input)), place, show.run_if(resource_changed::<Cell>), draw_lines)
                .chain(),
        );
}

/// The mesh of all balls, and the materials.
#[derive(Resource)]
struct Balls {
    mesh: Handle<Mesh>,
    inside: Handle<StandardMaterial>,
    outside: Handle<StandardMaterial>,
    on_edge: Handle<StandardMaterial>,
    in_interior: Handle<StandardMaterial>,
    /// The surface has its colours in its vertices.
    surface: Handle<StandardMaterial>,
}

impl FromWorld for Balls {
    fn from_world(world: &mut World) -> Self {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(1.0).mesh().uv(32, 16));
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let mut material = |base_color| {
            materials.add(StandardMaterial { base_color, perceptual_roughness: 0.9, reflectance: 0.1, ..default() })
        };
        Self {
            mesh,
            inside: material(INSIDE),
            outside: material(OUTSIDE),
            on_edge: material(ON_EDGE),
            in_interior: material(IN_INTERIOR),
            surface: material(Color::WHITE),
        }
    }
}

fn set_up(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        Projection::Perspective(PerspectiveProjection { fov: ANGLE, ..default() }),
        // Colours as they were chosen.
        Tonemapping::None,
    ));
    let light = DirectionalLight { illuminance: 2_200.0, ..default() };
    commands.spawn((light, Transform::default().looking_to(Vec3::new(0.45, -0.7, -1.0), Vec3::Y)));
    for (index, view) in View::ALL.into_iter().enumerate() {
        let place = Vec3::X * SPACING * (index as f32 - 1.0);
        commands.spawn((Cube { view, surface: Surface::default() }, Transform::from_translation(place)));
    }
}

fn configure_lines(mut configs: ResMut<GizmoConfigStore>) {
    let (config, _) = configs.config_mut::<DefaultGizmoConfigGroup>();
    // Triangles' edges before their triangles.
    config.depth_bias = -0.0002;
    config.line.width = 2.0;
}

fn turn(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    mut pose: ResMut<Pose>,
) {
    if buttons.pressed(MouseButton::Left) {
        pose.yaw += 0.008 * motion.delta.x;
        pose.pitch = (pose.pitch + 0.008 * motion.delta.y).clamp(-FRAC_PI_2, FRAC_PI_2);
    }
    pose.zoom = (pose.zoom * 1.1f32.powf(scroll.delta.y.clamp(-4.0, 4.0))).clamp(0.4, 4.0);
}

/// Places the camera so that the part of the window that is not covered shows the stage, and turns every cube towards
/// it by the same angles, so that all are seen alike.
fn place(
    pose: Res<Pose>,
    covered: Res<Covered>,
    camera: Single<(&Camera, &mut Transform), Without<Cube>>,
    mut cubes: Query<&mut Transform, With<Cube>>,
) {
    let (camera, mut eye) = camera.into_inner();
    let Some(size) = camera.logical_viewport_size() else { return };
    let free = Vec2::new(size.x, size.y - covered.0).max(Vec2::ONE);
    // In cells, at the cubes' distance.
    let pixel = (STAGE / free).max_element() / pose.zoom;
    let distance = 0.5 * size.y * pixel / (0.5 * ANGLE).tan();
    *eye = Transform::from_xyz(0.0, -0.5 * covered.0 * pixel, distance);
    for mut cube in &mut cubes {
        let towards = Quat::from_rotation_arc(Vec3::Z, (eye.translation - cube.translation).normalize());
        cube.rotation = towards * Quat::from_rotation_x(pose.pitch) * Quat::from_rotation_y(pose.yaw);
    }
}

/// Makes every cube's balls and surface anew.
fn show(
    cell: Res<Cell>,
    balls: Res<Balls>,
    mut cubes: Query<(Entity, &mut Cube)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut commands: Commands,
) -> Result {
    let case = cell.case();
    for (entity, mut cube) in &mut cubes {
        cube.surface = cell.surface(cube.view)?;
        let surface = &cube.surface;
        let mut commands = commands.entity(entity);
        commands.despawn_children();
        let mut ball = |place: Vec3, radius: f32, material: &Handle<StandardMaterial>| {
            let transform = Transform::from_translation(place).with_scale(Vec3::splat(radius));
            commands.with_child((Mesh3d(balls.mesh.clone()), MeshMaterial3d(material.clone()), transform));
        };
        for corner in Corner::ALL {
            let distance = (cell.weights[corner.index()] - cell.isovalue).abs();
            let material = if case.is_inside(corner) { &balls.inside } else { &balls.outside };
            ball(corner_place(corner), 0.03 + 0.06 * distance.min(1.5), material);
        }
        for &position in surface.mesh.positions.iter().filter(|_| !surface.is_refined) {
            let (radius, material) =
                if is_interior(position) { (0.035, &balls.in_interior) } else { (0.022, &balls.on_edge) };
            ball(to_cube(position), radius, material);
        }
        if !surface.mesh.is_empty() {
            let mesh = meshes.add(to_asset(&surface.mesh, surface.is_refined));
            commands.with_child((Mesh3d(mesh), MeshMaterial3d(balls.surface.clone())));
        }
    }
    Ok(())
}

fn draw_lines(cubes: Query<(&Cube, &Transform)>, mut gizmos: Gizmos) {
    for (Cube { surface, .. }, &transform) in &cubes {
        gizmos.cube(transform, CUBE_EDGES);
        for triangle in surface.mesh.triangles().filter(|_| !surface.is_refined) {
            let [a, b, c] = triangle.map(|v| transform * to_cube(surface.mesh.positions[v as usize]));
            gizmos.linestrip([a, b, c, a], TRIANGLE_EDGES);
        }
    }
}

/// Where a corner is in its cube.
pub(crate) fn corner_place(corner: Corner) -> Vec3 {
    to_cube(corner.offset().map(f32::from))
}

fn to_cube(position: [f32; 3]) -> Vec3 {
    Vec3::from(position) - 0.5
}

/// A mesh with two sides, each in its own colour: the one that faces outside is blue, the other orange.
///
/// `is_smooth`: with the normals of the vertices, instead of those of the triangles.
fn to_asset(buffer: &MeshBuffer, is_smooth: bool) -> Mesh {
    let [mut positions, mut normals] = [const { Vec::new() }; 2];
    let mut colors = Vec::new();
    for triangle in buffer.triangles() {
        let corners = triangle.map(|v| to_cube(buffer.positions[v as usize]));
        let [a, b, c] = corners;
        let flat = (b - a).cross(c - a).normalize_or_zero();
        let along = triangle.map(|v| if is_smooth { Vec3::from(buffer.normals[v as usize]) } else { flat });
        for (order, sign, color) in [([0, 1, 2], 1.0, OUTSIDE), ([0, 2, 1], -1.0, INSIDE)] {
            positions.extend(order.map(|i: usize| corners[i]));
            normals.extend(order.map(|i: usize| sign * along[i]));
            colors.extend([color.to_linear().to_f32_array(); 3]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
}
