//! [`Args`]: the command line.

use std::f32::consts::PI;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use clap::Parser;
use marchless::{DualSettings, MaterialSet};

use crate::error::Error;
use crate::output::FORMATS;
use crate::sample::{Endian, SampleType};

/// Meshes the isosurface of a volume; samples below the isovalue are inside.
#[derive(Parser, Debug)]
#[command(name = "mesh_volume")]
pub(crate) struct Args {
    /// The volume: plain samples, x fastest (.raw), or a NumPy array with the indices `[z][y][x]` (.npy).
    #[arg(value_name = "IN.{raw,npy}")]
    pub(crate) input: PathBuf,

    /// Samples per axis; a .npy file has them in its header.
    #[arg(long, value_name = "X,Y,Z", value_parser = shape, allow_hyphen_values = true)]
    pub(crate) shape: Option<[u32; 3]>,

    /// The type of the samples; a .npy file has it in its header.
    #[arg(long = "type", value_name = "TYPE")]
    pub(crate) sample_type: Option<SampleType>,

    /// The byte order of the samples, by default little; a .npy file has it in its header.
    #[arg(long, value_name = "ORDER")]
    pub(crate) endian: Option<Endian>,

    /// The number of bytes before the samples, by default 0; a .npy file has its own header.
    #[arg(long, value_name = "BYTES", value_parser = bytes, allow_hyphen_values = true)]
    pub(crate) skip: Option<u64>,

    /// The value at the surface, in the units of the samples; for bool 0.5, since false is 0 and true is 1.
    ///
    /// Samples of more than 16 bits are meshed by their difference to V in 32-bit floating point. The difference is
    /// rounded to 24 bits, but no sample changes sides. V itself is a 64-bit number; beyond 2^53 it may be rounded.
    #[arg(long, value_name = "V", value_parser = finite, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) iso: f64,

    /// Turn normals and triangles towards smaller values, not towards larger ones.
    #[arg(long)]
    pub(crate) invert: bool,

    /// The distance of neighbouring samples along each axis.
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing, default_value = "1,1,1", allow_hyphen_values = true)]
    pub(crate) spacing: [f64; 3],

    /// The position of the first sample.
    ///
    /// Positions are 32-bit numbers: far from 0, they are rounded more coarsely.
    #[arg(long, value_name = "X,Y,Z", value_parser = origin, default_value = "0,0,0", allow_hyphen_values = true)]
    pub(crate) origin: [f64; 3],

    /// Close the surface where it leaves the volume.
    ///
    /// The space around the volume counts as outside: above the isovalue, or with --invert below it. Walls lie half a
    /// sample beyond the outermost samples; beyond a sample that equals the isovalue, only 1/1024 of a sample.
    #[arg(long)]
    pub(crate) close: bool,

    /// Where the signs of a cell's corners are ambiguous, follow the trilinear interpolant; by default, inside corners
    /// stay separate.
    #[arg(long)]
    pub(crate) exact: bool,

    /// Mesh with the dual mesher: one vertex in each cell that the surface crosses, or several where it passes more than
    /// once.
    ///
    /// Without --close, the surface ends up to one cell before the border of the volume. The whole volume is held in
    /// memory.
    #[arg(long, conflicts_with_all = ["exact", "chunk"])]
    pub(crate) dual: bool,

    /// Smooth the dual mesh in N steps, 0 to 8; vertices stay in their cells.
    #[arg(long, value_name = "N", requires = "dual", value_parser = steps, default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) smooth: u32,

    /// Keep creases, edges and tips sharp.
    #[arg(long, requires = "dual")]
    pub(crate) sharp: bool,

    /// Let normals break where triangles turn by more than this many degrees from one to the next, 0 to 180.
    ///
    /// Vertices are copied there, so --check does not go with it. The mesh has the same triangles without it.
    #[arg(long, value_name = "DEGREES", requires = "sharp", conflicts_with = "check", value_parser = angle, allow_hyphen_values = true)]
    pub(crate) crease: Option<f32>,

    /// Write one mesh per chunk of N cells along each axis (fewer at the far ends), not a single one.
    ///
    /// The files are OUT.0000.ply and so on, numbered by chunk, x fastest. Together they are the whole mesh, in its
    /// coordinates. A chunk without a surface has no file; an old file of it is removed. A layer of chunks is held in
    /// memory.
    #[arg(long, value_name = "N", value_parser = cells, allow_hyphen_values = true)]
    pub(crate) chunk: Option<NonZeroU32>,

    /// Print a report of the mesh's soundness; with any defect, write nothing and end with exit code 3.
    ///
    /// The surface may be open where it leaves the volume, unless --close closes it; with --dual, which ends before the
    /// border, --close is needed. Each chunk is checked by itself.
    /// The mesh is held in memory: a layer of chunks at a time with --chunk, otherwise all of it. The check takes
    /// another 200 bytes per triangle.
    #[arg(long)]
    pub(crate) check: bool,

    /// The mesh file. An old file is replaced only when the new one is complete.
    #[arg(short, long, value_name = "OUT.{ply,obj,stl,glb}")]
    pub(crate) output: PathBuf,
}

impl Args {
    /// The number of layers of samples that are added around the volume.
    pub(crate) const fn margin(&self) -> u32 {
        self.close as u32
    }

    /// The settings of the dual mesher, at an isovalue of the weights; `None` for the primal one.
    pub(crate) fn dual_settings(&self, isovalue: f32) -> Option<DualSettings> {
        let sharp = if self.sharp { MaterialSet::ALL } else { MaterialSet::EMPTY };
        let crease = self.crease.map(|degrees| degrees.to_radians().min(PI));
        let settings = DualSettings { isovalue, smoothing: self.smooth, sharp, crease, ..DualSettings::default() };
        self.dual.then_some(settings)
    }

    /// Checks the names and places of the files, and which options go together, before any work is done.
    ///
    /// # Errors
    /// [`Error`] if the output would replace the input (the files of chunks are checked later), if its folder does not
    /// exist, or if it is not a file or has no known format; [`Error::OpenCheck`].
    pub(crate) fn check_usage(&self) -> Result<(), Error> {
        if self.dual && self.check && !self.close {
            return Err(Error::OpenCheck);
        }
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

    /// Checks that `path` may be replaced.
    ///
    /// # Errors
    /// [`Error::SameFile`] if it is the input, [`Error::OutputNotAFile`] if it is not a file.
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

/// The folder of a file, which need not exist yet.
pub(crate) fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The extension of a file's name in lower case; empty if there is none.
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

fn steps(text: &str) -> Result<u32, String> {
    let number = text.trim().parse().ok().filter(|number| *number <= 8);
    number.ok_or_else(|| "it must be a whole number of steps from 0 to 8".to_owned())
}

fn angle(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok().filter(|degrees| (0.0..=180.0).contains(degrees));
    number.ok_or_else(|| "it must be a number of degrees from 0 to 180".to_owned())
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
