//! Reader of XDMF files, versions 2 and 3: XML that describes arrays in HDF5 or binary files beside it.
//!
//! A *collection* of type `Temporal` is a series; several of them in one file (one for each function, as dolfinx writes)
//! become one series with the fields of all. Arrays are located when the file is opened; numbers are read step by step.

mod function;
mod grid;
mod hdf;
mod items;
mod step;
mod tree;

use super::format::Format;
use super::joined::Joined;
use super::series::Series;
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use grid::{Geometry, Grid};
use items::Item;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::XdmfStep;
use tree::{DEPTH_MAX, Document, Id};

/// XDMF files. One file is a series of all its collections; several join their fields on the same mesh.
pub(super) const FORMAT: Format = Format {
    name: "XDMF with HDF5",
    extensions: &["xdmf", "xmf"],
    joins: true,
    recognises: |head| head.is_xml("Xdmf"),
    open: open_all,
    files,
};

fn open_all(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let named = paths.first().map_or(Path::new(""), |first| first);
    Joined::of(named, paths.iter().map(|path| open(path)).collect::<FileResult<_>>()?)
}

/// The steps of one temporal collection, or of all grids outside of temporal collections.
struct Collection {
    name: String,
    times: Vec<f64>,
    steps: Vec<XdmfStep>,
    notes: Vec<String>,
}

/// Opens the series of an XDMF file: reads the first step, and checks that the files of the others exist.
///
/// # Errors
/// If the file cannot be read, is damaged, has no grid, or an unsupported one; if files that it names are missing.
fn open(path: &Path) -> FileResult<Box<dyn SeriesSource>> {
    let (collections, notes) = read(path)?;
    for (file, place) in files_of(&collections) {
        crate::files::check_kind(&file)?;
        if !file.is_file() {
            return Err(FileError::invalid(path, place, format!("the file {} is missing", file.display()))
                .remedy("copy it there, or correct the path, which is relative to the XDMF file"));
        }
    }
    let mut series: Vec<Box<dyn SeriesSource>> = Vec::new();
    for (i, collection) in collections.into_iter().enumerate() {
        let times = TimeAxis { values: collection.times };
        let notes = [if i == 0 { notes.clone() } else { Vec::new() }, collection.notes].concat();
        let description = path.display().to_string();
        series.push(Box::new(Series::<XdmfStep>::new(description, times, collection.steps, notes)?));
    }
    Joined::of(path, series)
}

/// The files that hold the numbers of an XDMF file.
///
/// # Errors
/// If it is damaged.
fn files(path: &Path) -> FileResult<Vec<PathBuf>> {
    Ok(files_of(&read(path)?.0).into_keys().collect())
}

/// All files, each with the first element that names it.
fn files_of(collections: &[Collection]) -> BTreeMap<PathBuf, String> {
    let mut files = BTreeMap::new();
    for step in collections.iter().flat_map(|collection| &collection.steps) {
        for item in step.grids.iter().flat_map(items_of) {
            if let Some(file) = item.file().filter(|file| !files.contains_key(*file)) {
                files.insert(file.to_owned(), step.document.place(item.id));
            }
        }
    }
    files
}

fn items_of(grid: &Grid) -> Vec<&Item> {
    let mut items: Vec<&Item> = grid.topology.connectivity.iter().collect();
    match &grid.geometry {
        Geometry::Together(item, _) => items.push(item),
        Geometry::Apart(all) => items.extend(all.iter()),
    }
    items.extend(grid.attributes.iter().flat_map(|attribute| attribute.stored.items()));
    items
}

