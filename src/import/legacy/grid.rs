//! Points and cells of legacy files.

use super::LegacyFile;
use super::array::Array;
use super::header::{Cells, Dataset, Header, Size};
use crate::error::{FileError, FileResult};
use crate::import::cell_list::{CellList, GHOST_ARRAY, is_ghost, listed_faces};
use crate::import::cells::GridReader;
use crate::import::lattice::{EvenGrid, Lattice};
use crate::mesh::POLYHEDRON_VTK_TYPE;
use glam::DVec3;
use std::hash::{Hash, Hasher};
use std::path::Path;

/// Most points per byte of a file that does not list them: those of an array of bits.
const POINTS_PER_BYTE: usize = 8;

/// The mesh of a file, whose numbers are not read yet.
#[derive(Debug)]
pub(super) enum Geometry {
    Unstructured {
        points: Array,
        cells: Option<(Cells, Array)>,
    },
    /// Points at equal distances along each axis, from the first one of index 0.
    Even {
        lattice: Lattice,
        first: [i64; 3],
        grid: EvenGrid,
    },
    /// Points with coordinates of their own.
    Curved {
        lattice: Lattice,
        points: Array,
    },
    /// Points at these coordinates along each axis.
    Axes {
        lattice: Lattice,
        axes: [Array; 3],
    },
}

impl Geometry {
    /// The mesh of a header whose file has this many bytes.
    ///
    /// # Errors
    /// If a part is missing, or sizes contradict each other.
    pub(super) fn of(path: &Path, header: &mut Header, bytes: usize) -> FileResult<Self> {
        let lacks = |what: &str| FileError::invalid(path, "", format!("has no {what}")).remedy("write the file again");
        let lattice_of = |size: Option<Size>| match size {
            Some(Size::Dimensions(dims)) => Ok((Lattice::of(dims, bytes), [0; 3])),
            Some(Size::Extent(extent)) => Ok((Lattice::of_extent(extent, bytes), [extent[0], extent[2], extent[4]])),
            None => Err(lacks("DIMENSIONS")),
        };
        let lattice = |size| {
            let (lattice, first) = lattice_of(size)?;
            let lattice = lattice.and_then(|lattice: Lattice| match lattice.points() {
                points if points <= bytes.saturating_mul(POINTS_PER_BYTE) => Ok(lattice),
                points => Err(format!("claims {points} points in a file of {bytes} bytes")),
            });
            Ok((lattice.map_err(|problem| FileError::invalid(path, "DIMENSIONS", problem))?, first))
        };
        Ok(match header.dataset {
            None => return Err(lacks("DATASET")),
            Some(Dataset::UnstructuredGrid) => {
                let cells = match (header.cells.take(), header.cell_types.take()) {
                    (Some(cells), types) if cells.count() > 0 => {
                        Some((cells, types.ok_or_else(|| lacks("CELL_TYPES"))?))
                    }
                    _ => None,
                };
                Self::Unstructured { points: header.points.take().ok_or_else(|| lacks("POINTS"))?, cells }
            }
            Some(Dataset::StructuredPoints) => {
                let (lattice, first) = lattice(header.size)?;
                let grid = EvenGrid::of(header.origin.unwrap_or([0.0; 3]), header.spacing.unwrap_or([1.0; 3]));
                if !grid.is_finite() {
                    let problem = format!("has the origin {:?} and the spacing {:?}", grid.origin, grid.spacing);
                    return Err(FileError::invalid(path, "ORIGIN", problem).remedy("write finite numbers"));
                }
                Self::Even { lattice, first, grid }
            }
            Some(Dataset::StructuredGrid) => {
                let (lattice, _) = lattice(header.size)?;
                let points = header.points.take().ok_or_else(|| lacks("POINTS"))?;
                if points.count / 3 != lattice.points() {
                    let problem = format!("has {} points, but {:?} along its axes", points.count / 3, lattice.dims());
                    return Err(FileError::invalid(path, "POINTS", problem).remedy("correct DIMENSIONS or POINTS"));
                }
                Self::Curved { lattice, points }
            }
            Some(Dataset::RectilinearGrid) => {
                let (lattice, _) = lattice(header.size)?;
                match std::mem::take(&mut header.axes) {
                    [Some(x), Some(y), Some(z)] => Self::Axes { lattice, axes: [x, y, z] },
                    [None, ..] => return Err(lacks("X_COORDINATES")),
                    [_, None, _] => return Err(lacks("Y_COORDINATES")),
                    [.., None] => return Err(lacks("Z_COORDINATES")),
                }
            }
        })
    }

    /// Number of points, and of cells.
    pub(super) fn counts(&self) -> (usize, usize) {
        match self {
            Self::Unstructured { points, cells } => {
                (points.count / 3, cells.as_ref().map_or(0, |(cells, _)| cells.count()))
            }
            Self::Even { lattice, .. } | Self::Curved { lattice, .. } | Self::Axes { lattice, .. } => {
                (lattice.points(), lattice.cells())
            }
        }
    }

    /// Hashes the mesh as it is stored.
    pub(super) fn hash(&self, file: &LegacyFile, state: &mut impl Hasher) {
        let mut add = |array: &Array| {
            (array.kind, array.count).hash(state);
            state.write(file.stored(array));
        };
        match self {
            Self::Unstructured { points, cells } => {
                add(points);
                match cells {
                    None => {}
                    Some((Cells::Rows(_, words), types)) => [words, types].into_iter().for_each(add),
                    Some((Cells::Offsets { offsets, connectivity }, types)) => {
                        [offsets, connectivity, types].into_iter().for_each(add);
                    }
                }
            }
            Self::Even { lattice, first, grid } => (lattice, first, grid).hash(state),
            Self::Curved { lattice, points } => {
                add(points);
                lattice.hash(state);
            }
            Self::Axes { lattice, axes } => {
                axes.iter().for_each(add);
                lattice.hash(state);
            }
        }
    }
}

