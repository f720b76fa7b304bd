//! `DataItem` elements: locating and reading the numbers of an array.

use super::super::hdf::{SlabAxis, product};
use super::super::numbers::{Number, Numbers, parse_ascii};
use super::hdf;
use super::tree::{DEPTH_MAX, Document, Id};
use crate::error::{FileError, FileResult};
use crate::files;
use crate::slowdown::{Slow, waste};
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// An array that is not yet read. Equal items are equal arrays.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Item {
    /// The element, for messages.
    pub(super) id: Id,
    /// The shape given in the XDMF file.
    pub(super) dims: Vec<u64>,
    /// Type and byte order given in the XDMF file; an HDF5 file's own take precedence.
    number: Number,
    big_endian: bool,
    source: Source,
    /// The selected part of the source, axis by axis; the source then has shape `source_dims`.
    slab: Option<Vec<SlabAxis>>,
    source_dims: Vec<u64>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Source {
    /// Text, in these byte ranges of the XDMF file.
    Inline(Vec<Range<usize>>),
    Hdf {
        file: PathBuf,
        dataset: String,
    },
    Binary {
        file: PathBuf,
        seek: u64,
    },
}

impl Item {
    /// The `DataItem` `id`.
    ///
    /// # Errors
    /// If it is of an unsupported kind, or lacks what its kind needs.
    pub(super) fn of(document: &Document, id: Id) -> FileResult<Self> {
        Self::at_depth(document, id, 0)
    }

    fn at_depth(document: &Document, id: Id, depth: usize) -> FileResult<Self> {
        if depth > DEPTH_MAX {
            return Err(document.invalid(id, "is nested too deeply"));
        }
        match document.either(id, &["ItemType", "Type"]).unwrap_or("Uniform") {
            kind if kind.eq_ignore_ascii_case("Uniform") => Self::uniform(document, id),
            kind if kind.eq_ignore_ascii_case("HyperSlab") => Self::hyperslab(document, id, depth),
            kind => Err(document.unsupported(id, format!("is of ItemType {kind}, which is not read"))),
        }
    }

    fn uniform(document: &Document, id: Id) -> FileResult<Self> {
        let dims = dims_of(document, id)?.ok_or_else(|| document.invalid(id, "lacks its Dimensions"))?;
        let big_endian = match document.attribute(id, "Endian").unwrap_or("Native").trim() {
            "Native" => cfg!(target_endian = "big"),
            "Little" => false,
            "Big" => true,
            other => return Err(document.invalid(id, format!("Endian=\"{other}\" is unknown"))),
        };
        let format = document.attribute(id, "Format").unwrap_or("XML").trim().to_ascii_uppercase();
        let source = match format.as_str() {
            "XML" => Source::Inline(document.text_ranges(id).to_vec()),
            "HDF" | "HDF5" => {
                let text = document.text(id);
                let parts = text.rsplit_once(":/").or_else(|| text.rsplit_once(':'));
                let (file, dataset) =
                    parts.filter(|(file, name)| !file.is_empty() && !name.is_empty()).ok_or_else(|| {
                        document
                            .invalid(id, format!("'{text}' is no name of a data set"))
                            .remedy("write it as FILE.h5:/PATH")
                    })?;
                if dataset.contains('|') {
                    return Err(document
                        .unsupported(id, format!("'{text}' selects a part, which is not read"))
                        .remedy("write the selection as a DataItem of ItemType HyperSlab"));
                }
                Source::Hdf { file: beside(document, file), dataset: format!("/{}", dataset.trim_start_matches('/')) }
            }
            "BINARY" => Self::binary(document, id)?,
            _ => return Err(document.unsupported(id, format!("Format=\"{format}\" is not read"))),
        };
        let number = number_of(document, id)?;
        Ok(Self { id, source_dims: dims.clone(), dims, number, big_endian, source, slab: None })
    }

    fn binary(document: &Document, id: Id) -> FileResult<Source> {
        if let Some(other) = document.attribute(id, "Compression").filter(|c| !c.eq_ignore_ascii_case("Raw")) {
            return Err(document.unsupported(id, format!("Compression=\"{other}\" is not read")));
        }
        let seek = document.count(id, "Seek")?.unwrap_or(0);
        let file = document.text(id);
        if file.is_empty() {
            return Err(document.invalid(id, "names no file"));
        }
        Ok(Source::Binary { file: beside(document, &file), seek })
    }

