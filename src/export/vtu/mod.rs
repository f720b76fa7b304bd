//! A series as `.vtu` files with a `.pvd` that gives their times: what ParaView and VTK open.
//!
//! The values are those of the source, f32 and exact; the format has no mesh shared by steps, so each file repeats it.

mod piece;
#[cfg(test)]
mod tests;
mod xml;

use super::folder::NewFolder;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, SeriesSource};
use crate::files;
use crate::mesh::RawMesh;
use crate::task::{Cancel, Progress};
use piece::Values;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// What of a series to write, and under which name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VtuOptions {
    /// First part of the file names; the name of the folder if there is none.
    pub name: Option<String>,
    /// Names of the fields to write, with all their components; all fields if there is none.
    pub fields: Vec<String>,
    /// Steps to write, in this order; all steps if there is none.
    pub steps: Option<Vec<usize>>,
}

/// What was written.
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

/// Why a series was not written. Nothing is left behind.
#[derive(Debug, thiserror::Error)]
pub enum VtuError {
    /// The source could not be read, lacks what was asked for, or a file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Somebody asked to stop.
    #[error("cancelled; nothing was written")]
    Cancelled,
}

/// Writes the steps of `source` into the new folder `dir`: `NAME.pvd`, `NAME_0000.vtu`, `NAME_0001.vtu` and so on, counted
/// from 0 whatever steps were chosen. An empty folder may be there already.
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
    let name = file_name(dir, options)?;
    let (folder, steps, text, bytes) = write_folder(source, dir, &name, "", options, progress, cancel)?;
    let path = folder.path().join(format!("{name}.pvd"));
    fs::write(&path, &text).map_err(|e| FileError::io(&path, "write", &e))?;
    folder.finish()?;
    Ok(VtuReport { pvd: dir.join(format!("{name}.pvd")), steps, bytes: bytes + text.len() as u64 })
}

/// Writes the steps of `source` as the collection `pvd` with its `.vtu` files in a new folder beside it: `run.pvd`, and
/// `run/run_0000.vtu` and so on, as ParaView saves a series. `options.name` is not used.
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
    if pvd.extension().is_none_or(|e| !e.eq_ignore_ascii_case("pvd")) {
        return Err(FileError::unsupported(pvd, "", "a series is written as a .pvd file").remedy("name it so").into());
    }
    let check_free = || match fs::symlink_metadata(pvd) {
        Ok(_) => Err(FileError::invalid(pvd, "", "exists").remedy("choose another name or remove it")),
        Err(_) => Ok(()),
    };
    check_free()?;
    let dir = pvd.with_extension("");
    let name = file_name(&dir, &VtuOptions::default())?;
    // The collection names it in text; where the name of `pvd` is none, it has the name of its files.
    let dir = dir.with_file_name(&name);
    let prefix = format!("{name}/");
    let (folder, steps, text, bytes) = write_folder(source, &dir, &name, &prefix, options, progress, cancel)?;
    check_free()?;
    folder.finish()?;
    if let Err(error) = files::replace_with(pvd, text.as_bytes()) {
        // Without the list of its files the folder is of no use, and would be in the way of the next attempt.
        let _ = fs::remove_dir_all(&dir);
        return Err(error.into());
    }
    Ok(VtuReport { pvd: pvd.to_owned(), steps, bytes: bytes + text.len() as u64 })
}

/// Writes the `.vtu` files beside the folder `dir` to be. Also returns their number, the text of the collection, in
/// which `prefix` stands before the names of the files, and the bytes written.
fn write_folder(
    source: &dyn SeriesSource,
    dir: &Path,
    name: &str,
    prefix: &str,
    options: &VtuOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(NewFolder, usize, String, u64), VtuError> {
    let mut values: Vec<Values> = choose_fields(source, &options.fields)?.into_iter().map(Values::empty).collect();
    let steps = choose_steps(source, options.steps.as_deref())?;
    let folder = NewFolder::begin(dir)?;
    let mesh = source.mesh()?;
    check_mesh(source, &mesh)?;
    progress.begin("export", steps.len() as u64, "steps");
    let writer = Files { source, mesh: &mesh, dir: folder.path(), name, prefix };
    let written = writer.write(&steps, &mut values, progress, cancel);
    progress.end();
    let (text, bytes) = written?;
    Ok((folder, steps.len(), text, bytes))
}

/// Where the files come from and go to.
struct Files<'a> {
    source: &'a dyn SeriesSource,
    mesh: &'a RawMesh,
    dir: &'a Path,
    name: &'a str,
    prefix: &'a str,
}

