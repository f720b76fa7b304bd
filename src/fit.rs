//! Fits of functions to the series of a store, with a report on what they lose.
//!
//! [`crate::functions`] has the functions, [`crate::functions::report`] how they are judged, [`crate::store`] where they are kept.

use crate::codec::StepRequest;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldSelector};
use crate::functions::report::{Judged, Report, Samples};
use crate::functions::vertices::{VertexFunctions, VertexKernels};
use crate::mesh::Mesh;
use crate::store::{FieldReader, FunctionsInfo, FunctionsWriter, Store, StoreLock};
use crate::task::{Cancel, Progress};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Most steps that are judged unless they are chosen.
pub const STEPS_JUDGED: usize = 16;

/// How functions at the vertices are fitted, and judged.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// The functions.
    pub functions: VertexFunctions,
    /// The field that they are judged by; `None` for the first of vertices.
    pub field: Option<FieldSelector>,
    /// The steps that they are judged in; `None` for at most [`STEPS_JUDGED`] spread over the series.
    pub steps: Option<Vec<usize>>,
    /// The seed of the samples.
    pub seed: u64,
    /// Whether functions or a store that are there are replaced.
    pub overwrite: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { functions: VertexFunctions::default(), field: None, steps: None, seed: 1, overwrite: false }
    }
}

/// What a fit did.
#[derive(Clone, Debug, Serialize)]
pub struct Fitted {
    /// The store that has the functions.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub output: PathBuf,
    /// The functions, and their errors.
    #[serde(flatten)]
    pub functions: FunctionsInfo,
    /// Bytes of the functions.
    pub bytes: u64,
    /// Duration in seconds.
    pub seconds: f64,
}

impl fmt::Display for Fitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.functions)?;
        let (mb, seconds) = (self.bytes as f64 / 1e6, self.seconds);
        write!(f, "written  {}, {mb:.2} MB of functions, in {seconds:.1} s", self.output.display())
    }
}

/// Why a fit failed. No files are then left behind, and the store is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The store cannot be read or written, or has nothing that functions can be fitted to.
    #[error(transparent)]
    File(#[from] FileError),
    /// The fit was cancelled.
    #[error("cancelled; nothing was written")]
    Cancelled,
}

/// Fits functions at the vertices, and writes them into the store, or, with `out`, into a copy of it there.
///
/// # Errors
/// If the mesh has no functions, as points without cells or cells that are not joined; if the field has values of cells; if steps or files
/// cannot be read or written, or it is cancelled.
pub fn fit(
    store: &Store,
    out: Option<&Path>,
    options: &FitOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Fitted, FitError> {
    let start = Instant::now();
    let reader = store.field(&field_of(store, options.field.as_ref())?)?;
    if reader.info().values_of == Association::Cell {
        let place = format!("field '{}'", reader.info().name);
        let error =
            FileError::unsupported(store.path(), place, "has values of cells, functions have those of vertices");
        return Err(error.remedy("import the series with --cells-to-points, or choose another field (--field)").into());
    }
    let _lock = match out {
        None => Some(StoreLock::wait(store.path(), cancel).ok_or(FitError::Cancelled)?),
        Some(_) => None,
    };
    let writer = match out {
        None => FunctionsWriter::add(store, options.overwrite)?,
        Some(out) => FunctionsWriter::copy(store, out, options.overwrite)?,
    };
    let mesh = store.mesh()?;
    let fitted = fitted(store, &mesh, &options.functions)?;
    let report = judged(&reader, &mesh, &fitted, options, progress, cancel)?.ok_or(FitError::Cancelled)?;
    let functions = FunctionsInfo::of(&options.functions, &fitted, report);
    let bytes = writer.finish(&functions, &fitted.kernels, progress, cancel)?.ok_or(FitError::Cancelled)?;
    let output = out.unwrap_or(store.path()).to_owned();
    Ok(Fitted { output, functions, bytes, seconds: start.elapsed().as_secs_f64() })
}

/// The field that is asked for, else the first one of vertices, else the first.
fn field_of(store: &Store, asked: Option<&FieldSelector>) -> FileResult<FieldSelector> {
    let of_vertices = store.fields().iter().find(|field| field.values_of == Association::Point);
    let first = || Some(FieldSelector { name: of_vertices.or(store.fields().first())?.name.clone(), component: None });
    let none = || FileError::invalid(store.path(), "fields", "the store has no field");
    asked.cloned().or_else(first).ok_or_else(none)
}

/// The functions at the vertices of a mesh.
fn fitted(store: &Store, mesh: &Mesh, options: &VertexFunctions) -> FileResult<VertexKernels> {
    let refused = |problem: &str| FileError::unsupported(store.path(), "mesh", problem);
    if !mesh.is_cloud() && !mesh.is_connected {
        let error =
            refused("has cells that are not joined, so that functions at their vertices do not know of each other");
        return Err(error.remedy("if its cells fit together, import it with --connectivity full"));
    }
    options.of(mesh).map_err(|problem| refused(&problem))
}

/// The steps that are judged.
fn steps_of(asked: Option<&[usize]>, count: usize) -> Vec<usize> {
    match asked {
        Some(steps) => steps.to_vec(),
        None if count <= STEPS_JUDGED => (0..count).collect(),
        None => (0..STEPS_JUDGED).map(|i| i * (count - 1) / (STEPS_JUDGED - 1)).collect(),
    }
}

/// The errors of functions in some steps of a field; `None` if it was cancelled.
fn judged(
    reader: &FieldReader,
    mesh: &Mesh,
    fitted: &VertexKernels,
    options: &FitOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> FileResult<Option<Report>> {
    /// Steps that are in memory at a time.
    const TOGETHER: usize = 8;
    let steps = steps_of(options.steps.as_deref(), reader.step_count());
    let samples = Samples::of(mesh, Samples::PER_GROUP, options.seed);
    let mut judged = Judged::default();
    progress.begin("judging", steps.len() as u64, "steps");
    for together in steps.chunks(TOGETHER) {
        let mut values = Vec::new();
        for &step in together {
            let mut of_step = vec![0.0; reader.value_count()];
            if reader.decode_step_unless(StepRequest::whole(step, cancel), &mut of_step)?.is_none() {
                return Ok(None);
            }
            values.push((step, of_step));
        }
        if !samples.judge(&fitted.kernels, &values, &mut judged, cancel) {
            return Ok(None);
        }
        progress.advance(together.len() as u64);
    }
    progress.end();
    let info = reader.info();
    Ok(Some(samples.report(mesh, &judged, (&info.name, info.range), reader.step_count())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_are_judged_are_spread_over_the_series() {
        assert_eq!(steps_of(None, 3), [0, 1, 2]);
        assert_eq!(steps_of(None, STEPS_JUDGED), (0..STEPS_JUDGED).collect::<Vec<_>>());
        let spread = steps_of(None, 151);
        assert_eq!((spread.len(), spread[0], spread[1], spread[15]), (16, 0, 10, 150));
        assert!(steps_of(None, 17).is_sorted_by(|a, b| a < b));
        assert_eq!(steps_of(Some(&[4, 9]), 100), [4, 9]);
    }
}
