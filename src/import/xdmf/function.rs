//! Functions of finite elements, as FEniCS (dolfin) writes them with `write_checkpoint`: coefficients, and which of them each cell has.
//!
//! An `Attribute` of ItemType `FiniteElementFunction` has four arrays: the dofs of all cells, one cell after the other; the coefficients,
//! one for each dof; where the dofs of each cell begin; and the number that each cell had in memory. The dofs of a cell are those of its
//! first component, then those of the second, ...; those of a component begin with one for each corner, in the order of the topology.
//!
//! Cells are in the order of the topology, whatever their numbers in memory: dolfin writes both lists in one order. Where points have
//! several dofs in that order, the numbers are tried as places in the topology.

use super::super::cells::{Kind, kind};
use super::super::numbers::{Number, Numbers};
use super::super::pieces::COMPONENTS_MAX;
use super::super::tuples::Tuples;
use super::grid::{Attribute, CellShape, Grid, Stored};
use super::items::Item;
use super::tree::{Document, Id};
use crate::error::FileResult;
use crate::field::{Association, FieldInfo};

/// Corners of a tetrahedron.
const CORNERS: usize = 4;
/// A point that no cell has.
const NO_DOF: u64 = u64::MAX;

/// The arrays of a function. Their lengths fit each other and the cells, as the XDMF file says them.
#[derive(Debug)]
pub(super) struct Function {
    id: Id,
    /// The dofs of all cells.
    dofs: Item,
    /// The values, by dof.
    pub(super) coefficients: Item,
    /// Where the dofs of each cell begin, and where the last ones end.
    starts: Item,
    /// The number of each cell in memory.
    numbers: Item,
    /// Dofs of a cell, and those of each of its components.
    of_cell: usize,
    of_component: usize,
}

/// Whether an `Attribute` is a function.
pub(super) fn is_function(document: &Document, id: Id) -> bool {
    document.attribute(id, "ItemType").is_some_and(|kind| kind.trim().eq_ignore_ascii_case("FiniteElementFunction"))
}

/// What has the values of a function that are read, its degree, and the dofs of a cell for each component.
fn element(document: &Document, id: Id) -> Result<(Association, u8, usize), String> {
    let said = |key: &str| document.attribute(id, key).unwrap_or("").trim();
    let [family, degree, cell] = ["ElementFamily", "ElementDegree", "ElementCell"].map(said);
    let is_tetrahedron = cell.eq_ignore_ascii_case("tetrahedron");
    match (family.to_ascii_uppercase().as_str(), degree.parse::<u8>()) {
        ("CG", Ok(degree @ 1..)) if is_tetrahedron => {
            let d = usize::from(degree);
            Ok((Association::Point, degree, (d + 1) * (d + 2) * (d + 3) / 6))
        }
        ("DG", Ok(0)) if is_tetrahedron => Ok((Association::Cell, 0, 1)),
        _ => Err(format!(
            "is a function of elements '{family}' of degree '{degree}' on cells '{cell}': CG, and DG of degree 0, on tetrahedra are read"
        )),
    }
}

impl Grid {
    /// Adds a function, or a note if it is unsupported.
    ///
    /// # Errors
    /// If its arrays contradict each other or the cells.
    pub(super) fn add_function(&mut self, document: &Document, id: Id) -> FileResult<()> {
        let name = document.attribute(id, "Name").unwrap_or("").to_owned();
        match Function::of(document, id, self)? {
            Ok((association, degree, function)) => {
                if degree > 1 {
                    self.notes.push(format!(
                        "field '{name}' is of degree {degree}: its values at corners of cells alone are read"
                    ));
                }
                let components = function.of_cell / function.of_component;
                let field = FieldInfo { name, components, association };
                self.attributes.push(Attribute { field, stored: Stored::Function(Box::new(function)) });
            }
            Err(reason) => self.left_out.push(format!("'{name}' ({reason})")),
        }
        Ok(())
    }
}

