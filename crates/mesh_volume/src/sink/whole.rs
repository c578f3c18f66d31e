//! [`WholeSink`]: one file for the whole mesh.

use std::path::PathBuf;

use marchless::MeshBuffer;

use super::{Check, Made, Sink};
use crate::Stop;
use crate::args::Args;
use crate::error::Error;
use crate::input::Volume;
use crate::output::Output;
use crate::transform::Transform;

/// Writes the mesh to one file while it is made.
pub(crate) struct WholeSink {
    transform: Transform,
    output: Output,
    vertices: u64,
    triangles: u64,
    kept: Option<Kept>,
}

/// The data that a check needs.
struct Kept {
    /// The path that the report shows.
    path: PathBuf,
    /// The whole mesh without its normals.
    mesh: MeshBuffer,
    /// The box around the volume and its margin; the mesh may be open in its faces.
    bounds: [[f32; 3]; 2],
}

impl WholeSink {
    /// # Errors
    /// [`Error`] if no file can be created.
    pub(crate) fn new(args: &Args, volume: &Volume, transform: Transform) -> Result<Self, Error> {
        let kept = args.check.then(|| Kept {
            path: args.output.clone(),
            mesh: MeshBuffer::new(),
            bounds: transform.corners([[0; 3], volume.lattice().map(|samples| samples - 1 + 2 * args.margin())]),
        });
        Ok(Self { transform, output: Output::create(&args.output)?, vertices: 0, triangles: 0, kept })
    }
}

impl Sink for WholeSink {
    fn take(&mut self, _slab: u32, piece: &mut MeshBuffer, stop: &Stop) -> Result<(), Error> {
        self.transform.apply(piece);
        self.vertices += piece.positions.len() as u64;
        self.triangles += piece.triangle_count() as u64;
        if let Some(Kept { mesh, .. }) = &mut self.kept {
            mesh.positions.try_reserve(piece.positions.len()).map_err(|_| Error::MeshMemory)?;
            mesh.indices.try_reserve(piece.indices.len()).map_err(|_| Error::MeshMemory)?;
            mesh.positions.extend_from_slice(&piece.positions);
            mesh.indices.extend_from_slice(&piece.indices);
        }
        self.output.append(piece)?;
        piece.clear();
        stop.check()
    }

    fn finish(self: Box<Self>, stop: &Stop) -> Result<Made, Error> {
        let Self { output, vertices, triangles, kept, .. } = *self;
        let check = kept.map(|Kept { path, mesh, bounds }| {
            let mut check = Check::new(false);
            check.examine(&path, &mesh, bounds).map(|()| check)
        });
        let check = check.transpose()?;
        let files = vec![output.complete(stop)?];
        Ok(Made { files, stale: Vec::new(), foreign: None, vertices, triangles, check })
    }
}
