//! What a legacy file holds: its mesh, its arrays, and where their numbers lie.

use super::array::Array;
use super::cursor::{AGAIN, Cursor, shown};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use std::path::Path;

/// The newest version of the format.
const NEWEST_VERSION: u32 = 5;
/// Arrays of the field data that have the time of the file.
pub(super) const TIME_ARRAYS: [&str; 2] = ["TIME", "TimeValue"];

/// The parts of a file, as its keywords name them.
#[derive(Debug, Default)]
pub(super) struct Header {
    pub(super) is_binary: bool,
    pub(super) dataset: Option<Dataset>,
    pub(super) size: Option<Size>,
    pub(super) spacing: Option<[f64; 3]>,
    pub(super) origin: Option<[f64; 3]>,
    /// Coordinates along x, y and z.
    pub(super) axes: [Option<Array>; 3],
    pub(super) points: Option<Array>,
    pub(super) cells: Option<Cells>,
    pub(super) cell_types: Option<Array>,
    /// Numbers of points and of cells that the arrays are for.
    pub(super) values: [Option<usize>; 2],
    pub(super) point_arrays: Vec<Array>,
    pub(super) cell_arrays: Vec<Array>,
    /// Arrays that are not read, as `'NAME' (REASON)`.
    pub(super) left_out: Vec<String>,
    /// One of [`TIME_ARRAYS`].
    pub(super) time: Option<Array>,
}

/// The kinds of meshes that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Dataset {
    UnstructuredGrid,
    StructuredPoints,
    StructuredGrid,
    RectilinearGrid,
}

/// The size of a structured mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Size {
    /// Numbers of points along x, y and z.
    Dimensions([u64; 3]),
    /// The first and the last index along each.
    Extent([i64; 6]),
}

/// The vertices of unstructured cells.
#[derive(Debug, Hash)]
pub(super) enum Cells {
    /// For each of this number of cells the number of its vertices, and these.
    Rows(usize, Array),
    /// Where the vertices of each begin in a list of all, and end.
    Offsets { offsets: Array, connectivity: Array },
}

/// How much of a file is parsed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    Whole,
    /// Up to the mesh, before which writers put the field data.
    Time,
}

/// Parses a file, or its start.
///
/// # Errors
/// If it is no legacy file, ends too early, or has a keyword that is not read.
pub(super) fn parse(path: &Path, bytes: &[u8], extent: Extent) -> FileResult<Header> {
    let mut cursor = Cursor { path, bytes, at: 0, is_binary: false };
    let is_binary = first_lines(&mut cursor)?;
    cursor.is_binary = is_binary;
    let mut parser = Parser { cursor, header: Header { is_binary, ..Header::default() }, section: None };
    while let Some(word) = parser.cursor.word() {
        let keyword = word.to_ascii_lowercase();
        let is_before_mesh = matches!(
            keyword.as_slice(),
            b"dataset" | b"field" | b"dimensions" | b"extent" | b"spacing" | b"aspect_ratio" | b"origin"
        );
        if extent == Extent::Time && !is_before_mesh && parser.cursor.at < bytes.len() {
            return Ok(parser.header);
        }
        parser.keyword(word, &keyword)?;
    }
    if extent == Extent::Time || parser.header.dataset.is_none() {
        return Err(parser.cursor.cut("mesh"));
    }
    Ok(parser.header)
}

/// Reads the lines before the mesh: the version, a title, and whether arrays are binary.
fn first_lines(cursor: &mut Cursor<'_>) -> FileResult<bool> {
    const START: &[u8] = b"# vtk DataFile Version";
    let path = cursor.path;
    let version = cursor.line().and_then(|line| line.trim_ascii_start().strip_prefix(START)).ok_or_else(|| {
        let problem = "this is no legacy VTK file: its first line is not '# vtk DataFile Version'";
        FileError::invalid(path, "line 1", problem)
    })?;
    let version = shown(version.trim_ascii());
    if version.split('.').next().and_then(|major| major.parse().ok()).is_some_and(|major: u32| major > NEWEST_VERSION) {
        let problem = format!("is of version {version} of the format");
        return Err(FileError::unsupported(path, "line 1", problem).remedy("write it as version 5.1 or older"));
    }
    cursor.line().ok_or_else(|| cursor.cut("title"))?;
    let encoding = cursor.needed("word ASCII or BINARY")?;
    match encoding.to_ascii_lowercase().as_slice() {
        b"ascii" => Ok(false),
        b"binary" => Ok(true),
        _ => Err(cursor.invalid(format!("'{}' is neither ASCII nor BINARY", shown(encoding)))),
    }
}

