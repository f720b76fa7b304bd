//! A step of a volume.

use super::header::Brick;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::import::cells::GridReader;
use crate::import::numbers::{Numbers, Values};
use crate::import::pieces::Piece;
use crate::import::series::StepReader;
use std::hash::{DefaultHasher, Hash};
use std::path::Path;
use std::sync::Arc;

/// A step: its file, of which nothing but the header is in memory.
pub(super) struct BrickStep {
    pieces: [Whole; 1],
}

/// The whole volume.
pub(super) struct Whole {
    brick: Arc<Brick>,
    step: usize,
}

impl StepReader for BrickStep {
    type Origin = (Arc<Brick>, usize);
    type Piece = Whole;

    fn open((brick, step): &Self::Origin) -> FileResult<Self> {
        Ok(Self { pieces: [Whole { brick: brick.clone(), step: *step }] })
    }

    fn path(&self) -> &Path {
        self.pieces[0].path()
    }

    fn bytes(&self) -> usize {
        0
    }

    fn pieces(&self) -> &[Whole] {
        &self.pieces
    }
}

impl Piece for Whole {
    type Array = Numbers;

    fn path(&self) -> &Path {
        &self.brick.path
    }

    fn counts(&self) -> (usize, usize) {
        (self.brick.lattice.points(), self.brick.lattice.cells())
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        let (points, cells) = self.counts();
        let even = &self.brick.grid;
        grid.check_room(self.path(), "", points, cells)?;
        let first_point = grid.mesh.points.len();
        grid.mesh.points.extend(self.brick.lattice.even([0; 3], even));
        let is_parallel = (0..3).all(|row| (0..3).all(|axis| row == axis || even.direction[row][axis] == 0.0));
        self.brick.lattice.add_cells(grid, self.path(), first_point, is_parallel, |_| false)
    }

    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        (self.brick.lattice, self.brick.grid).hash(state);
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        let Brick { name, components, .. } = &*self.brick;
        vec![FieldInfo { name: name.clone(), components: *components, association: Association::Point }]
    }

    fn decode(&self, _array: usize) -> FileResult<Numbers> {
        let Brick { lattice, components, steps, number, big_endian, data, .. } = &*self.brick;
        let bytes = lattice.points().checked_mul(components * number.size());
        let bytes = bytes.ok_or_else(|| FileError::invalid(self.path(), "", "has too many values"))?;
        let bytes = data.read(self.step, *steps, bytes, *number)?;
        let big_endian = *big_endian && data.encoding != super::data::Encoding::Text;
        Ok(Numbers { number: *number, big_endian, bytes })
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}
