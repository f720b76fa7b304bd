//! Blocks of elements: all of a block are of one type.

use super::super::cells::{GridReader, Kind, kind, refuse_solid};
use super::faces::FaceBlocks;
use super::netcdf::NetCdf;
use crate::error::{FileError, FileResult};
use crate::mesh::POLYHEDRON_VTK_TYPE;

/// Largest index: beyond it, f64 skips integers.
const MAX_INDEX: f64 = 9_007_199_254_740_992.0;

/// The beginning of the names of a type of elements, the types of VTK for numbers of nodes, and that for any other number.
type ElementType = (&'static str, &'static [(u64, u8)], u8);

/// All types. Corners come first in all, in VTK's order.
#[rustfmt::skip]
const ELEMENT_TYPES: &[ElementType] = &[
    ("HEX", &[(8, 12), (20, 25), (24, 33), (27, 29)], 72), ("TET", &[(4, 10), (10, 24)], 71),
    ("WED", &[(6, 13), (12, 31), (15, 26), (18, 32)], 73), ("PYR", &[(5, 14), (13, 27), (19, 37)], 74),
    ("TRI", &[], 5), ("SHE", &[(3, 5), (6, 5)], 9), ("QUA", &[], 9), ("BAR", &[], 3), ("BEA", &[], 3), ("TRU", &[], 3),
    ("ROD", &[], 3), ("EDG", &[], 3), ("LIN", &[], 3), ("CIR", &[], 1), ("SPH", &[], 1), ("POI", &[], 1), ("SUP", &[], 2),
    ("NSI", &[], 7), ("NFA", &[], POLYHEDRON_VTK_TYPE),
];

/// The variables of elements with as many nodes or faces as each wants.
const OF_ANY_NUMBER: [&str; 2] = ["NSI", "NFA"];

/// A block of elements.
pub(super) struct Block {
    /// Its number from 1 on, part of the names of its variables.
    pub(super) number: usize,
    /// Its number for users, and the name that it may have.
    pub(super) id: f64,
    pub(super) name: String,
    /// Number of elements.
    pub(super) cells: usize,
    pub(super) element_type: String,
    /// VTK's type of the elements.
    vtk: u8,
    /// The variable with a row for each element, and the shape of that variable.
    list: String,
    shape: Vec<u64>,
}

impl Block {
    /// Its number for users, if it is one.
    pub(super) fn user_number(&self) -> Option<u32> {
        let number = self.id as u32;
        (f64::from(number) == self.id).then_some(number)
    }

    /// All blocks of a file that have elements. The file is large enough for what they claim.
    ///
    /// # Errors
    /// If a block is damaged, or of a type that is not read.
    pub(super) fn all(netcdf: &NetCdf) -> FileResult<Vec<Self>> {
        let count = netcdf.count("num_el_blk")?;
        let names = netcdf.strings("eb_names")?;
        let has_ids = netcdf.shape("eb_prop1").is_some();
        let ids = if has_ids { netcdf.read("eb_prop1", &[], &[count as u64])? } else { Vec::new() };
        let mut blocks = Vec::new();
        let mut numbers = 0_u64;
        for number in 1..=count {
            let cells = netcdf.count(&format!("num_el_in_blk{number}"))?;
            if cells == 0 {
                continue;
            }
            let id = ids.get(number - 1).copied().unwrap_or(number as f64);
            let name = names.get(number - 1).cloned().unwrap_or_default();
            let block = Self::of(netcdf, number, (id, name), cells)?;
            // Values that a block lacks are made up for its elements.
            let of_block = netcdf.check_shape(&block.list, 0, &block.shape)?.max(cells as u64);
            numbers = numbers.saturating_add(of_block);
            if !netcdf.can_hold(numbers) {
                return Err(
                    netcdf.invalid(&block.list, "claims more than the file can hold, with the blocks before it")
                );
            }
            blocks.push(block);
        }
        Ok(blocks)
    }

    fn of(netcdf: &NetCdf, number: usize, (id, name): (f64, String), cells: usize) -> FileResult<Self> {
        let place = format!("block {number}");
        let [connect, faces, counts] = ["connect", "facconn", "ebepecnt"].map(|name| format!("{name}{number}"));
        let element_type = netcdf.text(&connect, "elem_type").or_else(|| netcdf.text(&faces, "elem_type"));
        let element_type = element_type.ok_or_else(|| {
            let problem = format!("lacks its elements: variable '{connect}' with the attribute 'elem_type'");
            FileError::invalid(netcdf.path(), &place, problem).remedy("write the file again")
        })?;
        let upper = element_type.to_ascii_uppercase();
        let known = ELEMENT_TYPES.iter().find(|(begin, ..)| upper.starts_with(begin));
        let (begin, types, other) = known
            .ok_or_else(|| refuse_solid(netcdf.path(), place, &format!("has elements of type '{element_type}'")))?;
        if OF_ANY_NUMBER.contains(begin) {
            let (list, shape) = (counts, vec![cells as u64]);
            return Ok(Self { number, id, name, cells, element_type, vtk: *other, list, shape });
        }
        let nodes = netcdf.shape(&connect).and_then(|shape| shape.last().copied()).unwrap_or(0);
        let vtk = types.iter().find(|(count, _)| *count == nodes).map_or(*other, |(_, vtk)| *vtk);
        Ok(Self { number, id, name, cells, element_type, vtk, list: connect, shape: vec![cells as u64, nodes] })
    }

    /// Adds the elements to a mesh whose points are those of the file, from `first_point` on. `first` is the number of the first element.
    ///
    /// # Errors
    /// If they have nodes that there are not, or are of a type that is not read.
    pub(super) fn add_to(
        &self,
        netcdf: &NetCdf,
        grid: &mut GridReader,
        faces: &mut FaceBlocks,
        first: usize,
        (points, first_point): (usize, usize),
    ) -> FileResult<()> {
        let read = (self.vtk, kind(self.vtk));
        match read.1 {
            Kind::Flat => grid.skip(self.vtk, self.cells),
            Kind::Polyhedron => {
                for (i, faces) in faces.of_block(netcdf, self)?.iter().enumerate() {
                    let invalid =
                        |problem| netcdf.invalid(&format!("facconn{}", self.number), format!("cell {i} {problem}"));
                    grid.push_polyhedron(netcdf.path(), first + i, faces, points, first_point).map_err(invalid)?;
                }
            }
            _ => {
                let invalid = |problem: String| netcdf.invalid(&self.list, problem);
                let connect = netcdf.read(&self.list, &[], &self.shape)?;
                let width = connect.len() / self.cells;
                if width == 0 {
                    return Err(invalid("lists no nodes".to_owned()));
                }
                for (i, nodes) in connect.chunks_exact(width).enumerate() {
                    let vertices = nodes.iter().map(|&node| index_of(node)).collect::<Result<Vec<u64>, _>>();
                    let vertices = vertices.map_err(|problem| invalid(format!("element {i} {problem}")))?;
                    grid.push(first + i, read, &vertices, points, first_point).map_err(invalid)?;
                }
            }
        }
        Ok(())
    }
}

/// The index of a node or face that the file counts from 1 on.
pub(super) fn index_of(number: f64) -> Result<u64, String> {
    if number >= 1.0 && number.fract() == 0.0 && number <= MAX_INDEX {
        return Ok(number as u64 - 1);
    }
    Err(format!("names number {number}; numbers are counted from 1"))
}
