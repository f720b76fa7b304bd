//! Headers of NRRD: lines `FIELD: VALUE`, which a blank line ends.

use super::data::{Data, Encoding, Start};
use super::header::{Brick, Counts, beginning, finite, numbers};
use crate::error::{FileError, FileResult};
use crate::import::lattice::EvenGrid;
use crate::import::numbers::Number;
use crate::import::parts::located;
use std::collections::HashMap;
use std::path::Path;

/// What files begin with.
pub(super) const MAGIC: &[u8] = b"NRRD000";
/// Kinds of axes along which components do not run.
const NO_COMPONENTS: [&str; 5] = ["domain", "space", "time", "none", "???"];

/// The lines of a header.
struct Header<'a> {
    path: &'a Path,
    fields: HashMap<String, String>,
}

/// Reads a header.
///
/// # Errors
/// If it is damaged, or says something that is not read.
pub(super) fn read(path: &Path) -> FileResult<Brick> {
    let bytes = beginning(path)?;
    if !bytes.starts_with(MAGIC) {
        return Err(FileError::invalid(path, "", "is no NRRD file: it does not begin with 'NRRD000'"));
    }
    let (fields, end) = lines(&bytes);
    let header = Header { path, fields };
    let sizes = header.needed("sizes")?;
    let sizes: Option<Vec<u64>> = sizes.split_whitespace().map(|word| word.parse().ok()).collect();
    let sizes = sizes.ok_or_else(|| header.invalid("sizes", "are no counts"))?;
    if header.needed("dimension")?.parse() != Ok(sizes.len()) {
        return Err(header.invalid("sizes", "are not as many as the dimension says"));
    }
    let (dims, components, steps, first) = match sizes[..] {
        [x, y, z] => ([x, y, z], 1, 1, 0),
        [n, x, y, z] if header.has_components() => ([x, y, z], n, 1, 1),
        [x, y, z, n] => ([x, y, z], 1, n, 0),
        _ => return Err(header.unsupported("dimension", "is neither 3 nor 4")),
    };
    let number =
        number(header.needed("type")?).ok_or_else(|| header.unsupported("type", "is not read; write float"))?;
    let encoding = match header.needed("encoding")? {
        "raw" => Encoding::Raw,
        "gzip" | "gz" => Encoding::Gzip,
        "ascii" | "text" | "txt" => Encoding::Text,
        _ => return Err(header.unsupported("encoding", "is none of raw, gzip and ascii")),
    };
    let data = header.data(end, encoding)?;
    let (lattice, components, steps) = Counts { dims, components, steps }.checked(path, &data, number)?;
    let big_endian = match header.get("endian") {
        Some("big") => true,
        Some("little") => false,
        None if number.size() == 1 || encoding == Encoding::Text => false,
        _ => return Err(header.invalid("endian", "is neither big nor little")),
    };
    let grid = finite(path, header.grid(sizes.len(), first)?)?;
    let name = header.get("content").filter(|name| !name.is_empty()).unwrap_or("values").to_owned();
    Ok(Brick { path: path.to_owned(), lattice, grid, name, components, steps, number, big_endian, data })
}

