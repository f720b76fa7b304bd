//! Arrays of legacy files: their types, where their numbers lie, and what follows them.

use super::cursor::{AGAIN, Cursor, shown};
use crate::error::FileResult;
use crate::import::numbers::Number;
use std::ops::Range;

/// An array whose numbers are not read yet.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Array {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) components: usize,
    /// Numbers of all components.
    pub(super) count: usize,
    /// Where these lie in the file.
    pub(super) place: Range<usize>,
}

/// What an array holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    Numbers(Number),
    /// Eight in a byte, the first in the highest bit.
    Bits,
    /// `long`, of 4 or 8 bytes, with a sign or without.
    Long(bool),
    /// Texts, which are not read.
    Texts,
    /// Numbers and texts with their types, which are not read.
    Variants,
}

impl Kind {
    /// The type of that name, in any case.
    fn named(word: &[u8]) -> Option<Self> {
        let number = match word.to_ascii_lowercase().as_slice() {
            b"bit" => return Some(Self::Bits),
            b"long" => return Some(Self::Long(true)),
            b"unsigned_long" => return Some(Self::Long(false)),
            b"string" | b"utf8_string" => return Some(Self::Texts),
            b"variant" => return Some(Self::Variants),
            b"char" | b"signed_char" | b"vtktypeint8" => Number::Int8,
            b"unsigned_char" | b"vtktypeuint8" => Number::UInt8,
            b"short" | b"vtktypeint16" => Number::Int16,
            b"unsigned_short" | b"vtktypeuint16" => Number::UInt16,
            // VTK writes its own indices as `int`, whatever their width in memory.
            b"int" | b"vtkidtype" | b"vtktypeint32" => Number::Int32,
            b"unsigned_int" | b"vtktypeuint32" => Number::UInt32,
            b"long_long" | b"vtktypeint64" => Number::Int64,
            b"unsigned_long_long" | b"vtktypeuint64" => Number::UInt64,
            b"float" | b"vtktypefloat32" => Number::Float32,
            b"double" | b"vtktypefloat64" => Number::Float64,
            _ => return None,
        };
        Some(Self::Numbers(number))
    }
}

