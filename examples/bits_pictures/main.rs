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

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::prelude::*;
use clap::{Parser, ValueEnum};
use marchless::bits::BitGrid;
use marchless::{Region, Shape};
use marchless_examples::solid::Solid;
use marchless_examples::stage::{self, Failure, Prop, Stage};

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

/// [Units: pixels]
const SIZE: UVec2 = UVec2::new(480, 300);

const ROCK: [f32; 3] = [0.62, 0.52, 0.41];
const WATER: [f32; 3] = [0.16, 0.46, 0.80];
const MOSS: [f32; 3] = [0.42, 0.50, 0.27];
const PIECES: [[f32; 3]; 3] = [[0.86, 0.36, 0.20], [0.91, 0.68, 0.22], [0.30, 0.52, 0.72]];

const SUN: Vec3 = Vec3::new(-0.6, -1.0, -0.55);

fn main() -> ExitCode {
    let Args { scene, picture } = Args::parse();
    stage::render("bits_pictures", picture, SIZE, || scene.stage())
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

    fn prop(&self) -> Result<Prop> {
        let mut solid = Solid::new(&self.bits)?;
        // The grid's outer faces, and that of a cut, stay flat.
        let ends = self.bits.shape().size().map(|size| size as f32 - 0.5);
        solid.smooth(3, |position| core::array::from_fn(|axis| position[axis] == -0.5 || position[axis] == ends[axis]));
        Ok(Prop { mesh: solid.to_asset(|_, _, _| self.color), place: IVec3::from(self.place).as_vec3() })
    }
}

type Result<T> = core::result::Result<T, Failure>;

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
    stage(&[Body::new(caves, PIECES[1])], Vec3::splat(31.5), 140.0 * Vec3::new(0.62, 0.55, 0.9))
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
    stage(
        &[Body::new(rock, ROCK), Body::new(water, WATER)],
        Vec3::new(31.5, 30.0, 24.0),
        135.0 * Vec3::new(0.35, 0.38, 0.95),
    )
}

fn erosion() -> Result<Stage> {
    let rock = BitGrid::from_fn(Shape::new([100, 40, 21])?, snippets::columns)?;
    let left = snippets::weathered(&rock, 4)?;
    let before = Body { bits: rock, place: [0, 0, -30], color: PIECES[1] };
    stage(&[before, Body::new(left, ROCK)], Vec3::new(49.5, 14.0, -5.0), 135.0 * Vec3::new(0.32, 0.5, 0.85))
}

fn collision() -> Result<Stage> {
    let ground = BitGrid::from_fn(Shape::new([96, 40, 96])?, snippets::hills)?;
    let ball = BitGrid::from_fn(Shape::cube(11)?, |p| p.iter().map(|v| v.abs_diff(5).pow(2)).sum::<u32>() <= 27)?;
    let starts = [[20, 40, 40], [50, 40, 10], [14, 40, 75], [80, 40, 25], [46, 40, 62], [76, 40, 78]];
    let mut bodies: Vec<_> = (starts.into_iter().zip(PIECES.iter().cycle()))
        .map(|(start, &color)| Body { bits: ball.clone(), place: snippets::rolled(&ground, &ball, start), color })
        .collect();
    bodies.push(Body::new(ground, MOSS));
    stage(&bodies, Vec3::new(47.5, 12.0, 47.5), 180.0 * Vec3::new(0.45, 0.62, 0.75))
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
    stage(&bodies, Vec3::new(39.5, 16.0, 19.5), 120.0 * Vec3::new(0.3, 0.42, 0.9))
}

/// `eye`: from `target` to the camera. [Units: points]
fn stage(bodies: &[Body], target: Vec3, eye: Vec3) -> Result<Stage> {
    Ok(Stage { props: bodies.iter().map(Body::prop).collect::<Result<_>>()?, target, eye, sun: SUN })
}
