//! One `.vtp` file: VTK's XML PolyData, with raw appended arrays as in `.vtu` files. Points are Float64, fields Float32 per point, or
//! per triangle for fields of cells; isosurfaces have the Float64 array `isovalue` per triangle.

use super::step::StepSurface;
use crate::error::FileResult;
use crate::export::appended::Appended;
use crate::field::Association;
use std::path::Path;

/// Name of the array with the isovalue of each triangle.
const ISOVALUE: &str = "isovalue";

/// Writes a surface to `path`; returns the size of the file.
///
/// # Errors
/// If XML cannot express the name of a field, or the disk is full.
pub(super) fn write(path: &Path, surface: &StepSurface) -> FileResult<u64> {
    let StepSurface { points, triangles, isovalues, .. } = surface;
    let (point_count, polys) = (points.len(), triangles.len());
    let mut file = Appended::begin("PolyData", surface.time);
    file.text += &format!(
        "<Piece NumberOfPoints=\"{point_count}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"{polys}\">\n"
    );
    file.element("PointData", |file| file.fields(Association::Point, &surface.fields, point_count, path))?;
    file.element("CellData", |file| {
        if surface.is_isosurface {
            file.array("Float64", ISOVALUE, (1, polys), isovalues.iter().map(|v| v.to_le_bytes()));
        }
        file.fields(Association::Cell, &surface.fields, polys, path)
    })?;
    file.text += "<Points>\n";
    let coordinates = points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes);
    file.array("Float64", "Points", (3, point_count), coordinates);
    file.text += "</Points>\n<Polys>\n";
    let connectivity = triangles.iter().flatten().map(|i| i64::from(*i).to_le_bytes());
    file.array("Int64", "connectivity", (1, 3 * polys), connectivity);
    file.array("Int64", "offsets", (1, polys), (1..=polys as i64).map(|n| (3 * n).to_le_bytes()));
    file.text += "</Polys>\n</Piece>\n";
    file.write(path)
}
