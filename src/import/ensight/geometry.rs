//! A file of geometry: parts, each with points and blocks of elements of one type.

use super::case::AS_GOLD;
use super::elements::{ElementType, NFACED, NSIDED, element_type};
use super::encoded::{Encoding, Reader, floats, indices};
use crate::error::{FileError, FileResult};
use crate::files;
use crate::import::cells::{GridReader, Kind, kind, refuse_solid};
use crate::import::cursor::place;
use glam::DVec3;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes in which a binary file says that it is one: a line, and the length that Fortran writes before it.
const FIRST_LINE: usize = 84;

/// A file in memory, and where its parts lie.
pub(super) struct Geometry {
    pub(super) path: PathBuf,
    pub(super) bytes: Vec<u8>,
    pub(super) encoding: Encoding,
    pub(super) parts: Vec<Part>,
    /// The part of each number.
    pub(super) numbers: HashMap<u64, usize>,
}

/// A part: its points and elements.
pub(super) struct Part {
    /// What the file calls it, and its number.
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) points: usize,
    pub(super) cells: usize,
    /// All x, then all y, then all z.
    coordinates: Range<usize>,
    pub(super) blocks: Vec<Block>,
}

/// Elements of one type.
pub(super) struct Block {
    pub(super) of_type: ElementType,
    pub(super) cells: usize,
    /// The nodes of all elements.
    nodes: Range<usize>,
    /// Of polyhedra, the number of faces of each, and of nodes of each face.
    faces: [Range<usize>; 2],
}

/// Whether the file has a number for each node and element.
#[derive(Clone, Copy)]
struct Ids {
    nodes: bool,
    elements: bool,
}

impl Geometry {
    /// Reads a file and finds its parts.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or has parts that are not read.
    pub(super) fn open(path: &Path) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let first = String::from_utf8_lossy(&bytes[..bytes.len().min(FIRST_LINE)]).to_ascii_lowercase();
        if first.contains("fortran binary") {
            let problem = "is written as Fortran binary, which is not read";
            return Err(FileError::unsupported(path, "", problem).remedy(AS_GOLD));
        }
        let is_binary = first.starts_with("c binary");
        let encoding = if is_binary { Encoding::Binary { big_endian: false } } else { Encoding::Text };
        let mut reader = Reader::new(path, &bytes, encoding);
        if is_binary {
            reader.line("first line")?;
        }
        let parts = parts(&mut reader)?;
        let encoding = reader.encoding;
        let mut numbers = HashMap::new();
        for (index, (number, _)) in parts.iter().enumerate() {
            if numbers.insert(*number, index).is_some() {
                return Err(FileError::invalid(path, format!("part {number}"), "is there twice"));
            }
        }
        let parts = parts.into_iter().map(|(_, part)| part).collect();
        Ok(Self { path: path.to_owned(), bytes, encoding, parts, numbers })
    }

    /// Adds a part to a mesh.
    ///
    /// # Errors
    /// If an element has a node that there is not.
    pub(super) fn add_to(&self, part: &Part, grid: &mut GridReader) -> FileResult<()> {
        let first_point = grid.mesh.points.len();
        let numbers = floats(&self.path, &self.bytes, self.encoding, part.coordinates.clone())?;
        let all = numbers.values().to_f64();
        if part.points > 0 && all.len() == 3 * part.points {
            let (x, yz) = all.split_at(part.points);
            let (y, z) = yz.split_at(part.points);
            let points = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| DVec3::new(x, y, z));
            grid.mesh.points.extend(points);
        }
        let mut first = 0;
        for block in &part.blocks {
            self.add_block(block, grid, first, (part.points, first_point))?;
            first += block.cells;
        }
        Ok(())
    }

    fn add_block(
        &self,
        block: &Block,
        grid: &mut GridReader,
        first: usize,
        (points, first_point): (usize, usize),
    ) -> FileResult<()> {
        let of_type = block.of_type;
        let read = (of_type.vtk, kind(of_type.vtk));
        if of_type.is_ghost {
            grid.ghosts += block.cells;
            return Ok(());
        }
        if read.1 == Kind::Flat {
            grid.skip(of_type.vtk, block.cells);
            return Ok(());
        }
        let place =
            || format!("{} {}", of_type.name, place(&self.bytes, self.encoding != Encoding::Text, block.nodes.start));
        let invalid = |problem: String| FileError::invalid(&self.path, place(), problem);
        let nodes = self.indices(&block.nodes)?;
        if nodes.contains(&0) {
            return Err(invalid("an element has node 0; nodes are counted from 1".to_owned()));
        }
        let nodes: Vec<u64> = nodes.into_iter().map(|node| node - 1).collect();
        if read.1 == Kind::Polyhedron {
            return self.add_polyhedra(block, grid, first, &nodes, (points, first_point)).map_err(
                |problem| match problem {
                    Problem::Read(error) => error,
                    Problem::Cell(cell, problem) => invalid(format!("polyhedron {cell} {problem}")),
                },
            );
        }
        for (i, vertices) in nodes.chunks_exact(of_type.nodes.max(1)).enumerate() {
            grid.push(first + i, read, vertices, points, first_point).map_err(invalid)?;
        }
        Ok(())
    }

    fn add_polyhedra(
        &self,
        block: &Block,
        grid: &mut GridReader,
        first: usize,
        nodes: &[u64],
        (points, first_point): (usize, usize),
    ) -> Result<(), Problem> {
        let [faces, sizes] = [&block.faces[0], &block.faces[1]].map(|range| self.indices(range));
        let sizes = sizes.map_err(Problem::Read)?;
        let (mut sizes, mut nodes) = (sizes.into_iter(), nodes.iter().copied());
        for (i, faces) in faces.map_err(Problem::Read)?.into_iter().enumerate() {
            let sizes = sizes.by_ref().take(faces as usize);
            let faces: Vec<Vec<u64>> = sizes.map(|size| nodes.by_ref().take(size as usize).collect()).collect();
            let cell = first + i;
            let pushed = grid.push_polyhedron(&self.path, cell, &faces, points, first_point);
            pushed.map_err(|problem| Problem::Cell(i, problem))?;
        }
        Ok(())
    }

    fn indices(&self, range: &Range<usize>) -> FileResult<Vec<u64>> {
        indices(&self.path, &self.bytes, self.encoding, range.clone())
    }
}

