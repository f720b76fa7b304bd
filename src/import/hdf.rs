//! Data sets of HDF5 files. A read touches only the file's metadata on the way to the data set, and its chunks.
//!
//! The reader caches decoded data sets while a file is open, so a series would accumulate in memory: a file is reopened for each data
//! set ([`Hdf::open`]), or read without that cache ([`Hdf::open_uncached`]).

use super::numbers::{Number, Numbers, with_type};
use super::units::{self, unit_of};
use crate::error::{FileError, FileResult};
use crate::files;
use hdf5_reader::error::ByteOrder;
use hdf5_reader::group::Group;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::LinkTarget;
use hdf5_reader::{Dataset, Datatype, H5Type, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};
use std::path::{Path, PathBuf};

/// The first bytes of a file.
pub(super) const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Most decoded bytes per byte of the file: deflate's limit.
const RATIO_MAX: u64 = 1032;
/// Bytes of a data set allowed whatever the size of the file: unwritten ones have their fill value.
const UNWRITTEN_MAX: u64 = 64 << 20;

/// An open file.
pub(super) struct Hdf {
    path: PathBuf,
    file: Hdf5File,
    /// Its size.
    bytes: u64,
    /// What to do about a data set that is missing.
    missing: &'static str,
}

/// A data set of numbers.
pub(super) struct Array<'a> {
    file: &'a Hdf,
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

/// What an attribute holds.
pub(super) enum Attribute {
    Text(String),
    Numbers(Numbers),
}

impl Hdf {
    /// Opens a file; `missing` is the remedy for errors about what is missing.
    ///
    /// # Errors
    /// If there is no such file, or it is no HDF5 file.
    pub(super) fn open(path: &Path, place: impl Fn() -> String, missing: &'static str) -> FileResult<Self> {
        Self::open_with(path, place, missing, OpenOptions::default())
    }

    /// Opens a file that stays open: decoded chunks are not cached.
    ///
    /// # Errors
    /// As for [`Self::open`].
    pub(super) fn open_uncached(path: &Path, missing: &'static str) -> FileResult<Self> {
        Self::open_with(path, String::new, missing, OpenOptions::default().with_chunk_cache_bytes(0))
    }

    fn open_with(
        path: &Path,
        place: impl Fn() -> String,
        missing: &'static str,
        options: OpenOptions,
    ) -> FileResult<Self> {
        files::check_kind(path)?;
        let bytes = std::fs::metadata(path).map_err(|e| FileError::io(path, "open", &e))?.len();
        let file = Hdf5File::open_with_options(path, options).map_err(|e| failure(path, place(), &e, missing))?;
        Ok(Self { path: path.to_owned(), file, bytes, missing })
    }

    /// The file's name.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Its size.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The data set of that name.
    ///
    /// # Errors
    /// If there is none, or it is not numeric.
    pub(super) fn array<'a>(&'a self, name: &'a str) -> FileResult<Array<'a>> {
        let place = || format!("data set '{name}'");
        let dataset = self.file.dataset(name).map_err(|e| failure(&self.path, place(), &e, self.missing))?;
        let (number, big_endian) = number_of(dataset.dtype()).map_err(|problem| {
            FileError::unsupported(&self.path, place(), problem).remedy("write it as integers or floats")
        })?;
        Ok(Array { file: self, name, dataset, number, big_endian })
    }

    /// Names of the groups and of the data sets in a group; none if there is no such group.
    ///
    /// # Errors
    /// If the file is damaged.
    pub(super) fn names(&self, group: &str) -> FileResult<(Vec<String>, Vec<String>)> {
        let Some(found) = self.group(group)? else { return Ok(Default::default()) };
        found.member_names().map_err(|e| self.failure(group, &e))
    }

    /// An attribute of a group; `None` if there is no such group, or it has no such attribute.
    ///
    /// # Errors
    /// If the file is damaged.
    pub(super) fn attribute(&self, group: &str, name: &str) -> FileResult<Option<Attribute>> {
        let Some(found) = self.group(group)? else { return Ok(None) };
        let attributes = found.attributes().map_err(|e| self.failure(group, &e))?;
        let Some(attribute) = attributes.into_iter().find(|attribute| attribute.name == name) else { return Ok(None) };
        if let Ok(text) = attribute.read_string() {
            return Ok(Some(Attribute::Text(text)));
        }
        let place = format!("attribute '{name}' of '{group}'");
        let (number, big_endian) =
            number_of(&attribute.datatype).map_err(|problem| FileError::unsupported(&self.path, place, problem))?;
        Ok(Some(Attribute::Numbers(Numbers { number, big_endian, bytes: attribute.raw_data })))
    }