/// The header, as far as it is read.
pub(super) struct Parser<'a> {
    pub(super) cursor: Cursor<'a>,
    pub(super) header: Header,
    /// What the arrays that follow are for, and how many of these there are.
    pub(super) section: Option<(Association, usize)>,
}

impl Parser<'_> {
    /// Reads what follows a keyword.
    fn keyword(&mut self, word: &[u8], lower: &[u8]) -> FileResult<()> {
        let cursor = &mut self.cursor;
        match lower {
            b"dataset" => self.header.dataset = Some(dataset(cursor)?),
            b"dimensions" => self.header.size = Some(Size::Dimensions(cursor.three("number of points")?)),
            b"extent" => self.header.size = Some(extent(cursor)?),
            b"spacing" | b"aspect_ratio" => self.header.spacing = Some(cursor.three("distance")?),
            b"origin" => self.header.origin = Some(cursor.three("coordinate")?),
            b"x_coordinates" | b"y_coordinates" | b"z_coordinates" => {
                let count = cursor.number("number of coordinates")?;
                let name = shown(word);
                self.header.axes[usize::from(lower[0] - b'x')] = Some(cursor.array(&name, count, 1)?);
            }
            b"points" => {
                let count = cursor.number("number of points")?;
                self.header.points = Some(cursor.array("POINTS", count, 3)?);
            }
            b"cells" => self.header.cells = Some(cells(cursor)?),
            b"cell_types" => {
                let count = cursor.number("number of cells")?;
                self.header.cell_types = Some(cursor.array_of("CELL_TYPES", b"int", count, 1)?);
            }
            b"point_data" => self.begin(Association::Point)?,
            b"cell_data" => self.begin(Association::Cell)?,
            b"field" => self.field()?,
            _ => return self.attribute(word, lower),
        }
        Ok(())
    }

    /// The error that a keyword is not read.
    pub(super) fn unknown(&self, word: &[u8]) -> FileError {
        let problem = format!("'{}' is no keyword that is read", shown(word));
        self.cursor.invalid(problem).remedy("write the file again with VTK, or as .vtu")
    }
}

fn dataset(cursor: &mut Cursor<'_>) -> FileResult<Dataset> {
    let word = cursor.needed("kind of the mesh")?;
    match word.to_ascii_lowercase().as_slice() {
        b"unstructured_grid" => Ok(Dataset::UnstructuredGrid),
        b"structured_points" => Ok(Dataset::StructuredPoints),
        b"structured_grid" => Ok(Dataset::StructuredGrid),
        b"rectilinear_grid" => Ok(Dataset::RectilinearGrid),
        b"polydata" => Err(cursor
            .unsupported("is a surface (DATASET POLYDATA)".to_owned())
            .remedy("write the volume mesh that it bounds")),
        _ => Err(cursor
            .unsupported(format!("is of kind DATASET {}", shown(word)))
            .remedy("write an unstructured or structured grid")),
    }
}

fn extent(cursor: &mut Cursor<'_>) -> FileResult<Size> {
    let what = "index of a point";
    let ([a, b, c], [d, e, f]) = (cursor.three(what)?, cursor.three(what)?);
    Ok(Size::Extent([a, b, c, d, e, f]))
}

