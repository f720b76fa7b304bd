//! Isosurfaces, plane sections and the boundary of a series as files of triangles: `.vtp` (VTK's XML PolyData) and `.ply`.
//!
//! Points are in world coordinates, f64, in the file's units; fields are f32 of points. `mesh::contour` says where surfaces are, how
//! they are oriented and what happens where a vertex has the very value. A cell is a hole at a step where a chosen field has no finite
//! value at one of its vertices.

mod output;
mod ply;
mod step;
mod vtp;

use super::stored::{Group, chosen};
use super::vtu::choose_steps;
use crate::error::{FileError, FileResult};
use crate::field::FieldSelector;
use crate::render::surfaces::Cut;
use crate::short::Short;
use crate::store::{Store, StoredField};
use crate::task::{Cancel, Progress};
use output::Place;
use serde::Serialize;
use std::path::{Path, PathBuf};
use step::Steps;

/// Which surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Where a scalar has these values, in the field's units, all in one file.
    Isovalues(Vec<f64>),
    /// Where a plane cuts the mesh.
    Plane(Cut),
    /// The faces with a cell on one side only.
    Boundary,
}

/// What to write.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// Which surface.
    pub shape: Shape,
    /// Fields to write; all if there is none. Of isosurfaces the one field, of one number.
    pub fields: Vec<FieldSelector>,
    /// Steps to write, in this order; all steps if there is none.
    pub steps: Option<Vec<usize>>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SurfaceReport {
    /// The `.pvd` file, the file, or the pattern of the files.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub output: PathBuf,
    /// Number of files with a surface.
    pub steps: usize,
    /// Number of these files without a triangle.
    pub empty_steps: usize,
    /// Triangles of all steps.
    pub triangles: u64,
    /// Points of all steps.
    pub points: u64,
    /// Triangles without area that were left out.
    pub dropped_triangles: u64,
    /// Bytes of all files.
    pub bytes: u64,
}

/// Why no surface was written. Nothing is left behind.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// The store could not be read, lacks what was asked for, or a file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The isovalue lies outside of the range of the whole series, or is not a number.
    #[error("isovalue {} is never met: field {field} {}; choose a value in between", Short(*.value), range_text(*.range))]
    OutOfRange {
        /// The isovalue.
        value: f64,
        /// The field.
        field: String,
        /// Its range; `None` if it has no finite value.
        range: Option<[f32; 2]>,
    },
    /// All of the mesh lies on one side of the plane.
    #[error("the plane {plane} does not meet the mesh, whose box goes from {lo:?} to {hi:?}; choose a point in it")]
    Missed {
        /// The plane.
        plane: Cut,
        /// The lower corner of the box.
        lo: [f64; 3],
        /// The upper one.
        hi: [f64; 3],
    },
    /// Somebody asked to stop.
    #[error("cancelled; nothing was written")]
    Cancelled,
}

fn range_text(range: Option<[f32; 2]>) -> String {
    match range {
        Some([lo, hi]) => format!("goes from {} to {}", Short(lo), Short(hi)),
        None => "has no finite value".to_owned(),
    }
}

/// Writes the surfaces of the steps of `store`, one step in memory at a time. `output` says the format: `run.pvd` makes it and
/// `run/run_0000.vtp` and so on; `run_%04d.vtp` and `run_%04d.ply` are counted from 0 whatever steps were chosen, and `run.ply` is a
/// single step. Nothing may be in their places, where all files appear together at the end.
///
/// # Errors
/// If a place is taken or no name for this, the store cannot be read, a field or step does not exist, an isosurface is of several fields
/// or a vector, an isovalue is never met, a plane misses the mesh, the disk is full, or `cancel` was raised.
pub fn write_surfaces(
    store: &Store,
    output: &Path,
    options: &SurfaceOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<SurfaceReport, SurfaceError> {
    let steps = choose_steps(&store.path().display().to_string(), store.times(), options.steps.as_deref())?;
    let place = Place::of(output, steps.len())?;
    let groups = match &options.shape {
        Shape::Isovalues(values) => {
            let group = scalar(store, &options.fields)?;
            check_isovalues(values, group.components[0].info())?;
            vec![group]
        }
        Shape::Plane(_) | Shape::Boundary => chosen(store, &options.fields)?,
    };
    let mut source = Steps::new(store, &options.shape, groups)?;
    let mut files = place.begin()?;
    let mut report = SurfaceReport {
        output: output.to_owned(),
        steps: steps.len(),
        empty_steps: 0,
        triangles: 0,
        points: 0,
        dropped_triangles: 0,
        bytes: 0,
    };
    progress.begin("export", steps.len() as u64, "steps");
    let mut write = |step: usize| {
        if cancel.is_cancelled() {
            return Err(SurfaceError::Cancelled);
        }
        let surface = source.surface(step)?;
        report.bytes += files.write(&surface)?;
        report.empty_steps += usize::from(surface.triangles.is_empty());
        report.triangles += surface.triangles.len() as u64;
        report.points += surface.points.len() as u64;
        report.dropped_triangles += surface.dropped;
        progress.advance(1);
        Ok(())
    };
    let written = steps.iter().try_for_each(|&step| write(step));
    progress.end();
    written?;
    report.bytes += files.finish()?;
    Ok(report)
}

/// The one field of an isosurface.
fn scalar(store: &Store, selectors: &[FieldSelector]) -> FileResult<Group> {
    let mut groups = chosen(store, selectors)?;
    let unsupported = |problem: &str| FileError::unsupported(store.path(), "fields", problem);
    let one = match (groups.pop(), groups.is_empty()) {
        (Some(one), true) => one,
        _ => {
            let names: Vec<&str> = store.fields().iter().map(|f| f.name.as_str()).collect();
            let remedy = format!("choose one of {}", names.join(", "));
            return Err(unsupported("an isosurface is of one field").remedy(remedy));
        }
    };
    // Elsewhere the name of a vector alone means its magnitude.
    let asked = selectors.first().filter(|asked| asked.component.is_none() && asked.name != one.name);
    if one.components.len() != 1 || asked.is_some() {
        let name = asked.map_or(&one.name, |asked| &asked.name);
        let error = unsupported(&format!("'{name}' is a vector, and an isosurface is of one number"));
        return Err(error.remedy(format!("choose {name}:mag or {name}:0")));
    }
    Ok(one)
}

fn check_isovalues(values: &[f64], field: &StoredField) -> Result<(), SurfaceError> {
    // NaN is within no range.
    let is_met = |value: f64| field.range.is_some_and(|[lo, hi]| value >= f64::from(lo) && value <= f64::from(hi));
    match values.iter().find(|value| !is_met(**value)) {
        None => Ok(()),
        Some(&value) => Err(SurfaceError::OutOfRange { value, field: field.name.clone(), range: field.range }),
    }
}
