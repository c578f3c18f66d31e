//! [`write_atomically`]: a file is written whole, or not at all; [`check_file`] says beforehand where it cannot be.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::Path;

/// Writes a file beside its place and then moves it there, so that an old file is replaced only by a whole new one.
///
/// # Errors
/// What the system says, or `write`.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut fs::File) -> io::Result<()>) -> io::Result<()> {
    let mut name = path.file_name().map(OsString::from).ok_or(io::ErrorKind::InvalidFilename)?;
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = fs::File::create(&part).and_then(|mut file| {
        write(&mut file)?;
        file.sync_all()?;
        fs::rename(&part, path)
    });
    if written.is_err() {
        // It may not exist, and there is already an error to report.
        let _ = fs::remove_file(&part);
    }
    written
}

/// Says why a file of that name cannot be written, if its folder or its name tells.
///
/// # Errors
/// A sentence, where its folder is missing or it is a folder itself.
pub fn check_file(path: &Path) -> Result<(), String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(format!("{} cannot be written, since there is no folder {}", path.display(), folder.display()));
    }
    if path.is_dir() || path.file_name().is_none() {
        return Err(format!("{} cannot be written, since it is a folder", path.display()));
    }
    Ok(())
}
