//! [`Draft`]: two temporary files that become one.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::args::folder;

const BUFFER: usize = 1 << 18;

/// How much is copied between two looks at whether to go on.
const PIECE: u64 = 1 << 24;

/// A file in the making, in the folder where it is to be. Dropped before its end, it leaves nothing there.
pub(super) struct Draft {
    /// The file itself, under another name: the header and the body.
    body: BufWriter<NamedTempFile>,
    /// What comes behind the body; a file without a name.
    tail: BufWriter<File>,
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
        let mut body = BufWriter::with_capacity(BUFFER, builder.tempfile_in(folder)?);
        let tail = BufWriter::with_capacity(BUFFER, tempfile::tempfile_in(folder)?);
        body.write_all(&vec![0; header])?;
        Ok(Self { body, tail })
    }

    /// Where to write the body and the tail.
    pub(super) fn parts(&mut self) -> (&mut dyn Write, &mut dyn Write) {
        (&mut self.body, &mut self.tail)
    }

    /// Joins both parts, puts the header before them and the file in its place, where it replaces an older one.
    /// Where `go_on` no longer holds, it is [`io::ErrorKind::Interrupted`].
    pub(super) fn finish(mut self, path: &Path, header: &[u8], go_on: impl Fn() -> bool) -> io::Result<()> {
        self.body.flush()?;
        self.tail.flush()?;
        let (file, tail) = (self.body.get_mut(), self.tail.get_mut());
        tail.rewind()?;
        while io::copy(&mut tail.take(PIECE), file.as_file_mut())? > 0 {
            if !go_on() {
                return Err(io::ErrorKind::Interrupted.into());
            }
        }
        file.rewind()?;
        file.write_all(header)?;
        // Some file systems say only now that they are full.
        file.as_file().sync_all()?;
        if !go_on() {
            return Err(io::ErrorKind::Interrupted.into());
        }
        let file = self.body.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    }
}
