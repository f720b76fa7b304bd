//! Names, versions and attributes of the groups of a store.

use super::metadata;
use crate::codec::{ArraySpec, Chunking, ElementType, Quality};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use crate::files;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;
use zarrs_metadata::v3::GroupMetadataV3;

/// Version of the layout that is read: any minor version of this major one. A store has the least that holds what is in it.
/// 1.1: fields of cells, weights of means, cells of the source that were split. Readers of 1.0 read the rest; appending they would lose it.
/// 1.2: meshes without connectivity, which readers of 1.1 derive.
const STORE_VERSION: [u32; 2] = [1, 2];
/// Version of a store of points without cells (`kind: points`), which readers of meshes refuse by its major number.
/// 2.1: their volumes (`filling`), which readers of 2.0 take for those of balls.
const CLOUD_VERSION: [u32; 2] = [2, 1];
/// Version of a cloud without volumes.
const USUAL_CLOUD_VERSION: [u32; 2] = [2, 0];
/// Version of a store with nothing newer in it.
const USUAL_VERSION: [u32; 2] = [1, 1];
/// Version of the derived arrays (faces, face_cells, neighbours, moments); those of other versions are derived again or ignored.
pub(super) const DERIVED_VERSION: u64 = 1;
/// Attribute of a derived array that holds its version.
pub(super) const DERIVED_ATTRIBUTE: &str = "derived_version";

/// Group of the mesh.
pub(super) const MESH: &str = "mesh/0";
/// Group of the time axis.
pub(super) const TIME: &str = "time";
/// Group of the fields of vertices.
pub(super) const FIELDS: &str = "fields";
/// Group of the fields of cells, which readers of version 1.0 do not look for; absent if there are none.
pub(super) const CELL_FIELDS: &str = "cell_fields";

/// The group of the fields of vertices or of cells.
pub(super) const fn fields_of(association: Association) -> &'static str {
    match association {
        Association::Point => FIELDS,
        Association::Cell => CELL_FIELDS,
    }
}

/// Array of the checksums of the steps' values, by which a series is known again.
pub(super) const CHECKSUM_PER_STEP: &str = "checksum_per_step";
/// Array of the errors of the steps of complete blocks: sum of squares, number of values, largest.
pub(super) const ERRORS_PER_STEP: &str = "errors_per_step";
/// Array of the sums of squared errors of each vertex over these steps.
pub(super) const ERRORS_PER_VERTEX: &str = "errors_per_vertex";

/// The array `moments`: mean, variance and number of finite samples of each vertex, one row and chunk each.
pub(super) fn moments_array(vertices: u64) -> ArraySpec {
    ArraySpec {
        name: "moments".to_owned(),
        element: ElementType::F64,
        shape: vec![3, vertices],
        chunking: Chunking::PerRow,
        axes: vec!["mean_variance_count", "vertex"],
    }
}

/// Attributes of the root group.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct RootAttributes {
    /// Version of the layout, "major.minor".
    pub(super) tetreel_store: String,
    /// Version of the software that wrote it.
    pub(super) tetreel: String,
    /// What the mesh is of; absent for cells.
    #[serde(default, skip_serializing_if = "StoredKind::is_cells")]
    pub(super) kind: StoredKind,
    /// What the series was read from.
    #[serde(default)]
    pub(super) source: String,
    /// What was skipped while reading it.
    #[serde(default)]
    pub(super) notes: Vec<String>,
    /// Number of appends.
    #[serde(default)]
    pub(super) revision: u64,
}

/// What a stored mesh is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoredKind {
    /// Tetrahedra.
    #[default]
    Cells,
    /// Points with radii: a cloud.
    Points,
}

impl StoredKind {
    /// Whether it is of tetrahedra: stores do not say so.
    pub fn is_cells(&self) -> bool {
        *self == Self::Cells
    }
}

/// Attributes of the mesh.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct MeshAttributes {
    /// What was found and repaired at import.
    #[serde(default)]
    pub(super) repair: serde_json::Value,
    /// Corners of the bounding box in world coordinates.
    #[serde(default)]
    pub(super) bounds: Option<[[f64; 3]; 2]>,
    /// Corners of the box of the mesh without parts that are far away, if there are such.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frame: Option<[[f64; 3]; 2]>,
    /// Number of the source's cells, if several cells of the mesh are parts of one: so many values has a step of a field of cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source_cells: Option<u64>,
    /// Whether the arrays of faces and neighbours are there; absent where they are.
    #[serde(default, skip_serializing_if = "StoredConnectivity::is_full")]
    pub(super) connectivity: StoredConnectivity,
    /// Whether a cloud has an array of volumes over those of balls; absent where it has not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) has_volumes: bool,
}

/// The connectivity of a stored mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoredConnectivity {
    /// Faces and neighbours are stored, or derived where the arrays cannot be used.
    #[default]
    Full,
    /// The mesh is used without: its cells are drawn one by one.
    None,
}

impl StoredConnectivity {
    /// Whether there is any: stores do not say so.
    pub fn is_full(&self) -> bool {
        *self == Self::Full
    }
}

/// Attributes of the group of fields.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct FieldsAttributes {
    /// Folders of the fields, in the order of the source.
    pub(super) folders: Vec<String>,
}

