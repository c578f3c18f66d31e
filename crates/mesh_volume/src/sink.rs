//! [`Sink`]: where the mesh goes while it is made.

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

/// What examining a mesh needs at most; measured.
const BYTES_PER_TRIANGLE: usize = 200;

/// Where the mesh goes, piece by piece.
pub(crate) trait Sink {
    /// Takes what slab `slab` has added to the mesh out of `piece`.
    ///
    /// # Errors
    /// [`Error`] where it cannot be written or held in memory, or the user has enough of it.
    fn take(&mut self, slab: u32, piece: &mut MeshBuffer, stop: &Stop) -> Result<(), Error>;

    /// Completes all files.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    fn finish(self: Box<Self>, stop: &Stop) -> Result<Made, Error>;
}

/// What has been made: files that are whole, but not in their places yet.
pub(crate) struct Made {
    pub(crate) files: Vec<Whole>,
    /// Files of an earlier mesh, in the place of which there is nothing now.
    pub(crate) stale: Vec<PathBuf>,
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
    /// Files that are numbered, too, but are no chunks of this mesh: the first and how many.
    pub(crate) foreign: Option<(PathBuf, usize)>,
    /// What `--check` has found, where it was wanted.
    pub(crate) check: Option<Check>,
}

impl Made {
    /// Puts all files in their places and removes those of an earlier mesh.
    ///
    /// # Errors
    /// [`Error::Write`], and nothing has been added, [`Error::Remove`].
    pub(crate) fn put(self) -> Result<(), Error> {
        output::put(self.files)?;
        for path in self.stale {
            fs::remove_file(&path).map_err(|source| Error::Remove { path, source })?;
        }
        Ok(())
    }
}

/// What `--check` has found.
pub(crate) struct Check {
    /// How many meshes it has looked at, where those that are clean are not listed.
    pub(crate) meshes: Option<u64>,
    /// Which meshes, and what it has found.
    pub(crate) reports: Vec<(PathBuf, MeshReport)>,
    /// How long it took.
    pub(crate) time: Duration,
}

impl Check {
    /// Nothing yet. `several`: list no mesh that is clean.
    fn new(several: bool) -> Self {
        Self { meshes: several.then_some(0), reports: Vec::new(), time: Duration::ZERO }
    }

    /// Examines a mesh that may be open where it leaves the box `[min, max]`.
    ///
    /// # Errors
    /// [`Error::MeshMemory`].
    fn examine(&mut self, path: &Path, mesh: &MeshBuffer, bounds: [[f32; 3]; 2]) -> Result<(), Error> {
        let since = Instant::now();
        // Without room for what it needs, it would end the program and leave files behind.
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
