//! Zarr metadata of arrays: written from, and checked against, an [`ArraySpec`].

use super::folder::unlink;
use super::layout::{Storage, node_path};
use crate::codec::{ArraySpec, Chunking, Element, ElementType, ReadRange, check_chunk_size, chunk_key, read_rows};
use crate::error::{FileError, FileResult};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zarrs::array::builder::ArrayBuilderFillValue;
use zarrs::array::codec::Crc32cCodec;
use zarrs::array::{Array, ArrayBuilder, ArrayMetadata};
use zarrs::metadata::v3::MetadataV3;

/// An array that was found in a store and is cut and coded as tetreel writes it.
#[derive(Clone, Debug)]
pub(super) struct StoredArray {
    key: String,
    pub(super) shape: Vec<u64>,
    pub(super) attributes: Map<String, Value>,
}

fn builder(spec: &ArraySpec) -> ArrayBuilder {
    let fill: ArrayBuilderFillValue = match spec.element {
        ElementType::F32 | ElementType::F64 => "NaN".into(),
        ElementType::I8 | ElementType::U8 | ElementType::U16 | ElementType::U32 | ElementType::U64 => 0u8.into(),
    };
    let mut builder = ArrayBuilder::new(spec.shape.clone(), spec.chunk_shape(), spec.element.zarr_name(), fill);
    builder.bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())]);
    builder.dimension_names(Some(spec.axes.iter().copied()));
    builder
}

/// Writes the metadata of an array of the group `group`; the chunks are the caller's.
pub(super) fn write_metadata(
    root: &Path,
    storage: &Storage,
    group: &str,
    spec: &ArraySpec,
    attributes: Map<String, Value>,
) -> FileResult<()> {
    let key = format!("{group}/{}", spec.name);
    let failed = |e: String| FileError::unsupported(metadata_path(root, &key), "", format!("cannot write: {e}"));
    unlink(&metadata_path(root, &key))?;
    let array = builder(spec).attributes(attributes).build(storage.clone(), &node_path(&key));
    array.map_err(|e| failed(e.to_string()))?.store_metadata().map_err(|e| failed(e.to_string()))
}

impl StoredArray {
    /// Opens an array and checks its number type, axes, chunks and codecs.
    pub(super) fn open(
        root: &Path,
        storage: &Storage,
        key: &str,
        element: ElementType,
        chunking: Chunking,
        rank: usize,
    ) -> FileResult<Self> {
        let path = metadata_path(root, key);
        if !path.is_file() {
            return Err(FileError::invalid(path, "", "is missing").remedy("import the series again"));
        }
        let array = Array::open(storage.clone(), &node_path(key));
        let array = array.map_err(|e| FileError::invalid(&path, "array", e.to_string()))?;
        let shape = array.shape().to_vec();
        let wrong = |problem: String| Err(FileError::invalid(&path, "array", problem));
        if shape.len() != rank {
            return wrong(format!("has {} axes instead of {rank}", shape.len()));
        }
        let axes = vec![""; rank];
        let spec = ArraySpec { name: String::new(), element, shape, chunking, axes };
        let expected = builder(&spec).build_metadata();
        let expected = expected.map_err(|e| FileError::invalid(&path, "array", e.to_string()))?;
        let ArrayMetadata::V3(actual) = array.metadata() else {
            return wrong("is of Zarr version 2 instead of 3".to_owned());
        };
        if actual.data_type != expected.data_type {
            return wrong(format!("has numbers of type {} instead of {}", actual.data_type, expected.data_type));
        }
        if actual.chunk_grid != expected.chunk_grid || actual.chunk_key_encoding != expected.chunk_key_encoding {
            return wrong(format!("has chunks {} instead of {}", actual.chunk_grid, expected.chunk_grid));
        }
        if !same_extensions(&actual.codecs, &expected.codecs) || !actual.storage_transformers.is_empty() {
            let list: Vec<&str> = actual.codecs.iter().map(|codec| codec.name()).collect();
            return wrong(format!("is coded by {list:?} instead of little-endian bytes and crc32c"));
        }
        Ok(Self { key: key.to_owned(), shape: spec.shape, attributes: array.attributes().clone() })
    }

    /// The error that this array has an unexpected shape.
    pub(super) fn wrong_shape(&self, root: &Path, expected: &[u64]) -> FileError {
        let problem = format!("has shape {:?} instead of {expected:?}", self.shape);
        FileError::invalid(metadata_path(root, &self.key), "array", problem).remedy("import the series again")
    }

    /// Checks the shape.
    pub(super) fn expect_shape(self, root: &Path, expected: &[u64]) -> FileResult<Self> {
        if self.shape == expected { Ok(self) } else { Err(self.wrong_shape(root, expected)) }
    }

    /// Number of rows of an array of rows of N.
    pub(super) fn rows<const N: usize>(&self, root: &Path) -> FileResult<u64> {
        match self.shape[..] {
            [rows] if N == 1 => Ok(rows),
            [rows, width] if width == N as u64 => Ok(rows),
            _ => Err(self.wrong_shape(root, &[self.shape.first().copied().unwrap_or(0), N as u64])),
        }
    }

    /// Checks that the one chunk of an array of rows of N has the right length.
    pub(super) fn check_size<const N: usize>(
        &self,
        root: &Path,
        source: &dyn ReadRange,
        element: ElementType,
    ) -> FileResult<()> {
        let rows = self.rows::<N>(root)?;
        let key = chunk_key(&self.key, 0, self.shape.len());
        let count = rows.checked_mul(N as u64).ok_or_else(|| self.wrong_shape(root, &[]))?;
        if count == 0 { Ok(()) } else { check_chunk_size(source, &key, element, count) }
    }

    /// Reads the one chunk of an array of rows of N.
    pub(super) fn read<T: Element, const N: usize>(
        &self,
        root: &Path,
        source: &dyn ReadRange,
    ) -> FileResult<Vec<[T; N]>> {
        let rows = self.rows::<N>(root)?;
        read_rows(source, &chunk_key(&self.key, 0, self.shape.len()), rows)
    }
}

/// Whether two lists of codecs are the same; no configuration is as good as an empty one.
fn same_extensions(a: &[MetadataV3], b: &[MetadataV3]) -> bool {
    let configured = |m: &MetadataV3| m.configuration().filter(|c| !c.is_empty()).cloned();
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.name() == b.name() && configured(a) == configured(b))
}

fn metadata_path(root: &Path, key: &str) -> PathBuf {
    root.join(key).join("zarr.json")
}