    /// The unit of a data set, as an attribute of it says it.
    pub(super) fn unit(&self, name: &str) -> Option<String> {
        let dataset = self.file.dataset(name).ok()?;
        let text = |attribute: &str| dataset.attribute(attribute).ok()?.read_string().ok();
        units::ATTRIBUTES.into_iter().filter_map(text).find_map(|text| unit_of(&text))
    }

    /// Whether a group names what is in another file, as far as it lists its links itself.
    ///
    /// # Errors
    /// If the file is damaged.
    pub(super) fn has_links_elsewhere(&self, group: &str) -> FileResult<bool> {
        let Some(found) = self.group(group)? else { return Ok(false) };
        let header = self.file.get_or_parse_header(found.address()).map_err(|e| self.failure(group, &e))?;
        let is_elsewhere = |message: &HdfMessage| matches!(message, HdfMessage::Link(link) if matches!(link.target, LinkTarget::External { .. }));
        Ok(header.messages.iter().any(is_elsewhere))
    }

    fn group(&self, name: &str) -> FileResult<Option<Group>> {
        match self.file.group(name) {
            Ok(group) => Ok(Some(group)),
            Err(e) if matches!(innermost(&e), hdf5_reader::error::Error::GroupNotFound(_)) => Ok(None),
            Err(e) => Err(self.failure(name, &e)),
        }
    }

    fn failure(&self, group: &str, error: &hdf5_reader::error::Error) -> FileError {
        failure(&self.path, format!("group '{group}'"), error, self.missing)
    }
}

impl Array<'_> {
    /// The length of each axis, the slowest first.
    pub(super) fn shape(&self) -> &[u64] {
        self.dataset.shape()
    }

    /// An error about the data set.
    pub(super) fn invalid(&self, problem: String) -> FileError {
        FileError::invalid(&self.file.path, format!("data set '{}'", self.name), problem)
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
        let big_endian = self.big_endian && matches!(self.dataset.dtype(), Datatype::Enum { .. });
        Ok(Numbers { number: self.number, big_endian, bytes })
    }

    /// Reads rows, along the slowest axis.
    ///
    /// # Errors
    /// As for [`Self::read`], and if there are fewer rows.
    pub(super) fn read_rows(&self, first: u64, count: u64) -> FileResult<Numbers> {
        let Some((&rows, row)) = self.shape().split_first() else {
            return Err(self.invalid("is one number, not a list".to_owned()));
        };
        if first.checked_add(count).is_none_or(|end| end > rows) {
            let problem = format!("has {rows} rows where {count} from row {first} on are needed");
            return Err(self.invalid(problem).remedy("write the file again, or copy it again if it was cut"));
        }
        let axis = |start, count| SlabAxis { start, stride: 1, count };
        let slab: Vec<SlabAxis> = [axis(first, count)].into_iter().chain(row.iter().map(|&n| axis(0, n))).collect();
        self.read_slab(&slab)
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
        failure(&self.file.path, format!("data set '{}'", self.name), error, self.file.missing)
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
        E::UnsupportedLayoutClass(3) => {
            FileError::unsupported(path, place, "is virtual: the numbers are in other data sets, which are not read")
                .remedy("copy the numbers to one file, with h5repack -l CONTI for example")
        }
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

/// The selected numbers as little-endian bytes; those of an enumeration in its own order.
fn read_selection(dataset: &Dataset, number: Number, selection: &SliceInfo) -> hdf5_reader::error::Result<Vec<u8>> {
    let is_enumeration = matches!(dataset.dtype(), Datatype::Enum { .. });
    with_type!(number, T => {
        if is_enumeration {
            let selected = dataset.read_slice::<Stored<{ size_of::<T>() }>>(selection)?;
            return Ok(selected.iter().map(|stored| stored.0).collect::<Vec<_>>().into_flattened());
        }
        let selected = dataset.read_slice::<T>(selection)?;
        Ok(selected.iter().map(|number| number.to_le_bytes()).collect::<Vec<_>>().into_flattened())
    })
}

/// The bytes of a number as stored: the reader has no slices of enumerations otherwise.
#[derive(Clone)]
struct Stored<const BYTES: usize>([u8; BYTES]);

impl<const BYTES: usize> H5Type for Stored<BYTES> {
    fn hdf5_type() -> Datatype {
        Datatype::Opaque { size: BYTES as u32, tag: String::new() }
    }

    fn from_bytes(bytes: &[u8], _: &Datatype) -> hdf5_reader::error::Result<Self> {
        let stored = bytes.get(..BYTES).and_then(|bytes| bytes.try_into().ok());
        stored.map(Self).ok_or_else(|| hdf5_reader::error::Error::InvalidData("a number is cut".to_owned()))
    }

    fn element_size(_: &Datatype) -> usize {
        BYTES
    }
}
