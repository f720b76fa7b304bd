//! The XML header of a `.vtu` file: its arrays, and where their data lie.

use super::super::numbers::Number;
use super::super::xml::{Attributes, same_length_utf8};
use super::compression::Compressor;
use super::faces::FACE_ARRAYS;
use super::open_array::OpenArray;
use super::structured::Structure;
use crate::error::{FileError, FileResult};
use crate::import::lattice::Lattice;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::ops::Range;
use std::path::Path;

/// The header of a file.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// Byte order of binary data and width of their header words.
    pub(crate) words: Words,
    pub(crate) compressor: Option<Compressor>,
    /// The array `TimeValue` of the field data, and its number of tuples.
    pub(crate) time_value: Option<(ArrayInfo, usize)>,
    pub(crate) pieces: Vec<Piece>,
    /// The points of a structured grid; `None` if the file lists points and cells.
    pub(crate) structure: Option<Structure>,
    pub(crate) appended: Option<Appended>,
    /// Names of point and cell arrays that are not numeric.
    pub(crate) skipped: Vec<String>,
}

/// Format of the header words of binary data; the data have the same byte order.
#[derive(Clone, Copy, Debug, Hash)]
pub(crate) struct Words {
    pub(crate) big_endian: bool,
    /// Bytes per word: 4 (`UInt32`, the default) or 8 (`UInt64`).
    pub(crate) size: usize,
}

impl Default for Words {
    fn default() -> Self {
        Self { big_endian: false, size: 4 }
    }
}

/// Offset of `appended` data (behind the underscore).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appended {
    pub(crate) start: usize,
    pub(crate) base64: bool,
}

/// A `Piece`: points, and cells that refer to them.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) points: usize,
    pub(crate) cells: usize,
    pub(crate) point_data: Vec<ArrayInfo>,
    pub(crate) cell_data: Vec<ArrayInfo>,
    pub(crate) coordinates: Option<ArrayInfo>,
    pub(crate) connectivity: Option<ArrayInfo>,
    pub(crate) offsets: Option<ArrayInfo>,
    pub(crate) types: Option<ArrayInfo>,
    /// Those of polyhedra.
    pub(crate) face_arrays: Vec<ArrayInfo>,
    /// The points of a structured grid, and the first index along each axis.
    pub(crate) lattice: Option<(Lattice, [i64; 3])>,
    /// Coordinates along x, y and z of such a grid.
    pub(crate) axes: Vec<ArrayInfo>,
}

/// A `DataArray` element.
#[derive(Clone, Debug)]
pub(crate) struct ArrayInfo {
    pub(crate) name: String,
    pub(crate) number: Number,
    /// Numbers per tuple, at least 1.
    pub(crate) components: usize,
    pub(crate) data: DataPlace,
    /// Unit of its numbers.
    pub(crate) unit: Option<String>,
    /// Byte offset of its tag.
    pub(crate) byte: usize,
}

/// Location and encoding of an array's numbers.
#[derive(Clone, Debug)]
pub(crate) enum DataPlace {
    /// Text, in these byte ranges of the file.
    Ascii(Vec<Range<usize>>),
    /// Base64, in these byte ranges.
    Base64(Vec<Range<usize>>),
    /// Offset in the appended section.
    Appended(usize),
}

/// How much of a header to parse.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// The whole header.
    Whole,
    /// Up to the array `TimeValue`: parsing ends at the first piece if there is none, or where its data are known. Writers put the field
    /// data before the pieces.
    TimeValue,
}

/// Parses the header at the start of `bytes`.
///
/// # Errors
/// If the file is not an unstructured grid, ends too early, or contradicts the format.
pub(crate) fn parse(path: &Path, bytes: &[u8], extent: Extent) -> FileResult<Header> {
    let text = same_length_utf8(&bytes[..xml_end(bytes)]);
    Parser {
        path,
        header: Header::default(),
        open: Vec::new(),
        array: None,
        extent,
        seen_file: false,
        file_bytes: bytes.len(),
    }
    .run(&text, bytes)
}

/// End of the XML: behind the tag of the appended section, whose data are not XML, or the end of the file.
fn xml_end(bytes: &[u8]) -> usize {
    const TAG: &[u8] = b"<AppendedData";
    let mut from = 0;
    while let Some(at) = bytes[from..].iter().position(|&b| b == b'<').map(|at| from + at) {
        if bytes[at..].starts_with(TAG) {
            return bytes[at..].iter().position(|&b| b == b'>').map_or(bytes.len(), |end| at + end + 1);
        }
        from = at + 1;
    }
    bytes.len()
}