/// The collections with the times of the longest of them, and notes on those left out.
fn read(path: &Path) -> FileResult<(Vec<Collection>, Vec<String>)> {
    let document = Arc::new(Document::open(path)?);
    let root = document.children_named(0, "Xdmf")?;
    let mut domains = Vec::new();
    for id in root {
        domains.extend(document.children_named(id, "Domain")?);
    }
    let domain = *domains
        .first()
        .ok_or_else(|| FileError::invalid(path, "<Xdmf>", "has no <Domain>").remedy("write the file again"))?;
    let grids = document.children_named(domain, "Grid")?.into_iter();
    let (temporal, plain): (Vec<Id>, Vec<Id>) = grids.partition(|&grid| is_temporal(&document, grid));
    let mut notes = Vec::new();
    if domains.len() > 1 {
        notes.push(format!("left out {} further domains", domains.len() - 1));
    }
    if temporal.is_empty() {
        return Ok((vec![single(&document, domain, &plain)?], notes));
    }
    let collections = temporal.iter().map(|&id| collection(&document, id)).collect::<FileResult<Vec<_>>>()?;
    let longest = collections.iter().map(|c| c.times.len()).max().unwrap_or_default();
    let times = collections.iter().find(|c| c.times.len() == longest).map(|c| c.times.clone()).unwrap_or_default();
    let (kept, others): (Vec<_>, Vec<_>) = collections.into_iter().partition(|c| c.times == times);
    notes.extend(others.iter().map(|c| format!("left out the collection '{}': it has other times", c.name)));
    Ok((kept, notes))
}

fn is_temporal(document: &Document, id: Id) -> bool {
    let is =
        |keys: &[&str], value: &str| document.either(id, keys).is_some_and(|text| text.eq_ignore_ascii_case(value));
    is(&["GridType", "Type"], "Collection") && is(&["CollectionType"], "Temporal")
}

/// A single step of the grids outside of temporal collections.
fn single(document: &Arc<Document>, domain: Id, grids: &[Id]) -> FileResult<Collection> {
    let mut leaves = Vec::new();
    let mut time = None;
    for &grid in grids {
        time = time.or(time_of(document, grid)?);
        collect_leaves(document, grid, 0, &mut leaves)?;
    }
    if leaves.is_empty() {
        return Err(document.invalid(domain, "has no <Grid>"));
    }
    let steps = vec![step(document, &leaves)?];
    let notes = notes_of(&steps);
    Ok(Collection { name: String::new(), times: vec![time.unwrap_or(0.0)], steps, notes })
}

/// A temporal collection, sorted by time.
fn collection(document: &Arc<Document>, id: Id) -> FileResult<Collection> {
    let grids = document.children_named(id, "Grid")?;
    if grids.is_empty() {
        return Err(document.invalid(id, "is a collection without a <Grid>"));
    }
    let times = grids.iter().map(|&grid| time_of(document, grid)).collect::<FileResult<Vec<_>>>()?;
    let mut notes = Vec::new();
    let times = match (listed_times(document, id, grids.len())?, times.iter().position(Option::is_none)) {
        (Some(listed), _) => listed,
        (None, None) => times.into_iter().flatten().collect(),
        (None, Some(_)) if times.iter().all(Option::is_none) => {
            notes.push("times are 0, 1, 2, ...: the file has none".to_owned());
            (0..grids.len()).map(|i| i as f64).collect()
        }
        (None, Some(i)) => return Err(document.invalid(grids[i], "has no <Time>, but others of the collection have")),
    };
    let mut timed: Vec<(f64, Id)> = times.into_iter().zip(grids).collect();
    timed.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = timed.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let problem = format!("has the same time {} as {}", pair[1].0, document.place(pair[0].1));
        return Err(document.invalid(pair[1].1, problem).remedy("remove one of the two"));
    }
    let mut steps = Vec::new();
    for &(_, grid) in &timed {
        let mut leaves = Vec::new();
        collect_leaves(document, grid, 0, &mut leaves)?;
        if leaves.is_empty() {
            return Err(document.invalid(grid, "holds no <Grid>"));
        }
        steps.push(step(document, &leaves)?);
    }
    notes.extend(notes_of(&steps));
    let name = document.attribute(id, "Name").unwrap_or("").to_owned();
    Ok(Collection { name, times: timed.into_iter().map(|(time, _)| time).collect(), steps, notes })
}

