//! [`Error`]: the reason why no mesh was written.

use std::fmt;
use std::io;
use std::path::PathBuf;

use marchless::MeshError;

use crate::npy::NpyError;
use crate::output::OutputError;
use crate::sample::{Endian, SampleType};

/// The reason why no mesh was written, or what else went wrong, in one sentence. No half-written file is left behind.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error("{} is both the input and the output; the mesh needs a file of its own", path.display())]
    SameFile { path: PathBuf },

    #[error("{} cannot be written, since its name does not end in .ply, .obj, .stl or .glb", path.display())]
    OutputFormat { path: PathBuf },

    #[error("{} cannot be written, since there is no folder {}", path.display(), folder.display())]
    NoFolder { path: PathBuf, folder: PathBuf },

    #[error("{} cannot be written, since it is there already and not a file", path.display())]
    OutputNotAFile { path: PathBuf },

    #[error("{} cannot be read, since its name does not end in .raw or .npy", path.display())]
    InputFormat { path: PathBuf },

    #[error("{} cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },

    #[error("{} cannot be read, since it is not a file", path.display())]
    InputNotAFile { path: PathBuf },

    #[error("a .raw file says nothing of itself: {flag} is needed")]
    FlagMissing { flag: &'static str },

    #[error("{} cannot be read: {source}", path.display())]
    Npy { path: PathBuf, source: NpyError },

    #[error("{} has {} × {} × {} samples along x, y and z, but at least 2 along each are needed, and at most {most}",
        path.display(), size[0], size[1], size[2])]
    Size { path: PathBuf, size: [u64; 3], most: u32 },

    #[error("{} has {} × {} × {} samples along x, y and z, but --shape says {},{},{}",
        path.display(), found[0], found[1], found[2], said[0], said[1], said[2])]
    ShapeDisagrees { path: PathBuf, found: [u32; 3], said: [u32; 3] },

    #[error("{} holds samples of type {found}, but --type says {said}", path.display())]
    TypeDisagrees { path: PathBuf, found: SampleType, said: SampleType },

    #[error("{} holds {found}-endian samples, but --endian says {said}", path.display())]
    EndianDisagrees { path: PathBuf, found: Endian, said: Endian },

    #[error("{} has {found} bytes before the samples, but --skip says {said}", path.display())]
    SkipDisagrees { path: PathBuf, found: u64, said: u64 },

    #[error("{} cannot be read: {before} and {} × {} × {} samples of type {sample_type} are more bytes than any file can hold",
        path.display(), size[0], size[1], size[2])]
    TooLarge { path: PathBuf, before: Before, size: [u32; 3], sample_type: SampleType },

    #[error("{} should be {expected} bytes long ({before} and {} × {} × {} samples of type {sample_type}), but has {found}",
        path.display(), size[0], size[1], size[2])]
    Length { path: PathBuf, expected: u64, before: Before, size: [u32; 3], sample_type: SampleType, found: u64 },

    #[error("a slab of {} × {} samples does not fit in memory", slab[0], slab[1])]
    Memory { slab: [u32; 2] },

    #[error(
        "a spacing of {spacing:?} along an axis of {samples} samples gives positions that 32-bit numbers cannot tell apart or hold"
    )]
    Spacing { spacing: f64, samples: u32 },

    #[error(
        "an origin of {origin:?} along an axis of {samples} samples gives positions that 32-bit numbers cannot hold"
    )]
    Origin { origin: f64, samples: u32 },

    #[error("{} cannot be meshed: {source}", path.display())]
    Mesh { path: PathBuf, source: MeshError },

    #[error(
        "--chunk {cells} makes {chunks} chunks of this volume, but no more than {most} are written: at least {least} cells are needed"
    )]
    TooManyChunks { cells: u32, chunks: u128, most: u64, least: u64 },

    #[error("the volume does not fit in memory, which --dual needs to hold it")]
    VolumeMemory,

    #[error("with --dual, --check needs --close: otherwise the surface ends before the border, and is open there")]
    OpenCheck,

    #[error("the mesh does not fit in memory, which --chunk and --check need to hold it")]
    MeshMemory,

    #[error("a triangle has a vertex that is not at hand")]
    VertexMissing,

    #[error("the mesh is not clean; nothing has been written")]
    NotClean,

    #[error("{} is of an earlier mesh and cannot be removed, though the new one is written: {source}", path.display())]
    Remove { path: PathBuf, source: io::Error },

    #[error("{} cannot be written: {source}", path.display())]
    Write { path: PathBuf, source: OutputError },

    #[error("interrupted; nothing has been written")]
    Interrupted,
}

/// The number of bytes before the samples, and where the number comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Before {
    /// From the file's own header.
    Header(u64),
    /// From the command line.
    Skip(u64),
}

impl Before {
    pub(crate) const fn bytes(self) -> u64 {
        match self {
            Self::Header(bytes) | Self::Skip(bytes) => bytes,
        }
    }
}

impl fmt::Display for Before {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Header(bytes) => write!(f, "{bytes} bytes of header"),
            Self::Skip(bytes) => write!(f, "{bytes} bytes to --skip"),
        }
    }
}

impl Error {
    /// The program's exit code: 2 for bad input, 1 if the system cannot hold or write the mesh, 3 for a mesh with
    /// defects, 130 for an interruption.
    pub(crate) const fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted => 130,
            Self::NotClean => 3,
            Self::Memory { .. } | Self::VolumeMemory | Self::MeshMemory | Self::Write { .. } | Self::Remove { .. } => 1,
            _ => 2,
        }
    }
}
