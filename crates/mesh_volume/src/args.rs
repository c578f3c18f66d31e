//! [`Args`]: what the command line may say.

use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use clap::Parser;

use crate::error::Error;
use crate::output::FORMATS;
use crate::sample::{Endian, SampleType};

/// Meshes the isosurface of a volume; what lies below the isovalue is inside.
#[derive(Parser, Debug)]
#[command(name = "mesh_volume")]
pub(crate) struct Args {
    /// The volume: plain samples, x fastest (.raw), or a NumPy array with the indices `[z][y][x]` (.npy).
    #[arg(value_name = "IN.{raw,npy}")]
    pub(crate) input: PathBuf,

    /// Samples per axis; a .npy file says so itself.
    #[arg(long, value_name = "X,Y,Z", value_parser = shape, allow_hyphen_values = true)]
    pub(crate) shape: Option<[u32; 3]>,

    /// The samples' type; a .npy file says so itself.
    #[arg(long = "type", value_name = "TYPE")]
    pub(crate) sample_type: Option<SampleType>,

    /// The order of a sample's bytes, little if nothing is said; a .npy file says so itself.
    #[arg(long, value_name = "ORDER")]
    pub(crate) endian: Option<Endian>,

    /// How many bytes of the file come before the samples, 0 if nothing is said; a .npy file says so itself.
    #[arg(long, value_name = "BYTES", value_parser = bytes, allow_hyphen_values = true)]
    pub(crate) skip: Option<u64>,

    /// Where the surface lies, in the samples' own numbers; for bool 0.5, since false is 0 and true is 1.
    ///
    /// Samples of more than 16 bits are meshed by their difference to V in 32-bit floating point: it is rounded to 24
    /// bits, though no sample changes sides. V itself is a 64-bit number, so that beyond 2^53 it may be rounded.
    #[arg(long, value_name = "V", value_parser = finite, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) iso: f64,

    /// Let normals point, and triangles look, to smaller values rather than to larger ones.
    #[arg(long)]
    pub(crate) invert: bool,

    /// How far apart neighbouring samples are along each axis.
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing, default_value = "1,1,1", allow_hyphen_values = true)]
    pub(crate) spacing: [f64; 3],

    /// The position of the first sample.
    ///
    /// Positions are 32-bit numbers: the farther from 0, the coarser they are rounded.
    #[arg(long, value_name = "X,Y,Z", value_parser = origin, default_value = "0,0,0", allow_hyphen_values = true)]
    pub(crate) origin: [f64; 3],

    /// Close the surface where it leaves the volume.
    ///
    /// The space around the volume counts as outside: as above the isovalue, or with --invert as below it. Walls lie
    /// half a sample beyond the outermost samples; beyond a sample that is equal to the isovalue, 1/1024 of one.
    #[arg(long)]
    pub(crate) close: bool,

    /// Where the signs of a cell's corners leave open what is joined, do as the trilinear interpolant has it, rather
    /// than separate what is inside.
    #[arg(long)]
    pub(crate) exact: bool,

    /// Write one mesh per chunk of N cells along each axis (fewer at the far ends) rather than a single one.
    ///
    /// The files are OUT.0000.ply and so on, numbered by chunk, x fastest; together they are the whole mesh, in its
    /// coordinates. A chunk without surface has no file, and loses an old one. A layer of chunks is held in memory.
    #[arg(long, value_name = "N", value_parser = cells, allow_hyphen_values = true)]
    pub(crate) chunk: Option<NonZeroU32>,

    /// Print a report of the mesh's soundness; with any defect, write nothing and end with exit code 3.
    ///
    /// Where the surface leaves the volume it may be open, unless --close closes it. Each chunk is examined by itself.
    /// The mesh is held in memory: a layer of chunks at a time with --chunk, otherwise all of it. Examining it takes
    /// another 200 bytes a triangle.
    #[arg(long)]
    pub(crate) check: bool,

    /// The mesh; an old file is replaced, but only by a whole new one.
    #[arg(short, long, value_name = "OUT.{ply,obj,stl,glb}")]
    pub(crate) output: PathBuf,
}

impl Args {
    /// How many layers of samples the mesher gets around the volume.
    pub(crate) const fn margin(&self) -> u32 {
        self.close as u32
    }

    /// Says what is wrong with the files' names and places, if anything is, before any work is done.
    ///
    /// # Errors
    /// [`Error`] where the output would replace the input (chunks are looked at later), has no folder, is no file or of
    /// no known format.
    pub(crate) fn check_files(&self) -> Result<(), Error> {
        let path = || self.output.clone();
        if self.chunk.is_none() {
            self.check_replaced(&self.output)?;
        }
        if !FORMATS.contains(&&*extension(&self.output)) {
            return Err(Error::OutputFormat { path: path() });
        }
        let folder = folder(&self.output);
        if !folder.is_dir() {
            return Err(Error::NoFolder { path: path(), folder: folder.to_owned() });
        }
        Ok(())
    }

    /// Says what is wrong with replacing what is at `path`, if anything is.
    ///
    /// # Errors
    /// [`Error::SameFile`] where it is the input, [`Error::OutputNotAFile`] where it is no file.
    pub(crate) fn check_replaced(&self, path: &Path) -> Result<(), Error> {
        if let (Ok(input), Ok(output)) = (self.input.canonicalize(), path.canonicalize())
            && input == output
        {
            return Err(Error::SameFile { path: path.to_owned() });
        }
        if path.exists() && !path.is_file() {
            return Err(Error::OutputNotAFile { path: path.to_owned() });
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

fn bytes(text: &str) -> Result<u64, String> {
    text.trim().parse().map_err(|_| format!("it must be a whole number of bytes from 0 to {}", u64::MAX))
}

fn cells(text: &str) -> Result<NonZeroU32, String> {
    text.trim().parse().map_err(|_| format!("it must be a whole number of cells from 1 to {}", u32::MAX))
}

fn shape(text: &str) -> Result<[u32; 3], String> {
    three(text, |number| number.parse().ok().filter(|&samples: &u32| samples >= 2))
        .ok_or_else(|| format!("it must be three whole numbers from 2 to {}, with commas between them", u32::MAX))
}

fn spacing(text: &str) -> Result<[f64; 3], String> {
    three(text, |number| number.parse().ok().filter(|&gap: &f64| gap.is_finite() && gap > 0.0))
        .ok_or_else(|| "it must be three numbers above 0, with commas between them".to_owned())
}

fn origin(text: &str) -> Result<[f64; 3], String> {
    three(text, |number| number.parse().ok().filter(|place: &f64| place.is_finite()))
        .ok_or_else(|| "it must be three finite numbers, with commas between them".to_owned())
}

fn three<T>(text: &str, parse: impl Fn(&str) -> Option<T>) -> Option<[T; 3]> {
    let numbers = text.split(',').map(|number| parse(number.trim())).collect::<Option<Vec<T>>>()?;
    numbers.try_into().ok()
}