impl Function {
    /// The function of an `Attribute`, with what has its values and its degree; inside, why it is not read.
    fn of(document: &Document, id: Id, grid: &Grid) -> FileResult<Result<(Association, u8, Self), String>> {
        if document.attribute(id, "Name").unwrap_or("").is_empty() {
            return Ok(Err("has no name".to_owned()));
        }
        let (association, degree, of_component) = match element(document, id) {
            Ok(element) => element,
            Err(reason) => return Ok(Err(reason)),
        };
        if !matches!(grid.topology.shape, CellShape::Same(vtk) if matches!(kind(vtk), Kind::Tet(_))) {
            return Ok(Err("is a function on tetrahedra, which the cells of its grid are not".to_owned()));
        }
        let items = document.children_named(id, "DataItem")?;
        let &[dofs, coefficients, starts, numbers] = items.as_slice() else {
            let problem = format!("has {} arrays, but a function has 4: dofs, values, offsets, cells", items.len());
            return Err(document.invalid(id, problem));
        };
        let item = |id: Id| Item::of(document, id);
        let (dofs, coefficients, starts, numbers) = (item(dofs)?, item(coefficients)?, item(starts)?, item(numbers)?);
        let cells = grid.topology.cells as u64;
        for (item, needed) in [(&starts, cells.checked_add(1)), (&numbers, Some(cells))] {
            if item.len() != needed {
                let problem = format!("has {:?} numbers, but the grid has {cells} cells", item.dims);
                return Err(document.invalid(item.id, problem));
            }
        }
        let all = dofs.len().and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX);
        let of_cell = all.checked_div(grid.topology.cells).unwrap_or(0);
        let components = of_cell / of_component;
        if components == 0
            || components as u64 > COMPONENTS_MAX
            || !all.is_multiple_of(grid.topology.cells)
            || !of_cell.is_multiple_of(of_component)
        {
            let problem = format!(
                "has {all} dofs, but {cells} cells have a multiple of {of_component} dofs each, the same number"
            );
            return Err(document.invalid(dofs.id, problem));
        }
        // Room is made for points that cells have.
        if association == Association::Point && grid.points.checked_mul(components).is_none_or(|values| values > all) {
            return Ok(Err(format!("has {all} dofs of cells, too few for {} points", grid.points)));
        }
        let function = Self { id, dofs, coefficients, starts, numbers, of_cell, of_component };
        Ok(Ok((association, degree, function)))
    }

    /// All arrays.
    pub(super) fn items(&self) -> [&Item; 4] {
        [&self.dofs, &self.coefficients, &self.starts, &self.numbers]
    }

    /// The values of points or cells, as tuples.
    ///
    /// # Errors
    /// If arrays are damaged, or dofs are none of the function's.
    pub(super) fn read(&self, grid: &Grid, association: Association) -> FileResult<Numbers> {
        let document = &*grid.document;
        self.check_starts(document)?;
        let mut dofs = indices(document, &self.dofs)?;
        let coefficients = self.coefficients.read(document)?;
        let is_f32 = coefficients.number == Number::Float32;
        let values = coefficients.values().to_f64();
        if let Some(at) = dofs.iter().position(|&dof| dof >= values.len() as u64) {
            let (cell, dof) = (at / self.of_cell, dofs[at]);
            let problem = format!("cell {cell} has dof {dof}, but there are {} values", values.len());
            return Err(document.invalid(self.dofs.id, problem));
        }
        if association == Association::Point {
            dofs = self.dofs_of_points(grid, &dofs)?;
        }
        let components = self.of_cell / self.of_component;
        let mut out = Tuples::new(components, dofs.len() / components, is_f32);
        let value = |&dof: &u64| values.get(dof as usize).copied().unwrap_or(f64::NAN);
        for component in 0..components {
            out.put(component, 0, dofs.iter().skip(component).step_by(components).map(value));
        }
        Ok(out.numbers)
    }

    /// Fails unless the dofs of all cells follow each other, the same number for each.
    fn check_starts(&self, document: &Document) -> FileResult<()> {
        let starts = indices(document, &self.starts)?;
        let wrong = (0_u64..).zip(&starts).find(|(cell, start)| cell.checked_mul(self.of_cell as u64) != Some(**start));
        match wrong {
            None => Ok(()),
            Some((cell, start)) => {
                let problem = format!("dofs of cell {cell} begin at {start}, but each cell has {}", self.of_cell);
                Err(document.invalid(self.starts.id, problem))
            }
        }
    }

    /// The dof of each component at each point, from those of the cells.
    fn dofs_of_points(&self, grid: &Grid, dofs: &[u64]) -> FileResult<Vec<u64>> {
        let (corners, of_type) = grid.corners()?;
        let of_row = of_type.corners;
        let cells = || dofs.chunks_exact(self.of_cell).enumerate();
        let in_order =
            self.join(grid, cells().zip(corners.chunks_exact(of_row)).map(|((i, dofs), row)| (i, dofs, row)));
        let Err(conflict) = in_order else { return in_order };
        let places = indices(&grid.document, &self.numbers)?;
        let row = |place: u64| {
            let first = usize::try_from(place).ok()?.checked_mul(of_row)?;
            corners.get(first..first.checked_add(of_row)?)
        };
        let mut seen = vec![false; places.len()];
        let is_permutation = places.iter().all(|&place| {
            seen.get_mut(usize::try_from(place).unwrap_or(usize::MAX))
                .is_some_and(|seen| !std::mem::replace(seen, true))
        });
        if !is_permutation {
            return Err(conflict);
        }
        let placed = cells().zip(&places).filter_map(|((i, dofs), &place)| Some((i, dofs, row(place)?)));
        self.join(grid, placed).map_err(|_| conflict)
    }

    /// The dofs of points from cells: the number, the dofs and the corners of each.
    fn join<'a>(
        &self,
        grid: &Grid,
        cells: impl Iterator<Item = (usize, &'a [u64], &'a [u64])>,
    ) -> FileResult<Vec<u64>> {
        let components = self.of_cell / self.of_component;
        let mut of_points = vec![NO_DOF; grid.points * components];
        for (cell, dofs, row) in cells {
            for (corner, &point) in row.iter().take(CORNERS).enumerate() {
                let first = usize::try_from(point).ok().and_then(|point| point.checked_mul(components));
                let known = first.and_then(|first| of_points.get_mut(first..first.checked_add(components)?));
                let known = known.ok_or_else(|| {
                    let problem = format!("cell {cell} has vertex {point}, but there are {} points", grid.points);
                    grid.document.invalid(grid.topology.id, problem)
                })?;
                for (known, dofs) in known.iter_mut().zip(dofs.chunks_exact(self.of_component)) {
                    let dof = dofs[corner];
                    if *known != NO_DOF && *known != dof {
                        let problem =
                            format!("point {point} has dof {known}, but dof {dof} in cell {cell}: cells do not meet");
                        return Err(grid.document.invalid(self.id, problem));
                    }
                    *known = dof;
                }
            }
        }
        Ok(of_points)
    }
}

