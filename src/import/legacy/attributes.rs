//! Keywords of arrays: those of points, of cells, and of the whole mesh.

use super::array::{Array, Kind};
use super::cursor::shown;
use super::header::{Parser, TIME_ARRAYS};
use crate::error::{FileError, FileResult};
use crate::field::Association;

impl Parser<'_> {
    /// Begins the arrays of points or cells.
    pub(super) fn begin(&mut self, association: Association) -> FileResult<()> {
        let count = self.cursor.number("number of values")?;
        self.section = Some((association, count));
        let of = usize::from(association == Association::Cell);
        match self.header.values[of].replace(count) {
            Some(before) if before != count => {
                Err(self.cursor.invalid(format!("the number of values was {before}, and is {count} here")))
            }
            _ => Ok(()),
        }
    }

    /// Reads an array of points or cells behind the keyword of what it means.
    pub(super) fn attribute(&mut self, word: &[u8], lower: &[u8]) -> FileResult<()> {
        let components = match lower {
            b"scalars" | b"color_scalars" | b"lookup_table" | b"texture_coordinates" => 0,
            b"global_ids" | b"pedigree_ids" | b"edge_flags" => 1,
            b"vectors" | b"normals" => 3,
            b"tensors6" => 6,
            b"tensors" => 9,
            _ => return Err(self.unknown(word)),
        };
        let Some((association, count)) = self.section else {
            let problem = format!("{} stands before POINT_DATA and CELL_DATA", shown(word));
            return Err(self.cursor.invalid(problem));
        };
        let name = decoded(self.cursor.needed("name of an array")?);
        let array = match lower {
            b"lookup_table" => {
                let colors = self.cursor.number("number of colours")?;
                return self.colors(&name, colors, 4);
            }
            b"color_scalars" => {
                let components = self.cursor.number("number of components")?;
                self.header.left_out.push(format!("'{name}' (holds colours)"));
                return self.colors(&name, count, components);
            }
            b"scalars" => self.scalars(&name, count)?,
            b"texture_coordinates" => {
                let components = self.cursor.number("number of components")?;
                self.cursor.array(&name, count, components)?
            }
            _ => self.cursor.array(&name, count, components)?,
        };
        self.add(association, count, array);
        Ok(())
    }

    fn scalars(&mut self, name: &str, count: usize) -> FileResult<Array> {
        let cursor = &mut self.cursor;
        let word = cursor.needed("type of an array")?;
        let named = |error: FileError| error.remedy("add a line 'LOOKUP_TABLE default' before the numbers");
        let components = match cursor.is_next("LOOKUP_TABLE") {
            true => 1,
            false => cursor.number("number of components").map_err(named)?,
        };
        if !cursor.is_next("LOOKUP_TABLE") {
            return Err(named(cursor.invalid(format!("SCALARS '{name}' has no LOOKUP_TABLE"))));
        }
        cursor.word();
        cursor.needed("name of a lookup table")?;
        cursor.array_of(name, word, count, components)
    }

    /// Passes colours, which are bytes or, as text, fractions.
    fn colors(&mut self, name: &str, count: usize, components: usize) -> FileResult<()> {
        let kind: &[u8] = if self.cursor.is_binary { b"unsigned_char" } else { b"float" };
        self.cursor.array_of(name, kind, count, components).map(drop)
    }

    /// Reads arrays of points or cells, or of the whole mesh, with their sizes.
    pub(super) fn field(&mut self) -> FileResult<()> {
        self.cursor.needed("name of the field")?;
        let arrays: usize = self.cursor.number("number of arrays")?;
        for _ in 0..arrays {
            let word = self.cursor.needed("name of an array")?;
            if word == b"NULL_ARRAY" {
                continue;
            }
            let name = decoded(word);
            let components = self.cursor.number("number of components")?;
            let tuples = self.cursor.number("number of tuples")?;
            let array = self.cursor.array(&name, tuples, components)?;
            if let Some((association, count)) = self.section {
                self.add(association, count, array);
            } else if TIME_ARRAYS.contains(&name.as_str()) && array.count > 0 && !array.is_text() {
                self.header.time.get_or_insert(array);
            }
        }
        Ok(())
    }

    /// Adds an array of `count` points or cells, or the reason why it is left out.
    fn add(&mut self, association: Association, count: usize, array: Array) {
        let name = &array.name;
        if array.is_text() {
            self.header.left_out.push(format!("'{name}' (holds no numbers)"));
        } else if array.count == 0 {
            self.header.left_out.push(format!("'{name}' (has no values)"));
        } else if Some(array.count) != count.checked_mul(array.components) {
            let tuples = array.count / array.components;
            self.header.left_out.push(format!("'{name}' (has {tuples} values where {count} are needed)"));
        } else if association == Association::Point {
            self.header.point_arrays.push(array);
        } else {
            self.header.cell_arrays.push(array);
        }
    }
}

