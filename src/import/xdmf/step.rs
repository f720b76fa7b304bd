//! One step: the grids that make up its mesh, and the fields on them.

use super::super::cells::{GridReader, Kind, kind, name_of, refuse_solid};
use super::super::numbers::{Numbers, Values};
use super::super::pieces::Piece;
use super::super::series::StepReader;
use super::grid::{Attribute, CELL_TYPES, CellShape, CellType, Geometry, Grid, POLY_VERTEX, Stored, Topology};
use super::items::Item;
use super::tree::Document;
use crate::error::{FileError, FileResult};
use crate::field::FieldInfo;
use crate::mesh::polyhedron::take_faces;
use glam::DVec3;
use std::hash::{DefaultHasher, Hash};
use std::path::Path;
use std::sync::Arc;

/// Location of a step.
#[derive(Clone)]
pub(crate) struct XdmfStep {
    pub(super) document: Arc<Document>,
    /// At least one.
    pub(super) grids: Arc<Vec<Grid>>,
}

impl StepReader for XdmfStep {
    type Origin = Self;
    type Piece = Grid;

    fn open(origin: &Self) -> FileResult<Self> {
        Ok(origin.clone())
    }

    fn path(&self) -> &Path {
        self.document.path()
    }

    fn bytes(&self) -> usize {
        0
    }

    fn pieces(&self) -> &[Grid] {
        &self.grids
    }
}

impl Piece for Grid {
    type Array = Numbers;

    fn path(&self) -> &Path {
        self.document.path()
    }

    fn counts(&self) -> (usize, usize) {
        (self.points, self.topology.cells)
    }

    fn add_to(&self, reader: &mut GridReader) -> FileResult<()> {
        let place = self.document.place(self.topology.id);
        reader.check_room(self.path(), &place, self.points, self.topology.cells)?;
        let first_point = reader.mesh.points.len();
        let with_volume = |reader: &GridReader| reader.mesh.cells.len() - reader.mesh.cells.points.len();
        let before = with_volume(reader);
        self.add_points(reader)?;
        self.add_cells(reader, first_point)?;
        reader.cells += self.topology.cells;
        if with_volume(reader) > before && matches!(self.geometry, Geometry::Together(_, 2)) {
            let problem = "the mesh is flat: GeometryType=\"XY\" with cells that have a volume";
            let error = self.document.unsupported(self.topology.id, problem);
            return Err(error.remedy("write points of three coordinates"));
        }
        Ok(())
    }

    /// Hashes locations in files; the position in the XDMF file does not count.
    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        let topology = &self.topology;
        (self.points, topology.shape, topology.cells, topology.nodes, topology.base).hash(state);
        topology.connectivity.as_ref().map(Item::place).hash(state);
        match &self.geometry {
            Geometry::Together(item, width) => (item.place(), width).hash(state),
            Geometry::Apart(items) => items.each_ref().map(Item::place).hash(state),
        }
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        self.attributes.iter().map(|attribute| attribute.field.clone()).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.left_out.clone()
    }

    fn unit(&self, array: usize) -> Option<String> {
        self.attributes.get(array)?.stored.values().unit()
    }

    fn decode(&self, array: usize) -> FileResult<Numbers> {
        let Attribute { field, stored } = &self.attributes[array];
        match stored {
            Stored::Values(item) => item.read(&self.document),
            Stored::Function(function) => function.read(self, field.association),
        }
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}

impl Grid {
    fn add_points(&self, reader: &mut GridReader) -> FileResult<()> {
        let points = &mut reader.mesh.points;
        match &self.geometry {
            Geometry::Together(item, width) => {
                let numbers = item.read(&self.document)?.values().to_f64();
                points.extend(
                    numbers.chunks_exact(*width).map(|p| DVec3::new(p[0], p[1], p.get(2).copied().unwrap_or(0.0))),
                );
            }
            Geometry::Apart(items) => {
                let read = |item: &Item| Ok(item.read(&self.document)?.values().to_f64());
                let [x, y, z] = [read(&items[0])?, read(&items[1])?, read(&items[2])?];
                points.extend(x.iter().zip(&y).zip(&z).map(|((&x, &y), &z)| DVec3::new(x, y, z)));
            }
        }
        Ok(())
    }

    fn add_cells(&self, reader: &mut GridReader, first_point: usize) -> FileResult<()> {
        let topology = &self.topology;
        match topology.shape {
            CellShape::Same(POLY_VERTEX) => return self.add_points_as_cells(reader, first_point),
            CellShape::Same(vtk) if kind(vtk) == Kind::Flat => {
                reader.skip(vtk, topology.cells);
                return Ok(());
            }
            _ if topology.cells == 0 => return Ok(()),
            CellShape::Mixed => {
                let list = self.list_of_corners()?;
                return self.add_mixed(reader, &list, first_point);
            }
            CellShape::Same(_) => {}
        }
        let (corners, of_type) = self.corners()?;
        let read = (of_type.vtk, kind(of_type.vtk));
        for (cell, vertices) in corners.chunks_exact(of_type.corners).enumerate() {
            let pushed = reader.push(cell, read, vertices, self.points, first_point);
            pushed.map_err(|problem| self.invalid_corners(problem))?;
        }
        Ok(())
    }

