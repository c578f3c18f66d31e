//! [`Header`]: the header of a `.npy` file.
//!
//! The format is that of NumPy's `numpy.lib.format`, versions 1 to 3: a magic, a version, the length of the rest, and a
//! Python dictionary of three entries. Crates for it bring parsers of all Python literals and big numbers. What NumPy
//! writes for plain numbers is simple enough to be parsed here, with a clear error for everything else.

use std::io::{self, Read};

use thiserror::Error;

use crate::sample::{Endian, SampleType};

const MAGIC: [u8; 6] = *b"\x93NUMPY";

/// The longest header text that is accepted; three entries need far less.
const MAX_TEXT: u64 = 1 << 16;

/// The description of the array in a `.npy` file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) sample_type: SampleType,
    /// The byte order of the samples; `None` for single bytes.
    pub(crate) endian: Option<Endian>,
    /// The lengths of the array's three axes, in the order of their indices.
    pub(crate) shape: [u64; 3],
    /// True if neighbours along the first axis are neighbours in the file, not those along the last.
    pub(crate) fortran_order: bool,
    /// The number of bytes before the samples.
    pub(crate) length: u64,
}

impl Header {
    /// Reads the header at the beginning of a file, and no further.
    ///
    /// # Errors
    /// [`NpyError`] if there is no valid header, or if the array does not have three axes and a type that can be
    /// meshed.
    pub(crate) fn read(file: &mut impl Read) -> Result<Self, NpyError> {
        let start = read_exactly(file, 8).map_err(|error| match error {
            NpyError::CutShort { .. } => NpyError::Magic,
            error => error,
        })?;
        if start[..6] != MAGIC {
            return Err(NpyError::Magic);
        }
        let length_bytes = match (start[6], start[7]) {
            (1, 0) => 2,
            (2 | 3, 0) => 4,
            (major, minor) => return Err(NpyError::Version { major, minor }),
        };
        let mut length = [0; 8];
        length[..length_bytes].copy_from_slice(&read_exactly(file, length_bytes as u64)?);
        let length = u64::from_le_bytes(length);
        if length > MAX_TEXT {
            return Err(NpyError::TooLong { found: length });
        }
        let text = read_exactly(file, length)?;
        Parser { text: &text, at: 0 }.header(8 + length_bytes as u64 + length)
    }
}

/// The reason why the header of a `.npy` file was refused.
#[derive(Debug, Error)]
pub(crate) enum NpyError {
    #[error("{0}")]
    Io(#[from] io::Error),
    #[error("it does not begin as a .npy file does")]
    Magic,
    #[error("it is a .npy file of version {major}.{minor}, but only versions 1.0, 2.0 and 3.0 are known")]
    Version { major: u8, minor: u8 },
    #[error("its .npy header is {found} bytes long, but no more than {MAX_TEXT} are expected")]
    TooLong { found: u64 },
    #[error("it ends within its .npy header, of which {expected} more bytes were expected and {found} came")]
    CutShort { expected: u64, found: u64 },
    #[error("its .npy header should have {expected} at byte {at}, but has {found}")]
    Syntax { expected: &'static str, at: usize, found: String },
    #[error("its .npy header has no '{key}'")]
    Missing { key: &'static str },
    #[error(
        "its samples are of NumPy's type {found}, but only b1, i1, u1, i2, u2, i4, u4, i8, u8, f4 and f8 can be meshed"
    )]
    Type { found: String },
    #[error("its array has {found} axes, but a volume has 3: z, y and x")]
    Axes { found: usize },
}

/// Reads `count` bytes. Does not trust the count: allocates only what the file really has.
fn read_exactly(file: &mut impl Read, count: u64) -> Result<Vec<u8>, NpyError> {
    let mut bytes = Vec::new();
    let found = file.take(count).read_to_end(&mut bytes)? as u64;
    if found == count { Ok(bytes) } else { Err(NpyError::CutShort { expected: count, found }) }
}

/// A parser of the dictionary: `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4, 5), }`, and spaces.
struct Parser<'a> {
    text: &'a [u8],
    at: usize,
}

