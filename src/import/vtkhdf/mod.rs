//! Reader of VTKHDF files: a data set of VTK, or a series of them, in one HDF5 file.
//!
//! The group `/VTKHDF` has a `Type`. An `UnstructuredGrid` lists the points and cells of all its parts of all steps one after the other,
//! with the counts of each part; the group `Steps` says where each step begins in these lists. Steps with equal beginnings have one mesh.
//! An `ImageData` has attributes for its points, and arrays with an axis for time. Collections and blocks are groups of these.
//! Counts and beginnings are read when the file is opened, arrays step by step, and of these only the rows of the step.

mod block;
mod image;
mod lists;
mod step;
#[cfg(test)]
mod tests;

use super::format::Format;
use super::hdf::{self, Attribute, Hdf};
use super::timed::{Timed, open_files};
use super::times::in_order;
use crate::error::{FileError, FileResult};
use crate::field::SeriesSource;
use block::{Block, Kind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::VtkHdfStep;

/// VTK's data sets in HDF5, with one step or several each.
pub(super) const FORMAT: Format = Format {
    name: "VTKHDF",
    extensions: &["vtkhdf", "hdf"],
    joins: true,
    recognises: |head| head.begins_with(hdf::MAGIC) && head.has(b"VTKHDF"),
    open,
    files: |_| Ok(Vec::new()),
};

/// The group that has all.
const ROOT: &str = "/VTKHDF";
/// The remedy where something is missing.
const MISSING: &str = "write the file again with VTK or ParaView; h5ls -r lists what it has";
/// The greatest major version that is read.
const VERSION_MAX: f64 = 2.0;

/// Opens files, each with its steps: reads the counts of all, and the first step.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let mut notes = Vec::new();
    let files = paths.iter().map(|path| steps_of(path, &mut notes)).collect::<FileResult<Vec<_>>>()?;
    open_files::<VtkHdfStep>(files, "times", notes)
}

