//! File name patterns with a number.

use crate::error::{FileError, FileResult};
use crate::files::os_string;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A file name with a number: `frame_%04d.png`, `%d` for no leading zeros, `%%` for a percent sign. Without a number it names a single
/// file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NumberedPath {
    before: OsString,
    /// Least number of digits; `None` for a single file.
    digits: Option<usize>,
    after: OsString,
}

impl NumberedPath {
    /// Parses a pattern; errors show `example`.
    ///
    /// # Errors
    /// If there are two numbers, or a conversion other than %d.
    pub fn new(path: &Path, example: &str) -> FileResult<Self> {
        let bad =
            |problem: &str| FileError::unsupported(path, "", problem).remedy(format!("write, for example, {example}"));
        let (mut parts, mut digits) = ([Vec::new(), Vec::new()], None);
        let mut rest = path.as_os_str().as_encoded_bytes();
        while let Some(at) = rest.iter().position(|&byte| byte == b'%') {
            let (text, number) = (&rest[..at], &rest[at + 1..]);
            let part = &mut parts[usize::from(digits.is_some())];
            part.extend_from_slice(text);
            if let Some(tail) = number.strip_prefix(b"%") {
                part.push(b'%');
                rest = tail;
                continue;
            }
            let (width, tail) = conversion(number).ok_or_else(|| bad("% is followed by no number format"))?;
            if digits.replace(width).is_some() {
                return Err(bad("two places for a number"));
            }
            rest = tail;
        }
        parts[usize::from(digits.is_some())].extend_from_slice(rest);
        let [before, after] =
            parts.map(|part| os_string(part).ok_or_else(|| bad("cannot be taken apart: it is no Unicode")));
        Ok(Self { before: before?, digits, after: after? })
    }

    /// Whether the pattern has a number.
    pub fn is_numbered(&self) -> bool {
        self.digits.is_some()
    }

    /// The path for number `n`.
    pub fn path(&self, n: usize) -> PathBuf {
        let mut path = self.before.clone();
        if let Some(digits) = self.digits {
            path.push(format!("{n:0digits$}"));
            path.push(&self.after);
        }
        path.into()
    }
}

/// Parses a number format behind its percent sign (`d`, `04d`): least number of digits, and the rest of the text.
fn conversion(text: &[u8]) -> Option<(usize, &[u8])> {
    let end = text.iter().position(|byte| !byte.is_ascii_digit())?;
    let (width, tail) = (std::str::from_utf8(&text[..end]).ok()?, text[end..].strip_prefix(b"d")?);
    let digits = if width.is_empty() { Some(1) } else { width.parse().ok().filter(|n| (1..=20).contains(n)) };
    Some((digits?, tail))
}
