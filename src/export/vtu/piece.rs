//! One `.vtu` file: a tetrahedral mesh and its fields at one time.

use crate::error::FileResult;
use crate::export::appended::{Appended, Values};
use crate::field::Association;
use crate::mesh::RawMesh;
use std::path::Path;

/// VTK's cell type of a linear tet.
const VTK_TETRA: u8 = 10;

/// Writes one step to `path`; returns the size of the file. Each component of a field has one value per point or cell.
pub(super) fn write(path: &Path, mesh: &RawMesh, time: f64, fields: &[Values]) -> FileResult<u64> {
    let (points, tets) = (&mesh.points, &mesh.cells.tets);
    let mut file = Appended::begin("UnstructuredGrid", time);
    file.text += &format!("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", points.len(), tets.len());
    file.fields("PointData", Association::Point, fields, points.len(), path)?;
    file.fields("CellData", Association::Cell, fields, tets.len(), path)?;
    file.text += "<Points>\n";
    let coordinates = points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes);
    file.array("Float64", "Points", (3, points.len()), coordinates);
    file.text += "</Points>\n<Cells>\n";
    let connectivity = tets.iter().flatten().map(|v| i64::from(*v).to_le_bytes());
    file.array("Int64", "connectivity", (1, 4 * tets.len()), connectivity);
    file.array("Int64", "offsets", (1, tets.len()), (1..=tets.len() as i64).map(|n| (4 * n).to_le_bytes()));
    file.array("UInt8", "types", (1, tets.len()), std::iter::repeat_n([VTK_TETRA], tets.len()));
    file.text += "</Cells>\n</Piece>\n";
    file.write(path)
}