    /// Reads a `HyperSlab`: an item of three rows, *start, stride, count*, and the item to select from.
    fn hyperslab(document: &Document, id: Id, depth: usize) -> FileResult<Self> {
        let children = document.children_named(id, "DataItem")?;
        let &[selection, source] = children.as_slice() else {
            return Err(document.invalid(id, "a HyperSlab has two DataItems: the selection and the array"));
        };
        let source = Self::at_depth(document, source, depth + 1)?;
        if source.slab.is_some() {
            return Err(document.unsupported(id, "selects from a HyperSlab, which is not read"));
        }
        let rank = source.dims.len();
        // Read as text, whatever its type: writers omit it, and a 4-byte float would round.
        let words = document.text(selection);
        let numbers: Option<Vec<u64>> = words.split_whitespace().map(|word| word.parse().ok()).collect();
        let numbers = numbers.filter(|numbers| numbers.len() == 3 * rank).ok_or_else(|| {
            let wanted = format!("a selection of {rank} axes is {} whole numbers in the text", 3 * rank);
            document.invalid(selection, format!("{wanted}: starts, strides, counts"))
        })?;
        let axis = |i: usize| SlabAxis { start: numbers[i], stride: numbers[rank + i], count: numbers[2 * rank + i] };
        let axes: Vec<_> = (0..rank).map(axis).collect();
        let fits = |(axis, &length): (&SlabAxis, &u64)| axis.stride > 0 && axis.end().is_some_and(|end| end <= length);
        if !axes.iter().zip(&source.dims).all(fits) {
            return Err(document.invalid(id, format!("reaches beyond the array of shape {:?}", source.dims)));
        }
        let dims: Vec<u64> = axes.iter().map(|axis| axis.count).collect();
        if let Some(said) = dims_of(document, id)?
            && product(&said) != product(&dims)
        {
            return Err(document.invalid(id, format!("selects {dims:?}, but its Dimensions are {said:?}")));
        }
        Ok(Self { id, dims, slab: Some(axes), ..source })
    }

    /// Number of elements; `None` if it overflows.
    pub(super) fn len(&self) -> Option<u64> {
        product(&self.dims)
    }

    /// Location of the numbers, the same for equal arrays wherever they are in the XDMF file.
    pub(super) fn place(&self) -> impl std::hash::Hash + '_ {
        (&self.source, &self.source_dims, &self.slab, &self.dims, self.number, self.big_endian)
    }

    /// The external file with the numbers; `None` for inline ones.
    pub(super) fn file(&self) -> Option<&Path> {
        match &self.source {
            Source::Inline(_) => None,
            Source::Hdf { file, .. } | Source::Binary { file, .. } => Some(file),
        }
    }

    /// The unit of the numbers, if they are in HDF5 and their data set says one.
    pub(super) fn unit(&self) -> Option<String> {
        match &self.source {
            Source::Hdf { file, dataset } => hdf::unit(file, dataset),
            Source::Inline(_) | Source::Binary { .. } => None,
        }
    }

    /// Reads the numbers: [`Item::len`] of them.
    ///
    /// # Errors
    /// If the file is missing or damaged, or holds other data.
    pub(super) fn read(&self, document: &Document) -> FileResult<Numbers> {
        let (number, big_endian) = (self.number, self.big_endian);
        waste(Slow::ReadXdmf, self.len().unwrap_or(0) as usize);
        let array = match &self.source {
            Source::Hdf { file, dataset } => {
                return hdf::read(file, dataset, &self.source_dims, self.slab.as_deref());
            }
            Source::Inline(ranges) => {
                let bytes = parse_ascii(number, document.numbers(ranges).as_bytes())
                    .map_err(|problem| document.invalid(self.id, problem))?;
                let (got, wanted) = (bytes.len() / number.size(), product(&self.source_dims));
                if Some(got as u64) != wanted {
                    let dims = &self.source_dims;
                    return Err(
                        document.invalid(self.id, format!("has {got} numbers, but its Dimensions are {dims:?}"))
                    );
                }
                // Text was parsed to little-endian bytes.
                Numbers { number, big_endian: false, bytes }
            }
            Source::Binary { file, seek } => {
                let bytes = read_binary(file, *seek, product(&self.source_dims), number.size())?;
                Numbers { number, big_endian, bytes }
            }
        };
        Ok(match &self.slab {
            None => array,
            Some(slab) => Numbers { bytes: select(&array.bytes, number.size(), &self.source_dims, slab), ..array },
        })
    }
}

