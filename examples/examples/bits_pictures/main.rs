//! The pictures of the page on grids of bits, `crates/marchless/docs/bits.md`: what the functions of that page return.
//!
//! `bits_pictures SCENE FILE.png` renders one of them, without a window. All of them anew:
//!
//! ```sh
//! for scene in caves water erosion collision floating; do
//!     cargo run --example bits_pictures -- $scene crates/marchless/docs/pictures/$scene.png
//! done
//! ```

mod snippets;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use clap::{Parser, ValueEnum};
use marchless::bits::BitGrid;
use marchless::{Region, Shape};
use marchless_examples::graphics;
use marchless_examples::picture::{PicturePlugin, PictureReady, check_picture, picture_plugins};
use marchless_examples::solid::Solid;

/// Renders a picture of the page on grids of bits.
#[derive(Parser)]
struct Args {
    scene: Scene,
    #[arg(value_name = "FILE.png")]
    picture: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Scene {
    Caves,
    Water,
    Erosion,
    Collision,
    Floating,
}

/// What a person gave is of no use.
const BAD_INPUT: u8 = 2;
/// There is no graphics adapter.
const NO_GRAPHICS: u8 = 3;
/// [Units: pixels]
const SIZE: UVec2 = UVec2::new(480, 300);

const ROCK: [f32; 3] = [0.62, 0.52, 0.41];
const WATER: [f32; 3] = [0.16, 0.46, 0.80];
const MOSS: [f32; 3] = [0.42, 0.50, 0.27];
const PIECES: [[f32; 3]; 3] = [[0.86, 0.36, 0.20], [0.91, 0.68, 0.22], [0.30, 0.52, 0.72]];

fn main() -> ExitCode {
    let Args { scene, picture } = Args::parse();
    let stage = check_picture(&picture).map_err(Into::into).and_then(|()| scene.stage());
    let stage = match stage {
        Ok(stage) => stage,
        Err(error) => {
            eprintln!("bits_pictures: {error}");
            return ExitCode::from(BAD_INPUT);
        }
    };
    let picture = PicturePlugin { path: picture, size: SIZE };
    match graphics::build(|app| _ = app.add_plugins((picture_plugins(), picture))) {
        Err(reason) => {
            eprintln!("bits_pictures: no picture can be rendered, since {reason}");
            ExitCode::from(NO_GRAPHICS)
        }
        Ok(mut app) => {
            app.insert_resource(ClearColor(Color::srgb(0.93, 0.94, 0.96)))
                .insert_resource(GlobalAmbientLight { brightness: 900.0, ..default() })
                .insert_resource(stage)
                .add_systems(Startup, set_up)
                .add_systems(Update, be_ready)
                .run();
            ExitCode::SUCCESS
        }
    }
}

/// What is drawn, and from where.
#[derive(Resource)]
struct Stage {
    bodies: Vec<Body>,
    /// The middle of what is looked at. [Units: points]
    target: Vec3,
    /// From there to the camera. [Units: points]
    eye: Vec3,
}

/// A grid in its place, in one colour.
struct Body {
    bits: BitGrid,
    place: [i32; 3],
    color: [f32; 3],
}

impl Body {
    fn new(bits: BitGrid, color: [f32; 3]) -> Self {
        Self { bits, place: [0; 3], color }
    }
}

type Result<T> = core::result::Result<T, Box<dyn Error + Send + Sync>>;

impl Scene {
    fn stage(self) -> Result<Stage> {
        match self {
            Self::Caves => caves(),
            Self::Water => water(),
            Self::Erosion => erosion(),
            Self::Collision => collision(),
            Self::Floating => floating(),
        }
    }
}

fn caves() -> Result<Stage> {
    let caves = snippets::caves(Shape::cube(64)?, 1)?;
    Ok(Stage {
        bodies: vec![Body::new(caves, PIECES[1])],
        target: Vec3::splat(31.5),
        eye: 140.0 * Vec3::new(0.62, 0.55, 0.9),
    })
}

fn water() -> Result<Stage> {
    let caves = snippets::caves(Shape::cube(64)?, 1)?;
    let spring = caves.iter().find(|point| point[1] == 32).ok_or("there is no cave half-way up")?;
    let mut water = snippets::water(&caves, spring)?;
    let mut rock = caves;
    rock.invert();
    // Cut open.
    for bits in [&mut rock, &mut water] {
        bits.fill(Region::new([0, 0, 32], [64; 3]), false);
    }
    Ok(Stage {
        bodies: vec![Body::new(rock, ROCK), Body::new(water, WATER)],
        target: Vec3::new(31.5, 30.0, 24.0),
        eye: 135.0 * Vec3::new(0.35, 0.38, 0.95),
    })
}

fn erosion() -> Result<Stage> {
    let rock = BitGrid::from_fn(Shape::new([100, 40, 21])?, snippets::columns)?;
    let left = snippets::weathered(&rock, 4)?;
    let before = Body { bits: rock, place: [0, 0, -30], color: PIECES[1] };
    Ok(Stage {
        bodies: vec![before, Body::new(left, ROCK)],
        target: Vec3::new(49.5, 14.0, -5.0),
        eye: 135.0 * Vec3::new(0.32, 0.5, 0.85),
    })
}

fn collision() -> Result<Stage> {
    let ground = BitGrid::from_fn(Shape::new([96, 40, 96])?, snippets::hills)?;
    let ball = BitGrid::from_fn(Shape::cube(11)?, |p| p.iter().map(|v| v.abs_diff(5).pow(2)).sum::<u32>() <= 27)?;
    let starts = [[20, 40, 40], [50, 40, 10], [14, 40, 75], [80, 40, 25], [46, 40, 62], [76, 40, 78]];
    let mut bodies: Vec<_> = (starts.into_iter().zip(PIECES.iter().cycle()))
        .map(|(start, &color)| Body { bits: ball.clone(), place: snippets::rolled(&ground, &ball, start), color })
        .collect();
    bodies.push(Body::new(ground, MOSS));
    Ok(Stage { bodies, target: Vec3::new(47.5, 12.0, 47.5), eye: 180.0 * Vec3::new(0.45, 0.62, 0.75) })
}

fn floating() -> Result<Stage> {
    let mut rock = BitGrid::from_fn(Shape::new([80, 40, 40])?, snippets::heads)?;
    for [x, z] in [[0, 20], [40, 0], [60, 20]] {
        rock.fill(Region::new([x, 10, z], [x + 20, 15, z + 20]), false);
    }
    let pieces = snippets::floating(&rock)?;
    let mut bodies: Vec<_> =
        (0..pieces.len()).map(|index| Body::new(pieces.mask(index), PIECES[index % PIECES.len()])).collect();
    for body in &bodies {
        rock.subtract(&body.bits)?;
    }
    bodies.push(Body::new(rock, ROCK));
    Ok(Stage { bodies, target: Vec3::new(39.5, 16.0, 19.5), eye: 120.0 * Vec3::new(0.3, 0.42, 0.9) })
}

fn set_up(
    stage: Res<Stage>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) -> bevy::ecs::error::Result {
    let material = materials.add(StandardMaterial { perceptual_roughness: 0.9, reflectance: 0.2, ..default() });
    for Body { bits, place, color } in &stage.bodies {
        let mut solid = Solid::new(bits)?;
        // The grid's outer faces, and that of a cut, stay flat.
        let ends = bits.shape().size().map(|size| size as f32 - 0.5);
        solid.smooth(3, |position| core::array::from_fn(|axis| position[axis] == -0.5 || position[axis] == ends[axis]));
        commands.spawn((
            Mesh3d(meshes.add(solid.to_asset(|_, _, _| *color))),
            MeshMaterial3d(material.clone()),
            Transform::from_translation(IVec3::from(*place).as_vec3()),
        ));
    }
    commands.spawn((
        Camera3d::default(),
        Projection::from(PerspectiveProjection { fov: 0.6, ..default() }),
        Transform::from_translation(stage.target + stage.eye).looking_at(stage.target, Vec3::Y),
        Tonemapping::AcesFitted,
    ));
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { num_cascades: 2, maximum_distance: 400.0, ..default() }.build(),
        Transform::default().looking_to(Vec3::new(-0.6, -1.0, -0.55), Vec3::Y),
    ));
    Ok(())
}

/// Meshes and materials arrive with the first updates.
fn be_ready(mut updates: Local<u32>, mut ready: ResMut<PictureReady>) {
    *updates += 1;
    ready.0 = *updates > 3;
}
