//! The metadata of groups and arrays: one `zarr.json` each.

use super::folder::unlink;
use crate::error::{FileError, FileResult};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};
use zarrs_metadata::v3::AdditionalFieldsV3;

/// Path of the metadata of a group or an array.
pub(super) fn path(root: &Path, key: &str) -> PathBuf {
    root.join(key).join("zarr.json")
}

/// Writes metadata; a file that is linked from other stores is replaced, not overwritten.
pub(super) fn write(root: &Path, key: &str, metadata: &impl Serialize) -> FileResult<()> {
    let path = path(root, key);
    let failed = |e: String| FileError::unsupported(&path, "", format!("cannot write: {e}"));
    unlink(&path)?;
    let json = serde_json::to_vec_pretty(metadata).map_err(|e| failed(e.to_string()))?;
    fs::create_dir_all(root.join(key)).and_then(|()| fs::write(&path, json)).map_err(|e| failed(e.to_string()))
}

/// Reads metadata; errors name `node` as its group or array.
pub(super) fn read<T: DeserializeOwned>(root: &Path, key: &str, node: &str) -> FileResult<T> {
    let path = path(root, key);
    if !path.is_file() {
        return Err(FileError::invalid(path, "", "is missing").remedy("import the series again"));
    }
    let json = fs::read(&path).map_err(|e| FileError::io(&path, "read", &e))?;
    serde_json::from_slice(&json).map_err(|e| FileError::invalid(&path, node, e.to_string()))
}

/// Refuses unknown fields that a reader must understand (Zarr v3, section "Extension points").
pub(super) fn check_fields(root: &Path, key: &str, node: &str, fields: &AdditionalFieldsV3) -> FileResult<()> {
    match fields.iter().find(|(_, field)| field.must_understand()) {
        None => Ok(()),
        Some((name, _)) => {
            let problem = format!("has a field '{name}' that must be understood, and is not known");
            let remedy = "a newer version of tetreel may read it";
            Err(FileError::unsupported(path(root, key), node, problem).remedy(remedy))
        }
    }
}
