//! The JSON file of a transfer function, and how a colour map is named in it and on the command line.

use super::TransferError;
use super::color_map::ColorMap;
use super::function::{OpacityPoint, OpacityValues, PositionKind, TransferFunction};
use super::paraview::{ColorMapEntry, JsonEntry, read_color_maps};
use crate::error::FileError;
use crate::files::os_string;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::path::Path;

/// The JSON form of a transfer function.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TransferFunctionFile {
    color_map: MapInFile,
    #[serde(default)]
    positions: PositionKind,
    #[serde(default)]
    values: OpacityValues,
    points: Vec<OpacityPoint>,
}

/// A colour map by name (as in `--tf`) or in full, as ParaView writes it.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum MapInFile {
    Name(String),
    Full(Box<JsonEntry>),
}

impl TransferFunctionFile {
    /// The transfer function; names of map files are relative to the folder `base`.
    fn resolve(self, path: &Path, base: &Path) -> Result<TransferFunction, TransferError> {
        let map = match self.color_map {
            MapInFile::Name(name) => find_map(OsStr::new(&name), base)?.map,
            MapInFile::Full(entry) => entry.into_entry(path, "color_map")?.map,
        };
        TransferFunction::new(map, self.points, self.positions, self.values)
    }
}

impl TryFrom<TransferFunctionFile> for TransferFunction {
    type Error = TransferError;

    /// Reads a transfer function inside other data, where map files cannot be named.
    fn try_from(file: TransferFunctionFile) -> Result<Self, TransferError> {
        if let MapInFile::Name(name) = &file.color_map
            && find_built_in(name).is_none()
        {
            let known = built_in_names();
            return Err(TransferError::NoBuiltInMap { name: name.clone(), known });
        }
        file.resolve(Path::new("transfer function"), Path::new(""))
    }
}

impl From<TransferFunction> for TransferFunctionFile {
    fn from(tf: TransferFunction) -> Self {
        let map = tf.color_map();
        let built_in = find_built_in(map.name()).is_some_and(|found| found == *map);
        let color_map = if built_in {
            MapInFile::Name(map.name().to_owned())
        } else {
            MapInFile::Full(Box::new(JsonEntry::of(&ColorMapEntry { map: map.clone(), opacity: None })))
        };
        Self { color_map, positions: tf.positions(), values: tf.values(), points: tf.points().to_vec() }
    }
}

impl TransferFunction {
    /// Reads a transfer function file. Map files named in it are relative to its folder.
    ///
    /// # Errors
    /// If the file cannot be read, is no transfer function, or its map or points are at fault.
    pub fn read(path: &Path) -> Result<Self, TransferError> {
        let text = std::fs::read_to_string(path).map_err(|e| FileError::io(path, "read the transfer function", &e))?;
        let file: TransferFunctionFile = serde_json::from_str(&text).map_err(|e| invalid_json(path, &e))?;
        let name_file = |e: TransferError| match e {
            TransferError::File(e) => TransferError::File(e),
            other => TransferError::File(FileError::invalid(path, "", other.to_string())),
        };
        file.resolve(path, path.parent().unwrap_or(Path::new(""))).map_err(name_file)
    }

    /// The text of a transfer function file. A built-in map is written as its name, another in full.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() // strings and finite numbers always have a JSON form
    }
}

fn invalid_json(path: &Path, e: &serde_json::Error) -> FileError {
    FileError::invalid(path, format!("line {} column {}", e.line(), e.column()), e.to_string())
}

/// Extension of a file of colour maps.
const JSON: &str = ".json";
/// [`JSON`] and the separator before the name of a map in the file.
const ENTRY: &str = ".json#";
/// Suffix of the name of a reversed map.
const REVERSED: &str = "_r";

/// The colour map called `name`: a built-in one, `FILE.json` (relative to `base`) with one map, or `FILE.json#NAME`; each with `_r` for its
/// reverse.
pub(super) fn find_map(name: &OsStr, base: &Path) -> Result<ColorMapEntry, TransferError> {
    if let Some(entry) = find_exact(name, base)? {
        return Ok(entry);
    }
    let stem = name.as_encoded_bytes().strip_suffix(REVERSED.as_bytes()).and_then(|stem| os_string(stem.to_vec()));
    let turned = stem.map(|stem| find_exact(&stem, base)).transpose()?.flatten();
    let unknown = || TransferError::UnknownMap { name: name.to_string_lossy().into_owned(), known: built_in_names() };
    turned.map(reversed).ok_or_else(unknown)
}

/// The built-in map called `name`, or its reverse.
fn find_built_in(name: &str) -> Option<ColorMap> {
    let turned = || Some(ColorMap::built_in(name.strip_suffix(REVERSED)?)?.reversed());
    ColorMap::built_in(name).cloned().or_else(turned)
}

fn built_in_names() -> String {
    ColorMap::built_in_names().collect::<Vec<_>>().join(", ")
}

fn reversed(entry: ColorMapEntry) -> ColorMapEntry {
    let turn = |p: OpacityPoint| OpacityPoint { position: 1.0 - p.position, value: p.value };
    let opacity = entry.opacity.map(|points| points.into_iter().rev().map(turn).collect());
    ColorMapEntry { map: entry.map.reversed(), opacity }
}

/// The map of exactly that name; `None` if it is neither built in nor names a JSON file.
fn find_exact(name: &OsStr, base: &Path) -> Result<Option<ColorMapEntry>, TransferError> {
    if let Some(map) = name.to_str().and_then(ColorMap::built_in) {
        return Ok(Some(ColorMapEntry { map: map.clone(), opacity: None }));
    }
    let bytes = name.as_encoded_bytes();
    if bytes.ends_with(JSON.as_bytes()) {
        let path = base.join(name);
        let mut entries = read_color_maps(&path)?;
        if entries.len() > 1 {
            let remedy = format!("choose one with {}#NAME: {}", path.display(), names(&entries));
            let problem = format!("has {} colour maps", entries.len());
            return Err(FileError::invalid(&path, "", problem).remedy(remedy).into());
        }
        return Ok(entries.pop());
    }
    let place = bytes.windows(ENTRY.len()).position(|part| part == ENTRY.as_bytes());
    let Some(end) = place.map(|at| at + JSON.len()) else { return Ok(None) };
    let Some(file) = os_string(bytes[..end].to_vec()) else { return Ok(None) };
    let entry_name = String::from_utf8_lossy(&bytes[end + 1..]);
    let path = base.join(file);
    let entries = read_color_maps(&path)?;
    let known = names(&entries);
    let named = |wanted: &str| entries.iter().find(|e| e.map.name() == wanted).cloned();
    let is_reversed = |stem: &str| named(stem).is_some();
    match named(&entry_name) {
        Some(entry) => Ok(Some(entry)),
        None if entry_name.strip_suffix(REVERSED).is_some_and(is_reversed) => Ok(None),
        None => Err(FileError::invalid(&path, "", format!("has no colour map '{entry_name}'"))
            .remedy(format!("it has {known}"))
            .into()),
    }
}

fn names(entries: &[ColorMapEntry]) -> String {
    entries.iter().map(|e| format!("'{}'", e.map.name())).collect::<Vec<_>>().join(", ")
}
