//! [`Series`]: the names of the chunks' files.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::args::{Args, folder};
use crate::error::Error;

/// The least number of digits in a file's name.
const LEAST_DIGITS: usize = 4;

/// The names of the chunks' files, and the existing files of an earlier mesh.
#[derive(Debug)]
pub(super) struct Series {
    /// The name without a number: `OUT.ply` of `OUT.0000.ply`.
    output: PathBuf,
    /// The digits of each number, so that the names sort like the numbers.
    digits: usize,
    /// Chunks whose files exist and have not been claimed.
    stale: BTreeSet<u64>,
    /// Files with such a name whose number is no chunk of this mesh.
    foreign: BTreeSet<OsString>,
}

impl Series {
    /// The names of `count` files.
    ///
    /// # Errors
    /// [`Error`] if a name is that of the input or of something that is not a file, or if the folder cannot hold such
    /// names.
    pub(super) fn new(args: &Args, count: u64) -> Result<Self, Error> {
        let digits = (count.max(1) - 1).to_string().len().max(LEAST_DIGITS);
        let (stale, foreign) = (BTreeSet::new(), BTreeSet::new());
        let mut series = Self { output: args.output.clone(), digits, stale, foreign };
        // The number may make the name too long.
        let path = series.path(0);
        match path.symlink_metadata() {
            Err(source) if source.kind() != ErrorKind::NotFound => {
                return Err(Error::Write { path, source: source.into() });
            }
            _ => {}
        }
        let folder = folder(&args.output);
        let unreadable = |source: std::io::Error| Error::Write { path: args.output.clone(), source: source.into() };
        for entry in fs::read_dir(folder).map_err(unreadable)? {
            let name = entry.map_err(unreadable)?.file_name();
            match series.number(Path::new(&name)) {
                Some(number) if number < count && name == series.name(number) => {
                    args.check_replaced(&series.path(number))?;
                    series.stale.insert(number);
                }
                Some(_) => {
                    series.foreign.insert(name);
                }
                None => {}
            }
        }
        Ok(series)
    }

    /// The path of a chunk's file; a file there is not stale any more.
    pub(super) fn claim(&mut self, number: u64) -> PathBuf {
        self.stale.remove(&number);
        self.path(number)
    }

    /// The existing files of chunks that were not claimed.
    pub(super) fn stale(&self) -> Vec<PathBuf> {
        self.stale.iter().map(|&number| self.path(number)).collect()
    }

    /// The first of the numbered files that are not chunks of this mesh, and their number.
    pub(super) fn foreign(&self) -> Option<(PathBuf, usize)> {
        self.foreign.first().map(|name| (self.output.with_file_name(name), self.foreign.len()))
    }

    fn path(&self, number: u64) -> PathBuf {
        self.output.with_file_name(self.name(number))
    }

    fn name(&self, number: u64) -> OsString {
        let [stem, extension] = [self.output.file_stem(), self.output.extension()].map(Option::unwrap_or_default);
        let mut name = stem.to_owned();
        name.push(format!(".{number:0width$}.", width = self.digits));
        name.push(extension);
        name
    }

    /// The number in a file's name; `None` if it is not a name of this series.
    fn number(&self, name: &Path) -> Option<u64> {
        let numbered = Path::new(name.file_stem()?);
        let digits = numbered.extension()?.to_str()?;
        let alike = name.extension() == self.output.extension() && numbered.file_stem() == self.output.file_stem();
        (alike && digits.len() >= LEAST_DIGITS && digits.bytes().all(|digit| digit.is_ascii_digit()))
            .then(|| digits.parse().unwrap_or(u64::MAX))
    }
}
