//! Data sets of HDF5 files. A read touches only the file's metadata on the way to the data set, and its chunks.
//!
//! The file is reopened for each data set: the reader caches decoded data sets while it is open, so a series would accumulate in memory.

use super::numbers::{Number, Numbers, with_type};
use crate::error::{FileError, FileResult};
use crate::files;
use hdf5_reader::error::ByteOrder;
use hdf5_reader::{Dataset, Datatype, Hdf5File, SliceInfo, SliceInfoElem};
use std::path::Path;

/// Most decoded bytes per byte of the file: deflate's limit.
const RATIO_MAX: u64 = 1032;
/// Bytes of a data set allowed whatever the size of the file: unwritten ones have their fill value.
const UNWRITTEN_MAX: u64 = 64 << 20;

/// An open file.
pub(super) struct Hdf<'a> {
    path: &'a Path,
    file: Hdf5File,
    /// Its size.
    bytes: u64,
    /// What to do about a data set that is missing.
    remedy: &'static str,
}

/// A data set of numbers.
pub(super) struct Array<'a> {
    file: &'a Hdf<'a>,
    name: &'a str,
    dataset: Dataset,
    number: Number,
    big_endian: bool,
}

/// Indices `start`, `start + stride`, ... of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SlabAxis {
    pub(super) start: u64,
    /// At least 1.
    pub(super) stride: u64,
    pub(super) count: u64,
}

impl SlabAxis {
    /// Index behind the last one; `None` if it is beyond u64.
    pub(super) fn end(&self) -> Option<u64> {
        match self.count.checked_sub(1) {
            None => Some(self.start),
            Some(steps) => steps.checked_mul(self.stride)?.checked_add(self.start)?.checked_add(1),
        }
    }
}

impl<'a> Hdf<'a> {
    /// Opens a file; `remedy` is for errors about a data set that is missing.
    ///
    /// # Errors
    /// If there is no such file, or it is no HDF5 file.
    pub(super) fn open(path: &'a Path, place: impl Fn() -> String, remedy: &'static str) -> FileResult<Self> {
        files::check_kind(path)?;
        let bytes = std::fs::metadata(path).map_err(|e| FileError::io(path, "open", &e))?.len();
        let file = Hdf5File::open(path).map_err(|e| failure(path, place(), &e, remedy))?;
        Ok(Self { path, file, bytes, remedy })
    }

    /// The data set of that name.
    ///
    /// # Errors
    /// If there is none, or it is not numeric.
    pub(super) fn array(&'a self, name: &'a str) -> FileResult<Array<'a>> {
        let place = || format!("data set '{name}'");
        let dataset = self.file.dataset(name).map_err(|e| failure(self.path, place(), &e, self.remedy))?;
        let (number, big_endian) = number_of(dataset.dtype()).map_err(|problem| {
            FileError::unsupported(self.path, place(), problem).remedy("write it as integers or floats")
        })?;
        Ok(Array { file: self, name, dataset, number, big_endian })
    }
}

impl Array<'_> {
    /// The length of each axis, the slowest first.
    pub(super) fn shape(&self) -> &[u64] {
        self.dataset.shape()
    }

    /// An error about the data set.
    pub(super) fn invalid(&self, problem: String) -> FileError {
        FileError::invalid(self.file.path, format!("data set '{}'", self.name), problem)
    }

    /// Reads all numbers.
    ///
    /// # Errors
    /// If it is damaged, or has an unsupported encoding.
    pub(super) fn read(&self) -> FileResult<Numbers> {
        self.check_size()?;
        let bytes = self.dataset.read_raw_bytes().map_err(|e| self.failure(&e))?;
        Ok(Numbers { number: self.number, big_endian: self.big_endian, bytes })
    }

    /// Reads the part that `slab` selects, axis by axis.
    ///
    /// # Errors
    /// As for [`Self::read`], and if the slab reaches beyond the data set.
    pub(super) fn read_slab(&self, slab: &[SlabAxis]) -> FileResult<Numbers> {
        self.check_size()?;
        let selection = selection(slab, self.shape()).map_err(|problem| self.invalid(problem))?;
        let bytes = read_selection(&self.dataset, self.number, &selection).map_err(|e| self.failure(&e))?;
        Ok(Numbers { number: self.number, big_endian: false, bytes })
    }

    fn check_size(&self) -> FileResult<()> {
        let (shape, file_bytes) = (self.shape(), self.file.bytes);
        let all = shape.iter().try_fold(self.number.size() as u64, |n, &d| n.checked_mul(d));
        if all.is_none_or(|bytes| bytes > decoded_max(file_bytes)) {
            let problem = format!("claims the shape {shape:?} in a file of {file_bytes} bytes");
            return Err(self.invalid(problem).remedy("write the file again with all its values"));
        }
        Ok(())
    }

    fn failure(&self, error: &hdf5_reader::error::Error) -> FileError {
        failure(self.file.path, format!("data set '{}'", self.name), error, self.file.remedy)
    }
}

