//! A place in a file of text and binary arrays, which moves on word by word, line by line or array by array.

use crate::error::{FileError, FileResult};
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

/// Most bytes of a word that a message shows.
const SHOWN_MAX: usize = 40;

/// The bytes of a file, and the next of them that is to be read.
pub(super) struct Cursor<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    /// Whether numbers of arrays are binary.
    pub(super) is_binary: bool,
}

impl<'a> Cursor<'a> {
    /// What is still to be read.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Passes blanks.
    pub(super) fn blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    }

    /// The next word; `None` at the end of the file.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.blanks();
        let rest = self.rest();
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += end;
        Some(&rest[..end]).filter(|word| !word.is_empty())
    }

    /// The next word, `what`.
    pub(super) fn needed(&mut self, what: &str) -> FileResult<&'a [u8]> {
        self.word().ok_or_else(|| self.cut(what))
    }

    /// The next word as a number, `what`.
    pub(super) fn number<T: FromStr>(&mut self, what: &str) -> FileResult<T> {
        let word = self.needed(what)?;
        let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number.ok_or_else(|| self.invalid(format!("'{}' is no {what}", shown(word))))
    }

    /// The next three words as numbers, each `what`.
    pub(super) fn three<T: FromStr>(&mut self, what: &str) -> FileResult<[T; 3]> {
        Ok([self.number(what)?, self.number(what)?, self.number(what)?])
    }

    /// Whether the next word is `keyword` in any case.
    pub(super) fn is_next(&mut self, keyword: &str) -> bool {
        let start = self.at;
        let is_it = self.word().is_some_and(|word| word.eq_ignore_ascii_case(keyword.as_bytes()));
        self.at = start;
        is_it
    }

    /// The rest of the line without its end, behind which the cursor moves; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = Some(self.rest()).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&b| b == b'\n');
        self.at += end.map_or(rest.len(), |end| end + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// Passes this number of words; where they lie.
    pub(super) fn words(&mut self, count: usize, what: &str) -> FileResult<Range<usize>> {
        self.blanks();
        let rest = self.rest();
        if count == 0 {
            return Ok(self.at..self.at);
        }
        let (mut left, mut is_inside) = (count, false);
        // Words have blanks between them: more than this cannot be there.
        let end = if count > rest.len() / 2 + 1 {
            None
        } else {
            rest.iter().position(|byte| {
                let is_blank = byte.is_ascii_whitespace();
                left -= usize::from(is_blank && is_inside);
                is_inside = !is_blank;
                left == 0
            })
        };
        let end = end.or_else(|| (left == 1 && is_inside).then_some(rest.len()));
        let Some(end) = end else {
            return Err(self.invalid(format!("the file ends in {what}, which claims {count} numbers")).remedy(AGAIN));
        };
        let start = self.at;
        self.at += end;
        Ok(start..self.at)
    }

    /// Passes this number of bytes; where they lie.
    pub(super) fn block(&mut self, count: usize, what: &str) -> FileResult<Range<usize>> {
        if count > self.rest().len() {
            let problem = format!("{what} claims {count} bytes, of which the file has {}", self.rest().len());
            return Err(self.invalid(problem).remedy(AGAIN));
        }
        let start = self.at;
        self.at += count;
        Ok(start..self.at)
    }

    /// The error that this place has `problem`.
    pub(super) fn invalid(&self, problem: String) -> FileError {
        FileError::invalid(self.path, place(self.bytes, self.is_binary, self.at), problem)
    }

    /// The error that this place has something that is not read.
    pub(super) fn unsupported(&self, problem: String) -> FileError {
        FileError::unsupported(self.path, place(self.bytes, self.is_binary, self.at), problem)
    }

    /// The error that the file ends where `what` is expected.
    pub(super) fn cut(&self, what: &str) -> FileError {
        self.invalid(format!("the file ends before the {what}")).remedy(AGAIN)
    }
}

/// The remedy for cut files.
pub(super) const AGAIN: &str = "write the file again, or copy it again if it was cut";

/// The line of a byte of a text, or the byte of a binary file.
pub(super) fn place(bytes: &[u8], is_binary: bool, at: usize) -> String {
    if is_binary {
        return format!("byte {at}");
    }
    let before = &bytes[..at.min(bytes.len())];
    format!("line {}", before.iter().filter(|&&b| b == b'\n').count() + 1)
}

/// A word for a message.
pub(super) fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(SHOWN_MAX)]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cursor(bytes: &[u8]) -> Cursor<'_> {
        Cursor { path: Path::new("a.vtk"), bytes, at: 0, is_binary: false }
    }

    #[test]
    fn words_lines_and_numbers_follow_each_other() {
        let mut text = cursor(b"one  two\r\nthree 4\n\n 5.5 -6");
        assert!(text.is_next("ONE") && !text.is_next("two"));
        assert_eq!(
            (text.word(), text.line(), text.line()),
            (Some(&b"one"[..]), Some(&b"  two"[..]), Some(&b"three 4"[..]))
        );
        assert_eq!((text.line(), text.number::<f64>("number").ok()), (Some(&b""[..]), Some(5.5)));
        assert!(text.number::<usize>("count").unwrap_err().to_string().contains("line 4: '-6' is no count"));
        assert_eq!((text.word(), text.line()), (None, None));
    }

    #[test]
    fn as_many_words_are_passed_as_there_are() {
        for (text, count, expected) in [
            (&b" 1 2\n3 4"[..], 3, Some(1..6)),
            (b"1 2 3", 3, Some(0..5)),
            (b"1 2 3 ", 3, Some(0..5)),
            (b"1 2 3", 4, None),
            (b"1 ", 2, None),
            (b"", 1, None),
            (b" ", 0, Some(1..1)),
            (b"1", usize::MAX, None),
        ] {
            assert_eq!(cursor(text).words(count, "it").ok(), expected, "{count} of {text:?}");
        }
    }
}
