//! Zarr metadata of arrays: written from, and checked against, an [`ArraySpec`].

use super::metadata;
use crate::codec::{ArraySpec, Chunking, Element, ElementType, ReadRange, check_chunk_size, chunk_key, read_rows};
use crate::error::{FileError, FileResult};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use zarrs_metadata::v3::{ArrayMetadataV3, MetadataV3};

/// An array of a store whose chunks and codecs are those that tetreel writes.
#[derive(Clone, Debug)]
pub(super) struct StoredArray {
    key: String,
    /// Its metadata, for messages.
    path: PathBuf,
    pub(super) shape: Vec<u64>,
    pub(super) attributes: Map<String, Value>,
}

/// The metadata of an array with this specification.
fn metadata_of(spec: &ArraySpec) -> ArrayMetadataV3 {
    let configured = |name: &str, key: &str, value: Value| {
        MetadataV3::new_with_configuration(name, Map::from_iter([(key.to_owned(), value)]))
    };
    let fill = match spec.element {
        ElementType::F32 | ElementType::F64 => "NaN".into(),
        ElementType::I8 | ElementType::U8 | ElementType::U16 | ElementType::U32 | ElementType::U64 => 0.into(),
    };
    let bytes = configured("bytes", "endian", json!("little"));
    let grid = configured("regular", "chunk_shape", json!(spec.chunk_shape()));
    let codecs = vec![bytes, MetadataV3::new_with_configuration("crc32c", Map::new())];
    ArrayMetadataV3::new(spec.shape.clone(), grid, MetadataV3::new(spec.element.zarr_name()), fill, codecs)
        .with_dimension_names(Some(spec.axes.iter().copied()))
}

/// Attribute that the crate zarrs adds to arrays. It is kept, so that stores have the same bytes whichever crate writes the metadata.
const ZARRS_ATTRIBUTE: &str = "_zarrs";

/// Writes the metadata of an array of the group `group`; the caller writes the chunks.
pub(super) fn write_metadata(
    root: &Path,
    group: &str,
    spec: &ArraySpec,
    mut attributes: Map<String, Value>,
) -> FileResult<()> {
    let zarrs = json!({
        "description": "This array was created with zarrs",
        "repository": "https://github.com/zarrs/zarrs",
        "version": "0.23.14",
    });
    attributes.insert(ZARRS_ATTRIBUTE.to_owned(), zarrs);
    metadata::write(root, &format!("{group}/{}", spec.name), &metadata_of(spec).with_attributes(attributes))
}

impl StoredArray {
    /// Opens an array and checks its number type, axes, chunks and codecs.
    pub(super) fn open(
        root: &Path,
        key: &str,
        element: ElementType,
        chunking: Chunking,
        rank: usize,
    ) -> FileResult<Self> {
        let actual: ArrayMetadataV3 = metadata::read(root, key, "array")?;
        metadata::check_fields(root, key, "array", &actual.additional_fields)?;
        let path = metadata::path(root, key);
        let wrong = |problem: String| Err(FileError::invalid(&path, "array", problem));
        let shape = actual.shape;
        if shape.len() != rank {
            return wrong(format!("has {} axes instead of {rank}", shape.len()));
        }
        let axes = vec![""; rank];
        let spec = ArraySpec { name: String::new(), element, shape, chunking, axes };
        let expected = metadata_of(&spec);
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
        Ok(Self { key: key.to_owned(), path, shape: spec.shape, attributes: actual.attributes })
    }

    /// The error that this array has an unexpected shape.
    pub(super) fn wrong_shape(&self, expected: &[u64]) -> FileError {
        let problem = format!("has shape {:?} instead of {expected:?}", self.shape);
        FileError::invalid(&self.path, "array", problem).remedy("import the series again")
    }

    /// Checks the shape.
    pub(super) fn expect_shape(self, expected: &[u64]) -> FileResult<Self> {
        if self.shape == expected { Ok(self) } else { Err(self.wrong_shape(expected)) }
    }

    /// Number of rows of an array of rows of N.
    pub(super) fn rows<const N: usize>(&self) -> FileResult<u64> {
        match self.shape[..] {
            [rows] if N == 1 => Ok(rows),
            [rows, width] if width == N as u64 => Ok(rows),
            _ => Err(self.wrong_shape(&[self.shape.first().copied().unwrap_or(0), N as u64])),
        }
    }

    /// Checks that the one chunk of an array of rows of N has the right length.
    pub(super) fn check_size<T: Element, const N: usize>(&self, source: &dyn ReadRange) -> FileResult<()> {
        let count = self.rows::<N>()?.checked_mul(N as u64).ok_or_else(|| self.wrong_shape(&[]))?;
        if count == 0 { Ok(()) } else { check_chunk_size::<T>(source, &self.chunk(), count) }
    }

    /// Reads the one chunk of an array of rows of N.
    pub(super) fn read<T: Element, const N: usize>(&self, source: &dyn ReadRange) -> FileResult<Vec<[T; N]>> {
        read_rows(source, &self.chunk(), self.rows::<N>()?)
    }

    /// Key of the one chunk.
    fn chunk(&self) -> String {
        chunk_key(&self.key, 0, self.shape.len())
    }
}

/// Whether two lists of codecs are equal; a missing configuration equals an empty one.
fn same_extensions(a: &[MetadataV3], b: &[MetadataV3]) -> bool {
    let configured = |m: &MetadataV3| m.configuration().filter(|c| !c.is_empty()).cloned();
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.name() == b.name() && configured(a) == configured(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_are_those_that_stores_have_had_to_the_byte() {
        let dir = tempfile::tempdir().unwrap();
        let spec = ArraySpec {
            name: "turned".to_owned(),
            element: ElementType::U8,
            shape: vec![3],
            chunking: Chunking::Whole,
            axes: vec!["cell"],
        };
        write_metadata(dir.path(), "mesh", &spec, Map::new()).unwrap();
        // Output of zarrs 0.23.
        let expected = r#"{
  "zarr_format": 3,
  "node_type": "array",
  "shape": [
    3
  ],
  "data_type": "uint8",
  "chunk_grid": {
    "name": "regular",
    "configuration": {
      "chunk_shape": [
        3
      ]
    }
  },
  "chunk_key_encoding": {
    "name": "default",
    "configuration": {
      "separator": "/"
    }
  },
  "fill_value": 0,
  "codecs": [
    {
      "name": "bytes",
      "configuration": {
        "endian": "little"
      }
    },
    {
      "name": "crc32c"
    }
  ],
  "attributes": {
    "_zarrs": {
      "description": "This array was created with zarrs",
      "repository": "https://github.com/zarrs/zarrs",
      "version": "0.23.14"
    }
  },
  "dimension_names": [
    "cell"
  ]
}"#;
        assert_eq!(std::fs::read_to_string(metadata::path(dir.path(), "mesh/turned")).unwrap(), expected);
        let opened = StoredArray::open(dir.path(), "mesh/turned", ElementType::U8, Chunking::Whole, 1).unwrap();
        assert_eq!(opened.shape, [3]);
        let unknown = expected.replacen('{', "{\n  \"encrypted\": true,", 1);
        std::fs::write(metadata::path(dir.path(), "mesh/turned"), unknown).unwrap();
        let refused = StoredArray::open(dir.path(), "mesh/turned", ElementType::U8, Chunking::Whole, 1).unwrap_err();
        assert!(refused.to_string().contains("encrypted"), "{refused}");
    }
}
