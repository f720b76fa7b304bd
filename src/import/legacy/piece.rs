//! A legacy file as a piece.

use super::LegacyFile;
use super::array::Array;
use super::grid::{add_to, ghost_array};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::import::cells::GridReader;
use crate::import::numbers::{ArrayBytes, Values};
use crate::import::pieces::Piece;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

impl LegacyFile {
    /// Its arrays: those of points, then those of cells.
    fn all(&self) -> impl Iterator<Item = (Association, &Array)> {
        let points = self.header.point_arrays.iter().map(|array| (Association::Point, array));
        points.chain(self.header.cell_arrays.iter().map(|array| (Association::Cell, array)))
    }
}

impl Piece for LegacyFile {
    type Array = ArrayBytes;

    fn path(&self) -> &Path {
        &self.path
    }

    fn counts(&self) -> (usize, usize) {
        self.geometry.counts()
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        add_to(grid, self)
    }

    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        self.header.is_binary.hash(state);
        self.geometry.hash(self, state);
        if let Some(ghosts) = ghost_array(&self.header) {
            state.write(self.stored(ghosts));
        }
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        let field = |(association, array): (Association, &Array)| FieldInfo {
            name: array.name.clone(),
            components: array.components,
            association,
        };
        self.all().map(field).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.header.left_out.clone()
    }

    fn decode(&self, array: usize) -> FileResult<ArrayBytes> {
        let found = self.all().nth(array);
        let (_, array) = found.ok_or_else(|| FileError::invalid(&self.path, "", "has no such array"))?;
        self.read(array)
    }

    fn values<'a>(&'a self, array: &'a ArrayBytes) -> Values<'a> {
        array.values(&self.bytes)
    }
}
