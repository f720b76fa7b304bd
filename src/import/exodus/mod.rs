//! Reader of Exodus II files: netCDF in any of its formats, with a mesh in blocks of elements and the values of all steps.
//!
//! The mesh is read when it is asked for, values one variable and one step at a time. Variables that differ in their last letters alone are
//! the components of one array: `disp_x`, `disp_y`, `disp_z`.

mod blocks;
mod database;
mod faces;
mod netcdf;
mod step;
#[cfg(test)]
mod tests;
mod vectors;

use super::format::Format;
use super::hdf;
use super::series::Series;
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use database::Database;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::ExodusStep;

/// Exodus files: each holds all steps.
pub(super) const FORMAT: Format = Format {
    name: "Exodus II",
    extensions: &["e", "exo", "ex2", "exii", "g", "gen"],
    joins: false,
    recognises: |head| {
        let is_classic = [1, 2, 5].iter().any(|&version| head.begins_with(&[b'C', b'D', b'F', version]));
        is_classic || (head.begins_with(hdf::MAGIC) && head.has(b"connect1"))
    },
    open,
    files: |_| Ok(Vec::new()),
};

/// Opens a file, the only one of `paths`.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "an Exodus file is opened alone")) };
    let database = Arc::new(Database::open(path)?);
    let mut notes = database.notes();
    notes.extend(later_meshes(path));
    let mut steps: Vec<(f64, usize)> = database.times.iter().copied().zip(0..).collect();
    if steps.is_empty() {
        notes.push("the file has no steps: its mesh is at time 0".to_owned());
        steps.push((0.0, 0));
    }
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = steps.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let problem = format!("steps {} and {} have the same time {}", pair[0].1, pair[1].1, pair[0].0);
        return Err(FileError::invalid(path, "variable 'time_whole'", problem).remedy("remove one of the two"));
    }
    let times = TimeAxis { values: steps.iter().map(|(time, _)| *time).collect() };
    let steps = steps.into_iter().map(|(_, step)| ExodusStep::new(database.clone(), step)).collect();
    Ok(Box::new(Series::<ExodusStep>::new(path.display().to_string(), times, steps, notes)?))
}

/// A note on the first file of a later mesh, as adaptive codes write them beside `NAME.e`.
fn later_meshes(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let later = ["-s002", "-s0002"].map(|end| path.with_file_name(format!("{name}{end}")));
    let found = later.iter().find(|later| later.is_file())?;
    Some(format!("the mesh is that of this file alone: {} has a later one", found.display()))
}

/// Why a file is not read whose name is that of a part of an Exodus output, and the remedy.
pub(super) fn refused_part(path: &Path) -> Option<(&'static str, &'static str)> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let is_exodus = |extension: &str| FORMAT.extensions.contains(&extension);
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match name.split('.').rev().collect::<Vec<_>>()[..] {
        [part, parts, extension, _, ..] if is_number(part) && is_number(parts) && is_exodus(extension) => {
            Some(("is a part of an Exodus file, which is not read by itself", "join the parts with epu"))
        }
        [last, _, ..] if last.split_once("-s").is_some_and(|(e, number)| is_exodus(e) && is_number(number)) => Some((
            "is an Exodus file of a later mesh of an adaptive run, which is not read by this name",
            "copy it to a name that ends in .e, and import it to a store of its own",
        )),
        _ => None,
    }
}
