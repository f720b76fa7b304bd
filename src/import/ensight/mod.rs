//! Reader of EnSight Gold: a case file, which names files of geometry and of variables, as text or C binary.
//!
//! A step in memory is its geometry file and where the parts lie in it; a geometry that all steps share is in memory once. The file of a
//! variable is read when the variable is asked for. Parts are the pieces of a step.

mod case;
mod elements;
mod encoded;
mod geometry;
mod plan;
mod step;
#[cfg(test)]
mod tests;
mod variable;

use super::format::Format;
use super::series::Series;
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use geometry::Geometry;
use plan::Plan;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::{Case, EnsightStep};

/// Case files: each names the files of all steps.
pub(super) const FORMAT: Format = Format {
    name: "EnSight Gold",
    extensions: &["case", "encas"],
    joins: false,
    recognises: |head| {
        let is_gold = [&b"ensight gold"[..], b"EnSight Gold", b"ENSIGHT GOLD"].iter().any(|word| head.has(word));
        is_gold && head.has(b"FORMAT") && head.has(b"GEOMETRY")
    },
    open,
    files: |path| Plan::of(path)?.files(),
};

/// Opens a case, the only one of `paths`.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "an EnSight case is opened alone")) };
    let plan = Plan::of(path)?;
    plan.files()?;
    let times = TimeAxis { values: plan.times.clone() };
    let notes = plan.notes.clone();
    let first = Arc::new(Geometry::open(&plan.geometry.at(0)?)?);
    let case = Arc::new(Case { plan, first });
    let steps = (0..times.len()).map(|step| (case.clone(), step)).collect();
    Ok(Box::new(Series::<EnsightStep>::new(description(path), times, steps, notes)?))
}

fn description(path: &Path) -> String {
    path.display().to_string()
}
