//! Reader of `.npz` files: arrays of NumPy in a zip file, by their names.
//!
//! `points` is `[n, 3]`. Cells are `cells`, `[m, 4]` tetrahedra, `[m, 5]` pyramids, `[m, 6]` wedges or `[m, 8]` hexahedra with their
//! corners in VTK's order; or VTK's lists `types`, `offsets` and `connectivity`; without any the points are a cloud, `radius` and `volume`,
//! `[n]`, have their radii and volumes. `time` (or `times`) is `[s]`. Every other array is a
//! field: `[s, n]` or `[s, m]` with a value for each point or cell at each step, `[s, n, k]` or `[s, m, k]` with k components; without
//! times there is one step, whose axis may be missing. `point_` or `cell_` before the name says what a field is on, which must be said if
//! there are as many points as cells; it is no part of the field's name. A step is read when it is asked for.

mod archive;
mod mesh;
mod npy;
mod step;
#[cfg(test)]
mod tests;

use super::format::Format;
use super::pieces::COMPONENTS_MAX;
use super::series::Series;
use super::times::in_order;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo, SeriesSource, TimeAxis};
use archive::{Array, arrays};
use mesh::Mesh;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use step::NpzStep;

/// Arrays of NumPy.
pub(super) const FORMAT: Format = Format {
    name: "arrays of NumPy",
    extensions: &["npz"],
    joins: false,
    recognises: |head| head.begins_with(b"PK\x03\x04") && head.has(b".npy"),
    open,
    files: |_| Ok(Vec::new()),
};

/// A file: its mesh and its fields.
pub(super) struct Contents {
    path: PathBuf,
    mesh: Mesh,
    fields: Vec<Field>,
    left_out: Vec<String>,
}

/// An array of values.
struct Field {
    info: FieldInfo,
    array: Array,
    /// Whether its rows are steps; else they are points or cells.
    has_steps: bool,
}

/// Opens the only one of `paths`: reads the headers of all arrays, and the mesh.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "an .npz file is opened alone")) };
    let (mut found, left_out) = arrays(path)?;
    let times = take(&mut found, "time").into_iter().chain(take(&mut found, "times")).collect::<Vec<_>>();
    let times = match &times[..] {
        [] => None,
        [times] if times.shape.len() <= 1 => {
            Some(in_order(&times.read()?.values().to_f64()).map_err(|problem| times.invalid(problem))?)
        }
        [times] => return Err(times.invalid(format!("has the shape {:?}, not a time for each step", times.shape))),
        [_, other, ..] => return Err(other.invalid("is there beside 'time'").remedy("write one of them")),
    };
    let steps = times.as_ref().map(Vec::len);
    let mut contents =
        Contents { path: path.clone(), mesh: Mesh::take(path, &mut found)?, fields: Vec::new(), left_out };
    let mut notes = Vec::new();
    if found.iter().any(Array::is_compressed) && steps.is_some_and(|steps| steps > 1) {
        notes.push(
            "arrays are compressed: each step is reached through those before it; numpy.savez writes them plain"
                .to_owned(),
        );
    }
    for array in found {
        contents.add(array, steps)?;
    }
    let contents = Arc::new(contents);
    let times = times.unwrap_or_else(|| vec![(0.0, 0)]);
    let origins = times.iter().map(|&(_, step)| step::Origin { contents: contents.clone(), step }).collect();
    let times = TimeAxis { values: times.into_iter().map(|(time, _)| time).collect() };
    Ok(Box::new(Series::<NpzStep>::new(path.display().to_string(), times, origins, notes)?))
}

/// Removes the array of that name.
fn take(arrays: &mut Vec<Array>, name: &str) -> Option<Array> {
    arrays.iter().position(|array| array.name == name).map(|at| arrays.remove(at))
}

/// Removes the array of that name, which must be there.
fn needed(path: &Path, arrays: &mut Vec<Array>, name: &str) -> FileResult<Array> {
    take(arrays, name).ok_or_else(|| {
        FileError::invalid(path, "", format!("has no array '{name}'"))
            .remedy("numpy.savez(file, points=[n, 3], cells=[m, 4], time=[s], NAME=[s, n]) has all that is needed; without cells it is a cloud")
    })
}

impl Contents {
    /// Adds an array as a field.
    ///
    /// # Errors
    /// If it could be on points or on cells.
    fn add(&mut self, array: Array, steps: Option<usize>) -> FileResult<()> {
        let (points, cells) = (self.mesh.points as u64, self.mesh.cells as u64);
        let (named, name) = match array.name.split_once('_') {
            Some(("point", name)) if !name.is_empty() => (Some(Association::Point), name.to_owned()),
            Some(("cell", name)) if !name.is_empty() => (Some(Association::Cell), name.to_owned()),
            _ => (None, array.name.clone()),
        };
        let on = |association: Association, count: u64| {
            let is_wanted = named.is_none_or(|named| named == association);
            let (components, has_steps) = is_wanted.then(|| arrangement(&array.shape, count, steps)).flatten()?;
            Some((FieldInfo { name: name.clone(), components, association }, has_steps))
        };
        let (info, has_steps) = match (on(Association::Point, points), on(Association::Cell, cells)) {
            (Some(_), Some(_)) => {
                let problem = format!("could be on points or on cells: there are {points} of each");
                let remedy = format!("name it point_{name} or cell_{name}");
                return Err(array.invalid(problem).remedy(remedy));
            }
            (Some(found), None) | (None, Some(found)) => found,
            (None, None) => {
                let steps = match steps {
                    Some(steps) => format!("{steps} steps"),
                    None => "one step: there is no array 'time'".to_owned(),
                };
                let shape = &array.shape;
                let reason = format!("has the shape {shape:?} for {points} points, {cells} cells and {steps}");
                self.left_out.push(format!("'{}' ({reason})", array.name));
                return Ok(());
            }
        };
        self.fields.push(Field { info, array, has_steps });
        Ok(())
    }
}

/// Number of components of a field of `count` tuples a step, and whether it has an axis of steps; `None` if it has another shape. Without
/// times there is one step.
fn arrangement(shape: &[u64], count: u64, steps: Option<usize>) -> Option<(usize, bool)> {
    let tuples = |shape: &[u64]| match *shape {
        [n] if n == count => Some(1),
        [n, components] if n == count && (1..=COMPONENTS_MAX).contains(&components) => Some(components as usize),
        _ => None,
    };
    let of_steps = match shape.split_first() {
        Some((&rows, rest)) if rows == steps.unwrap_or(1) as u64 => tuples(rest),
        _ => None,
    };
    match of_steps {
        Some(components) => Some((components, true)),
        None if steps.is_none() => tuples(shape).map(|components| (components, false)),
        None => None,
    }
}
