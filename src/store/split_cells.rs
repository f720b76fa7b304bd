//! The source's cells of which several tetrahedra were made, for export.

use super::array::StoredArray;
use super::layout::{self, MESH};
use super::mesh::{ArrayWriter, column};
use crate::codec::{Chunking, ElementType, ReadRange};
use crate::error::{FileError, FileResult};
use crate::mesh::polyhedron::take_faces;
use crate::mesh::{POLYHEDRON_VTK_TYPE, Solid, SolidShape, SplitCells};
use serde_json::Map;
use std::path::Path;

/// Group of the mesh that has them, absent if there are none: VTK's number of each cell's shape, the vertices of those that are no polyhedra
/// in VTK's order, and the index of each in the source.
const GROUP: &str = "split_cells";
const TYPES: &str = "types";
const VERTICES: &str = "vertices";
const SOURCES: &str = "sources";
/// The faces of polyhedra, absent if there are none: for each their number, then for each face the number of its corners, and these.
const FACES: &str = "faces";
/// For each cell that is cut from a point in its middle its place among these cells, and that vertex of the mesh; absent if there are none.
const STEINER: &str = "steiner";

/// Writes the split cells of a mesh; returns the bytes of their chunks.
pub(super) fn write(root: &Path, cells: &SplitCells) -> FileResult<u64> {
    if cells.source.is_empty() {
        return Ok(0);
    }
    let group = format!("{MESH}/{GROUP}");
    layout::write_group(root, &group, &Map::new())?;
    let types: Vec<u8> = cells.solids.iter().map(Solid::vtk_type).collect();
    let (mut corners, mut faces) = (Vec::<u32>::new(), Vec::<u32>::new());
    for solid in cells.solids.iter() {
        match solid {
            Solid::Shape(_, of_cell) => corners.extend(of_cell),
            Solid::Polyhedron(polyhedron) => faces.extend(polyhedron.faces),
        }
    }
    let mut to = ArrayWriter::new(root, &group);
    to.write(TYPES, column(&types), ["cell", ""], Map::new())?;
    to.write(VERTICES, column(&corners), ["corner", ""], Map::new())?;
    if !faces.is_empty() {
        to.write(FACES, column(&faces), ["word", ""], Map::new())?;
    }
    to.write(SOURCES, column(&cells.source), ["cell", ""], Map::new())?;
    if !cells.steiner.is_empty() {
        to.write(STEINER, &cells.steiner, ["cell", "place_vertex"], Map::new())?;
    }
    Ok(to.sink.bytes)
}

/// Reads the split cells of a mesh with this number of vertices: none if the mesh has none, or an older version wrote the store.
pub(super) fn read(root: &Path, source: &dyn ReadRange, vertices: u64) -> FileResult<SplitCells> {
    if !root.join(MESH).join(GROUP).exists() {
        return Ok(SplitCells::default());
    }
    let open =
        |name: &str, element| StoredArray::open(root, &format!("{MESH}/{GROUP}/{name}"), element, Chunking::Whole, 1);
    let types = open(TYPES, ElementType::U8)?.read::<u8, 1>(source)?.into_flattened();
    let corners = open(VERTICES, ElementType::U32)?.read::<u32, 1>(source)?.into_flattened();
    let sources = open(SOURCES, ElementType::U32)?.expect_shape(&[types.len() as u64])?;
    let mut cells = SplitCells { source: sources.read::<u32, 1>(source)?.into_flattened(), ..SplitCells::default() };
    let invalid = |name: &str, problem: String| {
        FileError::invalid(root.join(MESH).join(GROUP).join(name), "array", problem).remedy("import the series again")
    };
    if !cells.source.is_sorted_by(|a, b| a < b) {
        return Err(invalid(SOURCES, "cells of the source are not in order".to_owned()));
    }
    let has_faces = root.join(MESH).join(GROUP).join(FACES).exists();
    let faces =
        if has_faces { open(FACES, ElementType::U32)?.read::<u32, 1>(source)?.into_flattened() } else { vec![] };
    let is_vertex = |vertex: &u32| u64::from(*vertex) < vertices;
    if let Some(beyond) = corners.iter().find(|vertex| !is_vertex(vertex)) {
        return Err(invalid(VERTICES, format!("has vertex {beyond}, but the mesh has {vertices}")));
    }
    let (mut rest, mut faces) = (corners.as_slice(), faces.as_slice());
    for (cell, &number) in types.iter().enumerate() {
        if number == POLYHEDRON_VTK_TYPE {
            let is_sound = |of_cell: &[Vec<u32>]| !of_cell.is_empty() && of_cell.iter().flatten().all(is_vertex);
            let (of_cell, after) = take_faces(faces)
                .filter(|(of_cell, _)| is_sound(of_cell))
                .ok_or_else(|| invalid(FACES, format!("has no faces of split cell {cell}")))?;
            cells.solids.push_polyhedron(of_cell.iter().map(Vec::as_slice));
            faces = after;
            continue;
        }
        let shape = SolidShape::ALL.into_iter().find(|shape| shape.vtk_type() == number);
        let shape =
            shape.ok_or_else(|| invalid(TYPES, format!("cell {cell} is of type {number}, which is not known")))?;
        let (of_cell, after) = rest
            .split_at_checked(shape.corners())
            .ok_or_else(|| invalid(VERTICES, format!("ends in split cell {cell} of {}", types.len())))?;
        cells.solids.push(shape, of_cell.iter().copied());
        rest = after;
    }
    for (name, more) in [(VERTICES, rest), (FACES, faces)] {
        if !more.is_empty() {
            return Err(invalid(name, format!("has {} numbers more than its cells", more.len())));
        }
    }
    if root.join(MESH).join(GROUP).join(STEINER).exists() {
        let name = format!("{MESH}/{GROUP}/{STEINER}");
        cells.steiner = StoredArray::open(root, &name, ElementType::U32, Chunking::Whole, 2)?.read::<u32, 2>(source)?;
        let is_sound = |[place, vertex]: &[u32; 2]| (*place as usize) < types.len() && is_vertex(vertex);
        if !cells.steiner.iter().all(is_sound) || !cells.steiner.is_sorted_by(|[a, _], [b, _]| a < b) {
            let problem = "does not have cells in order, with vertices of the mesh".to_owned();
            return Err(invalid(STEINER, problem));
        }
    }
    Ok(cells)
}
