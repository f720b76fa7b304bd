//! Faces of polyhedra (`NFACED`), which blocks of faces list.

use super::blocks::{Block, index_of};
use super::netcdf::NetCdf;
use crate::error::FileResult;

/// The faces of all blocks of faces, read when a block of polyhedra is.
#[derive(Default)]
pub(super) struct FaceBlocks {
    all: Option<Vec<Vec<u64>>>,
    /// How many elements have each face.
    uses: Vec<u8>,
}

impl FaceBlocks {
    /// The faces of each element of a block.
    ///
    /// # Errors
    /// If an element has faces that there are not, or that two have already, or lists are damaged.
    pub(super) fn of_block(&mut self, netcdf: &NetCdf, block: &Block) -> FileResult<Vec<Vec<Vec<u64>>>> {
        if self.all.is_none() {
            let faces = all(netcdf)?;
            self.uses = vec![0; faces.len()];
            self.all = Some(faces);
        }
        let faces = self.all.as_deref().unwrap_or_default();
        let name = format!("facconn{}", block.number);
        let mut cells = Vec::with_capacity(block.cells);
        for of_cell in lists(netcdf, &name, &format!("ebepecnt{}", block.number), block.cells)? {
            let mut found = Vec::with_capacity(of_cell.len());
            for face in of_cell {
                let invalid = |problem: &str| {
                    netcdf.invalid(&name, format!("element {} has face {}, {problem}", cells.len(), face + 1))
                };
                let at = usize::try_from(face).ok().filter(|&at| at < faces.len());
                let at = at.ok_or_else(|| invalid(&format!("but there are {} faces", faces.len())))?;
                self.uses[at] += 1;
                if self.uses[at] > 2 {
                    return Err(invalid("which two have already"));
                }
                found.push(faces[at].clone());
            }
            cells.push(found);
        }
        Ok(cells)
    }
}

/// The vertices of all faces.
fn all(netcdf: &NetCdf) -> FileResult<Vec<Vec<u64>>> {
    let mut faces = Vec::new();
    for number in 1..=netcdf.count("num_fa_blk")? {
        let count = netcdf.count(&format!("num_fa_in_blk{number}"))?;
        if count > 0 {
            faces.extend(lists(netcdf, &format!("fbconn{number}"), &format!("fbepecnt{number}"), count)?);
        }
    }
    Ok(faces)
}

/// Lists of indices, one behind the other in the variable `name`, with their lengths in `counts`.
fn lists(netcdf: &NetCdf, name: &str, counts: &str, count: usize) -> FileResult<Vec<Vec<u64>>> {
    let counts = netcdf.read(counts, &[], &[count as u64])?;
    let shape = netcdf.shape(name).unwrap_or_default();
    let numbers = netcdf.read(name, &[], &shape)?;
    let indices = numbers.iter().map(|&number| index_of(number)).collect::<Result<Vec<u64>, _>>();
    let indices = indices.map_err(|problem| netcdf.invalid(name, problem))?;
    let mut rest = &indices[..];
    let mut lists = Vec::with_capacity(count);
    for (i, &length) in counts.iter().enumerate() {
        // A negative length or none becomes 0.
        let split = rest.split_at_checked(length as usize);
        let (list, after) = split.ok_or_else(|| netcdf.invalid(name, format!("ends in list {i} of {count}")))?;
        lists.push(list.to_vec());
        rest = after;
    }
    if rest.is_empty() { Ok(lists) } else { Err(netcdf.invalid(name, format!("has {} numbers too many", rest.len()))) }
}
