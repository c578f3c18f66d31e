//! [`Args`]: the command line's arguments.

use std::path::PathBuf;

use bevy::math::UVec2;
use clap::Parser;
use marchless_examples::files::check_file;
use marchless_examples::picture::{check_picture, picture_size};

use crate::caves::{EDGES, Settings, View};

/// Caves grown by a cellular automaton from noise, in a block of rock that is cut open.
#[derive(Parser, Debug)]
#[command(name = "cellular_caves")]
pub(crate) struct Args {
    /// Which noise.
    #[arg(long, default_value_t = Settings::default().seed)]
    seed: u32,

    /// How many points the block has along each edge.
    #[arg(long, value_name = "N", default_value_t = Settings::default().edge,
        value_parser = clap::value_parser!(u32).range(i64::from(*EDGES.start())..=i64::from(*EDGES.end())))]
    edge: u32,

    /// Which share of the noise is rock, from 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = Settings::default().fill)]
    fill: f32,

    /// How many of its 26 neighbours must be rock for air to turn to rock; 27 is never.
    #[arg(long, value_name = "N", default_value_t = Settings::default().birth,
        value_parser = clap::value_parser!(u8).range(..=27))]
    birth: u8,

    /// How many of its 26 neighbours must be rock for rock to stay rock; 27 is never.
    #[arg(long, value_name = "N", default_value_t = Settings::default().survival,
        value_parser = clap::value_parser!(u8).range(..=27))]
    survival: u8,

    /// How many steps the automaton takes.
    #[arg(long, value_name = "N", default_value_t = Settings::default().steps,
        value_parser = clap::value_parser!(u8).range(..=30))]
    steps: u8,

    /// How far the block is cut open, from 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = Settings::default().cut)]
    cut: f32,

    /// Show the largest cave as a body, instead of the rock.
    #[arg(long)]
    caves: bool,

    /// Render a picture without a window, and exit.
    #[arg(long, value_name = "FILE.png", conflicts_with = "headless")]
    pub(crate) screenshot: Option<PathBuf>,

    /// The picture's width and height in pixels.
    #[arg(long, value_name = "W,H", value_parser = picture_size, default_value = "1280,720", requires = "screenshot")]
    pub(crate) size: UVec2,

    /// Run without any renderer: grow the caves, print their figures, check the mesh and write it.
    #[arg(long)]
    pub(crate) headless: bool,

    /// Where the headless run writes the mesh.
    #[arg(long, value_name = "FILE.glb", default_value = "caves.glb")]
    pub(crate) out: PathBuf,
}

impl Args {
    /// The caves to begin with.
    pub(crate) fn settings(&self) -> Settings {
        let &Self { seed, edge, fill, birth, survival, steps, cut, caves, .. } = self;
        let view = if caves { View::Caves } else { View::Rock };
        Settings { seed, edge, fill, birth, survival, steps, cut, view }
    }

    /// Says what is wrong with the files to be written, if anything is.
    ///
    /// # Errors
    /// A sentence about a folder that is missing, or a file that is not what its name says.
    pub(crate) fn check_files(&self) -> Result<(), String> {
        check_file(&self.out)?;
        self.screenshot.as_deref().map_or(Ok(()), check_picture)
    }
}

fn share(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok();
    number.filter(|number| (0.0..=1.0).contains(number)).ok_or("it must be a number from 0 to 1".to_owned())
}