impl Parser<'_> {
    fn header(mut self, length: u64) -> Result<Header, NpyError> {
        let (mut sample_type, mut fortran_order, mut shape) = (None, None, None);
        self.expect(b'{', "{")?;
        while !self.eat(b'}') {
            let (at, key) = (self.at, self.string("one of its three keys")?);
            self.expect(b':', "a colon")?;
            match &*key {
                "descr" if sample_type.is_none() => sample_type = Some(self.sample_type()?),
                "fortran_order" if fortran_order.is_none() => fortran_order = Some(self.truth()?),
                "shape" if shape.is_none() => shape = Some(self.shape()?),
                _ => {
                    self.at = at;
                    return Err(self.error("'descr', 'fortran_order' and 'shape', once each,"));
                }
            }
            if !self.eat(b',') {
                self.expect(b'}', "a comma or }")?;
                break;
            }
        }
        if self.peek().is_some() {
            return Err(self.error("nothing but spaces"));
        }
        let lengths = shape.ok_or(NpyError::Missing { key: "shape" })?;
        let (sample_type, endian) = sample_type.ok_or(NpyError::Missing { key: "descr" })?;
        Ok(Header {
            sample_type,
            endian,
            shape: lengths.try_into().map_err(|lengths: Vec<u64>| NpyError::Axes { found: lengths.len() })?,
            fortran_order: fortran_order.ok_or(NpyError::Missing { key: "fortran_order" })?,
            length,
        })
    }

    /// A type as NumPy writes it: byte order, kind, bytes.
    fn sample_type(&mut self) -> Result<(SampleType, Option<Endian>), NpyError> {
        if self.peek() == Some(b'[') {
            return Err(NpyError::Type { found: "[…] (a record)".to_owned() });
        }
        let found = self.string("a type")?;
        let Some((order, kind)) = found.split_at_checked(1) else { return Err(NpyError::Type { found }) };
        let sample_type = match kind {
            "b1" => SampleType::Bool,
            "i1" => SampleType::I8,
            "u1" => SampleType::U8,
            "i2" => SampleType::I16,
            "u2" => SampleType::U16,
            "i4" => SampleType::I32,
            "u4" => SampleType::U32,
            "i8" => SampleType::I64,
            "u8" => SampleType::U64,
            "f4" => SampleType::F32,
            "f8" => SampleType::F64,
            _ => return Err(NpyError::Type { found }),
        };
        let endian = match order {
            // A single byte has no order.
            "|" | "<" | ">" | "=" if sample_type.bytes() == 1 => None,
            "<" => Some(Endian::Little),
            ">" => Some(Endian::Big),
            // Native order means the reader's, as in NumPy.
            "=" => Some(Endian::NATIVE),
            _ => return Err(NpyError::Type { found }),
        };
        Ok((sample_type, endian))
    }

    fn truth(&mut self) -> Result<bool, NpyError> {
        for (word, truth) in [("True", true), ("False", false)] {
            self.peek();
            if self.text[self.at..].starts_with(word.as_bytes()) {
                self.at += word.len();
                return Ok(truth);
            }
        }
        Err(self.error("True or False"))
    }

    /// A tuple of lengths.
    fn shape(&mut self) -> Result<Vec<u64>, NpyError> {
        let mut lengths = Vec::new();
        self.expect(b'(', "the axes' lengths in brackets")?;
        while !self.eat(b')') {
            lengths.push(self.length()?);
            if !self.eat(b',') {
                self.expect(b')', "a comma or )")?;
                break;
            }
        }
        Ok(lengths)
    }

    fn length(&mut self) -> Result<u64, NpyError> {
        self.peek();
        let digits = self.text[self.at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = str::from_utf8(&self.text[self.at..][..digits]).ok().and_then(|digits| digits.parse().ok());
        let number = number.ok_or_else(|| self.error("a length of up to 64 bits"))?;
        self.at += digits;
        // Python 2 wrote an L after large numbers.
        self.eat(b'L');
        Ok(number)
    }

    /// A string without escapes.
    fn string(&mut self, expected: &'static str) -> Result<String, NpyError> {
        let quote = self.peek().filter(|quote| b"'\"".contains(quote)).ok_or_else(|| self.error(expected))?;
        let rest = &self.text[self.at + 1..];
        let length = rest.iter().position(|&byte| byte == quote).ok_or_else(|| self.error(expected))?;
        let string = rest[..length].iter().all(|byte| (b' '..=b'~').contains(byte) && *byte != b'\\');
        if !string {
            return Err(self.error(expected));
        }
        let string = String::from_utf8_lossy(&rest[..length]).into_owned();
        self.at += length + 2;
        Ok(string)
    }

    fn expect(&mut self, byte: u8, expected: &'static str) -> Result<(), NpyError> {
        if self.eat(byte) { Ok(()) } else { Err(self.error(expected)) }
    }

    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// The next byte that is not a space.
    fn peek(&mut self) -> Option<u8> {
        let spaces = self.text[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.at += spaces;
        self.text.get(self.at).copied()
    }

    fn error(&self, expected: &'static str) -> NpyError {
        let rest = &self.text[self.at..];
        let found = if rest.is_empty() {
            "nothing".to_owned()
        } else {
            format!("“{}”", rest[..rest.len().min(24)].escape_ascii())
        };
        NpyError::Syntax { expected, at: self.at, found }
    }
}