/// Most bytes that a data set of a file of this size may claim.
pub(super) fn decoded_max(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(RATIO_MAX).saturating_add(UNWRITTEN_MAX)
}

/// The reader's error as a [`FileError`], by kind; `missing` is the remedy where something is missing.
fn failure(path: &Path, place: String, error: &hdf5_reader::error::Error, missing: &str) -> FileError {
    use hdf5_reader::error::Error as E;
    match innermost(error) {
        E::Io(e) => FileError::io(path, "read", e),
        E::GroupNotFound(_) | E::DatasetNotFound(_) => {
            FileError::invalid(path, place, "does not exist").remedy(missing)
        }
        E::InvalidMagic => FileError::invalid(path, "", "is no HDF5 file").remedy("write or copy it again"),
        E::UnsupportedEncoding(what) | E::UnsupportedFilter(what) | E::ResourceLimit(what) => {
            FileError::unsupported(path, place, format!("is stored in a way that is not read ({what})"))
                .remedy("write it without compression or with gzip, with h5repack for example")
        }
        inner => FileError::invalid(path, place, format!("is damaged: {inner}"))
            .remedy("write the file again, or copy it again if it was cut"),
    }
}

/// An error without the contexts around it.
pub(super) fn innermost(error: &hdf5_reader::error::Error) -> &hdf5_reader::error::Error {
    match error {
        hdf5_reader::error::Error::Context { source, .. } => innermost(source),
        other => other,
    }
}

/// Number type and byte order of a data set.
fn number_of(dtype: &Datatype) -> Result<(Number, bool), String> {
    let (number, order) = match dtype {
        Datatype::FixedPoint { size, signed, byte_order } => (Number::integer(*size, *signed), *byte_order),
        Datatype::FloatingPoint { size, byte_order } => (Number::float(*size), *byte_order),
        // h5py stores booleans as an enumeration.
        Datatype::Enum { base, .. } => return number_of(base),
        _ => return Err("holds no numbers".to_owned()),
    };
    let number = number.ok_or_else(|| format!("holds numbers of a width that is not read ({dtype:?})"))?;
    Ok((number, order == ByteOrder::BigEndian))
}

/// Number of elements of an array of this shape; `None` if it overflows.
pub(super) fn product(dims: &[u64]) -> Option<u64> {
    dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(d))
}

fn selection(slab: &[SlabAxis], shape: &[u64]) -> Result<SliceInfo, String> {
    if slab.len() != shape.len() {
        return Err(format!("has {} axes, and the HyperSlab {}", shape.len(), slab.len()));
    }
    let mut selections = Vec::new();
    for (axis, &length) in slab.iter().zip(shape) {
        let end = axis.end().filter(|&end| end <= length);
        let end = end.ok_or_else(|| format!("has the shape {shape:?}, and the HyperSlab reaches beyond it"))?;
        selections.push(SliceInfoElem::Slice { start: axis.start, end, step: axis.stride });
    }
    Ok(SliceInfo { selections })
}

/// The selected numbers as little-endian bytes.
fn read_selection(dataset: &Dataset, number: Number, selection: &SliceInfo) -> hdf5_reader::error::Result<Vec<u8>> {
    with_type!(number, T => {
        let selected = dataset.read_slice::<T>(selection)?;
        Ok(selected.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}
