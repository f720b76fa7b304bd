//! Structured grids in VTK's XML format: `.vti` (equal distances), `.vtr` (coordinates along each axis), `.vts` (points of their own).

use super::header::Piece;
use super::{VtuFile, ghost_flags};
use crate::error::{FileError, FileResult};
use crate::import::cell_list::is_ghost;
use crate::import::cells::GridReader;
use crate::import::lattice::{EvenGrid, Lattice};
use crate::import::xml::Attributes;
use glam::DVec3;
use std::hash::Hash;
use std::str::FromStr;

/// The points of a structured grid.
#[derive(Clone, Copy, Debug, PartialEq, Hash)]
pub(crate) enum Structure {
    /// At equal distances.
    Even(EvenGrid),
    /// At coordinates along each axis.
    Axes,
    /// Each with its own coordinates.
    Curved,
}

impl Structure {
    /// That of a file of this type, if it is structured.
    pub(super) fn of_type(name: &str) -> Option<Self> {
        match name {
            "ImageData" => Some(Self::Even(EvenGrid::of([0.0; 3], [1.0; 3]))),
            "RectilinearGrid" => Some(Self::Axes),
            "StructuredGrid" => Some(Self::Curved),
            _ => None,
        }
    }

    /// Reads the attributes of the element that has the name of the type; the error says what is wrong with them.
    pub(super) fn read(&mut self, attributes: &Attributes) -> Result<(), String> {
        let Self::Even(grid) = self else { return Ok(()) };
        if let Some(origin) = numbers(attributes, "Origin")? {
            grid.origin = origin;
        }
        if let Some(spacing) = numbers(attributes, "Spacing")? {
            grid.spacing = spacing;
        }
        if let Some([a, b, c, d, e, f, g, h, i]) = numbers(attributes, "Direction")? {
            grid.direction = [[a, b, c], [d, e, f], [g, h, i]];
        }
        if grid.is_finite() { Ok(()) } else { Err("its origin, spacing or direction is not finite".to_owned()) }
    }
}

/// The lattice of a piece in a file of this many bytes, and the first index along each axis.
pub(super) fn extent(attributes: &Attributes, bytes: usize) -> Result<(Lattice, [i64; 3]), String> {
    let extent: [i64; 6] = numbers(attributes, "Extent")?.ok_or("<Piece> lacks its Extent")?;
    Ok((Lattice::of_extent(extent, bytes)?, [extent[0], extent[2], extent[4]]))
}

/// Numbers of an attribute; `None` if it is absent.
fn numbers<T: FromStr, const N: usize>(attributes: &Attributes, key: &str) -> Result<Option<[T; N]>, String> {
    let Some(text) = attributes.get(key) else { return Ok(None) };
    let numbers: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
    numbers.map(Some).ok_or_else(|| format!("{key}=\"{text}\" are no {N} numbers"))
}

