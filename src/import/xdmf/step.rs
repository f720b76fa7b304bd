//! One step: the grids that make up its mesh, and the fields on them.

use super::super::cells::{GridReader, Kind, kind, name_of, refuse_solid};
use super::super::numbers::Values;
use super::super::series::StepReader;
use super::grid::{Attribute, CELL_TYPES, CellShape, Geometry, Grid, Topology};
use super::items::{Item, ItemBytes};
use super::tree::Document;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::mesh::polyhedron::take_faces;
use glam::DVec3;
use std::hash::{DefaultHasher, Hash, Hasher};
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
    /// One item per grid, in order.
    type Decoded = Vec<ItemBytes>;

    fn open(origin: &Self) -> FileResult<Self> {
        Ok(origin.clone())
    }

    fn path(&self) -> &Path {
        self.document.path()
    }

    fn bytes(&self) -> usize {
        0
    }

    fn is_in_pieces(&self) -> bool {
        self.grids.len() > 1
    }

    fn counts(&self) -> FileResult<(usize, usize)> {
        Ok(self.grids.iter().fold((0, 0), |(points, cells), grid| {
            (points.saturating_add(grid.points), cells.saturating_add(grid.topology.cells))
        }))
    }

    fn read_grid(&self) -> FileResult<GridReader> {
        let mut reader = GridReader::default();
        for grid in self.grids.iter() {
            self.add_grid(&mut reader, grid)?;
        }
        Ok(reader)
    }

    fn stored_hash(&self) -> FileResult<u64> {
        // Hashes locations in files; the position in the XDMF file does not count.
        let mut state = DefaultHasher::new();
        for grid in self.grids.iter() {
            let topology = &grid.topology;
            (grid.points, topology.shape, topology.cells, topology.base).hash(&mut state);
            topology.connectivity.as_ref().map(Item::place).hash(&mut state);
            match &grid.geometry {
                Geometry::Together(item, width) => (item.place(), width).hash(&mut state),
                Geometry::Apart(items) => items.each_ref().map(Item::place).hash(&mut state),
            }
        }
        Ok(state.finish())
    }

    fn fields(&self) -> (Vec<FieldInfo>, Vec<String>) {
        let mut fields: Vec<FieldInfo> = Vec::new();
        let mut left_out: Vec<String> = self.grids.iter().flat_map(|grid| grid.left_out.clone()).collect();
        for grid in self.grids.iter() {
            for (i, Attribute { field, .. }) in grid.attributes.iter().enumerate() {
                let is_same = |other: &Attribute| other.field.components == field.components;
                if find(&grid.attributes[..i], field).is_some() {
                    left_out.push(format!("'{}' (a second array of that name)", field.name));
                } else if !self.grids.iter().all(|grid| find(&grid.attributes, field).is_some_and(is_same)) {
                    left_out.push(format!("'{}' (not the same in all pieces)", field.name));
                } else if !fields.contains(field) {
                    fields.push(field.clone());
                }
            }
        }
        fields.sort_by_key(|field| field.association == Association::Cell);
        (fields, left_out)
    }

    fn decode(&self, field: &FieldInfo, step: usize) -> FileResult<Vec<ItemBytes>> {
        let invalid = |problem: String| {
            FileError::invalid(self.path(), format!("step {step}"), problem).remedy("leave that step or that field out")
        };
        let read = |grid: &Grid| {
            let name = &field.name;
            let attribute = find(&grid.attributes, field).ok_or_else(|| {
                let kind = if field.association == Association::Point { "node" } else { "cell" };
                let reason = grid.left_out.iter().find(|text| text.starts_with(&format!("'{name}' (")));
                let reason = reason.map_or(String::new(), |text| format!(": {text}"));
                invalid(format!("has no {kind} attribute '{name}'{reason}"))
            })?;
            if attribute.field.components != field.components {
                let (new, old) = (attribute.field.components, field.components);
                return Err(invalid(format!("attribute '{name}' has {new} components, but {old} in the first step")));
            }
            attribute.item.read(&self.document)
        };
        self.grids.iter().map(read).collect()
    }

    fn values<'a>(&'a self, decoded: &'a Vec<ItemBytes>) -> Vec<Values<'a>> {
        decoded.iter().map(ItemBytes::values).collect()
    }
}

