//! Chunks: arrays of little-endian elements, each chunk followed by its CRC-32C.

use super::stop::{Stop, go_on, uncancelled};
use crate::error::{FileError, FileResult};
use crate::task::Cancel;
use std::borrow::Cow;
use std::path::PathBuf;

/// Bytes of the checksum behind a chunk.
const CHECKSUM_BYTES: u64 = 4;

/// Bytes that are read and checked between two checks of the cancel flag: a fraction of a millisecond.
pub(super) const PIECE_BYTES: usize = 1 << 20;

/// Reads bytes of named objects: of files in a folder today, of an object store later.
pub trait ReadRange: Send + Sync {
    /// Number of bytes of the object `key` (path segments joined by `/`).
    ///
    /// # Errors
    /// If there is no such object.
    fn size(&self, key: &str) -> FileResult<u64>;

    /// Whether there is an object `key`. A missing chunk holds its array's fill value where a codec says so.
    ///
    /// # Errors
    /// If that cannot be determined.
    fn exists(&self, key: &str) -> FileResult<bool>;

    /// Fills `parts` one after the other with the bytes from `offset` on.
    ///
    /// # Errors
    /// If the object cannot be read or ends too early.
    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()>;

    /// As [`ReadRange::read`], but calls `filled` with each part once it is filled, and stops if that returns false. Returns whether it
    /// never did. To be overridden where opening an object is expensive.
    ///
    /// # Errors
    /// As [`ReadRange::read`].
    fn read_while(
        &self,
        key: &str,
        mut offset: u64,
        parts: &mut [&mut [u8]],
        filled: &mut dyn FnMut(&[u8]) -> bool,
    ) -> FileResult<bool> {
        for part in parts {
            self.read(key, offset, &mut [part])?;
            offset += part.len() as u64;
            if !filled(part) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Path of the object in error messages.
    fn path(&self, key: &str) -> PathBuf;
}

/// Number type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementType {
    /// IEEE 754 single precision.
    F32,
    /// IEEE 754 double precision.
    F64,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
}

impl ElementType {
    /// Name of the Zarr data type.
    pub fn zarr_name(self) -> &'static str {
        match self {
            Self::F32 => "float32",
            Self::F64 => "float64",
            Self::I8 => "int8",
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::U64 => "uint64",
        }
    }
}

/// A number type of array elements.
pub trait Element: bytemuck::Pod + Send + Sync {
    /// The element type in the store.
    const TYPE: ElementType;
    /// The same number with its bytes reversed.
    #[must_use]
    fn reversed(self) -> Self;
}

macro_rules! element {
    ($($number:ty => $type:ident),*) => {$(
        impl Element for $number {
            const TYPE: ElementType = ElementType::$type;
            fn reversed(self) -> Self {
                let mut bytes = self.to_ne_bytes();
                bytes.reverse();
                Self::from_ne_bytes(bytes)
            }
        }
    )*};
}
element!(f32 => F32, f64 => F64, i8 => I8, u8 => U8, u16 => U16, u32 => U32, u64 => U64);

/// How an array is cut into chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chunking {
    /// One chunk for the whole array.
    Whole,
    /// One chunk for each index of the first axis (a step, a block).
    PerRow,
    /// This many indices of the first axis share a chunk; the last chunk is padded.
    Rows(u64),
}

/// Metadata of an array of the store.
#[derive(Clone, Debug, PartialEq)]
pub struct ArraySpec {
    /// Name within the group of the field; `GROUP/NAME` for an array of a group of its own.
    pub name: String,
    /// Number type.
    pub element: ElementType,
    /// Length of each axis, slowest first.
    pub shape: Vec<u64>,
    /// Division into chunks.
    pub chunking: Chunking,
    /// Names of the axes.
    pub axes: Vec<&'static str>,
}

impl ArraySpec {
    /// Length of each axis of a chunk; at least 1, as Zarr requires even if an axis of the array is empty.
    pub fn chunk_shape(&self) -> Vec<u64> {
        let mut shape: Vec<u64> = self.shape.iter().map(|&n| n.max(1)).collect();
        if let Some(first) = shape.first_mut() {
            match self.chunking {
                Chunking::Whole => {}
                Chunking::PerRow => *first = 1,
                Chunking::Rows(rows) => *first = rows,
            }
        }
        shape
    }
}

/// Name of a chunk in the group of its array, in Zarr's default encoding: `row` is the index along the first of `rank`
/// axes (0 if the array is one chunk).
///
/// ```
/// assert_eq!(tetreel::codec::chunk_key("raw", 12, 2), "raw/c/12/0");
/// ```
pub fn chunk_key(array: &str, row: u64, rank: usize) -> String {
    let mut key = format!("{array}/c/{row}");
    for _ in 1..rank {
        key.push_str("/0");
    }
    key
}