impl Array {
    /// Whether it holds no numbers.
    fn is_text(&self) -> bool {
        matches!(self.kind, Kind::Texts | Kind::Variants)
    }
}

/// A name, in which VTK writes blanks and other special bytes as `%20`.
fn decoded(word: &[u8]) -> String {
    let mut bytes = Vec::new();
    let mut rest = word;
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| first == b'%').and_then(|digits| std::str::from_utf8(digits).ok());
        match code.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::super::header::{Extent, parse};
    use super::*;
    use std::path::Path;

    fn names(arrays: &[Array]) -> Vec<(&str, usize)> {
        arrays.iter().map(|array| (array.name.as_str(), array.components)).collect()
    }

    #[test]
    fn names_are_decoded_and_what_is_no_code_is_kept() {
        assert_eq!(decoded(b"vel%20city%25%C3%a9"), "vel city%\u{e9}");
        assert_eq!(decoded(b"50%,%zz%2"), "50%,%zz%2");
    }

    #[test]
    fn all_keywords_of_attributes_are_read_in_any_case() {
        let text = "dataset Structured_Points dimensions 1 1 2 aspect_ratio 1 2 3 ORIGIN 0 0 0 POINT_DATA 2 \
            scalars s int lookup_table default 1 2 LOOKUP_TABLE t 1 0.1 0.2 0.3 0.4 SCALARS s2 float 2 LOOKUP_TABLE t 1 2 3 4 \
            color_scalars c 3 0 0 0 0 0 0 VECTORS v double 1 2 3 4 5 6 NORMALS n float 1 0 0 1 0 0 TENSORS6 t6 float \
            1 2 3 4 5 6 1 2 3 4 5 6 TENSORS t9 float 1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 TEXTURE_COORDINATES tc 2 float 1 2 3 4 \
            GLOBAL_IDS g vtkIdType 1 2 FIELD f 4 NULL_ARRAY a%20b 1 2 char 1 -2 short 1 1 int 5 texts 1 2 string \na b\n\n \
            CELL_DATA 1 SCALARS of_cells unsigned_char 1 LOOKUP_TABLE default 9";
        let text = format!("# vtk DataFile Version 3.0\ntitle\nASCII\n{text}");
        let header = parse(Path::new("a.vtk"), text.as_bytes(), Extent::Whole).unwrap();
        let points = [("s", 1), ("s2", 2), ("v", 3), ("n", 3), ("t6", 6), ("t9", 9), ("tc", 2), ("g", 1), ("a b", 1)];
        assert_eq!(names(&header.point_arrays), points);
        assert_eq!(names(&header.cell_arrays), [("of_cells", 1)]);
        let left_out =
            ["'c' (holds colours)", "'short' (has 1 values where 2 are needed)", "'texts' (holds no numbers)"];
        assert_eq!(header.left_out, left_out);
        assert_eq!((header.spacing, header.values), (Some([1.0, 2.0, 3.0]), [Some(2), Some(1)]));
    }
}
