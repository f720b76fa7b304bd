//! `.vtu` files as a series of one step each.

use super::{VtuStep, time_value_of};
use crate::error::FileResult;
use crate::field::SeriesSource;
use crate::import::format::Format;
use crate::import::timed::{self, finite};
use std::path::PathBuf;

/// VTK's XML unstructured grids, one step per file.
pub(in crate::import) const FORMAT: Format = Format {
    name: "unstructured grids of VTK",
    extensions: &["vtu"],
    joins: true,
    recognises: |head| head.is_vtk(&["UnstructuredGrid"]),
    open,
    files: |_| Ok(Vec::new()),
};

/// Volumes with points at equal distances.
pub(in crate::import) const IMAGE: Format = Format {
    name: "regular volumes of VTK",
    extensions: &["vti"],
    recognises: |head| head.is_vtk(&["ImageData"]),
    ..FORMAT
};

/// Structured grids with coordinates along each axis.
pub(in crate::import) const RECTILINEAR: Format = Format {
    name: "rectilinear grids of VTK",
    extensions: &["vtr"],
    recognises: |head| head.is_vtk(&["RectilinearGrid"]),
    ..FORMAT
};

/// Structured grids whose points have coordinates of their own.
pub(in crate::import) const CURVILINEAR: Format = Format {
    name: "curvilinear grids of VTK",
    extensions: &["vts"],
    recognises: |head| head.is_vtk(&["StructuredGrid"]),
    ..FORMAT
};

fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    open_steps(paths.iter().map(|path| (path.clone(), vec![path.clone()])).collect(), Vec::new())
}

/// The array of the field data that has the time of a file.
const TIME: &str = "TimeValue";

/// Opens steps, each named by a file and read from some, with times as [`timed::open_steps`] takes them from the first of these.
pub(in crate::import) fn open_steps(
    steps: Vec<(PathBuf, Vec<PathBuf>)>,
    notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let time_of = |files: &Vec<PathBuf>| {
        let Some(first) = files.first() else { return Ok(None) };
        time_value_of(first)?.map(|time| finite(first, TIME, time)).transpose()
    };
    timed::open_steps::<VtuStep>(steps, TIME, time_of, notes)
}
