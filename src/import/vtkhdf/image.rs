//! Images: points at equal distances, which attributes describe.

use super::super::cell_list::GHOST_BITS;
use super::super::cells::GridReader;
use super::super::hdf::{Attribute, Hdf};
use super::super::lattice::Lattice;
use super::super::pieces::COMPONENTS_MAX;
use super::block::invalid;
use crate::error::FileResult;
use crate::field::Association;
use glam::DVec3;
use std::hash::{DefaultHasher, Hash};
use std::path::Path;

/// An image.
pub(super) struct Image {
    pub(super) lattice: Lattice,
    /// Least index along x, y and z.
    first: [i64; 3],
    origin: [f64; 3],
    /// From one point to the next along x, y and z.
    axes: [[f64; 3]; 3],
}

impl Image {
    /// Reads the attributes of a group.
    ///
    /// # Errors
    /// If one is missing or has other numbers.
    pub(super) fn read(file: &Hdf, group: &str) -> FileResult<Self> {
        let lacks = |name: &str, what: &str| invalid(file, group, format!("lacks the attribute {name}: {what}"));
        let extent = match file.attribute(group, "WholeExtent")? {
            Some(Attribute::Numbers(extent)) => extent.values().to_f64(),
            _ => Vec::new(),
        };
        let extent = <[f64; 6]>::try_from(extent).ok().filter(|extent| extent.iter().all(|x| x.abs() < 2e9));
        let extent = extent.ok_or_else(|| lacks("WholeExtent", "six whole numbers"))?.map(|x| x as i64);
        let bytes = usize::try_from(file.bytes()).unwrap_or(usize::MAX);
        let lattice = Lattice::of_extent(extent, bytes).map_err(|problem| invalid(file, group, problem))?;
        let origin = numbers::<3>(file, group, "Origin")?.ok_or_else(|| lacks("Origin", "three numbers"))?;
        let spacing = numbers::<3>(file, group, "Spacing")?.ok_or_else(|| lacks("Spacing", "three numbers"))?;
        let direction =
            numbers::<9>(file, group, "Direction")?.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let axes = std::array::from_fn(|axis| std::array::from_fn(|row| direction[3 * row + axis] * spacing[axis]));
        Ok(Self { lattice, first: [extent[0], extent[2], extent[4]], origin, axes })
    }

    /// Number of components of an array of this shape, and the rows of a step: z, y, x, components, with an axis of steps before them if
    /// there are offsets. The error says why it is none of these.
    pub(super) fn arrangement(
        &self,
        shape: &[u64],
        association: Association,
        has_offsets: bool,
    ) -> Result<(usize, Option<u64>), String> {
        let other = || format!("has the shape {shape:?}");
        let dims = self.lattice.dims().map(|n| n as u64);
        let [x, y, z] = if association == Association::Point { dims } else { dims.map(|n| n - 1) };
        let of_step = if has_offsets { shape.get(1..).ok_or_else(other)? } else { shape };
        let components = match *of_step {
            [c, b, a] if [a, b, c] == [x, y, z] => 1,
            [c, b, a, n] if [a, b, c] == [x, y, z] && (1..=COMPONENTS_MAX).contains(&n) => n as usize,
            _ => return Err(other()),
        };
        Ok((components, Some(if has_offsets { 1 } else { z })))
    }

    /// Adds points and cells to a mesh; those of `ghosts` that are hidden are left out.
    ///
    /// # Errors
    /// If there are too many.
    pub(super) fn add_to(&self, grid: &mut GridReader, path: &Path, ghosts: &[u64]) -> FileResult<()> {
        grid.check_room(path, "", self.lattice.points(), self.lattice.cells())?;
        let first_point = grid.mesh.points.len();
        let [nx, ny, nz] = self.lattice.dims();
        for z in 0..nz {
            for y in 0..ny {
                grid.mesh.points.extend((0..nx).map(|x| self.point([x, y, z])));
            }
        }
        let is_parallel = (0..3).all(|axis| (0..3).all(|row| row == axis || self.axes[axis][row] == 0.0));
        let is_hidden = |cell: usize| ghosts.get(cell).is_some_and(|flags| flags & GHOST_BITS != 0);
        self.lattice.add_cells(grid, path, first_point, is_parallel, is_hidden)
    }

    /// A point, rounded as VTK's are: a product of a matrix and the indices.
    fn point(&self, at: [usize; 3]) -> DVec3 {
        let index: [f64; 3] = std::array::from_fn(|axis| (self.first[axis] + at[axis] as i64) as f64);
        let [x, y, z] = self.axes;
        let row = |row: usize| x[row] * index[0] + y[row] * index[1] + z[row] * index[2] + self.origin[row];
        DVec3::new(row(0), row(1), row(2))
    }

    /// Hashes what points and cells follow from.
    pub(super) fn hash_mesh(&self, state: &mut DefaultHasher) {
        (self.lattice, self.first, self.origin.map(f64::to_bits), self.axes.map(|a| a.map(f64::to_bits))).hash(state);
    }
}

/// The numbers of an attribute; `None` if it is missing, has another number of them, or one is not finite.
fn numbers<const N: usize>(file: &Hdf, group: &str, name: &str) -> FileResult<Option<[f64; N]>> {
    let Some(Attribute::Numbers(found)) = file.attribute(group, name)? else { return Ok(None) };
    let found = <[f64; N]>::try_from(found.values().to_f64()).ok();
    Ok(found.filter(|found| found.iter().all(|x| x.is_finite())))
}
