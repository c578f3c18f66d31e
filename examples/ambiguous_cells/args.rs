//! [`Args`]: the command line's arguments.

use std::path::PathBuf;

use bevy::math::UVec2;
use clap::Parser;
use marchless_examples::picture::{check_picture, picture_size};

use crate::cell::{Cell, RANGE};

/// One cell, its eight weights on sliders, and the surface that each topology makes of it.
#[derive(Parser, Debug)]
#[command(name = "ambiguous_cells")]
pub(crate) struct Args {
    /// The weights of corners 0 to 7, from -1 to 1; negative is inside. By default those of a cell with a tunnel.
    #[arg(long, value_name = "A,B,C,D,E,F,G,H", value_parser = weights, allow_hyphen_values = true)]
    weights: Option<Weights>,

    /// Where the surface lies, from -1 to 1.
    #[arg(long, value_name = "V", value_parser = isovalue, default_value_t = 0.0, allow_hyphen_values = true)]
    isovalue: f32,

    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png")]
    pub(crate) screenshot: Option<PathBuf>,

    /// The picture's width and height in pixels.
    #[arg(long, value_name = "W,H", value_parser = picture_size, default_value = "1280,560", requires = "screenshot")]
    pub(crate) size: UVec2,
}

type Weights = [f32; 8];

impl Args {
    /// The cell to begin with.
    pub(crate) fn cell(&self) -> Cell {
        let default = Cell::default();
        Cell { weights: self.weights.unwrap_or(default.weights), isovalue: self.isovalue }
    }

    /// Says what is wrong with the file to be written, if anything is.
    ///
    /// # Errors
    /// A sentence about a folder that is missing, or a file that is not what its name says.
    pub(crate) fn check_files(&self) -> Result<(), String> {
        self.screenshot.as_deref().map_or(Ok(()), check_picture)
    }
}

fn number(text: &str) -> Option<f32> {
    text.trim().parse().ok().filter(|number| RANGE.contains(number))
}

fn weights(text: &str) -> Result<Weights, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(number).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or("it must be eight numbers from -1 to 1, with commas between them".to_owned())
}

fn isovalue(text: &str) -> Result<f32, String> {
    number(text).ok_or("it must be a number from -1 to 1".to_owned())
}
