//! One `.vtp` file: VTK's XML PolyData, with raw appended arrays as in `.vtu` files. Points are Float64, fields Float32 per point;
//! isosurfaces have the Float64 array `isovalue` per cell.

use super::step::StepSurface;
use crate::error::FileResult;
use crate::export::appended::{self, Head, block, tuples};
use crate::field::Association;
use std::io::{self, Write};
use std::path::Path;

/// Name of the array with the isovalue of each triangle.
const ISOVALUE: &str = "isovalue";

fn head(surface: &StepSurface, path: &Path) -> FileResult<String> {
    let (points, polys) = (surface.points.len(), surface.triangles.len());
    let mut head = Head::begin("PolyData");
    head.text += &format!(
        "<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"{polys}\">\n"
    );
    head.fields("PointData", Association::Point, &surface.fields, points, path)?;
    head.text += "<CellData>\n";
    if surface.is_isosurface {
        head.array("Float64", ISOVALUE, 1, polys, size_of::<f64>());
    }
    head.text += "</CellData>\n<Points>\n";
    head.array("Float64", "Points", 3, points, size_of::<f64>());
    head.text += "</Points>\n<Polys>\n";
    head.array("Int64", "connectivity", 1, 3 * polys, size_of::<i64>());
    head.array("Int64", "offsets", 1, polys, size_of::<i64>());
    head.text += "</Polys>\n</Piece>\n";
    Ok(head.end("PolyData"))
}

/// Writes the arrays in the order of their declarations in the head.
fn body(out: &mut impl Write, surface: &StepSurface) -> io::Result<()> {
    let StepSurface { time, points, triangles, isovalues, fields, .. } = surface;
    block(out, 1, std::iter::once(time.to_le_bytes()))?;
    for field in fields {
        block(out, field.components.iter().map(Vec::len).sum(), tuples(field))?;
    }
    if surface.is_isosurface {
        block(out, isovalues.len(), isovalues.iter().map(|v| v.to_le_bytes()))?;
    }
    block(out, 3 * points.len(), points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes))?;
    block(out, 3 * triangles.len(), triangles.iter().flatten().map(|i| i64::from(*i).to_le_bytes()))?;
    block(out, triangles.len(), (1..=triangles.len() as i64).map(|n| (3 * n).to_le_bytes()))?;
    out.write_all(appended::END)
}

/// Writes a surface to `path`; returns the size of the file.
///
/// # Errors
/// If XML cannot express the name of a field, or the disk is full.
pub(super) fn write(path: &Path, surface: &StepSurface) -> FileResult<u64> {
    let head = head(surface, path)?;
    appended::write(path, |out| {
        out.write_all(head.as_bytes())?;
        body(out, surface)
    })
}