/// What is wrong: the numbers cannot be read, or a cell has them wrong.
enum Problem {
    Read(FileError),
    Cell(usize, String),
}

/// All parts with their numbers.
fn parts(reader: &mut Reader) -> FileResult<Vec<(u64, Part)>> {
    reader.line("description")?;
    reader.line("description")?;
    let mut ids = Ids { nodes: false, elements: false };
    let mut parts: Vec<(u64, Part)> = Vec::new();
    let mut next = reader.keyword()?;
    while let Some(line) = next {
        let words: Vec<String> = line.split_whitespace().map(str::to_ascii_lowercase).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match (words.as_slice(), parts.last_mut()) {
            (["node", "id", how], None) => ids.nodes = is_given(reader, how)?,
            (["element", "id", how], None) => ids.elements = is_given(reader, how)?,
            (["extents"], None) => {
                reader.numbers(6, "extents")?;
            }
            (["part"], last) => {
                if last.is_none() {
                    reader.tell_byte_order();
                }
                let number = reader.count("part")? as u64;
                let name = reader.line("description of a part")?.trim().to_owned();
                let part =
                    Part { name, number: number as u32, points: 0, cells: 0, coordinates: 0..0, blocks: Vec::new() };
                parts.push((number, part));
            }
            (["coordinates"], Some((number, part))) => {
                if part.points > 0 {
                    return Err(reader.invalid(format!("part {number} has its coordinates twice")));
                }
                part.points = reader.count("points")?;
                if ids.nodes {
                    reader.numbers(part.points, "numbers of nodes")?;
                }
                part.coordinates = reader.numbers(reader.product(part.points, 3, "coordinates")?, "coordinates")?;
            }
            (["block", ..], Some((number, _))) => {
                let error = reader.unsupported(format!("part {number} is structured ('{line}'), which is not read"));
                return Err(error.remedy("save it as an unstructured grid, for example with ParaView"));
            }
            ([name], Some((number, part))) => {
                let Some(of_type) = element_type(name) else {
                    let what = format!("part {number} has elements of type '{}'", shown(name));
                    return Err(unread(reader, &what));
                };
                let block = block(reader, of_type, ids)?;
                let more = |cells: usize| cells.checked_add(block.cells);
                part.cells = more(part.cells).ok_or_else(|| reader.invalid("has too many elements".to_owned()))?;
                part.blocks.push(block);
            }
            _ => return Err(reader.invalid(format!("'{}' is no line of a geometry here", shown(&line)))),
        }
        next = reader.keyword()?;
    }
    if parts.is_empty() {
        return Err(reader.invalid("the geometry has no part".to_owned()));
    }
    Ok(parts)
}

/// Whether numbers of nodes or elements are in the file.
fn is_given(reader: &Reader, how: &str) -> FileResult<bool> {
    match how {
        "given" | "ignore" => Ok(true),
        "off" | "assign" => Ok(false),
        _ => Err(reader.invalid(format!("'{}' is none of off, given, assign and ignore", shown(how)))),
    }
}

fn unread(reader: &Reader, what: &str) -> FileError {
    let FileError { path, place, .. } = reader.invalid(String::new());
    refuse_solid(&path, place, what)
}

/// Passes the elements of a type.
fn block(reader: &mut Reader, of_type: ElementType, ids: Ids) -> FileResult<Block> {
    let cells = reader.count("elements")?;
    if ids.elements {
        reader.numbers(cells, "numbers of elements")?;
    }
    let mut faces = [0..0, 0..0];
    let count = match of_type.vtk {
        NSIDED => counted(reader, cells, "nodes of polygons")?.1,
        NFACED => {
            let (of_cells, count) = counted(reader, cells, "faces of polyhedra")?;
            let (of_faces, count) = counted(reader, count, "nodes of faces")?;
            faces = [of_cells, of_faces];
            count
        }
        _ => reader.product(cells, of_type.nodes, "nodes")?,
    };
    Ok(Block { of_type, cells, nodes: reader.numbers(count, "nodes of elements")?, faces })
}

/// Passes this many counts of `what`: where they lie, and their sum.
fn counted(reader: &mut Reader, count: usize, what: &str) -> FileResult<(Range<usize>, usize)> {
    let range = reader.numbers(count, what)?;
    let sum = reader.indices(range.clone())?.into_iter().try_fold(0_u64, u64::checked_add);
    let sum = sum.and_then(|sum| usize::try_from(sum).ok());
    Ok((range, sum.ok_or_else(|| reader.invalid(format!("claims too many {what}")))?))
}

/// The beginning of a word of the file, for a message.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}
