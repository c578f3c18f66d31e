//! [`DescriptionError`]: an error in a terrain's description, and its place in the file.

use std::io;

use ron::error::{Error as RonError, SpannedError};
use thiserror::Error;

use crate::source::SourceError;
use crate::terrain::TerrainError;

/// An error in a terrain's description or its file. Lines and columns count from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// The file's bytes could not be read.
    #[error("the terrain file cannot be read: {0}")]
    Read(#[from] io::Error),
    /// The text ends before the description does.
    #[error("the terrain file is cut short: it ends in line {line}, column {column}, in the middle of the description")]
    CutShort {
        /// The last line.
        line: usize,
        /// One past its end.
        column: usize,
    },
    /// The file is not UTF-8 text.
    #[error("a terrain file must be UTF-8 text, but there are other bytes in line {line}")]
    NotText {
        /// The line of the first byte that is not UTF-8.
        line: usize,
    },
    /// The text is not RON, or does not describe a terrain: unknown or missing fields, values of wrong types.
    #[error("line {line}, column {column}: {message}")]
    Text {
        /// The line of the error.
        line: usize,
        /// The column of the error.
        column: usize,
        /// The parser's message: what was expected and what was found.
        message: String,
    },
    /// A setting of the source is out of range.
    #[error("{}{error}", in_lines(lines))]
    Source {
        /// The setting, and its allowed range.
        error: SourceError,
        /// The lines that hold this number; the error is in one of them. Empty for a description without a file.
        lines: Vec<usize>,
    },
    /// A setting of the terrain is out of range.
    #[error("{}{error}", in_lines(lines))]
    Terrain {
        /// The setting, and its allowed range.
        error: TerrainError,
        /// The lines that hold this number; the error is in one of them. Empty for a description without a file.
        lines: Vec<usize>,
    },
    /// A height map's picture could not be read.
    #[error("the picture '{picture}' cannot be used: {message}")]
    Picture {
        /// Its path in `assets`.
        picture: String,
        /// The reason.
        message: String,
    },
    /// A height map has no samples. The loader reads them for files; code must set them.
    #[error("the picture '{picture}' has not been read")]
    NoPicture {
        /// Its path in `assets`.
        picture: String,
    },
    /// The description cannot be written.
    #[error("the description cannot be written: {message}")]
    Write {
        /// The reason.
        message: String,
    },
}

impl From<SourceError> for DescriptionError {
    fn from(error: SourceError) -> Self {
        Self::Source { error, lines: Vec::new() }
    }
}

impl From<TerrainError> for DescriptionError {
    fn from(error: TerrainError) -> Self {
        Self::Terrain { error, lines: Vec::new() }
    }
}

impl DescriptionError {
    /// The error for bytes that are not UTF-8, after `valid` text. `cut_off`: whether they end within a character.
    pub(super) fn from_utf8(valid: &str, cut_off: bool) -> Self {
        if cut_off { Self::cut_short(valid) } else { Self::NotText { line: valid.matches('\n').count() + 1 } }
    }

    /// Converts an error of the RON parser; an error at the end of the text means that the text is cut short.
    pub(super) fn from_ron(error: SpannedError, text: &str) -> Self {
        let (start, end) = (error.span.start, error.span.end);
        let rest = after(text, start.line, start.col).trim();
        let at_end = after(text, end.line, end.col).trim().is_empty();
        let in_last_word = !rest.contains(|c: char| !is_of_word(c));
        let text_error = |message: String| {
            let (line, column) = place(text, text.len() - after(text, start.line, start.col).trim_start().len());
            Self::Text { line, column, message }
        };
        match error.code {
            RonError::Eof | RonError::ExpectedStringEnd | RonError::UnclosedBlockComment => Self::cut_short(text),
            RonError::TrailingCharacters => text_error("there is text after the end of the description".into()),
            _ if at_end || in_last_word => Self::cut_short(text),
            code => text_error(code.to_string()),
        }
    }

    /// Adds the lines of `text` that hold the wrong number.
    pub(super) fn in_text(self, text: &str) -> Self {
        match self {
            Self::Source { error, .. } => {
                let lines = match &error {
                    SourceError::Setting { found, .. } => lines_with(text, *found),
                    _ => Vec::new(),
                };
                Self::Source { error, lines }
            }
            Self::Terrain { error, .. } => {
                let lines = match &error {
                    TerrainError::VoxelSize { found } => lines_with(text, f64::from(*found)),
                    _ => Vec::new(),
                };
                Self::Terrain { error, lines }
            }
            other => other,
        }
    }

    fn cut_short(text: &str) -> Self {
        let (line, column) = place(text, text.trim_end().len());
        Self::CutShort { line, column }
    }
}

/// The text from a line and column on, both counted from 1.
fn after(text: &str, line: usize, column: usize) -> &str {
    let lines: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let rest = &text[lines..];
    let columns: usize = rest.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
    &rest[columns..]
}

/// The line and column, counted from 1, of the byte at `offset`.
fn place(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset];
    let last = before.rsplit('\n').next().unwrap_or("");
    (before.matches('\n').count() + 1, last.chars().count() + 1)
}

/// True for the characters of names and numbers.
fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || "+-._".contains(c)
}

/// The lines, counted from 1, that hold a number outside of comments.
fn lines_with(text: &str, number: f64) -> Vec<usize> {
    let is_it = |word: &str| {
        let same =
            |found: f64| found == number || f64::from(found as f32) == number || (found.is_nan() && number.is_nan());
        word.replace('_', "").parse().is_ok_and(same)
    };
    let lines = (1..).zip(text.lines().map(|line| line.split("//").next().unwrap_or("")));
    lines.filter(|(_, line)| line.split(|c| !is_of_word(c)).any(is_it)).map(|(line, _)| line).collect()
}

fn in_lines(lines: &[usize]) -> String {
    let lines: Vec<_> = lines.iter().map(usize::to_string).collect();
    if lines.is_empty() { String::new() } else { format!("line {}: ", lines.join(" or ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_found_where_it_stands() {
        let text = "(a: 3.5,\n b: [-3.5, 1_000], // 2\n c: -0.35e1,\n d: 0.1)";
        assert_eq!(lines_with(text, -3.5), [2, 3]);
        assert_eq!(lines_with(text, 1000.0), [2]);
        assert_eq!(lines_with(text, 2.0), []);
        assert_eq!(lines_with(text, f64::from(0.1_f32)), [4]);
        assert_eq!(in_lines(&[2, 3]), "line 2 or 3: ");
    }
}
