//! [`Sink`]: the receiver of the mesh, piece by piece.

mod chunked;
mod series;
mod whole;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fmt, fs};

use marchless::{MeshBuffer, MeshReport};

use crate::Stop;
use crate::error::Error;
use crate::output::{self, Whole};
pub(crate) use chunked::ChunkedSink;
pub(crate) use whole::WholeSink;

/// The most memory that the check of a mesh takes per triangle, as measured.
const BYTES_PER_TRIANGLE: usize = 200;

/// A receiver of the mesh, piece by piece.
pub(crate) trait Sink {
    /// Takes the piece that slab `slab` has added to the mesh out of `piece`.
    ///
    /// # Errors
    /// [`Error`] if the piece cannot be written or held in memory, or if the user has interrupted the program.
    fn take(&mut self, slab: u32, piece: &mut MeshBuffer, stop: &Stop) -> Result<(), Error>;

    /// Completes all files.
    ///
    /// # Errors
    /// Those of [`take`](Self::take).
    fn finish(self: Box<Self>, stop: &Stop) -> Result<Made, Error>;
}

/// The result: complete files that are not in their places yet.
pub(crate) struct Made {
    pub(crate) files: Vec<Whole>,
    /// Files of an earlier mesh that the new one does not replace.
    pub(crate) stale: Vec<PathBuf>,
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
    /// Numbered files that are not chunks of this mesh: the first one and their number.
    pub(crate) foreign: Option<(PathBuf, usize)>,
    /// The findings of `--check`; `None` without that flag.
    pub(crate) check: Option<Check>,
}

impl Made {
    /// Puts all files in their places and removes those of an earlier mesh.
    ///
    /// # Errors
    /// [`Error::Write`], after which no file has been added; [`Error::Remove`].
    pub(crate) fn put(self) -> Result<(), Error> {
        output::put(self.files)?;
        for path in self.stale {
            fs::remove_file(&path).map_err(|source| Error::Remove { path, source })?;
        }
        Ok(())
    }
}

/// The findings of `--check`.
pub(crate) struct Check {
    /// The number of meshes checked, if clean ones are not listed.
    pub(crate) meshes: Option<u64>,
    /// The meshes that are listed, each with its report.
    pub(crate) reports: Vec<(PathBuf, MeshReport)>,
    /// The time that the check took.
    pub(crate) time: Duration,
}

impl Check {
    /// No findings yet. Clean meshes are not listed if there are `several`.
    fn new(several: bool) -> Self {
        Self { meshes: several.then_some(0), reports: Vec::new(), time: Duration::ZERO }
    }

    /// Checks a mesh, which may be open where it leaves the box `[min, max]`.
    ///
    /// # Errors
    /// [`Error::MeshMemory`].
    fn examine(&mut self, path: &Path, mesh: &MeshBuffer, bounds: [[f32; 3]; 2]) -> Result<(), Error> {
        let since = Instant::now();
        // If memory ran out during the check, the program would abort and leave files behind.
        let room = mesh.triangle_count().saturating_mul(BYTES_PER_TRIANGLE);
        Vec::<u8>::new().try_reserve_exact(room).map_err(|_| Error::MeshMemory)?;
        let report = MeshReport::in_box(&mesh.positions, &mesh.indices, bounds);
        if self.meshes.is_none() || !report.is_clean() {
            self.reports.push((path.to_owned(), report));
        }
        self.meshes = self.meshes.map(|meshes| meshes + 1);
        self.time += since.elapsed();
        Ok(())
    }

    pub(crate) fn is_clean(&self) -> bool {
        self.reports.iter().all(|(_, report)| report.is_clean())
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (path, report) in &self.reports {
            writeln!(f, "{}: {report}", path.display())?;
        }
        match (self.meshes, self.reports.len()) {
            (None, _) => Ok(()),
            (Some(meshes), 0) => writeln!(f, "meshes checked: {meshes}, all clean"),
            (Some(meshes), defective) => writeln!(f, "meshes checked: {meshes}, with defects: {defective}"),
        }
    }
}
