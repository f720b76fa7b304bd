//! The functions that take the place of the cells: a group beside the mesh, which most stores do not have.

use super::array::{StoredArray, write_metadata};
use super::field::FieldReader;
use super::folder::FolderSink;
use super::layout;
use super::refresh::Stamp;
use super::staging::{Staging, exchange, rename, sync_folder, sync_store};
use super::writer::bytes_on_disk;
use super::{Store, metadata};
use crate::codec::{ArraySpec, ChunkSink, Chunking, ElementType, ReadRange, chunk_key, read_rows, to_bytes};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use crate::files;
use crate::functions::Kernels;
use crate::functions::report::Report;
use crate::functions::vertices::{VertexFunctions, VertexKernels};
use crate::mesh::Mesh;
use crate::short::Short;
use crate::task::{Cancel, Progress};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::fmt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Group of all functions.
const FUNCTIONS: &str = "functions";
/// Group of those at the vertices.
const GROUP: &str = "functions/vertices";
/// Name of the array of widths.
const FACTORS: &str = "factors";

/// What a store says of its functions: the attributes of their group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FunctionsInfo {
    /// Version of the group.
    version: u64,
    /// How they were fitted.
    method: String,
    /// How they add up to a field.
    form: String,
    /// Their shape.
    shape: String,
    /// How they fall off.
    phi: String,
    /// Distance in widths at which they end.
    pub cut: f64,
    /// Widths in root mean squares of the edges.
    pub width: f64,
    /// Number of functions.
    pub count: u64,
    /// Number of those that were widened so that they reach into all cells.
    pub widened: u64,
    /// How far they are from the cells.
    pub report: Report,
}

/// The attributes that name a kind of functions, with what this version reads and writes.
fn kind() -> [(&'static str, Value); 5] {
    [
        ("version", json!(1)),
        ("method", json!("vertices")),
        ("form", json!("normalised")),
        ("shape", json!("ellipsoid")),
        ("phi", json!("gaussian")),
    ]
}

impl FunctionsInfo {
    /// Functions at the vertices, fitted with these options.
    pub fn of(options: &VertexFunctions, fitted: &VertexKernels, report: Report) -> Self {
        Self {
            version: 1,
            method: "vertices".to_owned(),
            form: "normalised".to_owned(),
            shape: "ellipsoid".to_owned(),
            phi: "gaussian".to_owned(),
            cut: options.cut,
            width: options.width,
            count: fitted.kernels.len() as u64,
            widened: fitted.widened as u64,
            report,
        }
    }
}

impl fmt::Display for FunctionsInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { method, form, shape, phi, count, widened, .. } = self;
        let [cut, width] = [self.cut, self.width].map(Short);
        write!(f, "fit      {method}: {count} functions, {form}, {phi}, {shape}, width {width}, cut {cut}")?;
        if *widened > 0 {
            write!(f, ", {widened} widened")?;
        }
        write!(f, "\n{}", self.report)
    }
}

/// The functions of a store.
#[derive(Clone, Debug)]
pub struct StoredFunctions {
    /// What the store says of them.
    pub info: FunctionsInfo,
    /// Rows of the lower triangles L, local units of the mesh.
    factors: Vec<[f32; 6]>,
    /// The array, for messages.
    path: PathBuf,
}

impl StoredFunctions {
    /// The functions about the vertices of the store's mesh.
    ///
    /// # Errors
    /// If a number is not finite; says of which function.
    pub fn kernels(self, mesh: &Mesh) -> FileResult<Kernels> {
        let Self { info, factors, path } = self;
        Kernels::new(mesh.positions.local.clone(), factors, info.cut)
            .map_err(|problem| FileError::invalid(path, "block 0", problem).remedy(AGAIN))
    }
}

/// What to do where functions cannot be used.
const AGAIN: &str = "make them again: tetreel fit --add --overwrite";

/// What a store says of its functions; `None` if it has none.
pub(super) fn read_info(root: &Path) -> FileResult<Option<FunctionsInfo>> {
    if !root.join(GROUP).exists() {
        return Ok(None);
    }
    let attributes: Map<String, Value> = layout::read_group(root, GROUP)?;
    let path = metadata::path(root, GROUP);
    for (name, known) in kind() {
        let found = attributes.get(name).unwrap_or(&Value::Null);
        if *found != known {
            let problem = format!("has functions of {name} {found}, which is not known; this reads {known}");
            let remedy = "a newer version of tetreel may read them, or make others: tetreel fit --add --overwrite";
            return Err(FileError::unsupported(path, "attributes", problem).remedy(remedy));
        }
    }
    let invalid = |problem: String| FileError::invalid(&path, "attributes", problem).remedy(AGAIN);
    let info: FunctionsInfo =
        serde_json::from_value(Value::Object(attributes)).map_err(|error| invalid(error.to_string()))?;
    Kernels::check_cut(info.cut).map_err(|problem| invalid(format!("has {problem}")))?;
    Ok(Some(info))
}

/// Reads the functions of a store whose mesh has this number of vertices; `None` if it has none.
pub(super) fn read(root: &Path, source: &dyn ReadRange, vertices: u64) -> FileResult<Option<StoredFunctions>> {
    let Some(info) = read_info(root)? else { return Ok(None) };
    let key = format!("{GROUP}/{FACTORS}");
    let array = StoredArray::open(root, &key, ElementType::F32, Chunking::PerRow, 3)?;
    let path = root.join(&key);
    if array.shape != [1, vertices, 6] || info.count != vertices {
        let problem =
            format!("has shape {:?}, of {} functions; the mesh has {vertices} vertices", array.shape, info.count);
        return Err(FileError::invalid(path, "array", problem).remedy(AGAIN));
    }
    let factors = read_rows(source, &chunk_key(&key, 0, 3), vertices).map_err(|mut error| {
        error.place = "block 0".to_owned();
        error
    })?;
    Ok(Some(StoredFunctions { info, factors, path }))
}

