//! Lines, counts and arrays of a file of geometry or of a variable, as text or C binary.

use super::case::AS_GOLD;
use crate::error::{FileError, FileResult};
use crate::import::cursor::{AGAIN, Cursor, place};
use crate::import::numbers::{Number, Numbers, parse_ascii};
use std::ops::Range;
use std::path::Path;

/// Bytes of a line in a binary file, and of a number.
const LINE: usize = 80;
const WORD: usize = 4;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    Binary { big_endian: bool },
}

/// The bytes of a file, and the next that is to be read.
pub(super) struct Reader<'a> {
    cursor: Cursor<'a>,
    pub(super) encoding: Encoding,
}

impl<'a> Reader<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8], encoding: Encoding) -> Self {
        Self { cursor: Cursor { path, bytes, at: 0, is_binary: encoding != Encoding::Text }, encoding }
    }

    /// The next line without blanks at its ends; `None` at the end of the file.
    pub(super) fn next_line(&mut self) -> FileResult<Option<String>> {
        let line = match self.encoding {
            Encoding::Text => self.cursor.line(),
            Encoding::Binary { .. } if self.cursor.rest().is_empty() => None,
            Encoding::Binary { .. } => {
                let range = self.cursor.block(LINE, "a line")?;
                self.cursor.bytes[range].split(|&byte| byte == 0).next()
            }
        };
        let line = line.map(|line| String::from_utf8_lossy(line.trim_ascii()).into_owned());
        if line.as_ref().is_some_and(|line| line.eq_ignore_ascii_case("BEGIN TIME STEP")) {
            let error = self.cursor.unsupported("has several steps in one file, which is not read".to_owned());
            return Err(error.remedy(AS_GOLD));
        }
        Ok(line)
    }

    /// The next line, `what`.
    pub(super) fn line(&mut self, what: &str) -> FileResult<String> {
        self.next_line()?.ok_or_else(|| self.cursor.cut(what))
    }

    /// The next line that is a keyword; `None` at the end of the file.
    pub(super) fn keyword(&mut self) -> FileResult<Option<String>> {
        loop {
            match self.next_line()? {
                Some(line) if line.is_empty() => {}
                other => return Ok(other),
            }
        }
    }

    /// The next number, which counts `what`.
    pub(super) fn count(&mut self, what: &str) -> FileResult<usize> {
        let start = self.cursor.at;
        let range = self.numbers(1, what)?;
        let count = self.indices(range)?.first().copied().and_then(|count| usize::try_from(count).ok());
        count.ok_or_else(|| {
            self.cursor.at = start;
            self.invalid(format!("has no number of {what}"))
        })
    }

    /// The next number as a value of a variable, `what`.
    pub(super) fn float(&mut self, what: &str) -> FileResult<f64> {
        let range = self.numbers(1, what)?;
        let floats = floats(self.cursor.path, self.cursor.bytes, self.encoding, range)?.values().to_f64();
        floats.first().copied().ok_or_else(|| self.cursor.cut(what))
    }

    /// Passes this many numbers, `what`; where they lie.
    pub(super) fn numbers(&mut self, count: usize, what: &str) -> FileResult<Range<usize>> {
        match self.encoding {
            Encoding::Text => {
                let range = self.cursor.words(count, what)?;
                self.end_line();
                Ok(range)
            }
            Encoding::Binary { .. } => {
                let bytes = self.product(count, WORD, what)?;
                self.cursor.block(bytes, what)
            }
        }
    }

    /// A product of counts in the file.
    pub(super) fn product(&self, a: usize, b: usize, what: &str) -> FileResult<usize> {
        let too_many = || self.invalid(format!("claims {a} times {b} {what}")).remedy(AGAIN);
        a.checked_mul(b).ok_or_else(too_many)
    }

    /// The numbers there, which count or number something.
    pub(super) fn indices(&self, range: Range<usize>) -> FileResult<Vec<u64>> {
        indices(self.cursor.path, self.cursor.bytes, self.encoding, range)
    }

    /// The error that this place has `problem`.
    pub(super) fn invalid(&self, problem: String) -> FileError {
        self.cursor.invalid(problem)
    }

    /// The error that this place has something that is not read.
    pub(super) fn unsupported(&self, problem: String) -> FileError {
        self.cursor.unsupported(problem)
    }

    /// Passes the end of a line of which nothing but blanks is left.
    fn end_line(&mut self) {
        let rest = self.cursor.rest();
        let blanks = rest.iter().position(|byte| *byte == b'\n' || !byte.is_ascii_whitespace());
        match blanks {
            Some(blanks) if rest[blanks] == b'\n' => self.cursor.at += blanks + 1,
            _ => {}
        }
    }

    /// Tells the byte order: parts have small numbers. The next word is such a number.
    pub(super) fn tell_byte_order(&mut self) {
        if let (Encoding::Binary { .. }, Some(word)) = (self.encoding, self.cursor.rest().first_chunk::<WORD>()) {
            let big_endian = u32::from_be_bytes(*word) < u32::from_le_bytes(*word);
            self.encoding = Encoding::Binary { big_endian };
        }
    }
}

/// The floats that lie there.
///
/// # Errors
/// If a word is no number.
pub(super) fn floats(path: &Path, bytes: &[u8], encoding: Encoding, range: Range<usize>) -> FileResult<Numbers> {
    decode(path, bytes, encoding, range, Number::Float32, Number::Float32)
}

/// The integers that lie there, which count or number something.
///
/// # Errors
/// If a word is no such number.
pub(super) fn indices(path: &Path, bytes: &[u8], encoding: Encoding, range: Range<usize>) -> FileResult<Vec<u64>> {
    let start = range.start;
    let numbers = decode(path, bytes, encoding, range, Number::Int64, Number::Int32)?;
    numbers.values().to_indices().map_err(|i| {
        let place = place(bytes, encoding != Encoding::Text, start);
        FileError::invalid(path, place, format!("number {i} from there is negative")).remedy(AGAIN)
    })
}

/// The numbers that lie there, of these types in text and in binary files.
fn decode(
    path: &Path,
    bytes: &[u8],
    encoding: Encoding,
    range: Range<usize>,
    in_text: Number,
    in_binary: Number,
) -> FileResult<Numbers> {
    let start = range.start;
    let stored = bytes.get(range).unwrap_or_default();
    match encoding {
        Encoding::Binary { big_endian } => Ok(Numbers { number: in_binary, big_endian, bytes: stored.to_vec() }),
        Encoding::Text => {
            let invalid = |problem: String| FileError::invalid(path, place(bytes, false, start), problem).remedy(AGAIN);
            let bytes = parse_ascii(in_text, stored).map_err(invalid)?;
            Ok(Numbers { number: in_text, big_endian: false, bytes })
        }
    }
}
