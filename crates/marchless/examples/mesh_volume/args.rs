//! [`Args`]: what the command line may say.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;

use crate::error::Error;
use crate::output::FORMATS;
use crate::sample::SampleType;

/// Meshes the isosurface of a volume; what lies below the isovalue is inside.
#[derive(Parser, Debug)]
#[command(name = "mesh_volume")]
pub(crate) struct Args {
    /// The volume: plain little-endian samples, x fastest (.raw), or a NumPy array with the indices [z][y][x] (.npy).
    #[arg(value_name = "IN.{raw,npy}")]
    pub(crate) input: PathBuf,

    /// Samples per axis; a .npy file says so itself.
    #[arg(long, value_name = "X,Y,Z", value_parser = shape, allow_hyphen_values = true)]
    pub(crate) shape: Option<[u32; 3]>,

    /// The samples' type; a .npy file says so itself.
    #[arg(long = "type", value_name = "TYPE")]
    pub(crate) sample_type: Option<SampleType>,

    /// Where the surface lies, in the samples' own numbers.
    #[arg(long, value_name = "V", value_parser = finite, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) iso: f64,

    /// Let normals point, and triangles look, to smaller values rather than to larger ones.
    #[arg(long)]
    pub(crate) invert: bool,

    /// How far apart neighbouring samples are along each axis.
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing, default_value = "1,1,1", allow_hyphen_values = true)]
    pub(crate) spacing: [f64; 3],

    /// The mesh; an old file is replaced, but only by a whole new one.
    #[arg(short, long, value_name = "OUT.{ply,obj,stl,glb}")]
    pub(crate) output: PathBuf,
}

impl Args {
    /// Says what is wrong with the files' names and places, if anything is, before any work is done.
    ///
    /// # Errors
    /// [`Error`] where the output would replace the input, has no folder, is no file or of no known format.
    pub(crate) fn check_files(&self) -> Result<(), Error> {
        let path = || self.output.clone();
        if let (Ok(input), Ok(output)) = (fs::canonicalize(&self.input), fs::canonicalize(&self.output))
            && input == output
        {
            return Err(Error::SameFile { path: path() });
        }
        if !FORMATS.contains(&&*extension(&self.output)) {
            return Err(Error::OutputFormat { path: path() });
        }
        let folder = folder(&self.output);
        if !folder.is_dir() {
            return Err(Error::NoFolder { path: path(), folder: folder.to_owned() });
        }
        if self.output.exists() && !self.output.is_file() {
            return Err(Error::OutputNotAFile { path: path() });
        }
        Ok(())
    }
}

/// The folder that a file lies in, or will.
pub(crate) fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// What follows the last dot of a file's name, in small letters; empty where nothing does.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok();
    number.filter(|number| number.is_finite()).ok_or_else(|| "it must be a finite number".to_owned())
}

fn shape(text: &str) -> Result<[u32; 3], String> {
    three(text, |number| number.parse().ok().filter(|&samples: &u32| samples >= 2))
        .ok_or_else(|| format!("it must be three whole numbers from 2 to {}, with commas between them", u32::MAX))
}

fn spacing(text: &str) -> Result<[f64; 3], String> {
    three(text, |number| number.parse().ok().filter(|&gap: &f64| gap.is_finite() && gap > 0.0))
        .ok_or_else(|| "it must be three numbers above 0, with commas between them".to_owned())
}

fn three<T>(text: &str, parse: impl Fn(&str) -> Option<T>) -> Option<[T; 3]> {
    let numbers = text.split(',').map(|number| parse(number.trim())).collect::<Option<Vec<T>>>()?;
    numbers.try_into().ok()
}
