//! Reader of raw volumes with a small header: MetaImage (`.mhd`, `.mha`) and NRRD (`.nhdr`, `.nrrd`). A bare `.raw` file does not say what it
//! holds; these headers do.
//!
//! Values are at the points of a regular grid. A step is read when it is asked for, and of uncompressed files its bytes alone.

mod data;
mod header;
mod metaimage;
mod nrrd;
mod step;
#[cfg(test)]
mod tests;

use super::format::Format;
use super::series::Series;
use crate::error::FileResult;
use crate::field::{SeriesSource, TimeAxis};
use header::Brick;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::BrickStep;

/// MetaImage files, one step each.
pub(super) const METAIMAGE: Format = Format {
    name: "raw volumes with a header of MetaImage",
    extensions: &["mhd", "mha"],
    joins: true,
    recognises: |head| head.has(b"ElementDataFile") && head.has(b"DimSize"),
    open: |paths| open(paths, metaimage::read),
    files: |path| Ok(vec![metaimage::read(path)?.data.path]),
};

/// NRRD files, one step each, or several along their slowest axis.
pub(super) const NRRD: Format = Format {
    name: "raw volumes with a header of NRRD",
    extensions: &["nhdr", "nrrd"],
    joins: true,
    recognises: |head| head.begins_with(nrrd::MAGIC),
    open: |paths| open(paths, nrrd::read),
    files: |path| Ok(vec![nrrd::read(path)?.data.path]),
};

fn open(paths: &[PathBuf], read: fn(&Path) -> FileResult<Brick>) -> FileResult<Box<dyn SeriesSource>> {
    let mut steps = Vec::new();
    for path in paths {
        let brick = Arc::new(read(path)?);
        steps.extend((0..brick.steps).map(|step| (brick.clone(), step)));
    }
    let times = TimeAxis { values: (0..steps.len()).map(|step| step as f64).collect() };
    let description = match paths {
        [first, .., last] => format!("{} .. {} ({} files)", first.display(), last.display(), paths.len()),
        [one] => one.display().to_string(),
        [] => String::new(),
    };
    let is_several = steps.len() > 1;
    let notes = is_several.then(|| "times are 0, 1, 2, ...: such files have none".to_owned());
    Ok(Box::new(Series::<BrickStep>::new(description, times, steps, notes.into_iter().collect())?))
}
