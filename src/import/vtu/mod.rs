//! Reader of VTK's XML format for grids, in every encoding that VTK writes: unstructured (`.vtu`) and structured ones.

mod cells;
mod compression;
mod encoded;
mod faces;
mod header;
mod open;
mod open_array;
mod piece;
mod structured;

pub(super) use open::{CURVILINEAR, FORMAT, IMAGE, RECTILINEAR, TIME, time_of};
pub(super) use piece::VtuPiece;

use super::numbers::{self, ArrayBytes, Decoded, Values};
use super::timed::at_start;
use cells::ghost_flags;
use header::{ArrayInfo, Piece};

use crate::error::{FileError, FileResult};
use crate::files;
use crate::slowdown::{Slow, waste};
use encoded::{Layout, Stored};
use header::{DataPlace, Extent, Header};
use std::borrow::Cow;
use std::hash::{Hash, Hasher};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A `.vtu` file in memory: its bytes and its parsed header.
pub(super) struct VtuFile {
    path: PathBuf,
    bytes: Vec<u8>,
    header: Header,
}

impl VtuFile {
    /// Reads the file and parses its header.
    ///
    /// # Errors
    /// If the file cannot be read, or is not an unstructured grid.
    pub(super) fn open(path: &Path) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let header = header::parse(path, &bytes, Extent::Whole)?;
        Ok(Self { path: path.to_owned(), bytes, header })
    }

    /// Piece `index`, which must be one of the header's.
    fn piece(&self, index: usize) -> &Piece {
        &self.header.pieces[index]
    }

    /// The number `TimeValue` of the field data, if there is one.
    fn time_value(&self) -> FileResult<Option<f64>> {
        let Some((array, tuples)) = &self.header.time_value else { return Ok(None) };
        let bytes = self.decode(array, *tuples)?;
        Ok(self.values(&bytes).to_f64().first().copied())
    }

    /// Decodes `array`, which must hold `tuples` tuples.
    ///
    /// # Errors
    /// If its data are damaged or of another size.
    pub(super) fn decode(&self, array: &ArrayInfo, tuples: usize) -> FileResult<ArrayBytes> {
        let numbers = tuples.checked_mul(array.components);
        let expected = numbers
            .and_then(|n| n.checked_mul(array.number.size()))
            .ok_or_else(|| self.invalid(array, array.byte, format!("{tuples} tuples are more than there can be")))?;
        waste(Slow::ReadVtu, expected);
        if expected == 0 {
            // Writers differ in how they write an empty array.
            return Ok(ArrayBytes { number: array.number, big_endian: false, data: Decoded::Own(Vec::new()) });
        }
        if let DataPlace::Ascii(ranges) = &array.data {
            let bytes = numbers::parse_ascii(array.number, &self.joined(ranges));
            let bytes = bytes.map_err(|problem| self.invalid(array, data_byte(ranges, array), problem))?;
            if bytes.len() != expected {
                let (got, wanted) = (bytes.len() / array.number.size(), expected / array.number.size());
                let problem = format!("has {got} numbers, but {wanted} are needed");
                return Err(self.invalid(array, data_byte(ranges, array), problem));
            }
            return Ok(ArrayBytes { number: array.number, big_endian: false, data: Decoded::Own(bytes) });
        }
        let (stored, start) = self.stored(array)?;
        let data = Layout::read(&stored, self.header.words, self.header.compressor)
            .and_then(|layout| encoded::decode(&stored, &layout, self.header.compressor, expected))
            .map_err(|problem| self.invalid(array, start, problem))?;
        let data = match data {
            Decoded::InPlace(range) => Decoded::InPlace(start + range.start..start + range.end),
            own => own,
        };
        Ok(ArrayBytes { number: array.number, big_endian: self.header.words.big_endian, data })
    }

    /// The typed numbers of a decoded array.
    pub(super) fn values<'a>(&'a self, array: &'a ArrayBytes) -> Values<'a> {
        array.values(&self.bytes)
    }

    /// Hashes the mesh arrays of `piece` as stored, undecoded: equal bytes are equal meshes, other bytes may be.
    pub(super) fn hash_stored_mesh(&self, piece: &Piece, state: &mut impl Hasher) -> FileResult<()> {
        let points = piece.coordinates.iter().filter(|_| piece.points > 0);
        let ghosts = piece.cell_data.iter().filter(|array| array.name == super::cell_list::GHOST_ARRAY);
        let cells = [&piece.connectivity, &piece.offsets, &piece.types].into_iter().flatten().chain(ghosts);
        let cells = cells.chain(&piece.face_arrays).chain(&piece.axes);
        (self.header.structure, piece.lattice).hash(state);
        for array in points.chain(cells.filter(|_| piece.cells > 0)) {
            self.hash_stored(array, state)?;
        }
        Ok(())
    }

    fn hash_stored(&self, array: &ArrayInfo, state: &mut impl Hasher) -> FileResult<()> {
        (array.number, self.header.words, self.header.compressor, array.components).hash(state);
        if let DataPlace::Ascii(ranges) = &array.data {
            state.write(&self.joined(ranges));
            return Ok(());
        }
        let (stored, start) = self.stored(array)?;
        let layout = Layout::read(&stored, self.header.words, self.header.compressor)
            .map_err(|problem| self.invalid(array, start, problem))?;
        state.write(layout.extent(&stored));
        Ok(())
    }

    /// The stored data of a binary array, and their byte offset in the file.
    fn stored(&self, array: &ArrayInfo) -> FileResult<(Stored<'_>, usize)> {
        match &array.data {
            DataPlace::Ascii(ranges) | DataPlace::Base64(ranges) => {
                Ok((Stored::Base64(without_blanks(self.joined(ranges))), data_byte(ranges, array)))
            }
            DataPlace::Appended(offset) => {
                let appended = self.header.appended.ok_or_else(|| {
                    self.invalid(array, array.byte, "is appended, but the file has no appended data".to_owned())
                })?;
                let start = appended.start.saturating_add(*offset);
                let rest = self.bytes.get(start..).ok_or_else(|| {
                    self.invalid(
                        array,
                        start,
                        format!("begins behind the end of the file ({} bytes)", self.bytes.len()),
                    )
                })?;
                Ok((if appended.base64 { Stored::Base64(Cow::Borrowed(rest)) } else { Stored::Raw(rest) }, start))
            }
        }
    }

    fn joined(&self, ranges: &[Range<usize>]) -> Cow<'_, [u8]> {
        match ranges {
            [] => Cow::Borrowed(&[]),
            [range] => Cow::Borrowed(self.bytes[range.clone()].trim_ascii()),
            _ => Cow::Owned(ranges.iter().flat_map(|range| &self.bytes[range.clone()]).copied().collect()),
        }
    }

    /// An error that names this file, the array and the byte offset of its data.
    fn invalid(&self, array: &ArrayInfo, byte: usize, problem: String) -> FileError {
        FileError::invalid(&self.path, format!("array '{}' (data at byte {byte})", array.name), problem)
            .remedy("write the file again, or copy it again if it was cut")
    }
}