/// A file named by the XDMF file, relative to it.
fn beside(document: &Document, name: &str) -> PathBuf {
    let folder = document.path().parent().unwrap_or(Path::new(""));
    let path = folder.join(name);
    if path.exists() { path } else { Some(folder.join(name.replace('\\', "/"))).filter(|p| p.exists()).unwrap_or(path) }
}

/// The attribute `Dimensions`, slowest axis first.
fn dims_of(document: &Document, id: Id) -> FileResult<Option<Vec<u64>>> {
    let Some(text) = document.attribute(id, "Dimensions") else { return Ok(None) };
    let dims: Option<Vec<u64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let dims = dims.filter(|dims| !dims.is_empty() && product(dims).is_some());
    dims.map(Some).ok_or_else(|| document.invalid(id, format!("Dimensions=\"{text}\" are no counts")))
}

/// Number type from type and width. `DataType` is the attribute's name in version 2, and in files of meshio.
fn number_of(document: &Document, id: Id) -> FileResult<Number> {
    let name = document.either(id, &["NumberType", "DataType"]).unwrap_or("Float");
    let precision: Option<u8> = document.count(id, "Precision")?;
    let invalid = |text: String| document.invalid(id, text);
    let number = match name.to_ascii_lowercase().as_str() {
        "float" => Number::float(precision.unwrap_or(4)),
        "int" => Number::integer(precision.unwrap_or(4), true),
        "uint" => Number::integer(precision.unwrap_or(4), false),
        "short" => Number::integer(2, true),
        "ushort" => Number::integer(2, false),
        "char" => Number::integer(1, true),
        "uchar" => Number::integer(1, false),
        _ => return Err(invalid(format!("NumberType=\"{name}\" is unknown"))),
    };
    number.ok_or_else(|| invalid(format!("NumberType=\"{name}\" has no Precision {}", precision.unwrap_or(4))))
}

fn read_binary(path: &Path, seek: u64, count: Option<u64>, size: usize) -> FileResult<Vec<u8>> {
    let mut file = files::open(path)?;
    let there = file.metadata().map_err(|e| FileError::io(path, "examine", &e))?.len();
    let wanted = count.and_then(|n| n.checked_mul(size as u64));
    let fits = wanted.filter(|wanted| seek.checked_add(*wanted).is_some_and(|end| end <= there));
    let wanted = fits.and_then(|n| usize::try_from(n).ok()).ok_or_else(|| {
        let numbers = count.map_or("more".to_owned(), |n| n.to_string());
        FileError::invalid(
            path,
            format!("byte {seek}"),
            format!("has {there} bytes where {numbers} numbers of {size} bytes are needed"),
        )
        .remedy("correct Dimensions, Precision or Seek of the DataItem")
    })?;
    file.seek(SeekFrom::Start(seek)).map_err(|e| FileError::io(path, "seek in", &e))?;
    let mut bytes = vec![0; wanted];
    file.read_exact(&mut bytes).map_err(|e| FileError::io(path, "read", &e))?;
    Ok(bytes)
}

