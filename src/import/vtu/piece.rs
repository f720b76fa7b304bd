//! A piece of a file in memory.

use super::super::cells::GridReader;
use super::super::numbers::{ArrayBytes, Values};
use super::super::pieces::Piece;
use super::cells::add_piece;
use super::structured;
use super::{ArrayInfo, VtuFile};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use std::hash::{DefaultHasher, Hash};
use std::path::Path;
use std::sync::Arc;

/// A piece of a file.
pub(crate) struct VtuPiece {
    file: Arc<VtuFile>,
    /// Its number in the file.
    index: usize,
}

impl VtuPiece {
    /// Reads a file; its size, and its pieces.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a grid.
    pub(crate) fn all(path: &Path) -> FileResult<(usize, Vec<Self>)> {
        let file = Arc::new(VtuFile::open(path)?);
        let pieces = (0..file.header.pieces.len()).map(|index| Self { file: file.clone(), index }).collect();
        Ok((file.bytes.len(), pieces))
    }

    /// Its arrays: those of points, then those of cells.
    fn infos(&self) -> impl Iterator<Item = (Association, &ArrayInfo)> {
        let piece = self.file.piece(self.index);
        let points = piece.point_data.iter().map(|array| (Association::Point, array));
        points.chain(piece.cell_data.iter().map(|array| (Association::Cell, array)))
    }
}

impl Piece for VtuPiece {
    type Array = ArrayBytes;

    fn path(&self) -> &Path {
        &self.file.path
    }

    fn counts(&self) -> (usize, usize) {
        let piece = self.file.piece(self.index);
        (piece.points, piece.cells)
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        let piece = self.file.piece(self.index);
        match piece.lattice {
            None => add_piece(grid, &self.file, piece),
            Some(_) => structured::add_piece(grid, &self.file, piece),
        }
    }

    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        self.counts().hash(state);
        self.file.hash_stored_mesh(self.file.piece(self.index), state)
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        let field = |(association, array): (Association, &ArrayInfo)| FieldInfo {
            name: array.name.clone(),
            components: array.components,
            association,
        };
        self.infos().map(field).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.file.header.skipped.iter().map(|name| format!("'{name}' (holds no numbers)")).collect()
    }

    fn unit(&self, array: usize) -> Option<String> {
        self.infos().nth(array)?.1.unit.clone()
    }

    fn decode(&self, array: usize) -> FileResult<ArrayBytes> {
        let (points, cells) = self.counts();
        let found = self.infos().nth(array);
        let (association, array) = found.ok_or_else(|| FileError::invalid(self.path(), "", "has no such array"))?;
        self.file.decode(array, if association == Association::Point { points } else { cells })
    }

    fn values<'a>(&'a self, array: &'a ArrayBytes) -> Values<'a> {
        self.file.values(array)
    }
}