impl XdmfStep {
    fn add_grid(&self, reader: &mut GridReader, grid: &Grid) -> FileResult<()> {
        let place = self.document.place(grid.topology.id);
        reader.check_room(self.path(), &place, grid.points, grid.topology.cells)?;
        let first_point = reader.mesh.points.len();
        let cells_before = reader.mesh.cells.len();
        self.add_points(reader, &grid.geometry)?;
        self.add_cells(reader, grid, first_point)?;
        reader.cells += grid.topology.cells;
        if reader.mesh.cells.len() > cells_before && matches!(grid.geometry, Geometry::Together(_, 2)) {
            let problem = "the mesh is flat: GeometryType=\"XY\" with cells that have a volume";
            return Err(self
                .document
                .unsupported(grid.topology.id, problem)
                .remedy("write points of three coordinates"));
        }
        Ok(())
    }

    fn add_points(&self, reader: &mut GridReader, geometry: &Geometry) -> FileResult<()> {
        let points = &mut reader.mesh.points;
        match geometry {
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

    fn add_cells(&self, reader: &mut GridReader, grid: &Grid, first_point: usize) -> FileResult<()> {
        let topology = &grid.topology;
        let of_type = match topology.shape {
            CellShape::Same(vtk) if kind(vtk) == Kind::Flat => {
                reader.skip(vtk, topology.cells);
                return Ok(());
            }
            _ if topology.cells == 0 => return Ok(()),
            CellShape::Same(vtk) => CELL_TYPES.iter().find(|known| known.vtk == vtk),
            CellShape::Mixed => None,
        };
        let lacks = || self.document.invalid(topology.id, "has no corners of its cells");
        let item = topology.connectivity.as_ref().ok_or_else(lacks)?;
        let invalid = |problem: String| self.document.invalid(item.id, problem);
        let mut corners = item.read(&self.document)?.values().to_indices().map_err(|i| {
            invalid(format!("number {i} is negative or no integer")).remedy("corners of cells are whole numbers")
        })?;
        let Some(of_type) = of_type else {
            return self.add_mixed(reader, grid, &corners, first_point);
        };
        let needed = of_type.corners as u64 * topology.cells as u64;
        if corners.len() as u64 != needed {
            let (got, cells, name) = (corners.len(), topology.cells, name_of(of_type.vtk));
            return Err(invalid(format!("has {got} corners, but {cells} cells of type {name} need {needed}")));
        }
        self.rebase(topology, &mut corners)?;
        let read = (of_type.vtk, kind(of_type.vtk));
        for (cell, vertices) in corners.chunks_exact(of_type.corners).enumerate() {
            reader.push(cell, read, vertices, grid.points, first_point).map_err(invalid)?;
        }
        Ok(())
    }

    /// Adds the cells of a mixed topology: a list of type, number of corners where the type leaves it open, corners.
    fn add_mixed(&self, reader: &mut GridReader, grid: &Grid, list: &[u64], first_point: usize) -> FileResult<()> {
        let topology = &grid.topology;
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
                reader.push_polyhedron(self.path(), cell, &faces, grid.points, first_point).map_err(named)?;
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
            if read.1 == Kind::Flat {
                reader.skip(known.vtk, 1);
                continue;
            }
            let mut vertices = vertices.to_vec();
            self.rebase(topology, &mut vertices)?;
            reader.push(cell, read, &vertices, grid.points, first_point).map_err(invalid)?;
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

fn find<'a>(attributes: &'a [Attribute], field: &FieldInfo) -> Option<&'a Attribute> {
    attributes.iter().find(|a| a.field.association == field.association && a.field.name == field.name)
}