/// The numbers of an item as indices.
fn indices(document: &Document, item: &Item) -> FileResult<Vec<u64>> {
    let numbers = item.read(document)?;
    let found = numbers.values().to_indices();
    found.map_err(|i| document.invalid(item.id, format!("number {i} is negative or no integer")))
}

#[cfg(test)]
mod tests {
    use super::super::FORMAT;
    use super::*;
    use crate::field::{Component, SeriesSource};

    /// Two tetrahedra with a face in common.
    const CELLS: &str = "0 1 2 3  1 2 3 4";
    /// The dofs of a vector field: those of the first component, then those of the second, of each cell.
    const DOFS: &str = "6 0 2 4 7 1 3 5  0 2 4 8 1 3 5 9";
    const VALUES: &str = "1.5 10 2.5 20 3.5 30 0.5 0 4.5 40";

    /// A grid with a function: the start of its tag and its arrays, each with its shape.
    fn written(element: &str, arrays: &[(&str, &str)]) -> String {
        let item = |kind: &str, dims: &str, numbers: &str| {
            format!("<DataItem Dimensions='{dims}' NumberType='{kind}' Precision='8' Format='XML'>{numbers}</DataItem>")
        };
        let kind = |i: usize| if i == 1 { "Float" } else { "Int" };
        let arrays: String =
            arrays.iter().enumerate().map(|(i, (dims, numbers))| item(kind(i), dims, numbers)).collect();
        let (cells, points) = (item("UInt", "2 4", CELLS), item("Float", "5 3", "0 0 0  1 0 0  0 1 0  0 0 1  1 1 1"));
        format!(
            "<Xdmf><Domain><Grid><Topology TopologyType='Tetrahedron' NumberOfElements='2'>{cells}</Topology>\
             <Geometry>{points}</Geometry><Attribute ItemType='FiniteElementFunction' {element} Name='u' Center='Other'>\
             {arrays}</Attribute></Grid></Domain></Xdmf>"
        )
    }