    /// Adds cells of points: as many each as is said, or as the list of them has for each, or one. Without a list they are the points in
    /// their order.
    fn add_points_as_cells(&self, reader: &mut GridReader, first_point: usize) -> FileResult<()> {
        let topology = &self.topology;
        let cells = topology.cells as u64;
        let (vertices, of_each) = match topology.connectivity {
            Some(_) => {
                let mut vertices = self.list_of_corners()?;
                self.rebase(topology, &mut vertices)?;
                let of_each = topology.nodes.unwrap_or(vertices.len() as u64 / cells.max(1));
                (vertices, of_each)
            }
            None => {
                let of_each = topology.nodes.unwrap_or(1);
                let count = cells.checked_mul(of_each).filter(|&count| count <= self.points as u64);
                let count = count.ok_or_else(|| {
                    let problem = format!("has {cells} cells of {of_each} points, but there are {}", self.points);
                    self.invalid_corners(problem)
                })?;
                ((0..count).collect(), of_each)
            }
        };
        if cells.checked_mul(of_each) != Some(vertices.len() as u64) {
            let problem = format!("has {} points for {cells} cells of {of_each}", vertices.len());
            return Err(self.invalid_corners(problem));
        }
        let of_each = usize::try_from(of_each).unwrap_or(usize::MAX).max(1);
        for (cell, vertices) in vertices.chunks_exact(of_each).enumerate() {
            let pushed = reader.push_points(cell, POLY_VERTEX, vertices, self.points, first_point);
            pushed.map_err(|problem| self.invalid_corners(problem))?;
        }
        Ok(())
    }

    /// An error about the corners of cells.
    fn invalid_corners(&self, problem: String) -> FileError {
        let topology = &self.topology;
        self.document.invalid(topology.connectivity.as_ref().map_or(topology.id, |item| item.id), problem)
    }

    /// The numbers that the topology lists.
    fn list_of_corners(&self) -> FileResult<Vec<u64>> {
        let lacks = || self.document.invalid(self.topology.id, "has no corners of its cells");
        let item = self.topology.connectivity.as_ref().ok_or_else(lacks)?;
        item.read(&self.document)?.values().to_indices().map_err(|i| {
            let error = self.invalid_corners(format!("number {i} is negative or no integer"));
            error.remedy("corners of cells are whole numbers")
        })
    }

    /// The corners of all cells, from 0 on, where all are of one type, and that type. They may be beyond the points.
    ///
    /// # Errors
    /// If there are none, or more or fewer than the cells have.
    pub(super) fn corners(&self) -> FileResult<(Vec<u64>, &'static CellType)> {
        let topology = &self.topology;
        let is_it = |known: &&CellType| topology.shape == CellShape::Same(known.vtk);
        let mixed = || self.document.invalid(topology.id, "has cells of several types");
        let of_type = CELL_TYPES.iter().find(is_it).ok_or_else(mixed)?;
        let mut corners = self.list_of_corners()?;
        let needed = (of_type.corners as u64).checked_mul(topology.cells as u64);
        if needed != Some(corners.len() as u64) {
            let (got, cells, name) = (corners.len(), topology.cells, name_of(of_type.vtk));
            let needed = needed.map_or("more".to_owned(), |needed| needed.to_string());
            let problem = format!("has {got} corners, but {cells} cells of type {name} need {needed}");
            return Err(self.invalid_corners(problem));
        }
        self.rebase(topology, &mut corners)?;
        Ok((corners, of_type))
    }

    /// Adds the cells of a mixed topology: a list of type, number of corners where the type leaves it open, corners.
    fn add_mixed(&self, reader: &mut GridReader, list: &[u64], first_point: usize) -> FileResult<()> {
        let topology = &self.topology;
        let invalid = |problem: String| self.document.invalid(topology.id, problem);
        let mut rest = list;
        for cell in 0..topology.cells {
            let cut = || invalid(format!("the list of cells ends in cell {cell} of {}", topology.cells));
            let (&code, after) = rest.split_first().ok_or_else(cut)?;
            let known = CELL_TYPES.iter().find(|t| t.code == code);
            let known =
                known.ok_or_else(|| invalid(format!("cell {cell} is of type {code}, which XDMF does not know")))?;
            let read = (known.vtk, kind(known.vtk));
            if read.1 == Kind::Polyhedron {
                let (mut faces, after) = take_faces(after).ok_or_else(cut)?;
                faces.iter_mut().try_for_each(|face| self.rebase(topology, face))?;
                let named = |problem: String| invalid(format!("cell {cell} {problem}"));
                reader.push_polyhedron(self.path(), cell, &faces, self.points, first_point).map_err(named)?;
                rest = after;
                continue;
            }
            if read.1 == Kind::Unread {
                let what = format!("cell {cell} is of type {code} ({})", name_of(known.vtk));
                return Err(refuse_solid(self.path(), self.document.place(topology.id), &what));
            }
            let (corners, after) = match known.corners {
                0 => after
                    .split_first()
                    .and_then(|(&n, after)| Some((usize::try_from(n).ok()?, after)))
                    .ok_or_else(cut)?,
                n => (n, after),
            };
            let (vertices, after) = after.split_at_checked(corners).ok_or_else(cut)?;
            rest = after;
            if read.1 == Kind::Flat && known.vtk != POLY_VERTEX {
                reader.skip(known.vtk, 1);
                continue;
            }
            let mut vertices = vertices.to_vec();
            self.rebase(topology, &mut vertices)?;
            if known.vtk == POLY_VERTEX {
                reader.push_points(cell, known.vtk, &vertices, self.points, first_point).map_err(invalid)?;
                continue;
            }
            reader.push(cell, read, &vertices, self.points, first_point).map_err(invalid)?;
        }
        if rest.is_empty() { Ok(()) } else { Err(invalid(format!("{} numbers follow the last cell", rest.len()))) }
    }

    /// Makes indices zero-based.
    fn rebase(&self, topology: &Topology, vertices: &mut [u64]) -> FileResult<()> {
        for vertex in vertices {
            *vertex = vertex.checked_sub(topology.base).ok_or_else(|| {
                self.document.invalid(topology.id, format!("point {vertex} is below the BaseOffset {}", topology.base))
            })?;
        }
        Ok(())
    }
}