impl FieldReader {
    /// The functions of the store that take the place of the cells, as [`Store::functions`]; `None` too for a field of cells, whose values
    /// are not those of functions.
    ///
    /// # Errors
    /// As [`Store::functions`].
    pub fn functions(&self) -> FileResult<Option<StoredFunctions>> {
        match self.info().values_of {
            Association::Point => read(&self.series.root, &*self.series.source, self.stored_count() as u64),
            Association::Cell => Ok(None),
        }
    }
}

/// Writes the group.
fn write(root: &Path, info: &FunctionsInfo, kernels: &Kernels) -> FileResult<()> {
    if !root.join(FUNCTIONS).exists() {
        layout::write_group(root, FUNCTIONS, &Map::new())?;
    }
    layout::write_group(root, GROUP, info)?;
    let spec = ArraySpec {
        name: FACTORS.to_owned(),
        element: ElementType::F32,
        shape: vec![1, kernels.len() as u64, 6],
        chunking: Chunking::PerRow,
        axes: vec!["block", "function", "factor"],
    };
    write_metadata(root, GROUP, &spec, Map::new())?;
    let payload = to_bytes(kernels.factors().as_flattened());
    FolderSink::new(root.join(GROUP)).put(&chunk_key(FACTORS, 0, 3), &payload)
}

/// Gives a store functions, or writes a copy of it that has them. Dropped before [`Self::finish`], it leaves no files.
#[derive(Debug)]
pub struct FunctionsWriter<'a> {
    store: &'a Store,
    place: Place,
}

#[derive(Debug)]
enum Place {
    /// The store's own folder, without links, and the folder beside it in which the group is written.
    Added(PathBuf, TempDir),
    Copied(Staging),
}

impl<'a> FunctionsWriter<'a> {
    /// Begins functions that are added to a store, nothing else of which changes.
    ///
    /// # Errors
    /// If it has some and they are not to be replaced, or if the folder that it is in cannot be written.
    pub fn add(store: &'a Store, overwrite: bool) -> FileResult<Self> {
        let root = std::fs::canonicalize(&store.root).map_err(|e| FileError::io(&store.root, "open", &e))?;
        if root.join(GROUP).exists() && !overwrite {
            let error = FileError::invalid(store.root.join(GROUP), "", "exists");
            return Err(error.remedy("allow it to be replaced (--overwrite), or write a copy of the store (-o)"));
        }
        let dir = files::sibling_folder(&root, FUNCTIONS)?;
        Ok(Self { store, place: Place::Added(root, dir) })
    }

    /// Begins a copy of a store at `target`, with its files as they are.
    ///
    /// # Errors
    /// If something exists there and is no tetreel store or `overwrite` is not set, or its folder cannot be written.
    pub fn copy(store: &'a Store, target: &Path, overwrite: bool) -> FileResult<Self> {
        Ok(Self { store, place: Place::Copied(Staging::begin(target, overwrite)?) })
    }

    /// Writes the functions, and moves them, or the copy, to their place. Returns the bytes of the functions; `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If a file cannot be written, or the store was changed meanwhile.
    pub fn finish(
        self,
        info: &FunctionsInfo,
        kernels: &Kernels,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> FileResult<Option<u64>> {
        let Self { store, place } = self;
        let written = match &place {
            Place::Added(_, dir) => dir.path(),
            Place::Copied(staging) => {
                progress.begin("copying", bytes_on_disk(&store.root)?, "bytes");
                let is_kept = |key: &str| !key.starts_with(&format!("{GROUP}/"));
                let is_whole = staging.copy(&store.root, is_kept, &mut |bytes| progress.advance(bytes), cancel)?;
                progress.end();
                if !is_whole {
                    return Ok(None);
                }
                staging.path()
            }
        };
        write(written, info, kernels)?;
        let bytes = bytes_on_disk(&written.join(GROUP))?;
        if Stamp::of(&store.root) != store.stamp {
            let problem = "was changed by somebody else meanwhile; it is left like that";
            return Err(FileError::invalid(&store.root, "", problem).remedy("run the command again"));
        }
        match place {
            Place::Added(root, dir) => put_in_place(&root, dir)?,
            Place::Copied(staging) => staging.commit()?,
        }
        Ok(Some(bytes))
    }
}

/// Moves the group to its store, where it takes the place of an earlier one.
fn put_in_place(root: &Path, dir: TempDir) -> FileResult<()> {
    sync_store(dir.path())?;
    // Groups of other functions, which a newer version may have written, stay.
    let part = if root.join(FUNCTIONS).exists() { GROUP } else { FUNCTIONS };
    let (new, target) = (dir.path().join(part), root.join(part));
    if !target.exists() {
        rename(&new, &target)?;
    } else if !exchange(&new, &target) {
        rename(&target, &dir.path().join("old"))?;
        rename(&new, &target)?;
    }
    sync_folder(files::parent_of(&target))?;
    let path = dir.path().to_owned();
    dir.close().map_err(|e| FileError::io(path, "remove", &e))
}