/// Byte offset of a `DataArray`'s inline data; of its tag if there are none.
fn data_byte(ranges: &[Range<usize>], array: &ArrayInfo) -> usize {
    ranges.first().map_or(array.byte, |range| range.start)
}

fn without_blanks(text: Cow<'_, [u8]>) -> Cow<'_, [u8]> {
    if text.iter().any(u8::is_ascii_whitespace) {
        return Cow::Owned(text.iter().copied().filter(|c| !c.is_ascii_whitespace()).collect());
    }
    text
}

/// The number `TimeValue` of a file, reading no more of it than needed.
///
/// # Errors
/// If the file cannot be read, or is not an unstructured grid.
fn time_value_of(path: &Path) -> FileResult<Option<f64>> {
    at_start(path, |bytes| match header::parse(path, &bytes, Extent::TimeValue) {
        Ok(header) => {
            let start = VtuFile { path: path.to_owned(), bytes, header };
            (start.time_value(), start.bytes)
        }
        Err(error) => (Err(error), bytes),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A file whose header has a comment of `blanks` bytes and a raw appended `TimeValue` of 2.5, `offset` bytes into the data, with `tail`
    /// more bytes.
    fn file_with_time(blanks: usize, offset: usize, tail: usize) -> Vec<u8> {
        let blank = " ".repeat(blanks);
        let head = format!(
            "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><!--{blank}--><FieldData><DataArray type=\"Float64\" \
             Name=\"TimeValue\" format=\"appended\" offset=\"{offset}\"/></FieldData></UnstructuredGrid>\
             <AppendedData encoding=\"raw\">_"
        );
        let data = [&vec![0; offset][..], &8_u32.to_le_bytes(), &2.5_f64.to_le_bytes(), &vec![b'<'; tail]].concat();
        [head.into_bytes(), data].concat()
    }

    #[test]
    fn the_time_is_found_however_far_back_it_is_and_its_lack_without_reading_on() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.vtu");
        let time_of = |bytes: &[u8]| {
            fs::write(&path, bytes).expect("a file");
            time_value_of(&path)
        };
        for (blanks, offset, tail) in
            [(0, 0, 0), (0, 0, 1 << 20), (200_000, 0, 9), (0, 200_000, 0), (70_000, 70_000, 5)]
        {
            assert_eq!(
                time_of(&file_with_time(blanks, offset, tail)).ok(),
                Some(Some(2.5)),
                "{blanks} {offset} {tail}"
            );
        }
        let mut cut = file_with_time(0, 70_000, 0);
        cut.pop();
        assert!(time_of(&cut).expect_err("cut").to_string().contains("ends after 7 of 8 bytes"));
        let none =
            "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"1\" NumberOfCells=\"0\">";
        assert_eq!(time_of(none.as_bytes()).ok(), Some(None), "what follows the first piece is not looked at");
    }
}