/// Weights of the cells around a vertex in its mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeanWeights {
    /// The volumes of the cells.
    Volume,
}

/// Attributes of a field.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct FieldAttributes {
    /// Name as the user selects it.
    pub(super) name: String,
    /// Association of the values in the source.
    pub(super) association: Association,
    /// How values of cells were brought to the vertices; absent where they were not, and for unweighted means of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) weights: Option<MeanWeights>,
    /// Unit of the values, if known.
    #[serde(default)]
    pub(super) units: Option<String>,
    /// Codec of the values; `magnitude` if they are computed from `magnitude_of`.
    pub(super) codec: String,
    /// Parameters of the codec.
    #[serde(default)]
    pub(super) codec_parameters: serde_json::Value,
    /// Folders of the components whose norm this field is; empty for a field with values of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) magnitude_of: Vec<String>,
    /// Error measured after coding; absent if it is exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) quality: Option<Quality>,
    /// Least and greatest finite value of the series, for other readers (`range_per_step` is exact).
    #[serde(default)]
    pub(super) range: Option<[f32; 2]>,
    /// Number of NaN and infinite values.
    #[serde(default)]
    pub(super) nonfinite: u64,
}

/// This layout's version as text.
pub(crate) fn store_version() -> String {
    text_of(STORE_VERSION)
}

/// The version of a store with this mesh as text.
pub(super) fn version_with(kind: StoredKind, mesh: &MeshAttributes) -> String {
    text_of(match kind {
        StoredKind::Points if mesh.has_volumes => CLOUD_VERSION,
        StoredKind::Points => USUAL_CLOUD_VERSION,
        StoredKind::Cells if mesh.connectivity.is_full() => USUAL_VERSION,
        StoredKind::Cells => STORE_VERSION,
    })
}

fn text_of([major, minor]: [u32; 2]) -> String {
    format!("{major}.{minor}")
}

/// Writes a group with its attributes.
pub(super) fn write_group(root: &Path, key: &str, attributes: &impl Serialize) -> FileResult<()> {
    let Ok(serde_json::Value::Object(attributes)) = serde_json::to_value(attributes) else {
        let problem = "cannot write: attributes are no JSON object";
        return Err(FileError::unsupported(metadata::path(root, key), "", problem));
    };
    metadata::write(root, key, &GroupMetadataV3::new().with_attributes(attributes))
}

/// Reads the attributes of a group.
pub(super) fn read_group<T: DeserializeOwned>(root: &Path, key: &str) -> FileResult<T> {
    let group: GroupMetadataV3 = metadata::read(root, key, "group")?;
    metadata::check_fields(root, key, "group", &group.additional_fields)?;
    serde_json::from_value(serde_json::Value::Object(group.attributes))
        .map_err(|e| FileError::invalid(metadata::path(root, key), "attributes", e.to_string()))
}

/// Reads the attributes of the root and checks that the store is one that this version can read.
pub(super) fn read_root(root: &Path) -> FileResult<RootAttributes> {
    files::check_kind(root)?;
    files::check_kind(&root.join("zarr.json"))?;
    if !root.is_dir() {
        let problem = if root.exists() { "is not a folder, so not a store" } else { "does not exist" };
        return Err(FileError::invalid(root, "", problem).remedy("name the folder that an import has written"));
    }
    if !is_store(root) {
        let error = FileError::invalid(root, "zarr.json", "is missing or not that of a tetreel store");
        return Err(error.remedy("import the series first"));
    }
    let attributes: RootAttributes = read_group(root, "")?;
    let major = attributes.tetreel_store.split('.').next().and_then(|v| v.parse::<u32>().ok());
    let is_known = match attributes.kind {
        StoredKind::Cells => major == Some(STORE_VERSION[0]),
        StoredKind::Points => major == Some(CLOUD_VERSION[0]),
    };
    if !is_known {
        let (theirs, ours) = (&attributes.tetreel_store, store_version());
        let problem = format!("store version {theirs}, written by tetreel {}; this reads {ours}", attributes.tetreel);
        return Err(FileError::unsupported(root, "zarr.json", problem).remedy("import the series again"));
    }
    Ok(attributes)
}

/// Refuses to add to a store of a newer version, which may have unknown content.
pub(super) fn check_appendable(root: &Path, attributes: &RootAttributes) -> FileResult<()> {
    let minor = attributes.tetreel_store.split('.').nth(1).and_then(|v| v.parse::<u32>().ok());
    let ours = if attributes.kind.is_cells() { STORE_VERSION } else { CLOUD_VERSION };
    if minor.is_some_and(|minor| minor <= ours[1]) {
        return Ok(());
    }
    let (theirs, ours) = (&attributes.tetreel_store, text_of(ours));
    let problem = format!("store version {theirs}, written by tetreel {}; this adds to {ours}", attributes.tetreel);
    Err(FileError::unsupported(root, "zarr.json", problem).remedy("use that version, or a later one"))
}

/// Whether `path` is a folder with a tetreel store of any version; reads its attributes only.
pub fn is_store(path: &Path) -> bool {
    let file = path.join("zarr.json");
    let text = if file.is_file() { std::fs::read(file).unwrap_or_default() } else { Vec::new() };
    let Ok(json) = serde_json::from_slice::<serde_json::Value>(&text) else { return false };
    json.pointer("/attributes/tetreel_store").is_some()
}