/// The selected elements of `size` bytes each; the selection lies within the shape.
fn select(bytes: &[u8], size: usize, dims: &[u64], slab: &[SlabAxis]) -> Vec<u8> {
    // Offsets, in elements, selected by the axes so far.
    let mut offsets = vec![0_usize];
    for (axis, &length) in slab.iter().zip(dims) {
        let of_axis = |base: &usize| {
            let base = base * length as usize;
            (0..axis.count).map(move |i| base + (axis.start + i * axis.stride) as usize)
        };
        offsets = offsets.iter().flat_map(of_axis).collect();
    }
    offsets.into_iter().flat_map(|at| bytes[at * size..(at + 1) * size].iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(inside: &str) -> FileResult<(Item, Vec<f64>)> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.xdmf");
        std::fs::write(folder.path().join("a.bin"), [0_u16, 258, 3].map(u16::to_be_bytes).concat()).expect("a file");
        std::fs::write(&path, format!("<Xdmf>{inside}</Xdmf>")).expect("a file");
        let document = Document::open(&path)?;
        let root = document.children(0)?[0];
        let item = Item::of(&document, document.children(root)?[0])?;
        let values = item.read(&document)?.values().to_f64();
        Ok((item, values))
    }

    #[test]
    fn numbers_in_the_file_beside_it_and_selections_of_both_are_read() {
        let read = |text: &str| item(text).map(|(item, values)| (item.dims, values)).map_err(|e| e.to_string());
        assert_eq!(
            read("<DataItem Dimensions='2 2'> 1 2.5\n3 nan </DataItem>").map(|r| r.1[..3].to_vec()),
            Ok(vec![1.0, 2.5, 3.0])
        );
        let binary =
            "<DataItem Dimensions='2' Format='Binary' NumberType='UShort' Endian='Big' Seek='2'>a.bin</DataItem>";
        assert_eq!(read(binary), Ok((vec![2], vec![258.0, 3.0])));
        let slab = |numbers: &str| {
            read(&format!(
                "<DataItem ItemType='HyperSlab' Dimensions='2 2'><DataItem Dimensions='3 2' Format='XML'>{numbers}</DataItem>\
                 <DataItem DataType='Int' Dimensions='3 4'>0 1 2 3  10 11 12 13  20 21 22 23</DataItem></DataItem>"
            ))
        };
        assert_eq!(slab("0 1  2 2  2 2"), Ok((vec![2, 2], vec![1.0, 3.0, 21.0, 23.0])));
        assert!(slab("0 1  2 2  2 3").expect_err("beyond").contains("beyond"));
        assert!(slab("0 1.5  2 2  2 2").expect_err("a float").contains("whole"));
        assert!(slab("0 1  0 2  2 2").expect_err("no stride").contains("beyond"));
        assert!(slab("0 0  1 1  3 2").expect_err("other dimensions").contains("Dimensions"));
    }

    #[test]
    fn what_a_data_item_lacks_or_says_wrongly_is_named() {
        for (text, part) in [
            ("<DataItem>1</DataItem>", "lacks its Dimensions"),
            ("<DataItem Dimensions='x'>1</DataItem>", "no counts"),
            ("<DataItem Dimensions='4294967296 4294967296'>1</DataItem>", "no counts"),
            ("<DataItem Dimensions='2'>1</DataItem>", "has 1 numbers"),
            ("<DataItem Dimensions='1' NumberType='Int'>1.5</DataItem>", "'1.5' is no Int32"),
            ("<DataItem Dimensions='1' NumberType='Complex'>1</DataItem>", "Complex"),
            ("<DataItem Dimensions='1' Precision='16'>1</DataItem>", "Precision 16"),
            ("<DataItem Dimensions='1' Format='Binary' Endian='Middle'>a.bin</DataItem>", "Middle"),
            ("<DataItem Dimensions='2' Format='Binary'>a.bin</DataItem>", "has 6 bytes"),
            ("<DataItem Dimensions='1' Format='Binary'>b.bin</DataItem>", "b.bin"),
            ("<DataItem Dimensions='1' Format='HDF'>b.h5</DataItem>", "FILE.h5:/PATH"),
            ("<DataItem Dimensions='1' Format='HDF'>b.h5:/a</DataItem>", "b.h5"),
            ("<DataItem Dimensions='1' Format='HDF'>b.h5:/a|0|1|1</DataItem>", "HyperSlab"),
            ("<DataItem Dimensions='1' Format='TIFF'>b.tif</DataItem>", "TIFF"),
            ("<DataItem Dimensions='1' ItemType='Function'>$0</DataItem>", "Function"),
        ] {
            let error = item(text).expect_err(text).to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
