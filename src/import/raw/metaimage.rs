//! Headers of MetaImage: lines `KEY = VALUE`, the last of which names the file of the values.

use super::data::{Data, Encoding, Start};
use super::header::{Brick, Counts, beginning, finite, numbers};
use crate::error::{FileError, FileResult};
use crate::import::lattice::EvenGrid;
use crate::import::numbers::Number;
use crate::import::parts::located;
use std::collections::HashMap;
use std::path::Path;

/// The key of the last line.
const LAST: &str = "ElementDataFile";

/// Reads a header.
///
/// # Errors
/// If it is damaged, or says something that is not read.
pub(super) fn read(path: &Path) -> FileResult<Brick> {
    let invalid = |key: &str, problem: String| FileError::invalid(path, format!("header, {key}"), problem);
    let bytes = beginning(path)?;
    let (keys, end) = lines(&bytes);
    let get = |names: &[&str]| names.iter().find_map(|name| keys.get(*name)).map(String::as_str);
    let needed =
        |key: &str| get(&[key]).ok_or_else(|| invalid(key, "is missing: this is no header of MetaImage".to_owned()));
    if needed("NDims")? != "3" {
        let problem = format!("is {}; volumes of 3 axes are read", needed("NDims")?);
        return Err(FileError::unsupported(path, "header, NDims", problem));
    }
    let is_true = |names: &[&str]| get(names).is_some_and(|value| value.eq_ignore_ascii_case("true") || value == "1");
    let three = |names: &[&str], other: [f64; 3]| match get(names) {
        None => Ok(other),
        Some(text) => numbers(text).ok_or_else(|| invalid(names[0], format!("'{text}' are no three numbers"))),
    };
    let dims = numbers(needed("DimSize")?).ok_or_else(|| invalid("DimSize", "is no three counts".to_owned()))?;
    let channels = get(&["ElementNumberOfChannels"]).unwrap_or("1");
    let components =
        channels.parse().map_err(|_| invalid("ElementNumberOfChannels", format!("'{channels}' is no count")))?;
    let kind = needed("ElementType")?;
    let number = number(kind).ok_or_else(|| {
        FileError::unsupported(path, "header, ElementType", format!("'{kind}' is not read")).remedy("write MET_FLOAT")
    })?;
    let origin = three(&["Offset", "Position", "Origin"], [0.0; 3])?;
    let spacing = three(&["ElementSpacing", "ElementSize"], [1.0; 3])?;
    let mut grid = EvenGrid::of(origin, spacing);
    if let Some(text) = get(&["TransformMatrix", "Rotation", "Orientation"]) {
        let matrix: [f64; 9] =
            numbers(text).ok_or_else(|| invalid("TransformMatrix", format!("'{text}' are no nine numbers")))?;
        // The direction of one axis behind that of another.
        grid.direction = std::array::from_fn(|row| std::array::from_fn(|axis| matrix[3 * axis + row]));
    }
    let is_text = get(&["BinaryData"]).is_some_and(|value| value.eq_ignore_ascii_case("false"));
    let encoding = match (is_true(&["CompressedData"]), is_text) {
        (true, _) => Encoding::Zlib,
        (_, true) => Encoding::Text,
        _ => Encoding::Raw,
    };
    let file = needed(LAST)?;
    let (file, begin) = match file.to_ascii_uppercase().as_str() {
        "LOCAL" => (path.to_owned(), end),
        upper if upper == "LIST" || upper.starts_with("LIST ") || file.contains('%') => {
            let problem = "names a list of files, which is not read";
            return Err(
                FileError::unsupported(path, "header, ElementDataFile", problem).remedy("write one file of values")
            );
        }
        _ => (located(path, file).map_err(|problem| invalid(LAST, problem))?, 0),
    };
    let start = match get(&["HeaderSize"]).map(str::parse::<i64>) {
        None | Some(Ok(0)) => Start::Byte(begin),
        Some(Ok(-1)) if encoding == Encoding::Raw => Start::Last,
        Some(Ok(size)) if size > 0 => Start::Byte(begin.saturating_add(size.unsigned_abs())),
        _ => return Err(invalid("HeaderSize", "is no count".to_owned())),
    };
    let data = Data { path: file, start, skip: 0, encoding };
    let (lattice, components, steps) = Counts { dims, components, steps: 1 }.checked(path, &data, number)?;
    let big_endian = is_true(&["ElementByteOrderMSB", "BinaryDataByteOrderMSB"]);
    let (path, grid, name) = (path.to_owned(), finite(path, grid)?, "values".to_owned());
    Ok(Brick { path, lattice, grid, name, components, steps, number, big_endian, data })
}

/// The values of keys, and the byte behind the last line.
fn lines(bytes: &[u8]) -> (HashMap<String, String>, u64) {
    let (mut keys, mut end) = (HashMap::new(), 0);
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        end += line.len() as u64;
        let line = String::from_utf8_lossy(line);
        let Some((key, value)) = line.split_once('=') else { continue };
        keys.insert(key.trim().to_owned(), value.trim().to_owned());
        if key.trim() == LAST {
            break;
        }
    }
    (keys, end)
}

fn number(kind: &str) -> Option<Number> {
    Some(match kind {
        "MET_CHAR" => Number::Int8,
        "MET_UCHAR" => Number::UInt8,
        "MET_SHORT" => Number::Int16,
        "MET_USHORT" => Number::UInt16,
        "MET_INT" | "MET_LONG" => Number::Int32,
        "MET_UINT" | "MET_ULONG" => Number::UInt32,
        "MET_LONG_LONG" => Number::Int64,
        "MET_ULONG_LONG" => Number::UInt64,
        "MET_FLOAT" => Number::Float32,
        "MET_DOUBLE" => Number::Float64,
        _ => return None,
    })
}