    fn opened(element: &str, arrays: &[(&str, &str)]) -> FileResult<Box<dyn SeriesSource>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.xdmf");
        std::fs::write(&path, written(element, arrays)).expect("a file");
        (FORMAT.open)(&[path])
    }

    /// The components of the only field.
    fn read(element: &str, arrays: &[(&str, &str)]) -> FileResult<(Association, Vec<Vec<f32>>)> {
        let source = opened(element, arrays)?;
        let field = source.fields().first().expect("a field");
        let component = |component: usize| {
            let mut out = Vec::new();
            source.read(field, Component::Index(component), 0, &mut out).map(|()| out)
        };
        Ok((field.association, (0..field.components).map(component).collect::<FileResult<_>>()?))
    }

    const CG1: &str = "ElementFamily='CG' ElementDegree='1' ElementCell='tetrahedron'";
    const DG0: &str = "ElementFamily='DG' ElementDegree='0' ElementCell='tetrahedron'";

    fn vector<'a>() -> [(&'a str, &'a str); 4] {
        [("16 1", DOFS), ("10 1", VALUES), ("3 1", "0 8 16"), ("2 1", "0 1")]
    }

    #[test]
    fn corners_have_the_coefficients_of_their_dofs_component_by_component() {
        let (association, values) = read(CG1, &vector()).expect("a function");
        assert_eq!(association, Association::Point);
        assert_eq!(values, [[0.5, 1.5, 2.5, 3.5, 4.5], [0.0, 10.0, 20.0, 30.0, 40.0]]);
        let mut permuted = vector();
        permuted[3].1 = "1 0";
        assert_eq!(read(CG1, &permuted).expect("numbers in memory do not count").1, values);
        permuted[0].1 = "0 2 4 8 1 3 5 9  6 0 2 4 7 1 3 5";
        assert_eq!(read(CG1, &permuted).expect("cells are where their numbers say").1, values);
    }

    #[test]
    fn of_higher_degrees_corners_are_read_and_of_degree_zero_cells() {
        let rows = ["6 0 2 4 20 21 22 23 24 25", "0 2 4 8 22 21 20 26 27 28"].join(" ");
        let values = (0..29).map(|i| format!("{i}")).collect::<Vec<_>>().join(" ");
        let arrays = [("20", rows.as_str()), ("29", &values), ("3", "0 10 20"), ("2", "0 1")];
        let element = "ElementFamily='CG' ElementDegree='2' ElementCell='tetrahedron'";
        assert_eq!(read(element, &arrays).expect("a function").1, [[6.0, 0.0, 2.0, 4.0, 8.0]]);
        let notes = opened(element, &arrays).expect("a function").notes();
        assert!(notes.iter().any(|note| note.contains("'u' is of degree 2: its values at corners")), "{notes:?}");
        let arrays = [("2", "1 0"), ("2", "2.5 7"), ("3", "0 1 2"), ("2", "1 0")];
        assert_eq!(read(DG0, &arrays).expect("a function"), (Association::Cell, vec![vec![7.0, 2.5]]));
    }

    #[test]
    fn other_elements_are_left_out_with_the_reason() {
        for (element, part) in [
            ("ElementFamily='RT' ElementDegree='1' ElementCell='tetrahedron'", "'RT' of degree '1'"),
            ("ElementFamily='DG' ElementDegree='1' ElementCell='tetrahedron'", "'DG' of degree '1'"),
            ("ElementFamily='CG' ElementDegree='0' ElementCell='tetrahedron'", "'CG' of degree '0'"),
            ("ElementFamily='CG' ElementDegree='-1' ElementCell='tetrahedron'", "'CG' of degree '-1'"),
            ("ElementFamily='Q' ElementDegree='1' ElementCell='hexahedron'", "cells 'hexahedron'"),
            ("", "'' of degree ''"),
        ] {
            let source = opened(element, &vector()).expect(element);
            assert!(source.fields().is_empty());
            assert!(source.notes().iter().any(|note| note.contains("'u' (") && note.contains(part)), "{element}");
        }
    }

    #[test]
    fn arrays_that_contradict_each_other_are_errors_with_file_and_place() {
        let mut cases = Vec::new();
        let mut case = |array: usize, with: (&'static str, &'static str), part: &'static str| {
            let mut arrays = vector().to_vec();
            arrays[array] = with;
            cases.push((arrays, part));
        };
        case(0, ("16", "6 0 2 4 7 1 3 5  0 2 4 10 1 3 5 9"), "cell 1 has dof 10, but there are 10 values");
        case(0, ("16", "6 0 2 4 7 1 3 5  0 2 4 -1 1 3 5 9"), "number 11 is negative");
        case(0, ("16", "6 0 2 4 7 1 3 5  0 2 9 8 1 3 5 9"), "point 3 has dof 4, but dof 9 in cell 1");
        case(0, ("15", "6 0 2 4 7 1 3 5  0 2 4 8 1 3 5"), "15 dofs");
        case(0, ("4", "0 1 2 3"), "4 dofs");
        case(0, ("0", ""), "0 dofs");
        case(0, ("9223372036854775808 2", ""), "no counts");
        case(0, ("9223372036854775808", ""), "dofs");
        case(1, ("9", "1.5 10 2.5 20 3.5 30 0.5 0 4.5"), "there are 9 values");
        case(2, ("3", "0 8 15"), "dofs of cell 2 begin at 15");
        case(2, ("3", "8 0 16"), "dofs of cell 0 begin at 8");
        case(2, ("2", "0 8"), "has [2] numbers, but the grid has 2 cells");
        case(3, ("3", "0 1 2"), "has [3] numbers, but the grid has 2 cells");
        cases.push((vector()[..3].to_vec(), "has 3 arrays"));
        for (arrays, part) in cases {
            let error = read(CG1, &arrays).expect_err(part).to_string();
            assert!(
                error.contains(part) && error.contains("a.xdmf: <") && error.contains("at byte"),
                "{part}: {error}"
            );
        }
        let mut twice = vector();
        (twice[0].1, twice[3].1) = ("0 2 4 8 1 3 5 9  6 0 2 4 7 1 3 5", "1 1");
        assert!(read(CG1, &twice).expect_err("no permutation").to_string().contains("do not meet"));
    }
}
