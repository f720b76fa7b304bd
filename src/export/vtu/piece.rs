//! One `.vtu` file: a tetrahedral mesh and its fields at one time.

use crate::error::FileResult;
use crate::export::appended::{self, Head, Values, block, tuples};
use crate::field::Association;
use crate::mesh::RawMesh;
use std::io::{self, Write};
use std::path::Path;

/// VTK's cell type of a linear tet.
const VTK_TETRA: u8 = 10;

/// The XML before the appended data.
fn head(mesh: &RawMesh, fields: &[Values], path: &Path) -> FileResult<String> {
    let (points, cells) = (mesh.points.len(), mesh.cells.tets.len());
    let mut head = Head::begin("UnstructuredGrid");
    head.text += &format!("<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n");
    head.fields("PointData", Association::Point, fields, points, path)?;
    head.fields("CellData", Association::Cell, fields, cells, path)?;
    head.text += "<Points>\n";
    head.array("Float64", "Points", 3, points, size_of::<f64>());
    head.text += "</Points>\n<Cells>\n";
    head.array("Int64", "connectivity", 1, 4 * cells, size_of::<i64>());
    head.array("Int64", "offsets", 1, cells, size_of::<i64>());
    head.array("UInt8", "types", 1, cells, size_of::<u8>());
    head.text += "</Cells>\n</Piece>\n";
    Ok(head.end("UnstructuredGrid"))
}

/// Writes the arrays in the order of their declarations in the head.
fn body(out: &mut impl Write, mesh: &RawMesh, time: f64, fields: &[Values]) -> io::Result<()> {
    block(out, 1, std::iter::once(time.to_le_bytes()))?;
    for of in [Association::Point, Association::Cell] {
        for field in fields.iter().filter(|f| f.info.association == of) {
            block(out, field.components.iter().map(Vec::len).sum(), tuples(field))?;
        }
    }
    block(out, 3 * mesh.points.len(), mesh.points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes))?;
    let cells = mesh.cells.tets.len();
    block(out, 4 * cells, mesh.cells.tets.iter().flatten().map(|v| i64::from(*v).to_le_bytes()))?;
    block(out, cells, (1..=cells as i64).map(|n| (4 * n).to_le_bytes()))?;
    block(out, cells, std::iter::repeat_n([VTK_TETRA], cells))?;
    out.write_all(appended::END)
}

/// Writes one step to `path`; returns the size of the file. Each component of a field has one value per point or cell.
pub(super) fn write(path: &Path, mesh: &RawMesh, time: f64, fields: &[Values]) -> FileResult<u64> {
    let head = head(mesh, fields, path)?;
    appended::write(path, |out| {
        out.write_all(head.as_bytes())?;
        body(out, mesh, time, fields)
    })
}
