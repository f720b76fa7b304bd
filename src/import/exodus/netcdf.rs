//! Variables of netCDF files: classic, with 64-bit offsets or data, and netCDF-4. A read touches only the numbers that are asked for.

use super::super::hdf::{decoded_max, innermost};
use crate::error::{FileError, FileResult};
use crate::files;
use hdf5_reader::storage::DynStorage;
use hdf5_reader::{FileStorage, Hdf5File, Storage, StorageBuffer};
use netcdf_reader::{Error, NcFile, NcFormat, NcOpenOptions, NcSliceInfo, NcSliceInfoElem, NcType, NcVariable, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longest name of a dimension, as libnetcdf has it.
const NAME_MAX: u64 = 256;
/// Most dimensions, far beyond what files have: two for each element block, one for each set.
const DIMENSIONS_MAX: u64 = 1 << 20;
/// Most files that are kept open at a time: systems allow 256 to 1024.
const OPEN_MAX: usize = 128;
/// The tag before the list of dimensions in classic files.
const DIMENSIONS_TAG: u64 = 0xA;

/// An open file.
pub(super) struct NetCdf {
    path: PathBuf,
    file: NcFile,
    dimensions: HashMap<String, u64>,
    /// Position of each variable in the file's list.
    variables: HashMap<String, usize>,
    file_bytes: u64,
    /// Most bytes that the numbers of a variable may take in memory.
    bytes_max: u64,
}

impl NetCdf {
    /// Opens a file, one of `files` that are open at a time, and reads its list of variables.
    ///
    /// # Errors
    /// If it is no netCDF file, is damaged, or has groups.
    pub(super) fn open(path: &Path, files: usize) -> FileResult<Self> {
        files::check_kind(path)?;
        let failed = |error: Error| failure(path, "", &error);
        let storage = FileStorage::open(path).map_err(|e| failed(e.into()))?;
        let storage: DynStorage = match files {
            0..=OPEN_MAX => Arc::new(storage),
            _ => Arc::new(Reopened { path: path.to_owned(), bytes: storage.len() }),
        };
        let file_bytes = storage.len();
        check_dimensions(&storage).map_err(failed)?.map_or(Ok(()), |problem| {
            Err(FileError::invalid(path, "header", problem).remedy("write the file again"))
        })?;
        let hdf5_max = decoded_max(file_bytes);
        let mut options =
            NcOpenOptions { max_read_bytes: usize::try_from(hdf5_max).unwrap_or(usize::MAX), ..Default::default() };
        options.chunk_cache_bytes /= files.max(1);
        let file = NcFile::from_storage_with_options(storage.clone(), options).map_err(failed)?;
        let is_hdf5 = matches!(file.format(), NcFormat::Nc4 | NcFormat::Nc4Classic);
        if is_hdf5 {
            // The reader of groups would follow circles of them for ever.
            let root = Hdf5File::from_storage(storage).and_then(|file| file.root_group()?.members());
            if !root.map_err(|e| failed(e.into()))?.0.is_empty() {
                return Err(FileError::unsupported(path, "", "has groups of variables, which are not read")
                    .remedy("write one mesh to a file"));
            }
        }
        let dimensions = file.dimensions().map_err(failed)?;
        let dimensions = dimensions.iter().map(|dimension| (dimension.name.clone(), dimension.size)).collect();
        let names = file.variables().map_err(failed)?.iter().enumerate();
        let variables = names.map(|(i, variable)| (variable.name.clone(), i)).collect();
        // Numbers of a byte become eight.
        let bytes_max = if is_hdf5 { hdf5_max } else { file_bytes.saturating_mul(8) };
        Ok(Self { path: path.to_owned(), file, dimensions, variables, file_bytes, bytes_max })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Size of a dimension.
    pub(super) fn dimension(&self, name: &str) -> Option<u64> {
        self.dimensions.get(name).copied()
    }

    /// A dimension as a number of things that each take a byte of the file at least; 0 if it is missing.
    ///
    /// # Errors
    /// If there cannot be that many.
    pub(super) fn count(&self, name: &str) -> FileResult<usize> {
        let size = self.dimension(name).unwrap_or(0);
        let count = usize::try_from(size).ok().filter(|_| size <= self.bytes_max);
        count.ok_or_else(|| {
            let problem = format!("claims {size} in a file of {} bytes", self.file_bytes);
            FileError::invalid(&self.path, format!("dimension '{name}'"), problem).remedy("write the file again")
        })
    }

    /// Names of all variables, in no order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.variables.keys().map(String::as_str)
    }

    fn variable(&self, name: &str) -> Option<&NcVariable> {
        self.file.variables().ok()?.get(*self.variables.get(name)?)
    }

    /// Lengths of the axes of a variable.
    pub(super) fn shape(&self, name: &str) -> Option<Vec<u64>> {
        self.variable(name).map(NcVariable::shape)
    }

    /// Whether the numbers of a variable are f32.
    pub(super) fn is_f32(&self, name: &str) -> bool {
        self.variable(name).is_some_and(|variable| variable.dtype == NcType::Float)
    }

    /// An attribute that is text.
    pub(super) fn text(&self, name: &str, attribute: &str) -> Option<String> {
        let attributes = &self.variable(name)?.attributes;
        let value = &attributes.iter().find(|found| found.name == attribute)?.value;
        value.as_string().map(|text| plain(&text))
    }

    /// An error about a variable.
    pub(super) fn invalid(&self, name: &str, problem: impl Into<String>) -> FileError {
        FileError::invalid(&self.path, place(name), problem)
            .remedy("write the file again, or copy it again if it was cut")
    }

    /// The rows of a table of letters; none if there is no such variable.
    ///
    /// # Errors
    /// If it holds no letters, or is damaged.
    pub(super) fn strings(&self, name: &str) -> FileResult<Vec<String>> {
        let Some(variable) = self.variable(name) else { return Ok(Vec::new()) };
        let shape = variable.shape();
        if variable.dtype != NcType::Char || shape.len() != 2 {
            return Err(self.invalid(name, format!("is no table of letters (shape {shape:?})")));
        }
        if shape[0] > self.file_bytes || product(&shape).is_none_or(|letters| letters > self.bytes_max) {
            return Err(self.too_large(name, &shape));
        }
        let strings = self.file.read_variable_as_strings(name).map_err(|e| failure(&self.path, &place(name), &e))?;
        Ok(strings.iter().map(|text| plain(text)).collect())
    }

    /// Checks that a variable has that shape behind its first `skipped` axes, and that the file can hold it. Returns the number of its
    /// values there.
    ///
    /// # Errors
    /// If it is missing or has another shape.
    pub(super) fn check_shape(&self, name: &str, skipped: usize, wanted: &[u64]) -> FileResult<u64> {
        let missing = || FileError::invalid(&self.path, place(name), "is missing").remedy("write the file again");
        let shape = self.shape(name).ok_or_else(missing)?;
        if shape.len() != skipped + wanted.len() || shape[skipped..] != *wanted {
            return Err(self.invalid(name, format!("has the shape {shape:?}, not {wanted:?} for each step")));
        }
        product(wanted).filter(|&values| self.can_hold(values)).ok_or_else(|| self.too_large(name, &shape))
    }

    /// Whether the file is large enough for so many numbers.
    pub(super) fn can_hold(&self, numbers: u64) -> bool {
        numbers.checked_mul(8).is_some_and(|bytes| bytes <= self.bytes_max)
    }

    fn too_large(&self, name: &str, shape: &[u64]) -> FileError {
        let problem = format!("claims the shape {shape:?} in a file of {} bytes", self.file_bytes);
        FileError::invalid(&self.path, place(name), problem).remedy("write the file again with all its values")
    }

    /// The numbers of a variable at these indices of its first axes, which has the shape `wanted` behind them.
    ///
    /// # Errors
    /// If it is missing or damaged, has another shape, or holds no numbers.
    pub(super) fn read(&self, name: &str, at: &[u64], wanted: &[u64]) -> FileResult<Vec<f64>> {
        self.check_shape(name, at.len(), wanted)?;
        let indices = at.iter().map(|&index| NcSliceInfoElem::Index(index));
        let whole = wanted.iter().map(|&end| NcSliceInfoElem::Slice { start: 0, end, step: 1 });
        let selection = NcSliceInfo { selections: indices.chain(whole).collect() };
        let read = self.file.read_variable_slice_as_f64(name, &selection);
        let array = read.map_err(|e| failure(&self.path, &place(name), &e))?;
        let (numbers, _) = array.into_raw_vec_and_offset();
        if product(wanted) != Some(numbers.len() as u64) {
            return Err(self.invalid(name, format!("holds {} numbers, not {wanted:?}", numbers.len())));
        }
        Ok(numbers)
    }
}

/// A file that is opened for each read.
struct Reopened {
    path: PathBuf,
    /// Its size.
    bytes: u64,
}

impl Storage for Reopened {
    fn len(&self) -> u64 {
        self.bytes
    }

    fn read_range(&self, offset: u64, len: usize) -> hdf5_reader::error::Result<StorageBuffer> {
        FileStorage::open(&self.path)?.read_range(offset, len)
    }
}

fn place(name: &str) -> String {
    format!("variable '{name}'")
}

/// The number of values of a shape; `None` if it is out of range, which a length of 0 does not hide.
fn product(shape: &[u64]) -> Option<u64> {
    let all = shape.iter().try_fold(1_u64, |n, &length| n.checked_mul(length.max(1)))?;
    Some(if shape.contains(&0) { 0 } else { all })
}

/// A text without what fills it up.
fn plain(text: &str) -> String {
    text.split('\0').next().unwrap_or("").trim().to_owned()
}

/// Checks the list of dimensions of a classic file: the reader copies their names for each variable. Returns what is wrong.
fn check_dimensions(storage: &DynStorage) -> Result<Option<String>> {
    let magic = storage.read_range(0, storage.len().min(4) as usize)?;
    let width = match magic.as_ref() {
        b"CDF\x01" | b"CDF\x02" => 4,
        b"CDF\x05" => 8,
        _ => return Ok(None),
    };
    let number = |at: u64, width: usize| -> Result<u64> {
        let bytes = storage.read_range(at, width)?;
        Ok(bytes.as_ref().iter().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    };
    let mut at = 4 + width as u64;
    if number(at, 4)? != DIMENSIONS_TAG {
        return Ok(None);
    }
    at += 4;
    let count = number(at, width)?;
    at += width as u64;
    if count > DIMENSIONS_MAX {
        return Ok(Some(format!("claims {count} dimensions")));
    }
    for index in 0..count {
        let length = number(at, width)?;
        if length > NAME_MAX {
            return Ok(Some(format!("claims {length} letters for the name of dimension {index}")));
        }
        at += 2 * width as u64 + length.next_multiple_of(4);
    }
    Ok(None)
}

/// The reader's error as a [`FileError`], by kind.
fn failure(path: &Path, place: &str, error: &Error) -> FileError {
    use hdf5_reader::error::Error as Hdf5;
    let not_read = |what: &str| {
        FileError::unsupported(path, place, format!("is stored in a way that is not read ({what})"))
            .remedy("write it without compression or with gzip, with nccopy for example")
    };
    let no_file = || FileError::invalid(path, "", "is no netCDF file, as Exodus files are").remedy("copy it again");
    match error {
        Error::Io(e) => FileError::io(path, "read", e),
        Error::InvalidMagic => no_file(),
        Error::UnsupportedVersion(version) => not_read(&format!("version {version} of netCDF")),
        Error::UnsupportedFeature(what) => not_read(what),
        Error::Hdf5(e) => match innermost(e) {
            Hdf5::Io(e) => FileError::io(path, "read", e),
            Hdf5::InvalidMagic => no_file(),
            Hdf5::UnsupportedEncoding(what) | Hdf5::UnsupportedFilter(what) | Hdf5::ResourceLimit(what) => {
                not_read(what)
            }
            inner => damaged(path, place, inner),
        },
        other => damaged(path, place, other),
    }
}

fn damaged(path: &Path, place: &str, why: &dyn std::fmt::Display) -> FileError {
    FileError::invalid(path, place, format!("is damaged: {why}"))
        .remedy("write the file again, or copy it again if it was cut")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_of_zero_hides_no_overflow() {
        assert_eq!(product(&[2, 3]), Some(6));
        assert_eq!(product(&[5, 0]), Some(0));
        assert_eq!(product(&[]), Some(1));
        assert_eq!(product(&[1 << 40, 0, 1 << 40]), None);
    }
}
