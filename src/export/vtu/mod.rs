//! Export of a series as `.vtu` files and a `.pvd` with their times, for ParaView and VTK.
//!
//! The values are those of the source, f32 and exact; the format cannot share a mesh between files, so each repeats it.

mod piece;
#[cfg(test)]
mod tests;

use super::appended::Values;
use super::collection::{Collection, NewCollection, file_name};
use super::folder::NewFolder;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::RawMesh;
use crate::task::{Cancel, Progress};
use serde::Serialize;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// Selection and name of the exported series.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VtuOptions {
    /// Prefix of the file names; `None`: the name of the folder.
    pub name: Option<String>,
    /// Names of the fields to write, with all their components; empty: all fields.
    pub fields: Vec<String>,
    /// Steps to write, in this order; `None`: all steps.
    pub steps: Option<Vec<usize>>,
}

/// Report of an export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct VtuReport {
    /// The `.pvd` file.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub pvd: PathBuf,
    /// Number of `.vtu` files.
    pub steps: usize,
    /// Bytes of all files.
    pub bytes: u64,
}

impl fmt::Display for VtuReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pvd, steps, bytes } = self;
        writeln!(f, "{}: {steps} steps, {:.1} MB", pvd.display(), *bytes as f64 / 1e6)
    }
}

/// Why a series was not written. No files are left behind.
#[derive(Debug, thiserror::Error)]
pub enum VtuError {
    /// The source could not be read, lacks what was asked for, or a file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The export was cancelled.
    #[error("cancelled; nothing was written")]
    Cancelled,
}

/// Writes the steps of `source` into the new folder `dir`: `NAME.pvd`, `NAME_0000.vtu`, `NAME_0001.vtu` and so on, counted from 0 whatever
/// steps were chosen. `dir` may exist if it is empty.
///
/// # Errors
/// If `dir` exists and is not empty, the source cannot be read or contradicts itself, a field or step does not exist, a
/// name cannot be written, the disk is full, or `cancel` was raised.
pub fn write_series(
    source: &dyn SeriesSource,
    dir: &Path,
    options: &VtuOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VtuReport, VtuError> {
    let name = file_name(dir, options.name.as_deref())?;
    let mut chosen = Chosen::of(source, options)?;
    let folder = NewFolder::begin(dir)?;
    let mut list = Collection::new(&name, "", "vtu");
    let bytes = chosen.write(source, &mut list, folder.path(), progress, cancel)?;
    let path = folder.path().join(format!("{name}.pvd"));
    let text = list.finish();
    fs::write(&path, &text).map_err(|e| FileError::io(&path, "write", &e))?;
    folder.finish()?;
    let steps = chosen.steps.len();
    Ok(VtuReport { pvd: dir.join(format!("{name}.pvd")), steps, bytes: bytes + text.len() as u64 })
}

/// Writes the steps of `source` as the collection `pvd` with its `.vtu` files in a new folder beside it: `run.pvd`, and `run/run_0000.vtu`
/// and so on, as ParaView does. `options.name` is ignored.
///
/// # Errors
/// As for [`write_series`]; if `pvd` does not end in `.pvd`, or it or the folder exists.
pub fn write_collection(
    source: &dyn SeriesSource,
    pvd: &Path,
    options: &VtuOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VtuReport, VtuError> {
    let place = NewCollection::at(pvd)?;
    let mut chosen = Chosen::of(source, options)?;
    let mut collection = place.begin("vtu")?;
    let dir = collection.folder.path().to_owned();
    let bytes = chosen.write(source, &mut collection.list, &dir, progress, cancel)?;
    let bytes = bytes + collection.finish()?;
    Ok(VtuReport { pvd: pvd.to_owned(), steps: chosen.steps.len(), bytes })
}

/// The selected fields and steps of an export.
struct Chosen {
    values: Vec<Values>,
    steps: Vec<usize>,
}

impl Chosen {
    fn of(source: &dyn SeriesSource, options: &VtuOptions) -> FileResult<Self> {
        let values = choose_fields(source, &options.fields)?.into_iter().map(Values::empty).collect();
        Ok(Self { values, steps: choose_steps(&source.describe(), source.times(), options.steps.as_deref())? })
    }

    /// Writes the `.vtu` files to the folder `dir` and adds them to the list; returns their size in bytes.
    fn write(
        &mut self,
        source: &dyn SeriesSource,
        list: &mut Collection,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<u64, VtuError> {
        let mesh = source.mesh()?;
        check_mesh(source, &mesh)?;
        progress.begin("export", self.steps.len() as u64, "steps");
        let mut bytes = 0;
        let mut write = |step: usize| {
            if cancel.is_cancelled() {
                return Err(VtuError::Cancelled);
            }
            for field in &mut self.values {
                read_field(source, field, step, &mesh)?;
            }
            let time = source.times().values[step];
            bytes += piece::write(&dir.join(list.add(time)), &mesh, time, &self.values)?;
            progress.advance(1);
            Ok(())
        };
        let written = self.steps.iter().try_for_each(|&step| write(step));
        progress.end();
        written.map(|()| bytes)
    }
}

/// Reads all components of a field at a step.
fn read_field(source: &dyn SeriesSource, field: &mut Values, step: usize, mesh: &RawMesh) -> FileResult<()> {
    let expected = match field.info.association {
        Association::Point => mesh.points.len(),
        Association::Cell => mesh.cells.len(),
    };
    for (component, values) in field.components.iter_mut().enumerate() {
        source.read(&field.info, Component::Index(component), step, values)?;
        if values.len() != expected {
            let problem = format!("has {} values at step {step} where the mesh needs {expected}", values.len());
            return Err(FileError::invalid(source.describe(), format!("field '{}'", field.info.name), problem));
        }
    }
    Ok(())
}

/// The selected fields, or all.
fn choose_fields(source: &dyn SeriesSource, names: &[String]) -> FileResult<Vec<FieldInfo>> {
    if names.is_empty() {
        return Ok(source.fields().to_vec());
    }
    let find = |name: &String| {
        source.fields().iter().find(|f| f.name == *name).cloned().ok_or_else(|| {
            let there: Vec<&str> = source.fields().iter().map(|f| f.name.as_str()).collect();
            FileError::invalid(source.describe(), format!("field '{name}'"), "does not exist")
                .remedy(format!("choose from {}", there.join(", ")))
        })
    };
    names.iter().map(find).collect()
}

/// The selected steps, or all; fails for a step beyond the series or without a finite time.
pub(super) fn choose_steps(source: &str, times: &TimeAxis, steps: Option<&[usize]>) -> FileResult<Vec<usize>> {
    let times = &times.values;
    let steps = steps.map_or_else(|| (0..times.len()).collect(), <[usize]>::to_vec);
    for &step in &steps {
        let invalid = |problem| Err(FileError::invalid(source, format!("step {step}"), problem));
        match times.get(step) {
            None => return invalid(format!("does not exist: the series has {} steps", times.len())),
            Some(time) if !time.is_finite() => return invalid(format!("has the time {time}")),
            Some(_) => {}
        }
    }
    Ok(steps)
}

/// Checks that every index is a point: readers trust the connectivity.
fn check_mesh(source: &dyn SeriesSource, mesh: &RawMesh) -> FileResult<()> {
    let points = mesh.points.len();
    match mesh.cells.iter().position(|cell| cell.iter().any(|v| *v as usize >= points)) {
        None => Ok(()),
        Some(cell) => {
            let problem = format!("has a vertex beyond the {points} points");
            Err(FileError::invalid(source.describe(), format!("cell {cell}"), problem))
        }
    }
}