/// The array and the row of a key made by [`chunk_key`]; `None` for any other name.
///
/// ```
/// assert_eq!(tetreel::codec::parse_chunk_key("vq/mean/c/12/0"), Some(("vq/mean", 12)));
/// assert_eq!(tetreel::codec::parse_chunk_key("raw/zarr.json"), None);
/// ```
pub fn parse_chunk_key(key: &str) -> Option<(&str, u64)> {
    let (array, index) = key.split_once("/c/")?;
    let row = index.split('/').next()?.parse().ok()?;
    Some((array, row))
}

/// The bytes of elements in the store's byte order (little-endian).
pub fn to_bytes<T: Element>(values: &[T]) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytemuck::cast_slice(values))
    } else {
        let reversed: Vec<T> = values.iter().map(|v| v.reversed()).collect();
        Cow::Owned(bytemuck::cast_slice(&reversed).to_vec())
    }
}

/// The checksum that follows the payload of a chunk.
pub fn seal(payload: &[u8]) -> [u8; CHECKSUM_BYTES as usize] {
    crc32c::crc32c(payload).to_le_bytes()
}

/// Fills `out` from the chunk `key`, whose payload must have exactly that length; returns the bytes read.
///
/// # Errors
/// If the chunk is missing, has another length, or does not match its checksum.
pub fn read_chunk<T: Element>(source: &dyn ReadRange, key: &str, out: &mut [T]) -> FileResult<u64> {
    uncancelled(|cancel| read_chunk_unless(source, key, out, cancel))
}

/// As [`read_chunk`], unless `cancel` is raised, which is checked after every piece; `out` is then unspecified.
///
/// # Errors
/// As [`read_chunk`], or `Cancelled`.
pub fn read_chunk_unless<T: Element>(
    source: &dyn ReadRange,
    key: &str,
    out: &mut [T],
    cancel: &Cancel,
) -> Result<u64, Stop> {
    go_on(cancel)?;
    let payload: &mut [u8] = bytemuck::cast_slice_mut(out);
    let expected = payload.len() as u64 + CHECKSUM_BYTES;
    check_size(source, key, expected)?;
    let mut stored = [0; CHECKSUM_BYTES as usize];
    let mut parts: Vec<&mut [u8]> = payload.chunks_mut(PIECE_BYTES).collect();
    let pieces = parts.len();
    parts.push(&mut stored);
    let (mut computed, mut filled) = (0, 0);
    let whole = source.read_while(key, 0, &mut parts, &mut |part| {
        // The last part is the checksum itself.
        if filled < pieces {
            computed = crc32c::crc32c_append(computed, part);
        }
        filled += 1;
        !cancel.is_cancelled()
    })?;
    if !whole {
        return Err(Stop::Cancelled);
    }
    if computed.to_le_bytes() != stored {
        let error = FileError::invalid(source.path(key), "chunk", "is damaged: its CRC-32C does not match");
        return Err(error.remedy("restore the file from a copy, or import the series again").into());
    }
    if cfg!(target_endian = "big") {
        out.iter_mut().for_each(|v| *v = v.reversed());
    }
    Ok(expected)
}

/// Reads a chunk of `count` rows of N elements. The file's length is checked before memory is allocated.
///
/// # Errors
/// As [`read_chunk`], and if the chunk cannot be addressed on this machine.
pub fn read_rows<T: Element, const N: usize>(source: &dyn ReadRange, key: &str, count: u64) -> FileResult<Vec<[T; N]>> {
    uncancelled(|cancel| read_rows_unless(source, key, count, cancel))
}

/// As [`read_rows`], unless `cancel` is raised.
///
/// # Errors
/// As [`read_rows`], or `Cancelled`.
pub fn read_rows_unless<T: Element, const N: usize>(
    source: &dyn ReadRange,
    key: &str,
    count: u64,
    cancel: &Cancel,
) -> Result<Vec<[T; N]>, Stop> {
    if count == 0 {
        return Ok(Vec::new()); // an empty array has no chunk
    }
    let too_large = || FileError::unsupported(source.path(key), "chunk", format!("has {count} rows: too large"));
    check_chunk_size::<T>(source, key, count.checked_mul(N as u64).ok_or_else(too_large)?)?;
    let mut rows = vec![[T::zeroed(); N]; usize::try_from(count).map_err(|_| too_large())?];
    read_chunk_unless(source, key, rows.as_flattened_mut(), cancel)?;
    Ok(rows)
}

/// Checks that a chunk of `count` elements has the right length, without reading its elements.
///
/// # Errors
/// If it is missing or has another length.
pub fn check_chunk_size<T: Element>(source: &dyn ReadRange, key: &str, count: u64) -> FileResult<()> {
    let bytes = count.checked_mul(size_of::<T>() as u64).and_then(|b| b.checked_add(CHECKSUM_BYTES));
    let bytes = bytes.ok_or_else(|| FileError::unsupported(source.path(key), "chunk", "is too large"))?;
    check_size(source, key, bytes)
}

fn check_size(source: &dyn ReadRange, key: &str, expected: u64) -> FileResult<()> {
    let actual = source.size(key)?;
    if actual == expected {
        return Ok(());
    }
    Err(FileError::invalid(source.path(key), "chunk", format!("has {actual} bytes instead of {expected}"))
        .remedy("restore the file from a copy, or import the series again"))
}