/// The steps of a file.
fn steps_of(path: &Path, notes: &mut Vec<String>) -> FileResult<Timed<step::Origin>> {
    let file = open_file(path)?;
    let (blocks, more) = blocks_of(&file)?;
    let steps = times_of(&file, &blocks, notes)?;
    notes.extend(more.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
    let blocks: Arc<Vec<Arc<Block>>> = Arc::new(blocks.into_iter().map(Arc::new).collect());
    let shared = Arc::new(path.to_owned());
    let origin = |step: usize| step::Origin { path: shared.clone(), blocks: blocks.clone(), step };
    let (times, origins) = match steps {
        None => (None, vec![origin(0)]),
        Some(steps) => {
            let (times, steps): (Vec<f64>, Vec<usize>) = steps.into_iter().unzip();
            (Some(times), steps.into_iter().map(origin).collect())
        }
    };
    Ok(Timed { path: path.to_owned(), times, origins })
}

fn open_file(path: &Path) -> FileResult<Hdf> {
    Hdf::open_uncached(path, MISSING)
}

/// The grids of a file, and notes on what is left out.
fn blocks_of(file: &Hdf) -> FileResult<(Vec<Block>, Vec<String>)> {
    if let Some(Attribute::Numbers(version)) = file.attribute(ROOT, "Version")?
        && let Some(&major) = version.values().to_f64().first()
        && major > VERSION_MAX
    {
        let problem = format!("is of version {major} of VTKHDF, and {VERSION_MAX} is the last that is read");
        return Err(FileError::unsupported(file.path(), "", problem).remedy("write it with an older VTK"));
    }
    match kind_of(file, ROOT)?.as_str() {
        "PartitionedDataSetCollection" | "MultiBlockDataSet" => composite(file),
        kind => {
            let kind = Kind::of(kind).ok_or_else(|| refused(file, ROOT, kind))?;
            Ok((vec![Block::read(file, ROOT, kind)?], Vec::new()))
        }
    }
}

/// The attribute `Type` of a group.
fn kind_of(file: &Hdf, group: &str) -> FileResult<String> {
    match file.attribute(group, "Type")? {
        Some(Attribute::Text(kind)) => Ok(kind),
        _ => Err(FileError::invalid(
            file.path(),
            "",
            format!("has no group '{group}' with a Type: it is no VTKHDF file"),
        )
        .remedy("of other HDF5 files, open the XDMF file beside them, or convert them to .vtkhdf")),
    }
}

/// The error for a data set of another type.
fn refused(file: &Hdf, group: &str, kind: &str) -> FileError {
    let remedy = match kind {
        "PolyData" => "surfaces have no volume: write the unstructured grid from which it was taken",
        _ => "convert it to an unstructured grid, for example with ParaView's filters Merge Blocks or Append Datasets",
    };
    FileError::unsupported(file.path(), format!("group '{group}'"), format!("is of type {kind}, which is not read"))
        .remedy(remedy)
}

/// The blocks of a collection, by their `Index`, else by name. The tree of the group `Assembly` is not followed: its leaves are these.
fn composite(file: &Hdf) -> FileResult<(Vec<Block>, Vec<String>)> {
    if file.has_links_elsewhere(ROOT)? {
        let problem = "has blocks in other files, which are not read";
        return Err(FileError::unsupported(file.path(), format!("group '{ROOT}'"), problem)
            .remedy("write it to one file (vtkHDFWriter: UseExternalComposite off)"));
    }
    let (names, _) = file.names(ROOT)?;
    let mut indexed = Vec::new();
    for name in names.into_iter().filter(|name| name != "Assembly" && name != "Steps") {
        let group = format!("{ROOT}/{name}");
        let index = match file.attribute(&group, "Index")? {
            Some(Attribute::Numbers(index)) => index.values().to_indices().ok().and_then(|list| list.first().copied()),
            _ => None,
        };
        indexed.push((index, group));
    }
    indexed.sort();
    let expected = (0..).zip(&indexed).find(|(expected, (index, _))| index.is_some_and(|index| index != *expected));
    if let Some((expected, _)) = expected {
        return Err(FileError::invalid(
            file.path(),
            format!("group '{ROOT}'"),
            format!("has no block of Index {expected}"),
        )
        .remedy("write it again, to one file"));
    }
    let (mut blocks, mut surfaces) = (Vec::new(), 0);
    for (_, group) in indexed {
        match kind_of(file, &group)?.as_str() {
            "PolyData" => surfaces += 1,
            kind => {
                let kind = Kind::of(kind).ok_or_else(|| refused(file, &group, kind))?;
                blocks.push(Block::read(file, &group, kind)?);
            }
        }
    }
    if blocks.is_empty() {
        return Err(FileError::invalid(file.path(), format!("group '{ROOT}'"), "has no block that is a grid"));
    }
    let note = (surfaces > 0).then(|| format!("skipped {surfaces} blocks that are surfaces (PolyData)"));
    Ok((blocks, note.into_iter().collect()))
}

/// The times of the steps and their numbers in the file, in order of time; `None` if it has one step without a time.
fn times_of(file: &Hdf, blocks: &[Block], notes: &mut Vec<String>) -> FileResult<Option<Vec<(f64, usize)>>> {
    let mut timed = blocks.iter().filter_map(|block| Some((block, block.times.as_ref()?)));
    let invalid = |place: &str, problem: String| FileError::invalid(file.path(), place, problem);
    let Some((first, times)) = timed.next() else {
        return Ok(time_value(file)?.map(|time| vec![(time, 0)]));
    };
    if let Some((other, _)) = timed.find(|(_, other)| *other != times) {
        let problem = format!("has other times than '{}'", first.group);
        return Err(invalid(&format!("group '{}'", other.group), problem).remedy("write blocks with the same steps"));
    }
    if let Some(still) = blocks.iter().find(|block| block.times.is_none()) {
        let note = format!("'{}' has no steps: it is the same at all times", still.group);
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    let place = format!("data set '{}/Steps/Values'", first.group);
    in_order(times).map(Some).map_err(|problem| invalid(&place, problem).remedy("write each time once"))
}

/// The time that a file of one step has in its field data.
fn time_value(file: &Hdf) -> FileResult<Option<f64>> {
    let group = format!("{ROOT}/FieldData");
    if !file.names(&group)?.1.iter().any(|name| name == "TimeValue") {
        return Ok(None);
    }
    let name = format!("{group}/TimeValue");
    let array = file.array(&name)?;
    match array.read()?.values().to_f64()[..] {
        [time] if time.is_finite() => Ok(Some(time + 0.0)),
        [time] => Err(array.invalid(format!("the time {time} is not finite"))),
        _ => Ok(None),
    }
}
