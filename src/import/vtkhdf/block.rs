//! What a file has of one grid at all steps: its mesh in lists or as a lattice, and its arrays. Numbers of values are not read.

use super::super::hdf::{Array, Attribute, Hdf};
use super::super::pieces::COMPONENTS_MAX;
use super::image::Image;
use super::lists::Lists;
use crate::error::{FileError, FileErrorKind, FileResult};
use crate::field::{Association, FieldInfo};

/// The types of grids that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Unstructured,
    Image,
}

impl Kind {
    /// The kind of an attribute `Type`; `None` for one that is not read.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "UnstructuredGrid" => Some(Self::Unstructured),
            "ImageData" => Some(Self::Image),
            _ => None,
        }
    }
}

/// The mesh of a block.
pub(super) enum Mesh {
    Lists(Lists),
    Image(Image),
}

/// A grid at all steps.
pub(super) struct Block {
    /// The group in the file.
    pub(super) group: String,
    pub(super) mesh: Mesh,
    /// The times of its steps, as many as the mesh and the offsets of arrays have; `None` if it is the same at all times.
    pub(super) times: Option<Vec<f64>>,
    pub(super) arrays: Vec<StepArray>,
    /// Arrays that are not read, with the reason.
    pub(super) left_out: Vec<String>,
}

/// An array of a block.
pub(super) struct StepArray {
    /// The data set.
    pub(super) name: String,
    pub(super) field: FieldInfo,
    /// The first row of each step; `None` if it has those of the mesh.
    pub(super) offsets: Option<Vec<u64>>,
    /// Rows of an image at a step, which do not depend on the mesh: one of many, or all.
    pub(super) rows: Option<u64>,
}

/// The groups of arrays, what they are on, and the offsets of their steps.
const ATTRIBUTES: [(&str, Association, &str); 2] =
    [("PointData", Association::Point, "PointDataOffsets"), ("CellData", Association::Cell, "CellDataOffsets")];

impl Block {
    /// Reads the block of a group.
    ///
    /// # Errors
    /// If counts are missing or contradict each other, or the file is damaged.
    pub(super) fn read(file: &Hdf, group: &str, kind: Kind) -> FileResult<Self> {
        let times = times_of(file, group)?;
        let steps = times.as_ref().map(Vec::len);
        let mesh = match kind {
            Kind::Unstructured => Mesh::Lists(Lists::read(file, group, steps)?),
            Kind::Image => Mesh::Image(Image::read(file, group)?),
        };
        let mut block = Self { group: group.to_owned(), mesh, times, arrays: Vec::new(), left_out: Vec::new() };
        for (folder, association, offsets) in ATTRIBUTES {
            let (_, names) = file.names(&format!("{group}/{folder}"))?;
            let (_, with_offsets) = match steps {
                Some(_) => file.names(&format!("{group}/Steps/{offsets}"))?,
                None => Default::default(),
            };
            for name in names {
                let offsets = match steps.filter(|_| with_offsets.contains(&name)) {
                    Some(steps) => Some(column(file, &format!("{group}/Steps/{offsets}/{name}"), steps)?),
                    None => None,
                };
                block.add_array(file, folder, (name, association), offsets)?;
            }
        }
        Ok(block)
    }

    fn add_array(
        &mut self,
        file: &Hdf,
        folder: &str,
        (name, association): (String, Association),
        offsets: Option<Vec<u64>>,
    ) -> FileResult<()> {
        let path = format!("{}/{folder}/{name}", self.group);
        let array = match file.array(&path) {
            Ok(array) => array,
            Err(error) if error.kind == FileErrorKind::Unsupported => {
                self.left_out.push(format!("'{name}' ({})", error.problem));
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        let found = match &self.mesh {
            Mesh::Lists(_) => listed(&array),
            Mesh::Image(image) => image.arrangement(array.shape(), association, offsets.is_some()),
        };
        match found {
            Ok((components, rows)) => {
                let field = FieldInfo { name, components, association };
                self.arrays.push(StepArray { name: path, field, offsets, rows });
            }
            Err(reason) => self.left_out.push(format!("'{name}' ({reason})")),
        }
        Ok(())
    }
}

/// Number of components of an array of tuples.
fn listed(array: &Array) -> Result<(usize, Option<u64>), String> {
    match *array.shape() {
        [_] => Ok((1, None)),
        [_, components] if (1..=COMPONENTS_MAX).contains(&components) => Ok((components as usize, None)),
        ref shape => Err(format!("has the shape {shape:?}")),
    }
}

/// The times of the group `Steps`; `None` if there is none.
fn times_of(file: &Hdf, group: &str) -> FileResult<Option<Vec<f64>>> {
    let steps = format!("{group}/Steps");
    if !file.names(group)?.0.iter().any(|name| name == "Steps") {
        return Ok(None);
    }
    let name = format!("{steps}/Values");
    let array = file.array(&name)?;
    let mut times = array.read()?.values().to_f64();
    if let Some(Attribute::Numbers(count)) = file.attribute(&steps, "NSteps")? {
        let count = count.values().to_indices().ok().and_then(|list| list.first().copied());
        // A file that is being written may have more rows than steps.
        match count.and_then(|count| usize::try_from(count).ok()).filter(|&count| count <= times.len()) {
            Some(count) => times.truncate(count),
            None => return Err(array.invalid(format!("has {} times, fewer than the NSteps of '{steps}'", times.len()))),
        }
    }
    Ok(Some(times))
}

/// A list of counts.
pub(super) fn counts(file: &Hdf, name: &str) -> FileResult<Vec<u64>> {
    let array = file.array(name)?;
    indices(&array, &array.read()?)
}

/// The numbers of an array as counts or indices.
pub(super) fn indices(array: &Array, numbers: &super::super::numbers::Numbers) -> FileResult<Vec<u64>> {
    numbers.values().to_indices().map_err(|i| array.invalid(format!("number {i} is negative or no integer")))
}

/// One number for each of `steps` steps; rows behind them do not count.
pub(super) fn column(file: &Hdf, name: &str, steps: usize) -> FileResult<Vec<u64>> {
    let array = file.array(name)?;
    let mut numbers = match *array.shape() {
        [_] | [_, 1] => indices(&array, &array.read()?)?,
        ref shape => return Err(array.invalid(format!("has the shape {shape:?}, not a number for each step"))),
    };
    if numbers.len() < steps {
        return Err(array.invalid(format!("has {} numbers for {steps} steps", numbers.len())));
    }
    numbers.truncate(steps);
    Ok(numbers)
}

/// An error about a group.
pub(super) fn invalid(file: &Hdf, group: &str, problem: String) -> FileError {
    FileError::invalid(file.path(), format!("group '{group}'"), problem)
}
