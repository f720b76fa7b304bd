//! Common parts of `.vtu` and `.vtp` files: an XML head that gives the offset of each array in the raw appended data behind it.
//!
//! Arrays are blocks of a UInt64 byte count and little-endian values. All sizes are known before the first value is
//! written, so the file is written once from front to back: an array is declared together with the values that follow later.

use super::xml;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Size of the write buffer in bytes.
const BUFFER: usize = 1 << 20;

/// A field of one step: a list of values for each component.
pub(super) struct Values {
    /// Name, number of components, and association of the values.
    pub info: FieldInfo,
    /// Values by component.
    pub components: Vec<Vec<f32>>,
}

impl Values {
    /// Empty values of a field.
    pub fn empty(info: FieldInfo) -> Self {
        Self { components: vec![Vec::new(); info.components], info }
    }
}

/// A file before it is written: its XML head, and its arrays.
pub(super) struct Appended<'a> {
    kind: &'static str,
    /// XML text so far.
    pub text: String,
    /// Offset of the next array.
    offset: u64,
    blocks: Vec<Block<'a>>,
}

/// Writes the values of an array.
type Block<'a> = Box<dyn FnOnce(&mut BufWriter<File>) -> io::Result<()> + 'a>;

impl<'a> Appended<'a> {
    /// Begins a file of this type; its first array is the time.
    pub fn begin(kind: &'static str, time: f64) -> Self {
        // VTK reads the number of values of field data from a separate attribute.
        let text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
            <VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
            <{kind}>\n<FieldData>\n\
            <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"appended\" offset=\"0\"/>\n\
            </FieldData>\n"
        );
        let time: Block<'a> = Box::new(move |out| block(out, 1, std::iter::once(time.to_le_bytes())));
        Self { kind, text, offset: 2 * size_of::<f64>() as u64, blocks: vec![time] }
    }

    /// Adds an array of `tuples` tuples of `components` numbers; `name` is escaped.
    pub fn array<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        (components, tuples): (usize, usize),
        values: impl Iterator<Item = [u8; N]> + 'a,
    ) {
        // A 1 is omitted, as by VTK: meshio reads an array that gives it as having two axes.
        let width = if components == 1 { String::new() } else { format!(" NumberOfComponents=\"{components}\"") };
        self.text += &format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\"{width} format=\"appended\" offset=\"{}\"/>\n",
            self.offset
        );
        let count = components * tuples;
        self.offset += (size_of::<u64>() + count * N) as u64;
        self.blocks.push(Box::new(move |out| block(out, count, values)));
    }

    /// Adds an element to the head, and what `add` adds within.
    pub fn element(&mut self, tag: &str, add: impl FnOnce(&mut Self) -> FileResult<()>) -> FileResult<()> {
        self.text += &format!("<{tag}>\n");
        add(self)?;
        self.text += &format!("</{tag}>\n");
        Ok(())
    }

    /// Adds the fields of points or of cells, and checks their names.
    pub fn fields(&mut self, of: Association, fields: &'a [Values], tuples: usize, path: &Path) -> FileResult<()> {
        for field in fields.iter().filter(|f| f.info.association == of) {
            let name = xml::attribute(&field.info.name).ok_or_else(|| {
                let place = format!("field '{}'", field.info.name.escape_debug());
                FileError::unsupported(path, place, "XML cannot express a character of the name")
                    .remedy("rename the field")
            })?;
            self.array("Float32", &name, (field.info.components, tuples), interleaved(field));
        }
        Ok(())
    }

    /// Creates the file `path`; returns its size.
    pub fn write(self, path: &Path) -> FileResult<u64> {
        write(path, |out| {
            write!(out, "{}</{}>\n<AppendedData encoding=\"raw\">\n_", self.text, self.kind)?;
            self.blocks.into_iter().try_for_each(|block| block(out))?;
            out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
        })
    }
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

/// The values of a field, interleaved by tuple.
fn interleaved(field: &Values) -> impl Iterator<Item = [u8; 4]> + '_ {
    let count = field.components.first().map_or(0, Vec::len);
    (0..count).flat_map(|i| field.components.iter().map(move |values| values[i].to_le_bytes()))
}

/// Creates the file `path`; returns its size.
pub(super) fn write(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> FileResult<u64> {
    let io = |action: &'static str| move |e: io::Error| FileError::io(path, action, &e);
    let mut out = BufWriter::with_capacity(BUFFER, File::create(path).map_err(io("create"))?);
    content(&mut out).map_err(io("write"))?;
    let file = out.into_inner().map_err(|e| FileError::io(path, "write", e.error()))?;
    Ok(file.metadata().map_err(io("examine"))?.len())
}