impl Cells {
    /// Number of cells.
    fn count(&self) -> usize {
        match self {
            Self::Rows(count, _) => *count,
            Self::Offsets { offsets, .. } => offsets.count.saturating_sub(1),
        }
    }
}

/// Adds the mesh of a file to `grid`.
///
/// # Errors
/// If its numbers are damaged or contradict each other, or if a cell has a volume and a shape that is not read.
pub(super) fn add_to(grid: &mut GridReader, file: &LegacyFile) -> FileResult<()> {
    let (points, cells) = file.geometry.counts();
    grid.check_room(&file.path, "", points, cells)?;
    let first_point = grid.mesh.points.len();
    let ghosts = ghosts(file)?;
    let is_hidden = |cell: usize| ghosts.get(cell).is_some_and(|&flags| is_ghost(flags));
    match &file.geometry {
        Geometry::Unstructured { points: array, cells: of_points } => {
            add_points(grid, file, array)?;
            if let Some((list, types)) = of_points {
                add_cells(grid, file, (list, types), &ghosts, (points, first_point))?;
            }
            grid.cells += cells;
            Ok(())
        }
        Geometry::Curved { lattice, points } => {
            add_points(grid, file, points)?;
            lattice.add_cells(grid, &file.path, first_point, false, is_hidden)
        }
        Geometry::Even { lattice, first, grid: even } => {
            grid.mesh.points.extend(lattice.even(*first, even));
            lattice.add_cells(grid, &file.path, first_point, true, is_hidden)
        }
        Geometry::Axes { lattice, axes: [x, y, z] } => {
            let axes = [file.floats(x)?, file.floats(y)?, file.floats(z)?];
            let invalid = |problem: String| FileError::invalid(&file.path, "COORDINATES", problem);
            let points = lattice.product(axes.each_ref().map(Vec::as_slice));
            grid.mesh.points.extend(points.map_err(invalid)?);
            lattice.add_cells(grid, &file.path, first_point, true, is_hidden)
        }
    }
}

fn add_points(grid: &mut GridReader, file: &LegacyFile, points: &Array) -> FileResult<()> {
    grid.mesh.points.extend(file.floats(points)?.chunks_exact(3).map(DVec3::from_slice));
    Ok(())
}

fn add_cells(
    grid: &mut GridReader,
    file: &LegacyFile,
    (cells, types): (&Cells, &Array),
    ghosts: &[u64],
    points: (usize, usize),
) -> FileResult<()> {
    if types.count != cells.count() {
        return Err(file.invalid(types, format!("has {} types for {} cells", types.count, cells.count())));
    }
    let types = file.indices(types)?;
    let (array, ends, connectivity) = match cells {
        Cells::Rows(count, array) => {
            let (ends, vertices) =
                split_rows(&file.indices(array)?, *count).map_err(|problem| file.invalid(array, problem))?;
            (array, ends, vertices)
        }
        Cells::Offsets { offsets, connectivity } => {
            let mut ends = file.indices(offsets)?;
            if ends.first() != Some(&0) {
                return Err(file.invalid(offsets, "does not begin with 0".to_owned()));
            }
            ends.remove(0);
            (connectivity, ends, file.indices(connectivity)?)
        }
    };
    // The vertices of a polyhedron are a list of its faces.
    let faces = types.iter().enumerate().map(|(cell, &of_type)| {
        let begin = cell.checked_sub(1).map_or(0, |before| ends[before]);
        let list = connectivity.get(begin as usize..ends[cell] as usize).unwrap_or_default();
        if of_type == u64::from(POLYHEDRON_VTK_TYPE) { listed_faces(list) } else { Ok(None) }
    });
    let place = file.place(array);
    let list =
        CellList { path: &file.path, place: &place, types: &types, ends: &ends, connectivity: &connectivity, ghosts };
    list.add_to(grid, faces, points)
}

/// The ends of cells in a list of all their vertices, and this list, from rows of a number of vertices and these; the error says what is
/// wrong with them.
fn split_rows(words: &[u64], cells: usize) -> Result<(Vec<u64>, Vec<u64>), String> {
    let (mut ends, mut connectivity) = (Vec::with_capacity(cells), Vec::with_capacity(words.len()));
    let mut rest = words;
    for cell in 0..cells {
        let row = rest.split_first().and_then(|(&count, after)| after.split_at_checked(usize::try_from(count).ok()?));
        let (vertices, after) = row.ok_or_else(|| format!("ends in cell {cell} of {cells}"))?;
        connectivity.extend_from_slice(vertices);
        ends.push(connectivity.len() as u64);
        rest = after;
    }
    if rest.is_empty() { Ok((ends, connectivity)) } else { Err(format!("has {} numbers behind its cells", rest.len())) }
}

/// The flags of ghost cells; empty if there are none.
fn ghosts(file: &LegacyFile) -> FileResult<Vec<u64>> {
    ghost_array(&file.header).map_or(Ok(Vec::new()), |array| file.indices(array))
}

/// The array of these flags.
pub(super) fn ghost_array(header: &Header) -> Option<&Array> {
    header.cell_arrays.iter().find(|array| array.name == GHOST_ARRAY && array.components == 1)
}