struct Parser<'a> {
    path: &'a Path,
    header: Header,
    /// Names of the open elements, outermost first.
    open: Vec<String>,
    array: Option<OpenArray>,
    extent: Extent,
    seen_file: bool,
    /// Bytes of the file, or of the part of it that was read.
    file_bytes: usize,
}

impl Parser<'_> {
    fn run(mut self, text: &str, bytes: &[u8]) -> FileResult<Header> {
        let mut reader = Reader::from_str(text);
        loop {
            let begin = reader.buffer_position() as usize;
            let event = reader.read_event().map_err(|e| self.invalid(begin, format!("malformed XML: {e}")))?;
            let end = reader.buffer_position() as usize;
            match event {
                Event::Start(tag) => {
                    if tag.name().as_ref() == "AppendedData" {
                        self.begin_appended(&tag, begin, end, bytes)?;
                        break;
                    }
                    self.begin_element(&tag, begin)?;
                    if let Some(array) = self.inside() {
                        array.begin(&tag, end);
                    }
                    self.open.push(tag.name().as_ref().to_owned());
                }
                Event::Empty(tag) => {
                    self.begin_element(&tag, begin)?;
                    self.end_array_at(self.open.len());
                }
                Event::Text(_) => {
                    if let Some(array) = self.inside() {
                        array.text(begin..end, bytes);
                    }
                }
                Event::End(_) => {
                    self.open.pop();
                    if let Some(array) = self.inside() {
                        array.end(begin, text);
                    }
                    self.end_array_at(self.open.len());
                    if self.open.is_empty() {
                        break;
                    }
                }
                Event::Eof => {
                    let inside = self.open.last().map_or(String::new(), |name| format!(" inside <{name}>"));
                    let problem = if self.seen_file { "the file ends" } else { "this is no VTK XML file: it ends" };
                    return Err(self.invalid(end, format!("{problem}{inside}")).remedy("write the file again"));
                }
                _ => {}
            }
            if self.extent == Extent::TimeValue && self.is_time_settled() {
                break;
            }
        }
        Ok(self.header)
    }

    fn is_time_settled(&self) -> bool {
        match &self.header.time_value {
            None => !self.header.pieces.is_empty(),
            Some((array, _)) => !matches!(array.data, DataPlace::Appended(_)),
        }
    }

    fn invalid(&self, byte: usize, problem: impl Into<String>) -> FileError {
        FileError::invalid(self.path, format!("byte {byte}"), problem)
    }

    fn begin_element(&mut self, tag: &BytesStart<'_>, byte: usize) -> FileResult<()> {
        let name = tag.name();
        if !self.seen_file && name.as_ref() != "VTKFile" {
            return Err(self.invalid(byte, format!("this is no VTK XML file: it begins with <{}>", name.as_ref())));
        }
        match name.as_ref() {
            "VTKFile" => self.begin_file(&self.attributes(tag, byte)?),
            "Piece" if self.header.structure.is_some() => {
                let read = super::structured::extent(&self.attributes(tag, byte)?, self.file_bytes);
                let (lattice, first) = read.map_err(|problem| self.invalid(byte, problem))?;
                let (points, cells) = (lattice.points(), lattice.cells());
                self.header.pieces.push(Piece { points, cells, lattice: Some((lattice, first)), ..Piece::default() });
                Ok(())
            }
            "Piece" => {
                let attributes = self.attributes(tag, byte)?;
                let count = |key| match attributes.count(key) {
                    Ok(Some(n)) => Ok(n),
                    Ok(None) => Err(self.invalid(byte, format!("<Piece> lacks {key}"))),
                    Err(problem) => Err(self.invalid(byte, problem)),
                };
                let piece =
                    Piece { points: count("NumberOfPoints")?, cells: count("NumberOfCells")?, ..Piece::default() };
                self.header.pieces.push(piece);
                Ok(())
            }
            "DataArray" => self.begin_array(&self.attributes(tag, byte)?, byte),
            "Array" => {
                let label = self.attributes(tag, byte)?.get("Name").unwrap_or("").to_owned();
                self.skip_array(label);
                Ok(())
            }
            name if self.open.len() == 1 && Structure::of_type(name).is_some() => {
                let attributes = self.attributes(tag, byte)?;
                let read = self.header.structure.as_mut().map_or(Ok(()), |structure| structure.read(&attributes));
                read.map_err(|problem| self.invalid(byte, problem))
            }
            _ => Ok(()),
        }
    }

    fn attributes(&self, tag: &BytesStart<'_>, byte: usize) -> FileResult<Attributes> {
        Attributes::of(tag).map_err(|problem| self.invalid(byte, problem))
    }

    fn begin_file(&mut self, attributes: &Attributes) -> FileResult<()> {
        self.seen_file = true;
        let unsupported = |problem: String| FileError::unsupported(self.path, "<VTKFile>", problem);
        match attributes.get("type") {
            Some("UnstructuredGrid") => {}
            Some(name) if Structure::of_type(name).is_some() => self.header.structure = Structure::of_type(name),
            Some(other) => {
                let error = unsupported(format!("this is a file of type {other}, and only grids are read"));
                let remedy = "convert it, for example with ParaView's filter Append Datasets";
                return Err(error.remedy(remedy));
            }
            None => return Err(self.invalid(0, "<VTKFile> lacks its type")),
        }
        self.header.words = Words {
            big_endian: match attributes.get("byte_order") {
                None | Some("LittleEndian") => false,
                Some("BigEndian") => true,
                Some(other) => return Err(self.invalid(0, format!("byte_order=\"{other}\" is unknown"))),
            },
            size: match attributes.get("header_type") {
                None | Some("UInt32") => 4,
                Some("UInt64") => 8,
                Some(other) => return Err(self.invalid(0, format!("header_type=\"{other}\" is unknown"))),
            },
        };
        self.header.compressor = match attributes.get("compressor") {
            None | Some("") => None,
            Some(name) => Some(Compressor::from_name(name).ok_or_else(|| {
                unsupported(format!("the compressor {name} is unknown"))
                    .remedy("write the file with ZLib, LZ4 or LZMA compression, or with none")
            })?),
        };
        Ok(())
    }

    fn begin_array(&mut self, attributes: &Attributes, byte: usize) -> FileResult<()> {
        let parent = self.open.last().map_or("", String::as_str);
        let name = attributes.get("Name").unwrap_or("").to_owned();
        let is_time = parent == "FieldData" && name == "TimeValue";
        if !(is_time || matches!(parent, "PointData" | "CellData" | "Points" | "Coordinates" | "Cells")) {
            return Ok(());
        }
        let place = format!("array '{name}' at byte {byte}");
        let invalid = |problem: String| FileError::invalid(self.path, place.as_str(), problem);
        let count = |key| attributes.count(key).map_err(invalid);
        if attributes.get("TimeStep").is_some() {
            return Err(FileError::unsupported(self.path, place, "the file holds several time steps")
                .remedy("write one .vtu file a step and list them in a .pvd file"));
        }
        let type_name = attributes.get("type").ok_or_else(|| invalid("lacks its type".to_owned()))?;
        let Ok(number) = type_name.parse::<Number>() else {
            if matches!(parent, "PointData" | "CellData") {
                self.skip_array(name);
                return Ok(());
            }
            return Err(invalid(format!("the type {type_name} is unknown")));
        };
        let data = match attributes.get("format") {
            None | Some("ascii") => DataPlace::Ascii(Vec::new()),
            Some("binary") => DataPlace::Base64(Vec::new()),
            Some("appended") => {
                DataPlace::Appended(count("offset")?.ok_or_else(|| invalid("lacks its offset".to_owned()))?)
            }
            Some(other) => return Err(invalid(format!("the format {other} is unknown"))),
        };
        let default_components = if parent == "Points" { 3 } else { 1 };
        let components = count("NumberOfComponents")?.unwrap_or(default_components).max(1);
        let tuples = count("NumberOfTuples")?.unwrap_or(1);
        let info = ArrayInfo { name, number, components, data, unit: None, byte };
        self.array = Some(OpenArray::new(info, tuples, self.open.len()));
        Ok(())
    }

    /// The open array, where no other element is open inside of it.
    fn inside(&mut self) -> Option<&mut OpenArray> {
        let depth = self.open.len();
        self.array.as_mut().filter(|array| array.depth + 1 == depth)
    }

    /// Notes an array that is not numeric, if it belongs to the points or cells.
    fn skip_array(&mut self, name: String) {
        if self.open.last().is_some_and(|parent| matches!(parent.as_str(), "PointData" | "CellData")) {
            self.header.skipped.push(name);
        }
    }

    /// Stores the open array if the element that ends inside of `depth` others is its own.
    fn end_array_at(&mut self, depth: usize) {
        let Some(OpenArray { info, tuples, .. }) = self.array.take_if(|array| array.depth == depth) else { return };
        let parent = self.open.last().map_or("", String::as_str);
        if parent == "FieldData" {
            self.header.time_value.get_or_insert((info, tuples));
            return;
        }
        let Some(piece) = self.header.pieces.last_mut() else { return };
        match (parent, info.name.as_str()) {
            ("PointData", _) => piece.point_data.push(info),
            ("CellData", _) => piece.cell_data.push(info),
            ("Points", _) => piece.coordinates = Some(info),
            ("Coordinates", _) => piece.axes.push(info),
            ("Cells", "connectivity") => piece.connectivity = Some(info),
            ("Cells", "offsets") => piece.offsets = Some(info),
            ("Cells", "types") => piece.types = Some(info),
            ("Cells", name) if FACE_ARRAYS.contains(&name) => piece.face_arrays.push(info),
            _ => {}
        }
    }

    fn begin_appended(&mut self, tag: &BytesStart<'_>, begin: usize, end: usize, bytes: &[u8]) -> FileResult<()> {
        let attributes = self.attributes(tag, begin)?;
        let base64 = match attributes.get("encoding") {
            None | Some("base64") => true,
            Some("raw") => false,
            Some(other) => return Err(self.invalid(begin, format!("the encoding {other} is unknown"))),
        };
        let blanks = bytes[end..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        if bytes.get(end + blanks) != Some(&b'_') {
            return Err(self.invalid(end + blanks, "the appended data do not begin with an underscore"));
        }
        self.header.appended = Some(Appended { start: end + blanks + 1, base64 });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_text(text: &str) -> FileResult<Header> {
        parse(Path::new("a.vtu"), text.as_bytes(), Extent::Whole)
    }

    #[test]
    fn only_text_directly_inside_an_array_is_its_data() {
        let text = r#"<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints=" 1 " NumberOfCells="0">
            <PointData><DataArray type="Float32" Name="a<b&c>d" format="ascii">
              1.5 <InformationKey name="K"><Value> 7 </Value></InformationKey> <!-- 8 -->
              <InformationKey name="UNITS_LABEL" location="vtkDataArray">
                m&lt;s°</InformationKey></DataArray>
              <Array type="String" Name="label"> 97 0 </Array><DataArray type="Bit" Name="bits"> 1 </DataArray>
              </PointData></Piece></UnstructuredGrid></VTKFile>"#;
        let header = parse_text(text).expect("a valid header");
        let array = &header.pieces[0].point_data[0];
        assert_eq!(array.name, "a<b&c>d");
        let DataPlace::Ascii(ranges) = &array.data else { panic!("{array:?}") };
        let data: Vec<_> = ranges.iter().map(|r| text[r.clone()].trim()).collect();
        assert_eq!(data, ["1.5"]);
        assert_eq!(array.unit.as_deref(), Some("m<s°"));
        assert_eq!(header.skipped, ["label", "bits"]);
        assert_eq!((header.words.size, header.words.big_endian), (4, false));
    }

    #[test]
    fn files_of_other_kinds_are_refused_by_name() {
        let refusal = |text: &str| parse_text(text).map(|_| ()).expect_err("not a grid").to_string();
        assert!(refusal(r#"<VTKFile type="PolyData"></VTKFile>"#).contains("type PolyData"));
        assert!(refusal("<html></html>").contains("no VTK XML file"));
        assert!(refusal("").contains("no VTK XML file"));
        assert!(refusal("# vtk DataFile Version 5.1").contains("no VTK XML file"));
        let zstd = r#"<VTKFile type="UnstructuredGrid" compressor="vtkZstdDataCompressor">"#;
        assert!(refusal(zstd).contains("vtkZstdDataCompressor"));
        let cut = r#"<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="1" NumberOfCells="0">"#;
        assert!(refusal(cut).contains("ends inside <Piece>"));
    }
}
