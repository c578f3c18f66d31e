//! [`Draft`]: two temporary files that become one.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write};
use std::path::Path;

use tempfile::{Builder, TempPath};

use crate::args::folder;

const BUFFER: usize = 1 << 18;

/// The number of bytes copied between two checks for an interruption.
const PIECE: u64 = 1 << 24;

/// An unfinished file in its final folder. If it is dropped before it is finished, it leaves nothing behind.
pub(super) struct Draft {
    /// The header and the body.
    body: BufWriter<File>,
    /// The part after the body, in a file without a name.
    tail: BufWriter<File>,
    /// The temporary name of the first file. The last field, so that the file is closed before it is removed.
    name: TempPath,
}

impl Draft {
    /// Begins a file with space for a header of `header` bytes.
    pub(super) fn create(path: &Path, header: usize) -> io::Result<Self> {
        let folder = folder(path);
        let mut builder = Builder::new();
        builder.prefix(".mesh_volume.").suffix(".part");
        // By default only the owner may read a temporary file, and so it would be with the mesh.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let (file, name) = builder.tempfile_in(folder)?.into_parts();
        let mut body = BufWriter::with_capacity(BUFFER, file);
        let tail = BufWriter::with_capacity(BUFFER, tempfile::tempfile_in(folder)?);
        body.write_all(&vec![0; header])?;
        Ok(Self { body, tail, name })
    }

    /// The writers of the body and of the tail.
    pub(super) fn parts(&mut self) -> (&mut dyn Write, &mut dyn Write) {
        (&mut self.body, &mut self.tail)
    }

    /// Joins both parts and writes the header before them. Returns the complete file's temporary name, or
    /// [`io::ErrorKind::Interrupted`] as soon as `go_on` returns false.
    pub(super) fn finish(mut self, header: &[u8], go_on: impl Fn() -> bool) -> io::Result<TempPath> {
        self.body.flush()?;
        self.tail.flush()?;
        let (file, tail) = (self.body.get_mut(), self.tail.get_mut());
        tail.rewind()?;
        while io::copy(&mut tail.take(PIECE), file)? > 0 {
            if !go_on() {
                return Err(io::ErrorKind::Interrupted.into());
            }
        }
        file.rewind()?;
        file.write_all(header)?;
        // Some file systems report only now that they are full.
        file.sync_all()?;
        Ok(self.name)
    }
}