/// Adds a piece of `file` to `grid`.
///
/// # Errors
/// If its arrays are damaged, or do not fit its extent.
pub(super) fn add_piece(grid: &mut GridReader, file: &VtuFile, piece: &Piece) -> FileResult<()> {
    let invalid = |problem: String| FileError::invalid(&file.path, "<Piece>", problem);
    let (Some((lattice, first)), Some(structure)) = (piece.lattice, &file.header.structure) else {
        return Err(invalid("lacks its Extent".to_owned()));
    };
    grid.check_room(&file.path, "<Piece>", piece.points, piece.cells)?;
    let first_point = grid.mesh.points.len();
    match structure {
        Structure::Even(even) => grid.mesh.points.extend(lattice.even(first, even)),
        Structure::Curved => super::cells::add_points(grid, file, piece)?,
        Structure::Axes => {
            let [x, y, z] = piece.axes.as_slice() else {
                return Err(invalid(format!("has {} arrays of coordinates, not 3", piece.axes.len())));
            };
            let dims = lattice.dims();
            let read = |axis: usize, array| Ok(file.values(&file.decode(array, dims[axis])?).to_f64());
            let axes = [read(0, x)?, read(1, y)?, read(2, z)?];
            grid.mesh
                .points
                .extend::<Vec<DVec3>>(lattice.product(axes.each_ref().map(Vec::as_slice)).map_err(invalid)?);
        }
    }
    let ghosts = ghost_flags(file, piece)?;
    let is_hidden = |cell: usize| ghosts.get(cell).is_some_and(|&flags| is_ghost(flags));
    lattice.add_cells(grid, &file.path, first_point, *structure != Structure::Curved, is_hidden)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Component, SeriesSource};

    /// A file of this name with 3 x 2 x 2 points, the extent beginning at (1, 0, 2), with a point array and a cell array.
    fn open(name: &str, kind: &str, attributes: &str, geometry: &str) -> FileResult<Box<dyn SeriesSource>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        let points: String = (0..12).map(|i| format!("{i} ")).collect();
        let text = format!(
            "<VTKFile type=\"{kind}\" version=\"1.0\"><{kind} WholeExtent=\"1 3 0 1 2 3\" {attributes}>\
             <Piece Extent=\"1 3 0 1 2 3\"><PointData><DataArray type=\"Float64\" Name=\"p\">{points}</DataArray></PointData>\
             <CellData><DataArray type=\"Int32\" Name=\"c\">5 6</DataArray>\
             <DataArray type=\"UInt8\" Name=\"vtkGhostType\">0 32</DataArray></CellData>{geometry}</Piece></{kind}></VTKFile>"
        );
        std::fs::write(&path, text).expect("a file");
        let source = crate::import::open(&path)?;
        // The mesh and the fields are read while the file is there.
        let mut values = Vec::new();
        for field in source.fields() {
            source.read(field, Component::Index(0), 0, &mut values)?;
        }
        Ok(source)
    }

    fn array(numbers: &str) -> String {
        format!("<DataArray type=\"Float32\" Name=\"any\" NumberOfComponents=\"1\">{numbers}</DataArray>")
    }

    #[test]
    fn grids_of_all_three_kinds_have_the_points_and_cells_of_their_extent() {
        let axes = ["1 2 4", "0 1", "-1 1"].map(array).concat();
        let curved: String = (0..12).map(|i| format!("{} {} {} ", i % 3, i / 3 % 2, i / 6)).collect();
        let curved = curved.replacen("0 0 0", "0 0 -0.5", 1);
        let grids = [
            ("a.vti", "ImageData", "Origin=\"10 0 0\" Spacing=\"0.5 1 2\"", String::new(), [10.5, 0.0, 4.0]),
            ("a.vtr", "RectilinearGrid", "", format!("<Coordinates>{axes}</Coordinates>"), [1.0, 0.0, -1.0]),
            (
                "a.vts",
                "StructuredGrid",
                "",
                format!("<Points>{}</Points>", array(&curved).replace("=\"1\"", "=\"3\"")),
                [0.0, 0.0, -0.5],
            ),
        ];
        for (name, kind, attributes, geometry, first) in grids {
            let source = open(name, kind, attributes, &geometry).expect(name);
            let mesh = source.mesh().expect(name);
            assert_eq!((mesh.points.len(), mesh.cells.len(), mesh.points[0].to_array()), (12, 1, first), "{name}");
            assert_eq!(mesh.cells.iter().next().unwrap().len(), 8);
            assert!(source.notes().iter().any(|note| note.contains("1 ghost cells")), "{:?}", source.notes());
            let mut values = Vec::new();
            source.read(&source.fields()[1], Component::Index(0), 0, &mut values).expect(name);
            assert_eq!(values, [5.0]);
        }
    }

    #[test]
    fn what_does_not_fit_the_extent_is_refused() {
        let axes = |numbers: &[&str]| {
            format!("<Coordinates>{}</Coordinates>", numbers.iter().map(|n| array(n)).collect::<String>())
        };
        for (name, kind, attributes, geometry, expected) in [
            ("a.vtr", "RectilinearGrid", "", axes(&["1 2 4", "0 1"]), "2 arrays of coordinates"),
            ("a.vtr", "RectilinearGrid", "", axes(&["1 2 4", "0 1 2", "0 1"]), "3 numbers, but 2"),
            ("a.vti", "ImageData", "Spacing=\"1 2\"", String::new(), "Spacing=\"1 2\""),
            ("a.vti", "ImageData", "Origin=\"nan 0 0\"", String::new(), "not finite"),
            ("a.vts", "StructuredGrid", "", String::new(), "lacks the array 'Points'"),
        ] {
            let error = open(name, kind, attributes, &geometry).err().expect(expected).to_string();
            assert!(error.contains(expected) && error.contains(name), "{error}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        for (extent, expected) in [
            ("", "lacks its Extent"),
            ("Extent=\"0 99999 0 99999 0 99999\"", "claims"),
            ("Extent=\"0 a\"", "no 6 numbers"),
        ] {
            let path = folder.path().join("b.vti");
            let text = format!("<VTKFile type=\"ImageData\"><ImageData><Piece {extent}></Piece></ImageData></VTKFile>");
            std::fs::write(&path, text).expect("a file");
            let error = crate::import::open(&path).err().expect(extent).to_string();
            assert!(error.contains(expected) && error.contains("b.vti"), "{error}");
        }
    }
}
