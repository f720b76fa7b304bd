//! Reports and errors of an import.

use super::compression::CompressionReport;
use crate::error::{FileError, FileErrorKind};
use crate::field::Association;
use crate::mesh::{MeshError, RepairReport};
use crate::short::Short;
use crate::store::range_text;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Why an import failed. No files are then left behind, but for checkpoints, and an existing store is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// A file could not be written, or the source lacks what was asked for or does not fit the store.
    #[error(transparent)]
    File(#[from] FileError),
    /// The source could not be read. If it is being written, a later attempt may succeed.
    #[error(transparent)]
    Source(FileError),
    /// The points and cells of the source are not a valid mesh.
    #[error("{source_name}: {error}")]
    Mesh {
        /// Name of the source.
        source_name: String,
        /// The mesh error.
        error: MeshError,
    },
    /// The import was cancelled.
    #[error("cancelled; no store was written")]
    Cancelled,
}

impl IngestError {
    /// Whether a half-written source may be the cause: damaged, cut or missing files. A complete but unusable source (a mesh that changes,
    /// another kind of file) does not count.
    pub fn may_be_half_written(&self) -> bool {
        matches!(self, Self::Source(error) if error.kind != FileErrorKind::Unsupported)
    }

    /// The file concerned, if there is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(error) | Self::Source(error) => Some(&error.path),
            Self::Mesh { .. } | Self::Cancelled => None,
        }
    }
}

/// Report of an import.
#[derive(Clone, Debug, Serialize)]
pub struct IngestReport {
    /// Description of the source.
    pub source: String,
    /// The store.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub output: PathBuf,
    /// What was found and repaired in the mesh.
    pub repair: RepairReport,
    /// Number of steps imported.
    pub steps: usize,
    /// Times of the first and the last imported step.
    pub times: [f64; 2],
    /// The fields of the store.
    pub fields: Vec<FieldReport>,
    /// Bytes of values read from the source (as f32).
    pub bytes_read: u64,
    /// Bytes of the store.
    pub bytes_written: u64,
    /// What was skipped in the source.
    pub notes: Vec<String>,
    /// Duration of each stage.
    pub seconds: StageSeconds,
    /// Megabytes of values per second over the whole import.
    pub megabytes_per_second: f64,
}

/// Report of a field.
#[derive(Clone, Debug, Serialize)]
pub struct FieldReport {
    /// Name in the store.
    pub name: String,
    /// Association of the values in the source.
    pub association: Association,
    /// What has the values in the store.
    pub values_of: Association,
    /// Least and greatest finite value; `None` if there is none.
    pub range: Option<[f32; 2]>,
    /// Number of NaN and infinite values.
    pub nonfinite: u64,
    /// The steps that have such values, and how many.
    pub nonfinite_steps: Vec<(usize, u64)>,
    /// Bytes of its chunks.
    pub bytes: u64,
    /// Sizes and errors, if the values were compressed.
    pub compression: Option<CompressionReport>,
}

/// Seconds of each stage. Reading overlaps with the others, so they do not add up to the total.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StageSeconds {
    /// Reading and building the mesh, and writing it.
    pub mesh: f64,
    /// Reading the values of the steps.
    pub read: f64,
    /// Reordering values to vertex order, and computing magnitudes.
    pub order: f64,
    /// Ranges and moments.
    pub moments: f64,
    /// Encoding and writing.
    pub encode: f64,
    /// Writing statistics and metadata, flushing, moving into place.
    pub finish: f64,
    /// The whole import.
    pub total: f64,
}

impl fmt::Display for IngestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} -> {}", self.source, self.output.display())?;
        writeln!(f, "mesh: {}", self.repair)?;
        writeln!(f, "steps: {}, time {} to {}", self.steps, Short(self.times[0]), Short(self.times[1]))?;
        for field in &self.fields {
            write!(f, "field {}: {}", field.name, range_text(field.range))?;
            match (field.association, field.values_of) {
                (Association::Cell, Association::Point) => write!(f, ", averaged from cells to vertices")?,
                (_, Association::Cell) => write!(f, ", of cells")?,
                _ => {}
            }
            if field.nonfinite > 0 {
                let steps = match &field.nonfinite_steps[..] {
                    [(step, _)] => format!("step {step}"),
                    [(first, _), .., (last, _)] => {
                        format!("{} steps from {first} to {last}", field.nonfinite_steps.len())
                    }
                    [] => "no step".to_owned(),
                };
                write!(f, ", {} values not finite, in {steps}", field.nonfinite)?;
            }
            writeln!(f)?;
            if let Some(compression) = &field.compression {
                writeln!(f, "{compression}")?;
            }
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        let s = &self.seconds;
        writeln!(
            f,
            "seconds: mesh {:.2}, read {:.2}, order {:.2}, moments {:.2}, encode {:.2}, finish {:.2}, \
             total {:.2}",
            s.mesh, s.read, s.order, s.moments, s.encode, s.finish, s.total
        )?;
        let [read, written] = [self.bytes_read, self.bytes_written].map(|bytes| bytes as f64 / 1e6);
        write!(f, "{read:.1} MB read, {written:.1} MB written, {:.0} MB/s", self.megabytes_per_second)
    }
}
