//! [`Args`]: the command line's arguments.

use std::path::PathBuf;

use bevy::math::UVec2;
use clap::{Parser, ValueEnum};
use marchless_examples::files::check_file;
use marchless_examples::look::LOOKS;
use marchless_examples::picture::{check_picture, picture_size};

use crate::flight::{Flight, SPEEDS};
use crate::world::{RADII, World};

/// An endless world to fly over.
#[derive(Parser, Debug)]
#[command(name = "flyover")]
pub(crate) struct Args {
    /// Which world: another number, other hills.
    #[arg(long, default_value_t = 7)]
    seed: u32,

    /// How far one sees, in voxels; beyond 512, at several levels of detail.
    #[arg(long, value_name = "VOXELS", value_parser = radius, default_value = "4096")]
    radius: f32,

    /// How fast the flight is, in voxels per second.
    #[arg(long, value_name = "VOXELS", value_parser = speed, default_value_t = SPEEDS[2])]
    speed: f32,

    /// Which look: palette, sky and light.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(..LOOKS.len() as i64))]
    look: u8,

    /// Show the edges of all triangles, in the colours of their levels of detail.
    #[arg(long, conflicts_with = "headless")]
    pub(crate) triangles: bool,

    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png", conflicts_with = "headless")]
    pub(crate) screenshot: Option<PathBuf>,

    /// The picture's width and height in pixels.
    #[arg(long, value_name = "W,H", value_parser = picture_size, default_value = "1280,720", requires = "screenshot")]
    pub(crate) size: UVec2,

    /// When the picture is taken.
    #[arg(long, value_enum, default_value_t = Moment::Arrived, requires = "screenshot")]
    pub(crate) moment: Moment,

    /// Fly without any renderer, 60 updates a second, and print what that took.
    #[arg(long)]
    pub(crate) headless: bool,

    /// How many updates the headless flight takes.
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub(crate) frames: u32,

    /// Where the headless flight writes a line per update.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) csv: Option<PathBuf>,
}

/// A moment of a visit to a hill. All pictures are taken from the same place.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Moment {
    /// As soon as everything is drawn.
    Arrived,
    /// Once a hole has been dug nearby.
    Dug,
    /// After a flight so far away that the hole was unloaded, and back.
    Back,
}

impl Args {
    /// The world that the command line asks for.
    pub(crate) fn world(&self) -> World {
        World { seed: self.seed, radius: self.radius, look: usize::from(self.look) }
    }

    /// The flight that the command line asks for.
    pub(crate) fn flight(&self) -> Flight {
        Flight { speed: self.speed, goes_on: true }
    }

    /// Says what is wrong with the files to be written, if anything is.
    ///
    /// # Errors
    /// A sentence about a folder that is missing, or a file that is not what its name says.
    pub(crate) fn check_files(&self) -> Result<(), String> {
        self.csv.as_deref().map_or(Ok(()), check_file)?;
        self.screenshot.as_deref().map_or(Ok(()), check_picture)
    }
}

fn radius(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok();
    let sentence = || format!("it must be a number from {} to {}", RADII.start(), RADII.end());
    number.filter(|number| RADII.contains(number)).ok_or_else(sentence)
}

fn speed(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok();
    number.filter(|number| (0.0..=1e5).contains(number)).ok_or("it must be a number from 0 to 100000".to_owned())
}
