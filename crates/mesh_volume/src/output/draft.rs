//! [`Draft`]: two temporary files that become one.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write};
use std::path::Path;

use tempfile::{Builder, TempPath};

use crate::args::folder;

const BUFFER: usize = 1 << 18;

/// How much is copied between two looks at whether to go on.
const PIECE: u64 = 1 << 24;

/// A file in the making, in the folder where it is to be. Dropped before its end, it leaves nothing there.
pub(super) struct Draft {
    /// The header and the body.
    body: BufWriter<File>,
    /// What comes behind the body; a file without a name.
    tail: BufWriter<File>,
    /// The name of the first file until it is whole. Last, so that it is closed before it is removed.
    name: TempPath,
}

impl Draft {
    /// Begins a file with room for a header of `header` bytes.
    pub(super) fn create(path: &Path, header: usize) -> io::Result<Self> {
        let folder = folder(path);
        let mut builder = Builder::new();
        builder.prefix(".mesh_volume.").suffix(".part");
        // Temporary files are otherwise for their owner's eyes only, and so would the mesh be.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let (file, name) = builder.tempfile_in(folder)?.into_parts();
        let mut body = BufWriter::with_capacity(BUFFER, file);
        let tail = BufWriter::with_capacity(BUFFER, tempfile::tempfile_in(folder)?);
        body.write_all(&vec![0; header])?;
        Ok(Self { body, tail, name })
    }

    /// Where to write the body and the tail.
    pub(super) fn parts(&mut self) -> (&mut dyn Write, &mut dyn Write) {
        (&mut self.body, &mut self.tail)
    }

    /// Joins both parts and puts the header before them; what is returned is the whole file's name until it is in its
    /// place. Where `go_on` no longer holds, it is [`io::ErrorKind::Interrupted`].
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
        // Some file systems say only now that they are full.
        file.sync_all()?;
        Ok(self.name)
    }
}