impl Header<'_> {
    fn get(&self, field: &str) -> Option<&str> {
        self.fields.get(&plain(field)).map(String::as_str)
    }

    fn needed(&self, field: &str) -> FileResult<&str> {
        self.get(field).ok_or_else(|| self.invalid(field, "is missing"))
    }

    fn invalid(&self, field: &str, problem: &str) -> FileError {
        FileError::invalid(self.path, format!("header, '{field}'"), problem)
    }

    fn unsupported(&self, field: &str, problem: &str) -> FileError {
        FileError::unsupported(self.path, format!("header, '{field}'"), problem)
    }

    /// Whether the fastest axis has the components of values.
    fn has_components(&self) -> bool {
        let kind = self.get("kinds").and_then(|kinds| kinds.split_whitespace().next()).unwrap_or("???");
        let is_beside_space = self.get("space directions").is_some_and(|text| text.starts_with("none"));
        is_beside_space || !NO_COMPONENTS.contains(&kind.to_ascii_lowercase().as_str())
    }

    /// Where the values are, in this file behind its header unless it names another.
    fn data(&self, end: u64, encoding: Encoding) -> FileResult<Data> {
        let (path, begin) = match self.get("data file") {
            None => (self.path.to_owned(), end),
            Some(name) if name == "LIST" || name.starts_with("LIST ") || name.contains('%') => {
                return Err(self.unsupported("data file", "names a list of files, which is not read"));
            }
            Some(name) => (located(self.path, name).map_err(|problem| self.invalid("data file", &problem))?, 0),
        };
        if self.get("line skip").is_some_and(|lines| lines != "0") {
            return Err(self.unsupported("line skip", "is not read; write 'byte skip'"));
        }
        let (start, skip) = match self.get("byte skip").map(str::parse::<i64>) {
            None | Some(Ok(0)) => (Start::Byte(begin), 0),
            Some(Ok(-1)) if encoding == Encoding::Raw => (Start::Last, 0),
            Some(Ok(bytes)) if bytes > 0 => (Start::Byte(begin), bytes.unsigned_abs()),
            _ => return Err(self.invalid("byte skip", "is no count")),
        };
        Ok(Data { path, start, skip, encoding })
    }

    /// Where the points are; `first` is the first of three axes of `count`.
    fn grid(&self, count: usize, first: usize) -> FileResult<EvenGrid> {
        let mut grid = EvenGrid::of([0.0; 3], [1.0; 3]);
        if let Some(text) = self.get("space origin") {
            grid.origin = vector(text).ok_or_else(|| self.invalid("space origin", "is no vector of three numbers"))?;
        }
        if let Some(text) = self.get("space directions") {
            let axes: Vec<Option<[f64; 3]>> = vectors(text).iter().map(|text| vector(text)).collect();
            let axes = axes.get(first..first + 3).filter(|_| axes.len() == count);
            let axes: Option<Vec<[f64; 3]>> = axes.and_then(|axes| axes.iter().copied().collect());
            let axes =
                axes.ok_or_else(|| self.invalid("space directions", "are no vector of three numbers for each axis"))?;
            grid.direction = std::array::from_fn(|row| std::array::from_fn(|axis| axes[axis][row]));
        } else if let Some(text) = self.get("spacings") {
            grid.spacing = self.of_axes("spacings", text, first, 1.0)?;
        }
        if let Some(text) = self.get("axis mins").filter(|_| self.get("space origin").is_none()) {
            grid.origin = self.of_axes("axis mins", text, first, 0.0)?;
        }
        Ok(grid)
    }

    /// Numbers of the three axes; NaN stands for `other`.
    fn of_axes(&self, field: &str, text: &str, first: usize, other: f64) -> FileResult<[f64; 3]> {
        let words: Vec<&str> = text.split_whitespace().skip(first).take(3).collect();
        let found = numbers::<f64, 3>(&words.join(" "))
            .ok_or_else(|| self.invalid(field, "are no numbers, one for each axis"))?;
        Ok(found.map(|number| if number.is_nan() { other } else { number }))
    }
}

/// The name of a field without blanks, in lower case.
fn plain(field: &str) -> String {
    field.split_whitespace().collect::<String>().to_ascii_lowercase()
}

/// Vectors in brackets, and words between them.
fn vectors(text: &str) -> Vec<String> {
    let spaced: String = text.replace('(', " (").replace(')', ") ");
    let (mut out, mut open): (Vec<String>, bool) = (Vec::new(), false);
    for word in spaced.split_whitespace() {
        match out.last_mut().filter(|_| open) {
            Some(last) => *last += word,
            None => out.push(word.to_owned()),
        }
        open = (open || word.starts_with('(')) && !word.ends_with(')');
    }
    out
}

/// A vector as `(x,y,z)`.
fn vector(text: &str) -> Option<[f64; 3]> {
    let inside = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    numbers(&inside.replace(',', " "))
}

/// The values of fields, and the byte behind the blank line.
fn lines(bytes: &[u8]) -> (HashMap<String, String>, u64) {
    let (mut fields, mut end) = (HashMap::new(), 0);
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        end += line.len() as u64;
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        if line.is_empty() {
            break;
        }
        if let Some((field, value)) =
            line.split_once(':').filter(|(_, value)| !value.starts_with('=') && !line.starts_with('#'))
        {
            fields.insert(plain(field), value.trim().to_owned());
        }
    }
    (fields, end)
}

fn number(kind: &str) -> Option<Number> {
    Some(match kind {
        "signed char" | "int8" | "int8_t" => Number::Int8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::UInt8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Number::Int16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::UInt16,
        "int" | "signed int" | "int32" | "int32_t" => Number::Int32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::UInt32,
        "longlong" | "long long" | "long long int" | "signed long long" | "int64" | "int64_t" => Number::Int64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Number::UInt64,
        "float" => Number::Float32,
        "double" => Number::Float64,
        _ => return None,
    })
}
