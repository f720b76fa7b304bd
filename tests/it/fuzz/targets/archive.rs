//! Several files in one input: a fuzzer knows only of bytes.
//!
//! Each file begins with a line `@@@ NAME`, behind which its bytes follow up to the next such line (the line break before it
//! belongs to no file). A name that ends in ` +crc` is that of a chunk to which the checksum is added here: else every change
//! of a chunk would end at its checksum.

use std::fs;
use std::path::Path;
use tetreel::codec::seal;

const MARK: &[u8] = b"@@@ ";
const SEALED: &str = " +crc";
/// Names that are longer or deeper are left out, as are those that would leave the folder.
const NAME_MAX: usize = 120;

/// The files of an input: names and bytes. What stands before the first name is left out, as are files whose names cannot be
/// used.
pub fn files(input: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let mut rest = input;
    let mut at = if input.starts_with(MARK) { Some(0) } else { next_mark(input) };
    while let Some(begin) = at {
        rest = &rest[begin + MARK.len()..];
        let line = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        let name = String::from_utf8_lossy(&rest[..line]).into_owned();
        rest = rest.get(line + 1..).unwrap_or_default();
        at = next_mark(rest);
        // The line break before a mark is not part of the file.
        let end = at.map_or(rest.len(), |at| at.saturating_sub(1));
        let (name, sealed) = name.strip_suffix(SEALED).map_or((name.as_str(), false), |name| (name, true));
        if is_usable(name) {
            let mut bytes = rest[..end].to_vec();
            if sealed {
                bytes.extend(seal(&rest[..end]));
            }
            files.push((name.to_owned(), bytes));
        }
    }
    files
}

/// Where a line begins that is a mark, behind the first byte; a mark at the very beginning follows a file without bytes.
fn next_mark(bytes: &[u8]) -> Option<usize> {
    if bytes.starts_with(MARK) {
        return Some(0);
    }
    bytes.windows(MARK.len() + 1).position(|w| w[0] == b'\n' && &w[1..] == MARK).map(|at| at + 1)
}

fn is_usable(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-.%~".contains(c);
    let is_part = |part: &str| !part.is_empty() && part != "." && part != ".." && part.chars().all(plain);
    name.len() <= NAME_MAX && name.split('/').all(is_part)
}

/// Writes the files of an input to a folder. Where two names cannot both be (a file and a folder), the first one is.
pub fn unpack(input: &[u8], folder: &Path) {
    for (name, bytes) in files(input) {
        let path = folder.join(name);
        if path.parent().is_some_and(|parent| fs::create_dir_all(parent).is_ok()) {
            let _ = fs::write(path, bytes);
        }
    }
}

/// The input that holds these files: names, bytes, and whether they are those of a chunk without its checksum.
#[allow(dead_code, reason = "the programs of cargo fuzz need it not")]
pub fn pack<'a>(files: impl IntoIterator<Item = (&'a str, &'a [u8], bool)>) -> Vec<u8> {
    let mut input = Vec::new();
    for (name, bytes, sealed) in files {
        if !input.is_empty() {
            input.push(b'\n');
        }
        input.extend(MARK);
        input.extend(name.as_bytes());
        input.extend(if sealed { SEALED } else { "" }.as_bytes());
        input.push(b'\n');
        input.extend(bytes);
    }
    input
}
