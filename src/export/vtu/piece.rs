//! One `.vtu` file: a mesh and its fields at one time.

use crate::error::FileResult;
use crate::export::appended::{Appended, Values};
use crate::field::{Association, RADIUS, VOLUME};
use crate::mesh::{RawMesh, Solid};
use std::path::Path;

/// VTK's cell types of a tetrahedron, and of a point.
const VTK_TETRA: u8 = 10;
const VTK_VERTEX: u8 = 1;

/// Place of the faces of a cell that has none of its own.
const NO_FACES: i64 = -1;

/// The list of a cell's faces, as VTK has it, if it is a polyhedron.
fn faces_of(solid: Solid<'_>) -> Option<&[u32]> {
    match solid {
        Solid::Shape(..) => None,
        Solid::Polyhedron(polyhedron) => Some(polyhedron.faces),
    }
}

/// Writes one step to `path`; returns the size of the file. Each component of a field has one value per point or cell.
pub(super) fn write(path: &Path, mesh: &RawMesh, time: f64, fields: &[Values]) -> FileResult<u64> {
    let (points, cells) = (&mesh.points, &mesh.cells);
    let mut file = Appended::begin("UnstructuredGrid", time);
    file.text += &format!("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", points.len(), cells.len());
    file.element("PointData", |file| {
        file.fields(Association::Point, fields, points.len(), path)?;
        for (name, sizes) in [(RADIUS, &cells.radii), (VOLUME, &cells.volumes)] {
            let is_field =
                fields.iter().any(|field| field.info.association == Association::Point && field.info.name == name);
            if !sizes.is_empty() && !is_field {
                let mut of_points = vec![f64::NAN; points.len()];
                cells.points.iter().zip(sizes).for_each(|(&point, &size)| of_points[point as usize] = size);
                file.array("Float64", name, (1, points.len()), of_points.into_iter().map(f64::to_le_bytes));
            }
        }
        Ok(())
    })?;
    file.element("CellData", |file| file.fields(Association::Cell, fields, cells.len(), path))?;
    file.text += "<Points>\n";
    let coordinates = points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes);
    file.array("Float64", "Points", (3, points.len()), coordinates);
    file.text += "</Points>\n<Cells>\n";
    let corners: usize = cells.iter().map(<[u32]>::len).sum();
    let connectivity = cells.iter().flatten().map(|v| i64::from(*v).to_le_bytes());
    file.array("Int64", "connectivity", (1, corners), connectivity);
    let offsets = cells.iter().scan(0_i64, |end, cell| {
        *end += cell.len() as i64;
        Some(end.to_le_bytes())
    });
    file.array("Int64", "offsets", (1, cells.len()), offsets);
    let of_solids = cells.solids.iter().map(Solid::vtk_type);
    let types = std::iter::repeat_n(VTK_TETRA, cells.tets.len()).chain(of_solids);
    let types = types.chain(std::iter::repeat_n(VTK_VERTEX, cells.points.len()));
    file.array("UInt8", "types", (1, cells.len()), types.map(|number| [number]));
    let polyhedra = || cells.solids.iter().filter_map(faces_of);
    let words: usize = polyhedra().map(<[u32]>::len).sum();
    if words > 0 {
        file.array("Int64", "faces", (1, words), polyhedra().flatten().map(|word| i64::from(*word).to_le_bytes()));
        let lists = std::iter::repeat_n(None, cells.tets.len()).chain(cells.solids.iter().map(faces_of));
        let ends = lists.scan(0_i64, |end, list: Option<&[u32]>| {
            *end += list.map_or(0, |list| list.len() as i64);
            Some(if list.is_some() { *end } else { NO_FACES }.to_le_bytes())
        });
        file.array("Int64", "faceoffsets", (1, cells.len()), ends);
    }
    file.text += "</Cells>\n</Piece>\n";
    file.write(path)
}
