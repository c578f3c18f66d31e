//! The pictures of the page on sources, `crates/bevy_marchless/docs/sources.md`: what the functions of that page
//! return.
//!
//! `source_pictures SCENE FILE.png` renders one of them, without a window. All of them anew:
//!
//! ```sh
//! for scene in noise ridges terraces warp product caves tunnels shapes materials; do
//!     cargo run --example source_pictures -- $scene crates/bevy_marchless/docs/pictures/$scene.png
//! done
//! ```

mod snippets;

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_marchless::prelude::*;
use bevy_marchless::source::prelude::*;
use clap::{Parser, ValueEnum};
use marchless_examples::solid::Solid as Body;
use marchless_examples::stage::{self, Failure, Prop, Stage};

/// Renders a picture of the page on sources.
#[derive(Parser)]
struct Args {
    scene: Scene,
    #[arg(value_name = "FILE.png")]
    picture: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Scene {
    Noise,
    Ridges,
    Terraces,
    Warp,
    Product,
    Caves,
    Tunnels,
    Shapes,
    Materials,
}

/// [Units: pixels]
const SIZE: UVec2 = UVec2::new(480, 320);
/// The block that is cut out of each landscape. [Units: points, one a world unit]
const BLOCK: SourceRegion = SourceRegion { min: [0; 3], size: [256, 128, 176], level: 0, spacing: 1.0 };
/// How far around light gets lost. [Units: points]
const REACH: i32 = 6;

/// Grass, earth, rock, sand, snow, clay, two kinds of sandstone, woods; sRGB.
const COLORS: [[f32; 3]; 9] = [
    [0.42, 0.50, 0.27],
    [0.52, 0.38, 0.25],
    [0.62, 0.53, 0.43],
    [0.86, 0.75, 0.52],
    [0.95, 0.96, 0.98],
    [0.72, 0.40, 0.28],
    [0.70, 0.58, 0.44],
    [0.76, 0.64, 0.50],
    [0.27, 0.36, 0.18],
];

fn main() -> ExitCode {
    let Args { scene, picture } = Args::parse();
    stage::render("source_pictures", picture, SIZE, || scene.stage())
}

impl Scene {
    fn stage(self) -> Result<Stage, Failure> {
        let landscape = Landscape::new(self.settings())?;
        let palette = Palette::new(COLORS.map(|[red, green, blue]| Color::srgb(red, green, blue)));
        let mesh = Body::of_source(&landscape, &BLOCK, REACH)?.to_asset_of_materials(&palette);
        Ok(Stage {
            props: vec![Prop { mesh, place: Vec3::ZERO }],
            target: Vec3::new(122.0, 30.0, 88.0),
            eye: 410.0 * Vec3::new(0.36, 0.45, 0.82),
            sun: Vec3::new(0.7, -0.75, -0.55),
        })
    }

    fn settings(self) -> LandscapeSettings {
        let (solid, materials) = match self {
            Self::Noise => (snippets::hills().into(), meadows()),
            Self::Ridges => (snippets::ridges().into(), meadows()),
            Self::Terraces => (snippets::terraces().into(), meadows()),
            Self::Warp => (snippets::warped().into(), meadows()),
            Self::Product => (snippets::plains_and_mountains().into(), meadows()),
            Self::Caves => (snippets::caves(), sandstone()),
            Self::Tunnels => (snippets::tunnels(), sandstone()),
            Self::Shapes => (snippets::shapes(), meadows()),
            Self::Materials => (snippets::mountains().into(), snippets::materials()),
        };
        LandscapeSettings { solid, materials }
    }
}

/// Grass, and rock below it and where it is steep.
fn meadows() -> Vec<MaterialRule> {
    let rock = Stratum { material: 2, ..default() };
    vec![Stratum { below_depth: 3.0, ..rock }.into(), Stratum { steeper_than: 1.4, ..rock }.into()]
}

/// Layers of sandstone.
fn sandstone() -> Vec<MaterialRule> {
    let layers =
        [(106.0, 7), (95.0, 3), (82.0, 6), (74.0, 7), (60.0, 2), (50.0, 3), (41.0, 7), (38.0, 2), (33.0, 7), (17.0, 6)];
    let rules = layers.map(|(above_height, material)| Stratum { material, above_height, ..default() }.into());
    rules.into_iter().chain([Stratum { material: 2, ..default() }.into()]).collect()
}
