//! [`ChunkedSink`]: one file for each chunk that has a surface.

use marchless::MeshBuffer;

use super::series::Series;
use super::{Check, Made, Sink};
use crate::Stop;
use crate::args::Args;
use crate::error::Error;
use crate::output::{Output, Whole};
use crate::split::{Chunks, Split};
use crate::transform::Transform;

/// Writes the chunks of a layer once they are complete.
pub(crate) struct ChunkedSink {
    transform: Transform,
    series: Series,
    split: Split,
    files: Vec<Whole>,
    vertices: u64,
    triangles: u64,
    check: Option<Check>,
}

impl ChunkedSink {
    /// # Errors
    /// [`Error`] if the place of a chunk's file has something that must not be replaced.
    pub(crate) fn new(args: &Args, chunks: Chunks, transform: Transform) -> Result<Self, Error> {
        Ok(Self {
            transform,
            series: Series::new(args, chunks.count)?,
            split: Split::new(chunks),
            files: Vec::new(),
            vertices: 0,
            triangles: 0,
            check: args.check.then(|| Check::new(true)),
        })
    }
}

impl Sink for ChunkedSink {
    fn take(&mut self, slab: u32, piece: &mut MeshBuffer, stop: &Stop) -> Result<(), Error> {
        for mut chunk in self.split.take(slab, piece)? {
            self.transform.apply(&mut chunk.mesh);
            self.vertices += chunk.mesh.positions.len() as u64;
            self.triangles += chunk.mesh.triangle_count() as u64;
            let path = self.series.claim(chunk.number);
            if let Some(check) = &mut self.check {
                check.examine(&path, &chunk.mesh, self.transform.corners(chunk.samples))?;
            }
            let mut output = Output::create(&path)?;
            output.append(&chunk.mesh)?;
            self.files.push(output.complete(stop)?);
        }
        piece.clear();
        stop.check()
    }

    fn finish(self: Box<Self>, _stop: &Stop) -> Result<Made, Error> {
        let Self { series, files, vertices, triangles, check, .. } = *self;
        Ok(Made { files, stale: series.stale(), foreign: series.foreign(), vertices, triangles, check })
    }
}
