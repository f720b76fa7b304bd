//! `.vtu` files and those of structured grids, one step each, and their times.

use super::time_value_of;
use crate::error::FileResult;
use crate::import::format::Format;
use crate::import::grids::open_each;
use crate::import::timed::finite;
use std::path::Path;

/// VTK's XML unstructured grids, one step per file.
pub(in crate::import) const FORMAT: Format = Format {
    name: "unstructured grids of VTK",
    extensions: &["vtu"],
    joins: true,
    recognises: |head| head.is_vtk(&["UnstructuredGrid"]),
    open: open_each,
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

/// The array of the field data that has the time of a file.
pub(in crate::import) const TIME: &str = "TimeValue";

/// The time of a file, reading no more of it than needed.
///
/// # Errors
/// If the file cannot be read, is not a grid, or the time is not finite.
pub(in crate::import) fn time_of(path: &Path) -> FileResult<Option<f64>> {
    time_value_of(path)?.map(|time| finite(path, TIME, time)).transpose()
}
