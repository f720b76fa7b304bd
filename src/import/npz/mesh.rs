//! The points and cells of a file.

use super::super::cell_list::CellList;
use super::super::cells::{GridReader, kind};
use super::archive::Array;
use super::{needed, take};
use crate::error::FileResult;
use glam::DVec3;
use std::path::Path;

/// A mesh, which is the same at all steps.
pub(super) struct Mesh {
    coordinates: Array,
    cell_arrays: Cells,
    pub(super) points: usize,
    pub(super) cells: usize,
}

/// Cells.
enum Cells {
    /// Of one type, with so many corners each.
    Same { corners: Array, vtk: u8, width: usize },
    /// Of any types: these, where the vertices of each cell end, and the vertices.
    Listed(Box<[Array; 3]>),
    /// None but the points, with their radii and volumes if these are there.
    Points([Option<Array>; 2]),
}

/// VTK's type of cells with so many corners.
const TYPES: [(u64, u8); 4] = [(4, 10), (5, 14), (6, 13), (8, 12)];

impl Mesh {
    /// Takes the arrays of the mesh.
    ///
    /// # Errors
    /// If one is missing or has another shape.
    pub(super) fn take(path: &Path, arrays: &mut Vec<Array>) -> FileResult<Self> {
        let coordinates = needed(path, arrays, "points")?;
        let &[points, 3] = &coordinates.shape[..] else {
            let problem = format!("has the shape {:?}, not three coordinates for each point", coordinates.shape);
            return Err(coordinates.invalid(problem).remedy("write it as [n, 3]"));
        };
        let (cell_arrays, cells) = match (take(arrays, "cells"), take(arrays, "connectivity")) {
            (Some(corners), None) => same(corners)?,
            (None, Some(connectivity)) => {
                let (types, offsets) = (needed(path, arrays, "types")?, needed(path, arrays, "offsets")?);
                let count = list(&types)?;
                list(&connectivity)?;
                if ![Some(count), count.checked_add(1)].contains(&Some(list(&offsets)?)) {
                    let problem = format!("has {} numbers for {count} cells", offsets.shape[0]);
                    return Err(offsets
                        .invalid(problem)
                        .remedy("write where each cell begins, and where the last one ends"));
                }
                (Cells::Listed(Box::new([types, offsets, connectivity])), count)
            }
            (Some(cells), Some(_)) => {
                return Err(cells.invalid("is there beside 'connectivity'").remedy("write one of them"));
            }
            (None, None) => {
                let radii = take(arrays, "radius");
                if let Some(radii) = radii.as_ref().filter(|radii| radii.shape != [points]) {
                    let problem = format!("has the shape {:?}, not a radius for each of {points} points", radii.shape);
                    return Err(radii.invalid(problem).remedy("write it as [n]"));
                }
                // One of another shape may be a field.
                let is_of_points = |array: &Array| array.name == "volume" && array.shape == [points];
                let volumes = arrays.iter().position(is_of_points).map(|at| arrays.remove(at));
                (Cells::Points([radii, volumes]), 0)
            }
        };
        let count = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
        Ok(Self { coordinates, cell_arrays, points: count(points), cells: count(cells) })
    }

    /// Adds points and cells to a mesh.
    ///
    /// # Errors
    /// If arrays are damaged, or cells have corners that are no points.
    pub(super) fn add_to(&self, grid: &mut GridReader, path: &Path) -> FileResult<()> {
        grid.check_room(path, "array 'points'", self.points, self.cells)?;
        let first_point = grid.mesh.points.len();
        let coordinates = self.coordinates.read()?.values().to_f64();
        grid.mesh.points.extend(coordinates.chunks_exact(3).map(DVec3::from_slice));
        match &self.cell_arrays {
            Cells::Same { corners, vtk, width } => {
                let indices = indices(corners)?;
                for (cell, vertices) in indices.chunks_exact(*width).enumerate() {
                    grid.push(cell, (*vtk, kind(*vtk)), vertices, self.points, first_point)
                        .map_err(|problem| corners.invalid(problem))?;
                }
            }
            Cells::Points([radii, volumes]) => {
                let read = |sizes: &Option<Array>| {
                    sizes.as_ref().map_or(Ok(Vec::new()), |sizes| FileResult::Ok(sizes.read()?.values().to_f64()))
                };
                let cells = &mut grid.mesh.cells;
                cells.points.extend(first_point as u32..grid.mesh.points.len() as u32);
                (cells.radii, cells.volumes) = (read(radii)?, read(volumes)?);
            }
            Cells::Listed(arrays) => {
                let [types, offsets, connectivity] = &**arrays;
                let mut ends = indices(offsets)?;
                let connectivity = indices(connectivity)?;
                if ends.len() > self.cells && ends[0] == 0 {
                    ends.remove(0);
                } else if ends.len() > self.cells {
                    return Err(offsets.invalid(format!("begins with {}, not 0", ends[0])));
                } else if ends.first() == Some(&0) {
                    // Where cells begin, without the last end.
                    ends.remove(0);
                    ends.push(connectivity.len() as u64);
                }
                let (types, ghosts) = (&indices(types)?[..], &[][..]);
                let (ends, connectivity) = (&ends[..], &connectivity[..]);
                let list = CellList { path, place: "array 'connectivity'", types, ends, connectivity, ghosts };
                list.add_to(grid, std::iter::empty(), (self.points, first_point))?;
            }
        }
        grid.cells += self.cells;
        Ok(())
    }
}

/// Cells of one type.
fn same(corners: Array) -> FileResult<(Cells, u64)> {
    let found = match corners.shape[..] {
        [count, width] => TYPES.iter().find(|(of, _)| *of == width).map(|&(width, vtk)| (count, width as usize, vtk)),
        _ => None,
    };
    let Some((count, width, vtk)) = found else {
        let problem = format!("has the shape {:?}, not [m, 4], [m, 5], [m, 6] or [m, 8]", corners.shape);
        return Err(corners.invalid(problem).remedy("of mixed cells, write connectivity, offsets and types"));
    };
    Ok((Cells::Same { corners, vtk, width }, count))
}

/// Length of a list.
fn list(array: &Array) -> FileResult<u64> {
    match array.shape[..] {
        [length] => Ok(length),
        _ => Err(array.invalid(format!("has the shape {:?}, not a list", array.shape))),
    }
}

fn indices(array: &Array) -> FileResult<Vec<u64>> {
    array.read()?.values().to_indices().map_err(|i| {
        array.invalid(format!("number {i} is negative or no integer")).remedy("write it as array.astype('i8')")
    })
}
