//! The arrays of a zip file, read row by row.
//!
//! Stored arrays are read in place. Deflated ones are decompressed from their beginning up to the rows, which are all that is kept.

use super::super::numbers::{Number, Numbers};
use super::npy::{Header, Unread};
use crate::error::{FileError, FileResult};
use crate::files;
use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, RECOMMENDED_BUFFER_SIZE, ZipArchive};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Most decoded bytes per byte of a deflated array.
const RATIO_MAX: u64 = 1032;

/// An array of plain numbers.
#[derive(Debug)]
pub(super) struct Array {
    path: PathBuf,
    /// Its name, without `.npy`.
    pub(super) name: String,
    number: Number,
    big_endian: bool,
    pub(super) shape: Vec<u64>,
    place: Member,
    /// Bytes before the numbers.
    header: u64,
}

/// Where an array is in the file.
#[derive(Clone, Copy, Debug)]
struct Member {
    start: u64,
    compressed: u64,
    size: u64,
    is_deflated: bool,
}

/// The arrays of a file, and those that are left out with the reason.
pub(super) fn arrays(path: &Path) -> FileResult<(Vec<Array>, Vec<String>)> {
    let file = files::open(path)?;
    let invalid = |place: String, problem: String| {
        FileError::invalid(path, place, problem).remedy("write it with numpy.savez, or copy it again if it was cut")
    };
    let damaged = |e: rawzip::Error| invalid(String::new(), format!("is no zip file, or a damaged one: {e}"));
    let (mut buffer, mut of_entries) = (vec![0; RECOMMENDED_BUFFER_SIZE], vec![0; RECOMMENDED_BUFFER_SIZE]);
    let archive = ZipArchive::from_file(file, &mut buffer).map_err(damaged)?;
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    let mut entries = archive.entries(&mut of_entries);
    while let Some(entry) = entries.next_entry().map_err(damaged)? {
        let name = String::from_utf8_lossy(entry.file_path().as_bytes()).into_owned();
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
            left_out.push(format!("'{name}' (is no array)"));
            continue;
        };
        let place = format!("array '{name}'");
        let is_deflated = entry.compression_method() == CompressionMethod::DEFLATE;
        let is_read = is_deflated || entry.compression_method() == CompressionMethod::STORE;
        if entry.flags().is_encrypted() || !is_read {
            return Err(FileError::unsupported(path, place, "is encrypted, or compressed in a way that is not read")
                .remedy("write it with numpy.savez or numpy.savez_compressed"));
        }
        let size = entry.uncompressed_size_hint();
        let (start, end) = archive.get_entry(entry.wayfinder()).map_err(damaged)?.compressed_data_range();
        let compressed = end.saturating_sub(start);
        let member = Member { start, compressed, size, is_deflated };
        let header = Header::read(&mut member.open(path)?).map_err(|problem| invalid(place.clone(), problem))?;
        let number = match header.number {
            Ok(number) => number,
            Err(Unread::NoNumbers) => {
                left_out.push(format!("'{name}' (holds no plain numbers)"));
                continue;
            }
            Err(Unread::Width(kind)) => {
                return Err(FileError::unsupported(
                    path,
                    place,
                    format!("holds numbers of type {kind}, which are not read"),
                )
                .remedy("write it as array.astype('f4')"));
            }
        };
        if header.is_fortran && header.shape.iter().filter(|&&n| n != 1).count() > 1 {
            return Err(FileError::unsupported(path, place, "is in Fortran's order, which is not read")
                .remedy("write it as numpy.ascontiguousarray(array)"));
        }
        let bytes = header.shape.iter().try_fold(number.size() as u64, |n, &d| n.checked_mul(d));
        if bytes.and_then(|bytes| bytes.checked_add(header.bytes)).is_none_or(|end| end > member.size_max(path)) {
            let problem = format!("claims the shape {:?}, but has {} bytes", header.shape, member.size);
            return Err(invalid(place, problem));
        }
        let (path, big_endian, shape) = (path.to_owned(), header.big_endian, header.shape);
        found.push(Array { path, name, number, big_endian, shape, place: member, header: header.bytes });
    }
    Ok((found, left_out))
}

impl Member {
    /// Its bytes from the first on.
    fn open(self, path: &Path) -> FileResult<Box<dyn Read>> {
        let mut file = files::open(path)?;
        file.seek(SeekFrom::Start(self.start)).map_err(|e| FileError::io(path, "seek in", &e))?;
        let stored = file.take(self.compressed);
        Ok(if self.is_deflated { Box::new(DeflateDecoder::new(BufReader::new(stored))) } else { Box::new(stored) })
    }

    /// The most bytes that it can have, whatever the file says.
    fn size_max(self, path: &Path) -> u64 {
        let there = std::fs::metadata(path).map_or(0, |metadata| metadata.len()).saturating_sub(self.start);
        let stored = self.compressed.min(there);
        self.size.min(if self.is_deflated { stored.saturating_mul(RATIO_MAX) } else { stored })
    }
}

impl Array {
    /// Whether it is compressed.
    pub(super) fn is_compressed(&self) -> bool {
        self.place.is_deflated
    }

    /// An error about it.
    pub(super) fn invalid(&self, problem: impl Into<String>) -> FileError {
        FileError::invalid(&self.path, format!("array '{}'", self.name), problem)
    }

    /// Reads all numbers.
    ///
    /// # Errors
    /// If it is damaged.
    pub(super) fn read(&self) -> FileResult<Numbers> {
        match self.shape.split_first() {
            Some((&rows, _)) => self.read_rows(0, rows),
            None => self.read_bytes(0, self.number.size() as u64),
        }
    }

    /// Reads rows, which are along the first axis.
    ///
    /// # Errors
    /// If it has fewer rows, or is damaged.
    pub(super) fn read_rows(&self, first: u64, count: u64) -> FileResult<Numbers> {
        let (&rows, row) = self.shape.split_first().ok_or_else(|| self.invalid("is one number"))?;
        if first.checked_add(count).is_none_or(|end| end > rows) {
            return Err(self.invalid(format!("has {rows} rows where {count} from row {first} on are needed")));
        }
        // In range: the whole array is, unless it has no rows.
        let row_bytes = row.iter().fold(self.number.size() as u64, |n, &d| n.saturating_mul(d));
        self.read_bytes(first * row_bytes, count * row_bytes)
    }

    fn read_bytes(&self, first: u64, count: u64) -> FileResult<Numbers> {
        let damaged = |e: io::Error| {
            self.invalid(format!("is cut or damaged: {e}")).remedy("write it again, or copy it again if it was cut")
        };
        let before = self.header + first;
        let mut from: Box<dyn Read> = if self.place.is_deflated {
            let mut from = self.place.open(&self.path)?;
            let skipped = io::copy(&mut (&mut from).take(before), &mut io::sink()).map_err(damaged)?;
            if skipped < before {
                return Err(self.invalid("is cut").remedy("write it again, or copy it again"));
            }
            from
        } else {
            let mut file: File = files::open(&self.path)?;
            file.seek(SeekFrom::Start(self.place.start + before))
                .map_err(|e| FileError::io(&self.path, "seek in", &e))?;
            Box::new(file)
        };
        let mut bytes = vec![0; usize::try_from(count).unwrap_or(usize::MAX)];
        from.read_exact(&mut bytes).map_err(damaged)?;
        Ok(Numbers { number: self.number, big_endian: self.big_endian, bytes })
    }
}
