//! Isosurfaces, plane sections and the boundary of a series as files of triangles: `.vtp` (VTK's XML PolyData) and `.ply`.
//!
//! Points are in world coordinates, f64, in the file's units; fields are f32 per point, or per triangle if cells have the values.
//! `mesh::contour` defines the surfaces, their orientation, and the case of a vertex with exactly the isovalue. A cell is a hole at a step
//! where a selected field is not finite in it or at one of its vertices.

mod output;
mod ply;
mod step;
mod vtp;

use super::stored::{Group, chosen};
use super::vtu::choose_steps;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldSelector};
use crate::render::surfaces::Cut;
use crate::short::Short;
use crate::store::{Store, StoredField};
use crate::task::{Cancel, Progress};
use output::Place;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use step::Steps;

/// The kind of surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Isosurfaces of these values, in the field's units, all in one file.
    Isovalues(Vec<f64>),
    /// Plane section of the mesh.
    Plane(Cut),
    /// Boundary: faces with a cell on one side only.
    Boundary,
}

/// Selection of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// The surface.
    pub shape: Shape,
    /// Fields to write; empty: all. An isosurface needs one scalar field.
    pub fields: Vec<FieldSelector>,
    /// Steps to write, in this order; `None`: all steps.
    pub steps: Option<Vec<usize>>,
}

/// Report of an export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SurfaceReport {
    /// Path of the `.pvd` file or single file, or the pattern of the files.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub output: PathBuf,
    /// Number of written surface files.
    pub steps: usize,
    /// Number of surface files without triangles.
    pub empty_steps: usize,
    /// Number of triangles over all steps.
    pub triangles: u64,
    /// Number of points over all steps.
    pub points: u64,
    /// Number of triangles left out because their area is zero.
    pub dropped_triangles: u64,
    /// Bytes of all files.
    pub bytes: u64,
}

impl fmt::Display for SurfaceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { output, steps, empty_steps, triangles, points, dropped_triangles, bytes } = self;
        let megabytes = *bytes as f64 / 1e6;
        write!(f, "{}: {steps} steps, {triangles} triangles of {points} points, {megabytes:.1} MB", output.display())?;
        if *empty_steps > 0 {
            write!(f, "; {empty_steps} steps have no triangle")?;
        }
        if *dropped_triangles > 0 {
            write!(f, "; {dropped_triangles} triangles without area are left out")?;
        }
        writeln!(f)
    }
}

/// Why no surface was written. No files are left behind.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// The store could not be read, lacks what was asked for, or a file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The isovalue is outside of the range of the whole series, or NaN.
    #[error("isovalue {} is never met: field {field} {}; choose a value in between", Short(*.value), range_text(*.range))]
    OutOfRange {
        /// The isovalue.
        value: f64,
        /// The field.
        field: String,
        /// Its range; `None` if it has no finite value.
        range: Option<[f32; 2]>,
    },
    /// The whole mesh is on one side of the plane.
    #[error("the plane {plane} does not meet the mesh, whose box goes from {lo:?} to {hi:?}; choose a point in it")]
    Missed {
        /// The plane.
        plane: Cut,
        /// Lower corner of the mesh's box.
        lo: [f64; 3],
        /// Upper corner of the mesh's box.
        hi: [f64; 3],
    },
    /// The export was cancelled.
    #[error("cancelled; nothing was written")]
    Cancelled,
}

fn range_text(range: Option<[f32; 2]>) -> String {
    match range {
        Some([lo, hi]) => format!("goes from {} to {}", Short(lo), Short(hi)),
        None => "has no finite value".to_owned(),
    }
}

/// Writes the surfaces of the steps of `store`, one step in memory at a time. `output` gives the format: `run.pvd` is written with
/// `run/run_0000.vtp` and so on; `run_%04d.vtp` and `run_%04d.ply` are counted from 0 whatever steps were chosen, and `run.ply` is a single
/// step. The paths must be free, and all files appear together at the end.
///
/// # Errors
/// If a path is taken or invalid, the store cannot be read, a field or step does not exist, an isosurface is of several fields or a vector,
/// an isovalue or a plane misses the mesh, the disk is full, or `cancel` was raised.
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

/// The single scalar field of an isosurface.
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
    if one.info.association == Association::Cell {
        let error =
            unsupported(&format!("'{}' has values of cells, constant in each, and so no isosurfaces", one.info.name));
        return Err(error.remedy("import the series with --cells-to-points"));
    }
    // Elsewhere a vector's name alone means its magnitude.
    let asked = selectors.first().filter(|asked| asked.component.is_none() && asked.name != one.info.name);
    if one.components.len() != 1 || asked.is_some() {
        let name = asked.map_or(&one.info.name, |asked| &asked.name);
        let error = unsupported(&format!("'{name}' is a vector, and an isosurface is of one number"));
        return Err(error.remedy(format!("choose {name}:mag or {name}:0")));
    }
    Ok(one)
}

fn check_isovalues(values: &[f64], field: &StoredField) -> Result<(), SurfaceError> {
    // NaN is outside of every range.
    let is_met = |value: f64| field.range.is_some_and(|[lo, hi]| value >= f64::from(lo) && value <= f64::from(hi));
    match values.iter().find(|value| !is_met(**value)) {
        None => Ok(()),
        Some(&value) => Err(SurfaceError::OutOfRange { value, field: field.name.clone(), range: field.range }),
    }
}
