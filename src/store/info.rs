//! What a store holds, as `info` prints it.

use super::Store;
use super::blocks::{self, BlockInfo};
use super::field::StoredField;
use super::functions::{self, FunctionsInfo};
use super::layout::{StoredConnectivity, StoredKind};
use super::writer::bytes_on_disk;
use crate::error::FileResult;
use crate::field::Association;
use crate::short::Short;
use serde::Serialize;
use std::fmt;

/// Summary of a store; its JSON is that of `info --json`.
#[derive(Clone, Debug, Serialize)]
pub struct StoreInfo {
    /// The mesh.
    pub mesh: MeshInfo,
    /// The time axis.
    pub time: TimeInfo,
    /// The fields of vertices, then those of cells, each in the order of the source.
    pub fields: Vec<StoredField>,
    /// The functions that take the place of the cells; left out if there are none, or if they are of a kind that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub functions: Option<FunctionsInfo>,
    /// Bytes on disk.
    pub bytes: u64,
    /// Versions and origin.
    pub version: VersionInfo,
}

/// Summary of the mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshInfo {
    /// What the mesh is of; left out for cells.
    #[serde(skip_serializing_if = "StoredKind::is_cells")]
    pub kind: StoredKind,
    /// Number of vertices.
    pub vertices: u64,
    /// Number of tetrahedra.
    pub cells: u64,
    /// Corners of the bounding box in world coordinates; `None` if the store lacks them.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// The blocks of the source; none if it has no two.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub blocks: Vec<BlockInfo>,
    /// Whether faces and neighbours are there; left out where they are.
    #[serde(skip_serializing_if = "StoredConnectivity::is_full")]
    pub connectivity: StoredConnectivity,
    /// What was found and repaired at import.
    pub repair: serde_json::Value,
}

/// Summary of the time axis.
#[derive(Clone, Debug, Serialize)]
pub struct TimeInfo {
    /// Number of steps.
    pub steps: usize,
    /// Time of the first step.
    pub first: f64,
    /// Time of the last step.
    pub last: f64,
}

/// Versions of a store, and its origin.
#[derive(Clone, Debug, Serialize)]
pub struct VersionInfo {
    /// Version of the layout.
    pub store: String,
    /// Version of the software that wrote it.
    pub tetreel: String,
    /// What the series was read from.
    pub source: String,
    /// What was skipped while reading it.
    pub notes: Vec<String>,
}

impl StoreInfo {
    pub(super) fn of(store: &Store) -> FileResult<Self> {
        let (mesh, times) = (&store.series.mesh, &store.times().values);
        let root = store.attributes.clone();
        let (mut notes, mut functions) = (root.notes, None);
        // Everything else can be used without them.
        match functions::read_info(&store.root) {
            Ok(found) => functions = found,
            Err(error) => notes.push(error.to_string()),
        }
        Ok(Self {
            mesh: MeshInfo {
                kind: mesh.kind,
                vertices: mesh.vertices,
                cells: mesh.cells,
                bounds: mesh.attributes.bounds,
                blocks: blocks::list(&store.root)?,
                connectivity: mesh.attributes.connectivity,
                repair: mesh.attributes.repair.clone(),
            },
            time: TimeInfo {
                steps: times.len(),
                first: times.first().copied().unwrap_or_default(),
                last: times.last().copied().unwrap_or_default(),
            },
            fields: store.fields().to_vec(),
            functions,
            bytes: bytes_on_disk(&store.root)?,
            version: VersionInfo { store: root.tetreel_store, tetreel: root.tetreel, source: root.source, notes },
        })
    }
}

impl StoreInfo {
    /// The radii and volumes of a cloud, as far as the store says them.
    fn sizes_text(&self) -> String {
        let text = |name: &str| {
            let ends = self.mesh.repair.get("cloud")?.get(name)?;
            let [lo, hi] = [ends.get(0)?.as_f64()?, ends.get(1)?.as_f64()?].map(Short);
            Some(format!(", {name} {lo} to {hi}"))
        };
        ["radius", "volume"].into_iter().filter_map(text).collect()
    }
}

/// A range of values for a line of text.
pub(crate) fn range_text(range: Option<[f32; 2]>) -> String {
    range.map_or("no finite value".to_owned(), |[lo, hi]| format!("{} to {}", Short(lo), Short(hi)))
}

impl fmt::Display for StoreInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let without = if self.mesh.connectivity.is_full() { "" } else { ", without connectivity (drawn as points)" };
        match self.mesh.kind {
            StoredKind::Cells => {
                writeln!(f, "mesh     {} cells, {} vertices{without}", self.mesh.cells, self.mesh.vertices)?;
            }
            StoredKind::Points => writeln!(f, "cloud    {} points{}", self.mesh.vertices, self.sizes_text())?,
        }
        if let Some([lo, hi]) = self.mesh.bounds {
            writeln!(f, "bounds   {lo:?} to {hi:?}")?;
        }
        self.mesh.blocks.iter().try_for_each(|block| writeln!(f, "{block}"))?;
        let [first, last] = [self.time.first, self.time.last].map(Short);
        writeln!(f, "time     {} steps, {first} to {last}", self.time.steps)?;
        for field in &self.fields {
            let of = if field.values_of == Association::Cell { " of cells" } else { "" };
            write!(f, "field    {} ({}{of}), {}", field.name, field.codec, range_text(field.range))?;
            if let Some(units) = &field.units {
                write!(f, " {units}")?;
            }
            if let Some(quality) = &field.quality {
                match quality.snr_db {
                    Some(snr) => write!(f, ", SNR {snr:.1} dB, errors up to {:.3e}", quality.max_error)?,
                    None => write!(f, ", without error")?,
                }
            }
            if field.nonfinite > 0 {
                write!(f, ", {} values not finite", field.nonfinite)?;
            }
            writeln!(f)?;
        }
        self.functions.iter().try_for_each(|functions| writeln!(f, "{functions}"))?;
        self.version.notes.iter().try_for_each(|note| writeln!(f, "note     {note}"))?;
        writeln!(f, "size     {:.1} MB", self.bytes as f64 / 1e6)?;
        write!(f, "written  by tetreel {} as store {}", self.version.tetreel, self.version.store)?;
        if !self.version.source.is_empty() {
            write!(f, " from {}", self.version.source)?;
        }
        Ok(())
    }
}
