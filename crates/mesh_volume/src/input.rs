//! [`Volume`]: a file of samples that is read a slab at a time.

use std::fs::{self, File};
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;

use crate::args::{Args, extension};
use crate::error::{Before, Error};
use crate::npy::{Header, NpyError};
use crate::sample::{Endian, SampleType};

/// A file of samples, opened at the first sample.
///
/// Its length agrees with its shape, and its header with the command line.
#[derive(Debug)]
pub(crate) struct Volume {
    path: PathBuf,
    file: File,
    pub(crate) sample_type: SampleType,
    /// The order of a sample's bytes.
    endian: Endian,
    /// Samples along x, y and z; at least 2 each.
    pub(crate) size: [u32; 3],
    /// True if neighbours along z are neighbours in the file, not those along x. A slab then has one x.
    ///
    /// A NumPy array has the indices `[z][y][x]` in any memory order, since NumPy hides that order from its users. The
    /// last index is the fastest in C order, the first one in Fortran order.
    pub(crate) z_fastest: bool,
}

impl Volume {
    /// Opens the input.
    ///
    /// # Errors
    /// [`Error`] if the file does not agree with its name and the flags, or if its length does not agree with its
    /// shape.
    pub(crate) fn open(args: &Args) -> Result<Self, Error> {
        let path = || args.input.clone();
        let extension = extension(&args.input);
        if extension != "raw" && extension != "npy" {
            return Err(Error::InputFormat { path: path() });
        }
        let read = |source| Error::Read { path: path(), source };
        // Opening a pipe would wait for a writer.
        if !fs::metadata(&args.input).map_err(read)?.is_file() {
            return Err(Error::InputNotAFile { path: path() });
        }
        let file = File::open(&args.input).map_err(read)?;
        let (sample_type, endian) = (SampleType::U8, Endian::Little);
        let mut volume = Self { path: path(), file, sample_type, endian, size: [0; 3], z_fastest: false };
        let before = if extension == "npy" { volume.read_header(args)? } else { volume.believe(args)? };

        let (size, sample_type) = (volume.size, volume.sample_type);
        let most = u32::MAX - 2 * args.margin();
        if size.iter().any(|&samples| samples > most) {
            return Err(Error::Size { path: path(), size: size.map(u64::from), most });
        }
        let expected = size
            .iter()
            .try_fold(sample_type.bytes() as u64, |bytes, &samples| bytes.checked_mul(u64::from(samples)))
            .and_then(|bytes| bytes.checked_add(before.bytes()))
            .ok_or_else(|| Error::TooLarge { path: path(), before, size, sample_type })?;
        let found = volume.file.metadata().map_err(read)?.len();
        if found != expected {
            return Err(Error::Length { path: path(), expected, before, size, sample_type, found });
        }
        volume.file.seek(SeekFrom::Start(before.bytes())).map_err(read)?;
        Ok(volume)
    }

    /// Samples along the axes of the file, the fastest first.
    pub(crate) const fn lattice(&self) -> [u32; 3] {
        let [x, y, z] = self.size;
        if self.z_fastest { [z, y, x] } else { [x, y, z] }
    }

    /// Samples along the two faster axes of the file.
    pub(crate) const fn slab(&self) -> [u32; 2] {
        let [a, b, _] = self.lattice();
        [a, b]
    }

    /// The number of slabs.
    pub(crate) const fn slabs(&self) -> u32 {
        self.lattice()[2]
    }

    /// Reads the next slab, which fills `bytes` with little-endian samples.
    ///
    /// # Errors
    /// [`Error::Read`], also if the file has become shorter.
    pub(crate) fn read(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        self.file.read_exact(bytes).map_err(|source| match source.kind() {
            io::ErrorKind::UnexpectedEof => {
                self.cannot_be_read(io::Error::other("it has become shorter while it was read"))
            }
            _ => self.cannot_be_read(source),
        })?;
        if self.endian == Endian::Big {
            match self.sample_type.bytes() {
                2 => reverse_each::<2>(bytes),
                4 => reverse_each::<4>(bytes),
                8 => reverse_each::<8>(bytes),
                _ => {}
            }
        }
        Ok(())
    }

    fn cannot_be_read(&self, source: io::Error) -> Error {
        Error::Read { path: self.path.clone(), source }
    }

    /// Takes type, byte order and size from the flags. Returns the number of bytes before the samples.
    fn believe(&mut self, args: &Args) -> Result<Before, Error> {
        self.size = args.shape.ok_or(Error::FlagMissing { flag: "--shape" })?;
        self.sample_type = args.sample_type.ok_or(Error::FlagMissing { flag: "--type" })?;
        self.endian = args.endian.unwrap_or(Endian::Little);
        Ok(Before::Skip(args.skip.unwrap_or(0)))
    }

    /// Takes type, byte order and size from the header. Returns the number of bytes before the samples.
    fn read_header(&mut self, args: &Args) -> Result<Before, Error> {
        let path = || args.input.clone();
        let header = Header::read(&mut self.file).map_err(|error| match error {
            NpyError::Io(source) => self.cannot_be_read(source),
            source => Error::Npy { path: path(), source },
        })?;
        let [z, y, x] = header.shape;
        let size = [x, y, z].map(|samples| u32::try_from(samples).ok().filter(|&samples| samples >= 2));
        let [Some(x), Some(y), Some(z)] = size else {
            return Err(Error::Size { path: path(), size: [x, y, z], most: u32::MAX });
        };
        let found = [x, y, z];
        if let Some(said) = args.shape.filter(|&said| said != found) {
            return Err(Error::ShapeDisagrees { path: path(), found, said });
        }
        if let Some(said) = args.sample_type.filter(|&said| said != header.sample_type) {
            return Err(Error::TypeDisagrees { path: path(), found: header.sample_type, said });
        }
        if let (Some(found), Some(said)) = (header.endian, args.endian)
            && found != said
        {
            return Err(Error::EndianDisagrees { path: path(), found, said });
        }
        if let Some(said) = args.skip.filter(|&said| said != header.length) {
            return Err(Error::SkipDisagrees { path: path(), found: header.length, said });
        }
        (self.size, self.sample_type, self.z_fastest) = (found, header.sample_type, header.fortran_order);
        self.endian = header.endian.unwrap_or(Endian::Little);
        Ok(Before::Header(header.length))
    }
}

/// Reverses the bytes of each sample of `N` bytes.
fn reverse_each<const N: usize>(bytes: &mut [u8]) {
    bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|sample| sample.reverse());
}
