//! One `.vtu` file: an XML head that gives the offset of each array in the raw appended data behind it.
//!
//! Arrays are blocks of a UInt64 byte count and little-endian values. All sizes are known before the first value is
//! written, so the file is written once from front to back.

use super::xml;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::mesh::RawMesh;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// VTK's cell type of a linear tet.
const VTK_TETRA: u8 = 10;
/// Bytes collected before they go to the file.
const BUFFER: usize = 1 << 20;

/// A field of one step: a list of values for each component.
pub(super) struct Values {
    /// Name, number of components, and whether the values are of points or of cells.
    pub info: FieldInfo,
    /// Values by component.
    pub components: Vec<Vec<f32>>,
}

impl Values {
    /// Room for the values of a field.
    pub fn empty(info: FieldInfo) -> Self {
        Self { components: vec![Vec::new(); info.components], info }
    }
}

/// The head of a file, and where the next array goes.
struct Head {
    text: String,
    offset: u64,
}

impl Head {
    /// Declares an array of `tuples` tuples of `components` numbers of `bytes` bytes; `name` is escaped.
    fn array(&mut self, kind: &str, name: &str, components: usize, tuples: usize, bytes: usize) {
        // As VTK, which leaves a 1 out: meshio takes a scalar that says it for an array of two axes.
        let width = if components == 1 { String::new() } else { format!(" NumberOfComponents=\"{components}\"") };
        self.text += &format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\"{width} format=\"appended\" offset=\"{}\"/>\n",
            self.offset
        );
        self.offset += (size_of::<u64>() + components * tuples * bytes) as u64;
    }

    fn fields(&mut self, tag: &str, of: Association, fields: &[Values], tuples: usize, path: &Path) -> FileResult<()> {
        self.text += &format!("<{tag}>\n");
        for field in fields.iter().filter(|f| f.info.association == of) {
            let name = xml::attribute(&field.info.name).ok_or_else(|| {
                let place = format!("field '{}'", field.info.name.escape_debug());
                FileError::unsupported(path, place, "XML cannot express a character of the name")
                    .remedy("rename the field")
            })?;
            self.array("Float32", &name, field.info.components, tuples, size_of::<f32>());
        }
        self.text += &format!("</{tag}>\n");
        Ok(())
    }
}

/// The XML in front of the appended data.
fn head(mesh: &RawMesh, fields: &[Values], path: &Path) -> FileResult<String> {
    let (points, cells) = (mesh.points.len(), mesh.tets.len());
    let mut head = Head {
        text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
            <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
            <UnstructuredGrid>\n<FieldData>\n"
            .to_owned(),
        offset: 0,
    };
    // VTK reads the number of values of field data from an attribute of its own.
    head.text +=
        "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"appended\" offset=\"0\"/>\n";
    head.offset += 2 * size_of::<f64>() as u64;
    head.text += &format!("</FieldData>\n<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n");
    head.fields("PointData", Association::Point, fields, points, path)?;
    head.fields("CellData", Association::Cell, fields, cells, path)?;
    head.text += "<Points>\n";
    head.array("Float64", "Points", 3, points, size_of::<f64>());
    head.text += "</Points>\n<Cells>\n";
    head.array("Int64", "connectivity", 1, 4 * cells, size_of::<i64>());
    head.array("Int64", "offsets", 1, cells, size_of::<i64>());
    head.array("UInt8", "types", 1, cells, size_of::<u8>());
    head.text += "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    Ok(head.text)
}

/// Writes one block: its size in bytes, then `count` values.
fn block<const N: usize>(out: &mut impl Write, count: usize, values: impl Iterator<Item = [u8; N]>) -> io::Result<()> {
    out.write_all(&((count * N) as u64).to_le_bytes())?;
    let mut written = 0;
    for value in values {
        out.write_all(&value)?;
        written += 1;
    }
    debug_assert_eq!(written, count, "the head has promised the offsets of the blocks");
    Ok(())
}

/// The values of a field, tuple by tuple.
fn tuples(field: &Values) -> impl Iterator<Item = [u8; 4]> + '_ {
    let count = field.components.first().map_or(0, Vec::len);
    (0..count).flat_map(|i| field.components.iter().map(move |values| values[i].to_le_bytes()))
}

/// The arrays, in the order in which the head has declared them.
fn body(out: &mut impl Write, mesh: &RawMesh, time: f64, fields: &[Values]) -> io::Result<()> {
    block(out, 1, std::iter::once(time.to_le_bytes()))?;
    for of in [Association::Point, Association::Cell] {
        for field in fields.iter().filter(|f| f.info.association == of) {
            block(out, field.components.iter().map(Vec::len).sum(), tuples(field))?;
        }
    }
    block(out, 3 * mesh.points.len(), mesh.points.iter().flat_map(|p| p.to_array()).map(f64::to_le_bytes))?;
    let cells = mesh.tets.len();
    block(out, 4 * cells, mesh.tets.iter().flatten().map(|v| i64::from(*v).to_le_bytes()))?;
    block(out, cells, (1..=cells as i64).map(|n| (4 * n).to_le_bytes()))?;
    block(out, cells, std::iter::repeat_n([VTK_TETRA], cells))?;
    out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
}

/// Writes one step to `path`; returns the size of the file. Every component of a field has one value per point or cell.
pub(super) fn write(path: &Path, mesh: &RawMesh, time: f64, fields: &[Values]) -> FileResult<u64> {
    let head = head(mesh, fields, path)?;
    let io = |action: &'static str| move |e: io::Error| FileError::io(path, action, &e);
    let mut out = BufWriter::with_capacity(BUFFER, File::create(path).map_err(io("create"))?);
    out.write_all(head.as_bytes()).map_err(io("write"))?;
    body(&mut out, mesh, time, fields).map_err(io("write"))?;
    let file = out.into_inner().map_err(|e| FileError::io(path, "write", e.error()))?;
    Ok(file.metadata().map_err(io("examine"))?.len())
}