impl Files<'_> {
    /// Writes the `.vtu` files; returns the text of their `.pvd` file and their size in bytes.
    fn write(
        &self,
        steps: &[usize],
        values: &mut [Values],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(String, u64), VtuError> {
        let mut collection = Collection::new(self.name, self.prefix);
        let mut bytes = 0;
        for &step in steps {
            if cancel.is_cancelled() {
                return Err(VtuError::Cancelled);
            }
            for field in values.iter_mut() {
                read_field(self.source, field, step, self.mesh)?;
            }
            let time = self.source.times().values[step];
            bytes += piece::write(&self.dir.join(collection.add(time)), self.mesh, time, values)?;
            progress.advance(1);
        }
        Ok((collection.finish(), bytes))
    }
}

/// The text of a `.pvd` file.
struct Collection<'a> {
    name: &'a str,
    prefix: &'a str,
    text: String,
    files: usize,
}

impl<'a> Collection<'a> {
    fn new(name: &'a str, prefix: &'a str) -> Self {
        let text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
            <VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
            <Collection>\n";
        Self { name, prefix, text: text.to_owned(), files: 0 }
    }

    /// Adds the next file and returns its name.
    fn add(&mut self, time: f64) -> String {
        let file = format!("{}_{:04}.vtu", self.name, self.files);
        self.files += 1;
        // The name was checked, so XML can express it. `{:?}` is the shortest decimal that reads back as the same f64.
        let attribute = xml::attribute(&format!("{}{file}", self.prefix)).unwrap_or_default();
        self.text += &format!("<DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{attribute}\"/>\n");
        file
    }

    fn finish(self) -> String {
        self.text + "</Collection>\n</VTKFile>\n"
    }
}

/// Reads all components of a field at a step.
fn read_field(source: &dyn SeriesSource, field: &mut Values, step: usize, mesh: &RawMesh) -> FileResult<()> {
    let expected = match field.info.association {
        Association::Point => mesh.points.len(),
        Association::Cell => mesh.tets.len(),
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

/// The fields asked for, or all.
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

/// The steps asked for, or all; none beyond the series, all with a finite time.
fn choose_steps(source: &dyn SeriesSource, steps: Option<&[usize]>) -> FileResult<Vec<usize>> {
    let times = &source.times().values;
    let steps = steps.map_or_else(|| (0..times.len()).collect(), <[usize]>::to_vec);
    for &step in &steps {
        let invalid = |problem| Err(FileError::invalid(source.describe(), format!("step {step}"), problem));
        match times.get(step) {
            None => return invalid(format!("does not exist: the series has {} steps", times.len())),
            Some(time) if !time.is_finite() => return invalid(format!("has the time {time}")),
            Some(_) => {}
        }
    }
    Ok(steps)
}

/// The first part of the file names.
fn file_name(dir: &Path, options: &VtuOptions) -> FileResult<String> {
    let from_folder = || dir.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = options.name.clone().unwrap_or_else(from_folder);
    let plain = Path::new(&name).file_name().is_some_and(|n| n.to_str() == Some(&name));
    if !plain || name.contains(['/', '\\']) || xml::attribute(&name).is_none() {
        let problem = format!("'{}' cannot begin the names of files", name.escape_debug());
        return Err(FileError::invalid(dir, "name", problem).remedy("give a name without separators"));
    }
    Ok(name)
}

/// A reader trusts the connectivity, so every index must be a point.
fn check_mesh(source: &dyn SeriesSource, mesh: &RawMesh) -> FileResult<()> {
    let points = mesh.points.len();
    match mesh.tets.iter().position(|tet| tet.iter().any(|v| *v as usize >= points)) {
        None => Ok(()),
        Some(cell) => {
            let problem = format!("has a vertex beyond the {points} points");
            Err(FileError::invalid(source.describe(), format!("cell {cell}"), problem))
        }
    }
}
