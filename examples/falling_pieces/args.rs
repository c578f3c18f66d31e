//! [`Args`]: the command line's arguments.

use std::path::PathBuf;

use bevy::math::UVec2;
use clap::{Parser, ValueEnum};
use marchless_examples::picture::{check_picture, picture_size};

/// Dig through a pillar: what hangs free falls.
#[derive(Parser, Debug)]
#[command(name = "falling_pieces")]
pub(crate) struct Args {
    /// Run without any renderer: cut the mushroom's stem, and wait until what falls has come to rest.
    #[arg(long)]
    pub(crate) headless: bool,

    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png", conflicts_with = "headless")]
    pub(crate) screenshot: Option<PathBuf>,

    /// The picture's width and height in pixels.
    #[arg(long, value_name = "W,H", value_parser = picture_size, default_value = "1280,720", requires = "screenshot")]
    pub(crate) size: UVec2,

    /// When the picture is taken.
    #[arg(long, value_enum, default_value_t = Moment::Falling, requires = "screenshot")]
    pub(crate) moment: Moment,
}

/// A moment of the fall.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moment {
    /// Before the stem is cut.
    Before,
    /// While the island falls.
    Falling,
    /// Once it has come to rest.
    Rest,
}

impl Args {
    /// Says what is wrong with the file to be written, if anything is.
    ///
    /// # Errors
    /// A sentence about a folder that is missing, or a file that is not what its name says.
    pub(crate) fn check_files(&self) -> Result<(), String> {
        self.screenshot.as_deref().map_or(Ok(()), check_picture)
    }
}
