//! A mesh with its steps: one file, or the parts of a decomposed one.

use super::database::{Array, Database, Source};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

/// Most blocks that a note lists.
const LISTED_MAX: usize = 16;

/// The files of a mesh.
pub(super) struct Whole {
    /// At least one; each has the arrays of all.
    pub(super) parts: Vec<Database>,
    /// The times that all have, in the order of the files; none if there are no steps.
    pub(super) times: Vec<f64>,
    /// On the blocks, and on what is missing.
    pub(super) notes: Vec<String>,
}

/// A block of all parts.
struct Listed<'a> {
    id: f64,
    name: &'a str,
    element_type: &'a str,
    cells: usize,
}

impl Whole {
    /// Opens all files of a mesh.
    ///
    /// # Errors
    /// If one is no Exodus file, is damaged, or has elements that are not read, or if parts have different times.
    pub(super) fn open(paths: &[PathBuf]) -> FileResult<Self> {
        let open = |path: &PathBuf| Database::open(path, paths.len());
        let mut parts = paths.iter().map(open).collect::<FileResult<Vec<_>>>()?;
        let (times, later) = common_times(&parts)?;
        complete(&mut parts);
        let notes = [notes_on_blocks(&parts), notes_on_points(&parts), later.into_iter().collect()].concat();
        Ok(Self { parts, times, notes })
    }
}

/// The times that all parts have, and a note if some have more.
fn common_times(parts: &[Database]) -> FileResult<(Vec<f64>, Option<String>)> {
    let number = |part: &&Database| part.times.len();
    let (Some(least), Some(most)) = (parts.iter().min_by_key(number), parts.iter().max_by_key(number)) else {
        return Ok((Vec::new(), None));
    };
    let times = &least.times;
    for part in parts {
        if let Some((step, (time, other))) = (0..).zip(part.times.iter().zip(times)).find(|(_, (a, b))| a != b) {
            let problem = format!("step {step} is at {time}, and at {other} in {}", least.netcdf.path().display());
            return Err(FileError::invalid(part.netcdf.path(), "variable 'time_whole'", problem)
                .remedy("keep only the parts of one run"));
        }
    }
    let (fewer, all) = (times.len(), most.times.len());
    if fewer == all {
        return Ok((times.clone(), None));
    }
    let (path, longest) = (least.netcdf.path(), most.netcdf.path().display());
    if fewer == 0 {
        let problem = format!("has no steps, and {longest} has {all}");
        return Err(FileError::invalid(path, "variable 'time_whole'", problem)
            .remedy("wait until its first step is written, or copy it again if it was cut"));
    }
    let note = format!("left out the last {} steps: {} has {fewer}, {longest} {all}", all - fewer, path.display());
    Ok((times.clone(), Some(note)))
}

/// Gives each part the arrays of all: those that it lacks have no values there.
fn complete(parts: &mut [Database]) {
    let mut known = HashSet::new();
    let fields: Vec<_> = parts.iter().flat_map(|part| &part.arrays).map(|array| array.field.clone()).collect();
    let fields: Vec<_> = fields.into_iter().filter(|field| known.insert(field.clone())).collect();
    for part in parts {
        let mut own: HashSet<_> = part.arrays.iter().map(|of| (of.field.association, of.field.name.clone())).collect();
        let mut added = HashSet::new();
        for field in &fields {
            if own.insert((field.association, field.name.clone())) {
                part.arrays.push(Array { field: field.clone(), source: Source::Nothing });
                added.insert(format!("'{}", field.name));
            }
        }
        let is_added = |text: &String| text.rsplit_once("' (").is_some_and(|(name, _)| added.contains(name));
        part.left_out.retain(|text| !is_added(text));
    }
}

/// Notes on blocks, and on those without some of the values.
fn notes_on_blocks(parts: &[Database]) -> Vec<String> {
    let mut blocks: Vec<Listed> = Vec::new();
    let mut places = HashMap::new();
    for block in parts.iter().flat_map(|part| &part.blocks) {
        match places.get(&block.id.to_bits()) {
            Some(&place) => {
                let listed: &mut Listed = &mut blocks[place];
                listed.cells = listed.cells.saturating_add(block.cells);
            }
            None => {
                places.insert(block.id.to_bits(), blocks.len());
                let (name, element_type) = (block.name.as_str(), block.element_type.as_str());
                blocks.push(Listed { id: block.id, name, element_type, cells: block.cells });
            }
        }
    }
    let listed = blocks.iter().take(LISTED_MAX).map(|block| {
        let name = if block.name.is_empty() { String::new() } else { format!(" {}", block.name) };
        format!("{}{name} ({} {})", block.id, block.cells, block.element_type)
    });
    let more = blocks.len().saturating_sub(LISTED_MAX);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    let mut notes =
        vec![format!("field 'block' is the number of a block: {}{more}", listed.collect::<Vec<_>>().join(", "))];
    let mut order = Vec::new();
    let mut lacking: HashMap<&str, HashSet<u64>> = HashMap::new();
    for (part, array) in parts.iter().flat_map(|part| part.arrays.iter().map(move |array| (part, array))) {
        if array.field.association == Association::Cell {
            let without = lacking.entry(&array.field.name).or_insert_with(|| {
                order.push(array.field.name.as_str());
                HashSet::new()
            });
            without.extend(part.without(array).map(|block| block.id.to_bits()));
        }
    }
    for name in order {
        let count = lacking.get(name).map_or(0, HashSet::len);
        if count > 0 {
            notes.push(format!("field '{name}' has no values (NaN) in {count} of {} blocks", blocks.len()));
        }
    }
    notes
}

/// Notes on variables of nodes that parts lack.
fn notes_on_points(parts: &[Database]) -> Vec<String> {
    let filled = || parts.iter().filter(|part| part.points > 0);
    let mut order = Vec::new();
    let mut lacking: HashMap<&str, usize> = HashMap::new();
    for array in filled().flat_map(|part| &part.arrays) {
        if array.field.association == Association::Point && matches!(array.source, Source::Nothing) {
            let count = lacking.entry(&array.field.name).or_insert_with(|| {
                order.push(array.field.name.as_str());
                0
            });
            *count += 1;
        }
    }
    let all = filled().count();
    let note = |name| format!("field '{name}' has no values (NaN) in {} of {all} parts", lacking[name]);
    order.into_iter().map(note).collect()
}