impl Cursor<'_> {
    /// The array of this name whose type is the next word, as [`Self::array_of`].
    pub(super) fn array(&mut self, name: &str, tuples: usize, components: usize) -> FileResult<Array> {
        let word = self.needed("type of an array")?;
        self.array_of(name, word, tuples, components)
    }

    /// An array of this name and type, whose numbers begin here or, if they are binary, in the next line; what follows it is passed.
    ///
    /// # Errors
    /// If the type is not known, or the file ends before the array does.
    pub(super) fn array_of(&mut self, name: &str, word: &[u8], tuples: usize, components: usize) -> FileResult<Array> {
        let unknown = || {
            let problem = format!("array '{name}' is of type '{}', which is not read", shown(word));
            self.unsupported(problem).remedy("write it as int, float or double")
        };
        let kind = Kind::named(word).ok_or_else(unknown)?;
        let what = format!("the array '{name}'");
        let too_many = || self.invalid(format!("{what} claims {tuples} tuples of {components} numbers")).remedy(AGAIN);
        let count = tuples.checked_mul(components).ok_or_else(too_many)?;
        let (kind, place) = self.data(kind, count, &what)?;
        self.metadata(components);
        Ok(Array { name: name.to_owned(), kind, components, count, place })
    }

    /// Passes the numbers of an array; `long` gets its width.
    fn data(&mut self, kind: Kind, count: usize, what: &str) -> FileResult<(Kind, Range<usize>)> {
        let start = self.at;
        match kind {
            Kind::Texts => {
                self.texts(count, what)?;
                return Ok((kind, start..self.at));
            }
            Kind::Variants => {
                let words = count.saturating_mul(2);
                return Ok((kind, self.words(words, what)?));
            }
            _ if !self.is_binary => {
                let kind = match kind {
                    Kind::Long(signed) => Kind::Numbers(if signed { Number::Int64 } else { Number::UInt64 }),
                    Kind::Bits => Kind::Numbers(Number::UInt8),
                    // No width limits what is written as text.
                    Kind::Numbers(Number::Int32) => Kind::Numbers(Number::Int64),
                    other => other,
                };
                return Ok((kind, self.words(count, what)?));
            }
            _ if count == 0 => return Ok((kind, start..start)),
            _ => {}
        }
        self.line();
        let kind = match kind {
            Kind::Long(signed) => Kind::Numbers(self.long(signed, count)),
            other => other,
        };
        let bytes = match kind {
            Kind::Numbers(number) => count.saturating_mul(number.size()),
            _ => count.div_ceil(8),
        };
        Ok((kind, self.block(bytes, what)?))
    }

    /// The type of the binary `long` numbers that begin here. Writers differ in their width: a line ends behind the last one.
    fn long(&self, signed: bool, count: usize) -> Number {
        let ends_line = |size: usize| {
            let end = count.checked_mul(size).and_then(|bytes| self.at.checked_add(bytes));
            end.is_some_and(|end| end == self.bytes.len() || self.bytes.get(end).is_some_and(u8::is_ascii_whitespace))
        };
        match (ends_line(8) || !ends_line(4), signed) {
            (true, true) => Number::Int64,
            (true, false) => Number::UInt64,
            (false, true) => Number::Int32,
            (false, false) => Number::UInt32,
        }
    }

    /// Passes texts: a line each, or the length of each before it, whose width is in the two highest bits of its first byte.
    fn texts(&mut self, count: usize, what: &str) -> FileResult<()> {
        self.line();
        for _ in 0..count {
            if !self.is_binary {
                self.line().ok_or_else(|| self.cut(what))?;
                continue;
            }
            let width = match self.rest().first().map(|byte| byte >> 6) {
                None => return Err(self.cut(what)),
                Some(3) => 1,
                Some(2) => 2,
                Some(1) => 4,
                Some(_) => 8,
            };
            let head = self.block(width, what)?;
            let length = self.bytes[head].iter().fold(0_u64, |n, &byte| n << 8 | u64::from(byte));
            let length = length & u64::MAX >> (64 - (8 * width as u32 - 2));
            self.block(usize::try_from(length).unwrap_or(usize::MAX), what)?;
        }
        Ok(())
    }

    /// Passes the block `METADATA` behind an array of `components`, which a blank line ends.
    fn metadata(&mut self, components: usize) {
        self.blanks();
        if !self.is_next("METADATA") {
            return;
        }
        self.line();
        let mut keys = 0_usize;
        while let Some(line) = self.line() {
            let mut words = line.split(u8::is_ascii_whitespace);
            let first = words.next().unwrap_or_default();
            if first.eq_ignore_ascii_case(b"COMPONENT_NAMES") {
                // The name of a component may be a blank line.
                (0..components).take_while(|_| self.line().is_some()).for_each(drop);
            } else if first.eq_ignore_ascii_case(b"INFORMATION") {
                let count = words.next().and_then(|word| std::str::from_utf8(word).ok()?.parse().ok());
                keys = count.unwrap_or(0);
            } else if first == b"NAME" {
                keys = keys.saturating_sub(1);
            } else if line.is_empty() && keys == 0 {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn cursor(bytes: &[u8], is_binary: bool) -> Cursor<'_> {
        Cursor { path: Path::new("a.vtk"), bytes, at: 0, is_binary }
    }

    /// The kind and the bytes of an array, and the word behind it.
    fn read(
        bytes: &[u8],
        is_binary: bool,
        tuples: usize,
        components: usize,
    ) -> Result<(Kind, Vec<u8>, String), String> {
        let mut cursor = cursor(bytes, is_binary);
        let array = cursor.array("a", tuples, components).map_err(|error| error.to_string())?;
        Ok((array.kind, bytes[array.place].to_vec(), shown(cursor.word().unwrap_or_default())))
    }

    #[test]
    fn types_are_named_in_any_case_and_have_their_width() {
        let number = |number| Ok((Kind::Numbers(number), b"1234567812345678".to_vec(), "NEXT".to_owned()));
        for (name, kind) in [("double", Number::Float64), ("vtkTypeInt64", Number::Int64), ("LONG", Number::Int64)] {
            assert_eq!(read(format!("{name}\n1234567812345678\nNEXT").as_bytes(), true, 1, 2), number(kind), "{name}");
        }
        for (name, kind) in
            [("vtkIdType", Number::Int32), ("Float", Number::Float32), ("unsigned_long", Number::UInt32)]
        {
            assert_eq!(read(format!("{name}\n1234567812345678\nNEXT").as_bytes(), true, 4, 1), number(kind), "{name}");
        }
        let bits = read(b"bit\n12 NEXT", true, 9, 1);
        assert_eq!(bits, Ok((Kind::Bits, b"12".to_vec(), "NEXT".to_owned())));
        assert_eq!(read(b"bit 0 1\n1 NEXT", false, 3, 1).unwrap().1, b"0 1\n1");
        assert!(read(b"complex 1 2", false, 1, 2).unwrap_err().contains("'complex'"));
    }

    #[test]
    fn texts_and_metadata_are_passed() {
        let texts =
            [&b"string\n"[..], &[0xc2], b"ab", &[0x80, 3], b"cde", &[0x40, 0, 0, 0], &[0; 8], b"\nNEXT"].concat();
        assert_eq!(read(&texts, true, 4, 1).unwrap().2, "NEXT");
        assert_eq!(read(b"string\na b\n\nc\nNEXT", false, 3, 1).unwrap().2, "NEXT");
        assert_eq!(read(b"variant 1 a 2 b NEXT", false, 2, 1).unwrap().2, "NEXT");
        let metadata = b"int 1 2\nMETADATA\nCOMPONENT_NAMES\n\nz%20z\nINFORMATION 2\nNAME A LOCATION B\nDATA 1\n\nNAME C LOCATION D\n\
            DATA x\n\nNEXT";
        assert_eq!(read(metadata, false, 1, 2).unwrap().2, "NEXT");
        assert_eq!(read(b"int 1\nMETADATA\nINFORMATION 0\n \n\nNEXT", false, 1, 1).unwrap().2, "NEXT");
    }

    #[test]
    fn counts_that_the_file_does_not_hold_are_refused() {
        for (bytes, is_binary) in
            [(&b"int\n1234"[..], true), (b"int 1 2", false), (b"string\nab", true), (b"bit\n1", true)]
        {
            for (tuples, components) in [(9, 1), (usize::MAX, 1), (usize::MAX, 3), (1 << 62, 1)] {
                let error = read(bytes, is_binary, tuples, components).unwrap_err();
                assert!(error.contains("array 'a'"), "{error}");
            }
        }
    }
}
