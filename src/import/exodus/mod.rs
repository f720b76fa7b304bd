//! Reader of Exodus II files: netCDF in any of its formats, with a mesh in blocks of elements and the values of all steps.
//!
//! The mesh is read when it is asked for, values one variable and one step at a time. Variables that differ in their last letters alone are
//! the components of one array: `disp_x`, `disp_y`, `disp_z`. The parts of a decomposed file (`NAME.e.4.0`, ...) are the pieces of each step.

mod blocks;
#[cfg(test)]
mod built;
mod database;
mod faces;
mod netcdf;
mod part_name;
#[cfg(test)]
mod part_tests;
mod step;
#[cfg(test)]
mod tests;
mod vectors;
mod whole;

pub(super) use part_name::{is_part, one_of_parts};

use super::format::Format;
use super::hdf;
use super::series::Series;
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use part_name::{all_parts, numbered};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::{ExodusStep, Origin};
use whole::Whole;

/// Exodus files: each holds all steps, of the mesh or of a part of it.
pub(super) const FORMAT: Format = Format {
    name: "Exodus II",
    extensions: &["e", "exo", "ex2", "exii", "g", "gen"],
    joins: false,
    recognises: |head| {
        let is_classic = [1, 2, 5].iter().any(|&version| head.begins_with(&[b'C', b'D', b'F', version]));
        is_classic || (head.begins_with(hdf::MAGIC) && head.has(b"connect1"))
    },
    open,
    files: all_parts,
};

/// Opens a file, or the parts of the one of which it is a part.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "an Exodus file is opened alone")) };
    let files = all_parts(path)?;
    let whole = Arc::new(Whole::open(&files)?);
    let mut notes = whole.notes.clone();
    notes.extend(later_meshes(path));
    let mut steps: Vec<(f64, usize)> = whole.times.iter().copied().zip(0..).collect();
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
    let steps = steps.into_iter().map(|(_, step)| Origin { whole: whole.clone(), step }).collect();
    let description = match &files[..] {
        [first, .., last] => format!("{} .. {} ({} parts)", first.display(), last.display(), files.len()),
        _ => path.display().to_string(),
    };
    Ok(Box::new(Series::<ExodusStep>::new(description, times, steps, notes)?))
}

/// The name of the first file of a later mesh, as adaptive codes write it beside `NAME.e`: what follows that name in it.
const LATER: [&str; 2] = ["-s002", "-s0002"];

/// A note on such a file of a later mesh.
fn later_meshes(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let (whole, end) = numbered(&name).map_or((name.as_str(), ""), |(whole, ..)| (whole, &name[whole.len()..]));
    let later = LATER.map(|number| path.with_file_name(format!("{whole}{number}{end}")));
    let found = later.iter().find(|later| later.is_file())?;
    Some(format!("the mesh is that of this file alone: {} has a later one", found.display()))
}

/// Why a file is not read whose name is that of a later mesh, and the remedy.
pub(super) fn refused_by_name(path: &Path) -> Option<(&'static str, &'static str)> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    let whole = numbered(&name).map_or(name.as_str(), |(whole, ..)| whole);
    let (extension, number) = whole.rsplit_once('.')?.1.split_once("-s")?;
    let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    (is_number && FORMAT.extensions.contains(&extension)).then_some((
        "is an Exodus file of a later mesh of an adaptive run, which is not read by this name",
        "copy it, with all its parts, to a name without '-s' and the number, and import it to a store of its own",
    ))
}
