//! Reader of legacy VTK files (`.vtk`), as text and binary, versions 1.0 to 5.1: unstructured, structured and rectilinear grids, and points
//! at equal distances.
//!
//! A file in memory is its bytes, and a table of where each array lies. The end of an array that is written as text is found by counting
//! words; its numbers are parsed when they are asked for. Binary numbers, the highest byte first, are read in place.

mod array;
mod attributes;
mod grid;
mod header;
mod piece;
#[cfg(test)]
mod tests;

use super::content::Head;
use super::cursor;
use super::format::Format;
use super::grids::open_each;
use super::numbers::{ArrayBytes, Decoded, Number, parse_ascii};
use super::timed::{at_start, finite};
use crate::error::{FileError, FileResult};
use crate::files;
use array::{Array, Kind};
use cursor::{AGAIN, place};
use grid::Geometry;
use header::{Extent, Header, TIME_ARRAYS, parse};
use std::path::{Path, PathBuf};

/// Legacy files, one step each.
pub(super) const FORMAT: Format = Format {
    name: "legacy VTK files",
    extensions: &["vtk"],
    joins: true,
    recognises: |head| head.begins_with(b"# vtk DataFile"),
    open: open_each,
    files: |_| Ok(Vec::new()),
};

/// What has the time in a file, for messages.
pub(super) fn time_name() -> String {
    TIME_ARRAYS.join(" or ")
}

/// Whether a file is one of this format: by its name, or by how it begins if its name says nothing.
pub(super) fn is_legacy(path: &Path) -> bool {
    Format::of(path)
        .map_or_else(|| (FORMAT.recognises)(&Head::of(path)), |format| format.extensions == FORMAT.extensions)
}

/// The time of a file, reading no more of it than needed.
///
/// # Errors
/// If the file cannot be read, is none of this format, or the time is not finite.
pub(super) fn time_of(path: &Path) -> FileResult<Option<f64>> {
    at_start(path, |bytes| match parse(path, &bytes, Extent::Time) {
        Ok(header) => {
            let time = header.time.map(|array| {
                let values = decode(path, &bytes, header.is_binary, &array)?;
                let first = values.values(&bytes).to_f64().first().copied();
                first.map(|time| finite(path, &array.name, time)).transpose()
            });
            (time.unwrap_or(Ok(None)), bytes)
        }
        Err(error) => (Err(error), bytes),
    })
}

/// A file in memory.
pub(super) struct LegacyFile {
    path: PathBuf,
    bytes: Vec<u8>,
    header: Header,
    geometry: Geometry,
}

impl LegacyFile {
    /// Reads a file and finds its arrays.
    ///
    /// # Errors
    /// If it cannot be read, is no legacy file or one of another kind of mesh, or contradicts itself.
    pub(super) fn open(path: &Path) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let mut header = parse(path, &bytes, Extent::Whole)?;
        let geometry = Geometry::of(path, &mut header, bytes.len())?;
        let (points, cells) = geometry.counts();
        for (section, claimed, there) in
            [("POINT_DATA", header.values[0], points), ("CELL_DATA", header.values[1], cells)]
        {
            if let Some(claimed) = claimed.filter(|&claimed| claimed != there) {
                let problem = format!("claims {claimed} values, but the mesh has {there}");
                return Err(FileError::invalid(path, section, problem).remedy("write the file again"));
            }
        }
        Ok(Self { path: path.to_owned(), bytes, header, geometry })
    }

    /// Bytes of the file.
    pub(super) fn size(&self) -> usize {
        self.bytes.len()
    }

    /// Reads the numbers of an array.
    fn read(&self, array: &Array) -> FileResult<ArrayBytes> {
        decode(&self.path, &self.bytes, self.header.is_binary, array)
    }

    /// All numbers of an array.
    fn floats(&self, array: &Array) -> FileResult<Vec<f64>> {
        Ok(self.read(array)?.values(&self.bytes).to_f64())
    }

    /// All numbers of an array, which count or number something.
    fn indices(&self, array: &Array) -> FileResult<Vec<u64>> {
        let bytes = self.read(array)?;
        let values = bytes.values(&self.bytes).to_indices();
        values.map_err(|i| self.invalid(array, format!("number {i} is negative or no integer")))
    }

    /// The bytes in the file that an array is stored in.
    fn stored(&self, array: &Array) -> &[u8] {
        &self.bytes[array.place.clone()]
    }

    /// An array and its place in the file, for messages.
    fn place(&self, array: &Array) -> String {
        place_of(&self.bytes, self.header.is_binary, array)
    }

    fn invalid(&self, array: &Array, problem: String) -> FileError {
        FileError::invalid(&self.path, self.place(array), problem).remedy(AGAIN)
    }
}

fn place_of(bytes: &[u8], is_binary: bool, array: &Array) -> String {
    format!("array '{}' (numbers from {})", array.name, place(bytes, is_binary, array.place.start))
}

/// Reads the numbers of an array of the file at `path`, or of its start.
///
/// # Errors
/// If a word is no number of the array's type.
fn decode(path: &Path, bytes: &[u8], is_binary: bool, array: &Array) -> FileResult<ArrayBytes> {
    let invalid = |problem: String| FileError::invalid(path, place_of(bytes, is_binary, array), problem).remedy(AGAIN);
    let stored = &bytes[array.place.clone()];
    let (number, data) = match array.kind {
        Kind::Numbers(number) if is_binary => (number, Decoded::InPlace(array.place.clone())),
        Kind::Numbers(number) => (number, Decoded::Own(parse_ascii(number, stored).map_err(invalid)?)),
        Kind::Bits => (Number::UInt8, Decoded::Own(unpacked(stored, array.count))),
        Kind::Long(_) | Kind::Texts | Kind::Variants => return Err(invalid("holds no numbers".to_owned())),
    };
    // What is parsed has the lowest byte first.
    Ok(ArrayBytes { number, big_endian: is_binary, data })
}

/// Bits, the first in the highest of each byte, as numbers.
fn unpacked(bytes: &[u8], count: usize) -> Vec<u8> {
    bytes.iter().flat_map(|byte| (0..8).map(move |bit| byte >> (7 - bit) & 1)).take(count).collect()
}
