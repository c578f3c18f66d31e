//! [`Args`]: the command line's arguments.

use std::path::PathBuf;

use bevy::math::DVec2;
use bevy::prelude::*;
use clap::Parser;
use marchless_examples::files::check_file;
use marchless_examples::look::LOOKS;
use marchless_examples::picture::{check_picture, picture_size};

/// A landscape to dig.
#[derive(Parser, Debug)]
#[command(name = "sculpt")]
pub(crate) struct Args {
    /// Which world: another number, other hills.
    #[arg(long, default_value_t = 7)]
    pub(crate) seed: u32,

    /// Which look: palette, sky and light.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(..LOOKS.len() as i64))]
    pub(crate) look: u8,

    /// Load elevation from a 16-bit greyscale PNG picture.
    #[arg(long, value_name = "FILE.png", requires_all = ["metres_per_pixel", "metres_per_unit"])]
    pub(crate) heightmap: Option<PathBuf>,

    /// How far apart the height map's samples are, along its rows and its columns.
    #[arg(long, value_name = "X,Z", value_parser = positive_pair, requires = "heightmap")]
    pub(crate) metres_per_pixel: Option<DVec2>,

    /// How many metres of height one unit of the height map is.
    #[arg(long, value_name = "H", value_parser = positive, requires = "heightmap")]
    pub(crate) metres_per_unit: Option<f64>,

    /// How many metres a voxel is large; by default as many as make the longer side 512 voxels.
    #[arg(long, value_name = "M", value_parser = positive, requires = "heightmap")]
    pub(crate) voxel_size: Option<f64>,

    /// How many times too high the height map is drawn.
    #[arg(long, value_name = "F", value_parser = positive, default_value_t = 1.0, requires = "heightmap")]
    pub(crate) exaggerate: f64,

    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png", conflicts_with = "headless")]
    pub(crate) screenshot: Option<PathBuf>,

    /// The picture's width and height in pixels.
    #[arg(long, value_name = "W,H", value_parser = picture_size, default_value = "1280,720", requires = "screenshot")]
    pub(crate) size: UVec2,

    /// Before the picture is taken, dig a ball where it shows this place (0,0 is its upper left corner, 1,1 the lower
    /// right one); R is the ball's radius in voxels. May be given several times.
    #[arg(long, value_name = "X,Y[,R]", value_parser = dig, requires = "screenshot")]
    pub(crate) dig: Vec<Dig>,

    /// Run without any renderer: build the world, dig a tunnel through it, check the mesh and write it.
    #[arg(long)]
    pub(crate) headless: bool,

    /// Where the headless run writes the mesh.
    #[arg(long, value_name = "FILE.glb", default_value = "sculpt.glb")]
    pub(crate) out: PathBuf,
}

/// A ball to dig.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dig {
    /// Where in the picture, as shares of its size.
    pub(crate) place: Vec2,
    /// [Units: voxels]
    pub(crate) radius: f32,
}

impl Args {
    /// Says what is wrong with the files to be written, if anything is.
    ///
    /// # Errors
    /// A sentence about a folder that is missing, or a file that is not what its name says.
    pub(crate) fn check_files(&self) -> Result<(), String> {
        check_file(&self.out)?;
        let Some(picture) = &self.screenshot else { return Ok(()) };
        check_picture(picture)
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok();
    number.filter(|number| number.is_finite() && *number > 0.0).ok_or("it must be a number above 0".to_owned())
}

fn positive_pair(text: &str) -> Result<DVec2, String> {
    let sentence = "it must be two numbers above 0, with a comma between them";
    let (x, z) = text.split_once(',').ok_or(sentence)?;
    Ok(DVec2::new(positive(x).map_err(|_| sentence)?, positive(z).map_err(|_| sentence)?))
}

fn dig(text: &str) -> Result<Dig, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let (x, y, radius) = match numbers.as_deref() {
        Some(&[x, y]) => (x, y, 12.0),
        Some(&[x, y, radius]) => (x, y, radius),
        _ => (f32::NAN, f32::NAN, f32::NAN),
    };
    if [x, y].iter().all(|v| (0.0..=1.0).contains(v)) && (1.0..=100.0).contains(&radius) {
        Ok(Dig { place: Vec2::new(x, y), radius })
    } else {
        Err("it must be two numbers from 0 to 1 and perhaps a radius from 1 to 100, with commas between them"
            .to_owned())
    }
}
