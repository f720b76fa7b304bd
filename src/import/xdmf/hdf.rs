//! Data sets of HDF5 files. A read touches only the file's metadata on the way to the data set, and its chunks.
//!
//! The file is reopened for each data set: the reader caches decoded data sets while it is open, so a series would accumulate in memory.

use super::super::numbers::{Number, Numbers, with_type};
use super::items::{SlabAxis, product};
use crate::error::{FileError, FileResult};
use crate::files;
use hdf5_reader::error::ByteOrder;
use hdf5_reader::{Dataset, Datatype, Hdf5File, SliceInfo, SliceInfoElem};
use std::path::Path;

/// Most decoded bytes per byte of the file: deflate's limit.
const RATIO_MAX: u64 = 1032;
/// Bytes of a data set allowed whatever the size of the file: unwritten ones have their fill value.
const UNWRITTEN_MAX: u64 = 64 << 20;

/// Reads the data set `name`, which must have the shape `dims` (axes of length 1 do not count; a flat list has any
/// shape), or the part of it that `slab` selects.
///
/// # Errors
/// If there is no such file or data set, it is damaged, has another shape, is not numeric, or has an unsupported encoding.
pub(super) fn read(path: &Path, name: &str, dims: &[u64], slab: Option<&[SlabAxis]>) -> FileResult<Numbers> {
    let place = || format!("data set '{name}'");
    let damaged = |e: hdf5_reader::error::Error| failure(path, place(), &e);
    files::check_kind(path)?;
    let file_bytes = std::fs::metadata(path).map_err(|e| FileError::io(path, "open", &e))?.len();
    let file = Hdf5File::open(path).map_err(damaged)?;
    let dataset = file.dataset(name).map_err(damaged)?;
    let (number, big_endian) = number_of(dataset.dtype())
        .map_err(|problem| FileError::unsupported(path, place(), problem).remedy("write it as integers or floats"))?;
    let invalid = |problem: String| FileError::invalid(path, place(), problem);
    if slab.is_none() && !is_same_shape(dataset.shape(), dims) {
        let problem = format!("has the shape {:?}, but the XDMF file says {dims:?}", dataset.shape());
        return Err(invalid(problem).remedy("correct the Dimensions of its DataItem"));
    }
    let all = dataset.shape().iter().try_fold(number.size() as u64, |n, &d| n.checked_mul(d));
    if all.is_none_or(|bytes| bytes > decoded_max(file_bytes)) {
        let problem = format!("claims the shape {:?} in a file of {file_bytes} bytes", dataset.shape());
        return Err(invalid(problem).remedy("write the file again with all its values"));
    }
    let Some(slab) = slab else {
        let bytes = dataset.read_raw_bytes().map_err(damaged)?;
        return Ok(Numbers { number, big_endian, bytes });
    };
    let selection = selection(slab, dataset.shape()).map_err(invalid)?;
    let bytes = read_slab(&dataset, number, &selection).map_err(damaged)?;
    Ok(Numbers { number, big_endian: false, bytes })
}

/// Most bytes that a data set of a file of this size may claim.
pub(in crate::import) fn decoded_max(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(RATIO_MAX).saturating_add(UNWRITTEN_MAX)
}

/// The reader's error as a [`FileError`], by kind.
fn failure(path: &Path, place: String, error: &hdf5_reader::error::Error) -> FileError {
    use hdf5_reader::error::Error as E;
    match innermost(error) {
        E::Io(e) => FileError::io(path, "read", e),
        E::GroupNotFound(_) | E::DatasetNotFound(_) => FileError::invalid(path, place, "does not exist")
            .remedy("correct the name behind the colon in the XDMF file; h5ls -r lists those there are"),
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
pub(in crate::import) fn innermost(error: &hdf5_reader::error::Error) -> &hdf5_reader::error::Error {
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

/// Whether two shapes hold the same numbers in the same order.
fn is_same_shape(a: &[u64], b: &[u64]) -> bool {
    let real = |shape: &[u64]| shape.iter().copied().filter(|&d| d != 1).collect::<Vec<_>>();
    let (a, b) = (real(a), real(b));
    a == b || ((a.len() <= 1 || b.len() <= 1) && product(&a) == product(&b))
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
fn read_slab(dataset: &Dataset, number: Number, selection: &SliceInfo) -> hdf5_reader::error::Result<Vec<u8>> {
    with_type!(number, T => {
        let selected = dataset.read_slice::<T>(selection)?;
        Ok(selected.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_the_same_if_they_differ_in_axes_of_one_or_are_flat() {
        assert!(is_same_shape(&[8, 1], &[8]) && is_same_shape(&[1, 8, 3], &[8, 3]) && is_same_shape(&[24], &[8, 3]));
        assert!(is_same_shape(&[1], &[]) && is_same_shape(&[0], &[0, 3]));
        assert!(!is_same_shape(&[3, 8], &[8, 3]) && !is_same_shape(&[24], &[8, 4]) && !is_same_shape(&[7], &[8]));
        assert!(!is_same_shape(&[u64::MAX, 2], &[8]));
    }
}