/// What is read in part of the first step.
fn notes_of(steps: &[XdmfStep]) -> Vec<String> {
    let grids = steps.iter().take(1).flat_map(|step| step.grids.iter());
    let notes: BTreeSet<&String> = grids.flat_map(|grid| &grid.notes).collect();
    notes.into_iter().cloned().collect()
}

fn step(document: &Arc<Document>, leaves: &[Id]) -> FileResult<XdmfStep> {
    let grids = leaves.iter().map(|&leaf| Grid::of(document, leaf)).collect::<FileResult<_>>()?;
    Ok(XdmfStep { document: document.clone(), grids: Arc::new(grids) })
}

/// The grids without nested grids, in file order.
fn collect_leaves(document: &Document, id: Id, depth: usize, leaves: &mut Vec<Id>) -> FileResult<()> {
    if depth > DEPTH_MAX {
        return Err(document.invalid(id, "is nested too deeply"));
    }
    if is_temporal(document, id) {
        return Err(document.unsupported(id, "is a temporal collection inside of another grid, which is not read"));
    }
    match document.either(id, &["GridType", "Type"]).unwrap_or("Uniform").to_ascii_lowercase().as_str() {
        "uniform" => leaves.push(id),
        "collection" | "tree" => {
            for grid in document.children_named(id, "Grid")? {
                collect_leaves(document, grid, depth + 1, leaves)?;
            }
        }
        other => return Err(document.unsupported(id, format!("GridType=\"{other}\" is not read"))),
    }
    Ok(())
}

/// The time of a grid, or of the first nested grid that has one.
fn time_of(document: &Document, id: Id) -> FileResult<Option<f64>> {
    let mut open = vec![id];
    while let Some(at) = open.pop() {
        let children = document.children(at)?;
        if let Some(&time) = children.iter().find(|&&child| document.name(child) == "Time") {
            let text = document.attribute(time, "Value").map(str::to_owned).unwrap_or_else(|| document.text(time));
            let value = text.trim().parse().ok().filter(|time: &f64| time.is_finite());
            // Adding zero turns -0 into +0.
            let value = value.ok_or_else(|| document.invalid(time, format!("'{text}' is no finite time")))?;
            return Ok(Some(value + 0.0));
        }
        open.extend(children.into_iter().rev().filter(|&child| document.name(child) == "Grid"));
    }
    Ok(None)
}

/// The times that a collection lists for all of its grids.
fn listed_times(document: &Document, id: Id, count: usize) -> FileResult<Option<Vec<f64>>> {
    let Some(&time) = document.children_named(id, "Time")?.first() else { return Ok(None) };
    let kind = document.either(time, &["TimeType", "Type"]).unwrap_or("Single").to_ascii_lowercase();
    if kind == "single" {
        return Ok(None);
    }
    let items = document.children_named(time, "DataItem")?;
    let text = items.first().map_or_else(|| document.text(time), |&item| document.text(item));
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|t| t.is_finite()));
    let invalid = |problem: String| document.invalid(time, problem);
    let numbers = numbers.ok_or_else(|| invalid(format!("'{text}' are no times")))?;
    match (kind.as_str(), numbers.as_slice()) {
        ("list", _) if numbers.len() == count => Ok(Some(numbers.into_iter().map(|t| t + 0.0).collect())),
        ("list", _) => Err(invalid(format!("lists {} times for {count} grids", numbers.len()))),
        ("hyperslab", &[start, stride, _]) => Ok(Some((0..count).map(|i| start + stride * i as f64 + 0.0).collect())),
        _ => Err(document
            .unsupported(time, format!("TimeType=\"{kind}\" is not read"))
            .remedy("give each grid its <Time Value=\"...\"/>")),
    }
}
