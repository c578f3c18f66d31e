//! [`Output`]: a mesh file that grows piece by piece and takes its place only when it is complete.
//!
//! Every format has a header with counts, then the data of the vertices, then the data of the triangles. The counts and
//! the start of the triangles are known last. So space is left for the header, and the triangles wait in a second file
//! (see [`Draft`]).

mod draft;
mod glb;
mod obj;
mod ply;
mod stl;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use marchless::MeshBuffer;
use tempfile::TempPath;

use crate::Stop;
use crate::args::extension;
use crate::error::Error;
use draft::Draft;

/// The formats, by file extension.
pub(crate) const FORMATS: [&str; 4] = ["ply", "obj", "stl", "glb"];

/// A mesh file that is being written.
pub(crate) struct Output {
    path: PathBuf,
    draft: Draft,
    encoder: Box<dyn Encoder>,
}

impl Output {
    /// Begins a file for `path`, in the format of its extension.
    ///
    /// # Errors
    /// [`Error`] if there is no such format, or if no file can be created in the folder.
    pub(crate) fn create(path: &Path) -> Result<Self, Error> {
        let encoder: Box<dyn Encoder> = match &*extension(path) {
            "ply" => Box::new(ply::Ply::default()),
            "obj" => Box::new(obj::Obj),
            "stl" => Box::new(stl::Stl::new()),
            "glb" => Box::new(glb::Glb::default()),
            _ => return Err(Error::OutputFormat { path: path.to_owned() }),
        };
        // A link stays a link; its target is replaced.
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let draft = Draft::create(&path, encoder.header_length())
            .map_err(|source| Error::Write { path: path.clone(), source: source.into() })?;
        Ok(Self { path, draft, encoder })
    }

    /// Appends a piece of the mesh. Its indices count all vertices since the first piece.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub(crate) fn append(&mut self, piece: &MeshBuffer) -> Result<(), Error> {
        let (body, tail) = self.draft.parts();
        self.encoder.encode(piece, body, tail).map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    /// Completes the file, but does not put it in its place yet.
    ///
    /// # Errors
    /// [`Error::Write`] or [`Error::Interrupted`].
    pub(crate) fn complete(self, stop: &Stop) -> Result<Whole, Error> {
        let Self { path, draft, encoder } = self;
        let name = match encoder.header() {
            Ok(header) => draft.finish(&header, || stop.check().is_ok()).map_err(OutputError::from),
            Err(error) => Err(error),
        };
        stop.check()?;
        match name {
            Ok(name) => Ok(Whole { path, name }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }
}

/// A complete file that waits, under another name, to be put in its place.
pub(crate) struct Whole {
    path: PathBuf,
    name: TempPath,
}

/// Puts files in their places, where they replace older ones.
///
/// # Errors
/// [`Error::Write`] if one cannot be put in its place; those that replaced no file are then removed again.
pub(crate) fn put(files: Vec<Whole>) -> Result<(), Error> {
    let mut added = Vec::new();
    for Whole { path, name } in files {
        let replaces = path.exists();
        if let Err(error) = name.persist(&path) {
            for path in added {
                // There is nothing left to be done for it.
                let _ = fs::remove_file(path);
            }
            return Err(Error::Write { path, source: error.error.into() });
        }
        if !replaces {
            added.push(path);
        }
    }
    Ok(())
}

/// A format of mesh files.
trait Encoder {
    /// The length of the header in bytes.
    fn header_length(&self) -> usize;

    /// Writes a piece of the mesh. `body` follows the header; `tail` follows the whole body.
    fn encode(&mut self, piece: &MeshBuffer, body: &mut dyn Write, tail: &mut dyn Write) -> Result<(), OutputError>;

    /// The header for all pieces.
    fn header(&self) -> Result<Vec<u8>, OutputError>;
}

/// The reason why a mesh file could not be written.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OutputError {
    #[error("{0}")]
    Io(#[from] io::Error),
    #[error("a .glb file has at most {} bytes, and this mesh needs more; a .ply file can take it", u32::MAX)]
    GlbTooLong,
    #[error("a .stl file has at most {} triangles, and this mesh has more; a .ply file can take it", u32::MAX)]
    StlTooLong,
    #[error("triangle {triangle} has a vertex that is not at hand")]
    VertexMissing { triangle: u64 },
}

/// The numbers as little-endian bytes, one after the other.
fn bytes<const N: usize>(numbers: [[f32; 3]; N]) -> [[[u8; 4]; 3]; N] {
    numbers.map(|vector| vector.map(f32::to_le_bytes))
}