/// The vertices of cells: `CELLS`, and behind it the number of cells and of all numbers, or of the two arrays that follow.
fn cells(cursor: &mut Cursor<'_>) -> FileResult<Cells> {
    let first = cursor.number("number of cells")?;
    let second = cursor.number("number of vertices")?;
    if !cursor.is_next("OFFSETS") {
        if first > second {
            return Err(cursor.invalid(format!("CELLS claims {first} cells in {second} numbers")).remedy(AGAIN));
        }
        return Ok(Cells::Rows(first, cursor.array_of("CELLS", b"int", second, 1)?));
    }
    cursor.word();
    let offsets = cursor.array("OFFSETS", first, 1)?;
    if !cursor.is_next("CONNECTIVITY") {
        return Err(cursor.invalid("OFFSETS has no CONNECTIVITY behind it".to_owned()).remedy(AGAIN));
    }
    cursor.word();
    Ok(Cells::Offsets { offsets, connectivity: cursor.array("CONNECTIVITY", second, 1)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str, extent: Extent) -> Result<Header, String> {
        let text = format!("# vtk DataFile Version 3.0\ntitle\nASCII\n{text}");
        parse(Path::new("a.vtk"), text.as_bytes(), extent).map_err(|error| error.to_string())
    }

    #[test]
    fn the_time_is_in_the_field_data_before_the_mesh() {
        let field = "DATASET UNSTRUCTURED_GRID FIELD FieldData 2 CYCLE 1 1 int 7 TIME 1 1 double 0.25";
        for extent in [Extent::Whole, Extent::Time] {
            assert!(parsed(&format!("{field} POINTS 0 float "), extent).unwrap().time.is_some());
        }
        assert!(parsed(field, Extent::Time).is_err(), "the number may be cut");
        assert!(parsed(&format!("{field} POIN"), Extent::Time).is_err(), "the keyword may be cut");
        let later = "DATASET UNSTRUCTURED_GRID POINTS 1 float what follows is not looked at";
        assert!(parsed(later, Extent::Time).unwrap().time.is_none());
    }

    #[test]
    fn what_is_not_read_is_refused_with_its_place() {
        for (text, expected) in [
            ("DATASET POLYDATA", "line 4: is a surface"),
            ("DATASET TABLE", "line 4: is of kind DATASET TABLE; write an unstructured"),
            ("", "the file ends before the mesh"),
            ("DATASET", "ends before the kind"),
            ("DATASET STRUCTURED_GRID\nBLANKING 1 int 0", "line 5: 'BLANKING' is no keyword"),
            ("DATASET STRUCTURED_GRID\nDIMENSIONS 1 -2 3", "line 5: '-2' is no number of points"),
            ("VECTORS v float", "stands before POINT_DATA"),
            ("POINT_DATA 1 SCALARS s float 1 LOOKUP_TABLE", "ends before the name of a lookup table"),
            ("POINT_DATA 1 SCALARS s float 0.5", "LOOKUP_TABLE default"),
            ("POINT_DATA 1 SCALARS s float 1 0.5", "add a line 'LOOKUP_TABLE default'"),
            ("POINT_DATA 1 POINT_DATA 2", "was 1, and is 2"),
            ("CELLS 3 2 1 1", "3 cells in 2 numbers"),
            ("CELLS 1 0 OFFSETS int 0 CELL_TYPES 0", "no CONNECTIVITY"),
            ("POINTS 99999999999999999999 float", "is no number of points"),
            ("POINTS 9223372036854775807 float 1", "claims"),
        ] {
            let error = parsed(text, Extent::Whole).unwrap_err();
            assert!(error.contains(expected) && error.starts_with("a.vtk: line "), "{error}");
        }
        for (text, expected) in [
            ("", "no legacy VTK file"),
            ("# vtk DataFile Version 6.0\nt\nASCII", "version 6.0"),
            ("# vtk DataFile Version 2.0", "before the title"),
            ("# vtk DataFile Version 2.0\nt", "before the word ASCII"),
            ("# vtk DataFile Version 2.0\nt\nXML", "'XML' is neither"),
        ] {
            let error = parse(Path::new("a.vtk"), text.as_bytes(), Extent::Whole).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
