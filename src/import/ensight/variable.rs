//! The values of a variable at a step, part by part.

use super::case::AS_GOLD;
use super::elements::element_type;
use super::encoded::{Reader, floats};
use super::geometry::{Geometry, Part, shown};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::files;
use crate::import::numbers::Numbers;
use crate::import::tuples::Tuples;
use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The place among VTK's components (XX YY ZZ XY YZ XZ) of each of EnSight's of a symmetric tensor (11 22 33 12 13 23).
const SYMMETRIC: [usize; 6] = [0, 1, 2, 3, 5, 4];

/// A file in memory, and where the values of parts lie in it.
pub(super) struct VariableFile {
    path: PathBuf,
    bytes: Vec<u8>,
    /// In the order of parts.
    sections: Vec<Section>,
}

/// Values of the points of a part, or of its elements of one type: all of the first component, then of the next.
struct Section {
    part: usize,
    /// The first point or element among those of the part, and their number.
    first: usize,
    count: usize,
    values: Range<usize>,
    /// The value that stands for none.
    undefined: Option<f64>,
}

impl VariableFile {
    /// Reads a file and finds the values of parts.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or has values of parts or elements that the geometry has not.
    pub(super) fn open(path: &Path, geometry: &Geometry, field: &FieldInfo) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let mut reader = Reader::new(path, &bytes, geometry.encoding);
        reader.line("description")?;
        let (mut sections, mut part) = (Vec::new(), None);
        let mut known = HashSet::new();
        let mut next = reader.keyword()?;
        while let Some(line) = next {
            if line.eq_ignore_ascii_case("part") {
                part = Some(part_of(&mut reader, geometry)?);
            } else if let Some(part) = part {
                let section = section(&mut reader, &line, (part, &geometry.parts[part]), field, &mut known)?;
                sections.push(section);
            } else {
                return Err(reader.invalid(format!("'{}' stands before any part", shown(&line))));
            }
            next = reader.keyword()?;
        }
        sections.sort_by_key(|section| section.part);
        Ok(Self { path: path.to_owned(), bytes, sections })
    }

    /// The values of a part; NaN where there are none.
    ///
    /// # Errors
    /// If a word is no number.
    pub(super) fn of_part(&self, geometry: &Geometry, part: usize, field: &FieldInfo) -> FileResult<Numbers> {
        let Part { points, cells, .. } = geometry.parts[part];
        let tuples = if field.association == Association::Point { points } else { cells };
        let mut out = Tuples::new(field.components, tuples, true);
        for component in 0..field.components {
            out.put(component, 0, std::iter::repeat_n(f64::NAN, tuples));
        }
        let from = self.sections.partition_point(|section| section.part < part);
        for section in self.sections[from..].iter().take_while(|section| section.part == part) {
            let values = floats(&self.path, &self.bytes, geometry.encoding, section.values.clone())?.values().to_f64();
            let of_value = |&value: &f64| if section.undefined == Some(value) { f64::NAN } else { value };
            for (i, values) in values.chunks_exact(section.count.max(1)).enumerate() {
                let component = if field.components == SYMMETRIC.len() { SYMMETRIC[i % SYMMETRIC.len()] } else { i };
                out.put(component, section.first, values.iter().map(of_value));
            }
        }
        Ok(out.numbers)
    }
}

/// The part of the number that follows.
fn part_of(reader: &mut Reader, geometry: &Geometry) -> FileResult<usize> {
    let number = reader.count("part")? as u64;
    let found = geometry.numbers.get(&number).copied();
    let geometry = geometry.path.display();
    found.ok_or_else(|| reader.invalid(format!("has values of part {number}, which {geometry} has not")))
}

/// Passes the values of the points of a part, or of its elements of a type. `known` has those that were passed.
fn section(
    reader: &mut Reader,
    line: &str,
    (index, part): (usize, &Part),
    field: &FieldInfo,
    known: &mut HashSet<(usize, usize)>,
) -> FileResult<Section> {
    let (name, how) = line.split_once(char::is_whitespace).map_or((line, ""), |(name, how)| (name, how.trim()));
    let undefined = match how.to_ascii_lowercase().as_str() {
        "" => None,
        "undef" => Some(reader.float("value that stands for none")?),
        "partial" => {
            let error = reader.unsupported(format!("'{}': values of some alone are not read", shown(line)));
            return Err(error.remedy("write values of all, with 'undef' where there are none"));
        }
        _ => return Err(reader.invalid(format!("'{}' is no line of a variable", shown(line)))),
    };
    if name == "block" {
        return Err(reader
            .unsupported("has values of a structured part, which is not read".to_owned())
            .remedy(AS_GOLD));
    }
    let (place, first, count) = match field.association {
        Association::Point if name == "coordinates" => (0, 0, part.points),
        Association::Cell => {
            of_elements(part, name, |place| known.contains(&(index, place))).ok_or_else(|| not_there(reader, name))?
        }
        Association::Point => return Err(not_there(reader, name)),
    };
    if !known.insert((index, place)) {
        return Err(reader.invalid("has the values of a part twice".to_owned()));
    }
    let what = format!("values of '{}'", field.name);
    let values = reader.numbers(reader.product(count, field.components, &what)?, &what)?;
    Ok(Section { part: index, first, count, values, undefined })
}

fn not_there(reader: &Reader, name: &str) -> FileError {
    reader.invalid(format!("has values of '{}', which the part has not, or had before", shown(name)))
}

/// The next block of elements of that type: its place, its first element and their number.
fn of_elements(part: &Part, name: &str, is_known: impl Fn(usize) -> bool) -> Option<(usize, usize, usize)> {
    let of_type = element_type(name)?;
    let mut first = 0;
    for (place, block) in part.blocks.iter().enumerate() {
        if block.of_type == of_type && !is_known(place) {
            return Some((place, first, block.cells));
        }
        first += block.cells;
    }
    None
}
