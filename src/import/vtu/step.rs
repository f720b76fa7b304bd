//! One step as one or more `.vtu` files.

use super::super::cells::GridReader;
use super::super::numbers::{ArrayBytes, Values};
use super::super::pieces::Piece;
use super::super::series::StepReader;
use super::cells::add_piece;
use super::structured;
use super::{ArrayInfo, VtuFile};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use std::hash::{DefaultHasher, Hash};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A step in memory: its files, undecoded.
pub(crate) struct VtuStep {
    /// At least one.
    files: Vec<Arc<VtuFile>>,
    /// The pieces that have points or cells; others may lack arrays.
    pieces: Vec<VtuPiece>,
}

/// A piece of a file.
pub(crate) struct VtuPiece {
    file: Arc<VtuFile>,
    /// Its number in the file.
    index: usize,
}

impl StepReader for VtuStep {
    type Origin = Vec<PathBuf>;
    type Piece = VtuPiece;

    fn open(paths: &Vec<PathBuf>) -> FileResult<Self> {
        if paths.is_empty() {
            return Err(FileError::invalid("", "", "there are no files to read"));
        }
        let open = |path: &PathBuf| Ok(Arc::new(VtuFile::open(path)?));
        let files = paths.iter().map(open).collect::<FileResult<Vec<_>>>()?;
        let of = |file: &Arc<VtuFile>| {
            let is_empty = |index: &usize| file.piece(*index).points == 0 && file.piece(*index).cells == 0;
            let all = (0..file.header.pieces.len()).filter(|index| !is_empty(index));
            all.map(|index| VtuPiece { file: file.clone(), index }).collect::<Vec<_>>()
        };
        let pieces = files.iter().flat_map(of).collect();
        Ok(Self { files, pieces })
    }

    fn path(&self) -> &Path {
        self.files.first().map_or(Path::new(""), |file| &file.path)
    }

    fn bytes(&self) -> usize {
        self.files.iter().map(|file| file.bytes.len()).sum()
    }

    fn pieces(&self) -> &[VtuPiece] {
        &self.pieces
    }
}

impl VtuPiece {
    /// Its arrays: those of points, then those of cells.
    fn all(&self) -> impl Iterator<Item = (Association, &ArrayInfo)> {
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
        self.all().map(field).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.file.header.skipped.iter().map(|name| format!("'{name}' (holds no numbers)")).collect()
    }

    fn decode(&self, array: usize) -> FileResult<ArrayBytes> {
        let (points, cells) = self.counts();
        let found = self.all().nth(array);
        let (association, array) = found.ok_or_else(|| FileError::invalid(self.path(), "", "has no such array"))?;
        self.file.decode(array, if association == Association::Point { points } else { cells })
    }

    fn values<'a>(&'a self, array: &'a ArrayBytes) -> Values<'a> {
        self.file.values(array)
    }
}
