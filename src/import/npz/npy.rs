//! The header of an array of NumPy: a dictionary in Python's notation behind a magic word.

use super::super::numbers::Number;
use std::io::Read;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header that is read. Those of arrays of plain numbers have 64 to 128 bytes.
const HEADER_MAX: usize = 1 << 12;

/// What a header says.
#[derive(Debug, PartialEq)]
pub(super) struct Header {
    pub(super) number: Result<Number, Unread>,
    pub(super) big_endian: bool,
    pub(super) is_fortran: bool,
    pub(super) shape: Vec<u64>,
    /// Bytes before the numbers.
    pub(super) bytes: u64,
}

/// A type that is not read.
#[derive(Debug, PartialEq)]
pub(super) enum Unread {
    /// Floats of other widths than 4 and 8 bytes.
    Width(String),
    /// Text, objects, complex numbers, records, times.
    NoNumbers,
}

impl Header {
    /// Reads a header; the error says what is wrong with it.
    pub(super) fn read(from: &mut impl Read) -> Result<Self, String> {
        let cut = |_| "ends within the header".to_owned();
        let mut start = [0; 8];
        from.read_exact(&mut start).map_err(cut)?;
        if !start.starts_with(MAGIC) {
            return Err("is no array of NumPy (.npy)".to_owned());
        }
        let length_bytes = if start[6] == 1 { 2 } else { 4 };
        let mut length = [0; 4];
        from.read_exact(&mut length[..length_bytes]).map_err(cut)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > HEADER_MAX {
            return Err(format!("has a header of {length} bytes"));
        }
        let mut text = vec![0; length];
        from.read_exact(&mut text).map_err(cut)?;
        let text = std::str::from_utf8(&text).map_err(|_| "has a header that is no text".to_owned())?;
        let bytes = (start.len() + length_bytes + length) as u64;
        parse(text)
            .map(|header| Self { bytes, ..header })
            .ok_or_else(|| format!("has the header {:?}", text.trim_end()))
    }
}

fn parse(text: &str) -> Option<Header> {
    let order = value(text, "fortran_order")?;
    let is_fortran = order.starts_with("True");
    if !is_fortran && !order.starts_with("False") {
        return None;
    }
    let shape = value(text, "shape")?.strip_prefix('(')?.split_once(')')?.0;
    let shape: Option<Vec<u64>> =
        shape.split(',').map(str::trim).filter(|word| !word.is_empty()).map(|word| word.parse().ok()).collect();
    let (number, big_endian) = number(value(text, "descr")?);
    Some(Header { number, big_endian, is_fortran, shape: shape?, bytes: 0 })
}

/// The text behind a key.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let at = text.find(&format!("'{key}'"))? + key.len() + 2;
    text.get(at..)?.trim_start().strip_prefix(':').map(str::trim_start)
}

/// Type and byte order of a description as `'<f8'`.
fn number(description: &str) -> (Result<Number, Unread>, bool) {
    let word = description.strip_prefix('\'').and_then(|rest| rest.split_once('\'')).map_or("", |(word, _)| word);
    let (big_endian, kind) = match word.split_at_checked(1) {
        Some((">", kind)) => (true, kind),
        Some(("<" | "|", kind)) => (false, kind),
        Some(("=", kind)) => (cfg!(target_endian = "big"), kind),
        _ => (false, ""),
    };
    let (kind, bytes) = kind.split_at_checked(1).unwrap_or_default();
    let bytes: u8 = bytes.parse().unwrap_or(0);
    let found = match kind {
        "f" => Number::float(bytes),
        "i" => Number::integer(bytes, true),
        "u" => Number::integer(bytes, false),
        "b" if bytes == 1 => Some(Number::UInt8),
        _ => return (Err(Unread::NoNumbers), big_endian),
    };
    (found.ok_or_else(|| Unread::Width(word.to_owned())), big_endian)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header as NumPy writes it.
    fn header(text: &str) -> Result<Header, String> {
        let bytes = [&b"\x93NUMPY\x01\x00"[..], &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat();
        Header::read(&mut &bytes[..])
    }

    #[test]
    fn headers_say_type_order_and_shape() {
        let read = |descr: &str, order: &str, shape: &str| {
            header(&format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}   \n"))
        };
        let of = read("'>f8'", "False", "(3, 4)").expect("valid");
        assert_eq!((of.number, of.big_endian, of.is_fortran), (Ok(Number::Float64), true, false));
        assert_eq!((of.shape, of.bytes), (vec![3, 4], 10 + 63));
        assert_eq!(read("'|b1'", "True", "()").map(|h| (h.number, h.shape)), Ok((Ok(Number::UInt8), vec![])));
        assert_eq!(read("'<i2'", "False", "(7,)").map(|h| (h.number, h.shape)), Ok((Ok(Number::Int16), vec![7])));
        assert_eq!(read("'<f2'", "False", "(7,)").map(|h| h.number), Ok(Err(Unread::Width("<f2".to_owned()))));
        for descr in ["'<U3'", "'|O'", "'<c16'", "[('a', '<f8')]", "'<M8[ns]'", "'"] {
            assert_eq!(read(descr, "False", "(7,)").map(|h| h.number), Ok(Err(Unread::NoNumbers)), "{descr}");
        }
        for (descr, order, shape) in
            [("'<f8'", "No", "(7,)"), ("'<f8'", "True", "7"), ("'<f8'", "True", "(-7,)"), ("'<f8'", "True", "(7")]
        {
            assert!(read(descr, order, shape).unwrap_err().contains("header"), "{descr} {order} {shape}");
        }
    }

    #[test]
    fn what_is_cut_or_no_array_is_refused() {
        assert!(header(&" ".repeat(5000)).unwrap_err().contains("5000 bytes"));
        assert!(Header::read(&mut &b"PK\x03\x04....."[..]).unwrap_err().contains("no array"));
        assert!(Header::read(&mut &b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..]).unwrap_err().contains("4294967295"));
        assert!(Header::read(&mut &b"\x93NUMPY\x01\x00\x70\x00{}"[..]).unwrap_err().contains("ends within"));
    }
}
