//! One step as one or more `.vtu` files.

use super::super::cells::GridReader;
use super::super::numbers::Values;
use super::super::series::StepReader;
use super::cells::add_piece;
use super::{ArrayBytes, ArrayInfo, Piece, VtuFile};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// A step in memory: its files, undecoded.
pub(crate) struct VtuStep {
    /// At least one.
    files: Vec<VtuFile>,
}

impl VtuStep {
    /// The non-empty pieces of all files.
    fn pieces(&self) -> impl Iterator<Item = (&VtuFile, &Piece)> {
        self.files.iter().flat_map(|file| file.pieces().map(move |piece| (file, piece)))
    }
}

impl StepReader for VtuStep {
    type Origin = Vec<PathBuf>;
    /// One array per non-empty piece, in order.
    type Decoded = Vec<ArrayBytes>;

    fn open(paths: &Vec<PathBuf>) -> FileResult<Self> {
        if paths.is_empty() {
            return Err(FileError::invalid("", "", "there are no files to read"));
        }
        Ok(Self { files: paths.iter().map(|path| VtuFile::open(path)).collect::<FileResult<_>>()? })
    }

    fn path(&self) -> &Path {
        self.files.first().map_or(Path::new(""), |file| &file.path)
    }

    fn bytes(&self) -> usize {
        self.files.iter().map(|file| file.bytes.len()).sum()
    }

    fn is_in_pieces(&self) -> bool {
        self.files.len() > 1 || self.files.first().is_some_and(|file| file.pieces().count() > 1)
    }

    fn counts(&self) -> FileResult<(usize, usize)> {
        Ok(self.pieces().fold((0, 0), |(points, cells), (_, piece)| {
            (points.saturating_add(piece.points), cells.saturating_add(piece.cells))
        }))
    }

    fn read_grid(&self) -> FileResult<GridReader> {
        let mut grid = GridReader::default();
        for (file, piece) in self.pieces() {
            add_piece(&mut grid, file, piece)?;
        }
        Ok(grid)
    }

    fn stored_hash(&self) -> FileResult<u64> {
        let mut state = DefaultHasher::new();
        for (file, piece) in self.pieces() {
            (piece.points, piece.cells).hash(&mut state);
            file.hash_stored_mesh(piece, &mut state)?;
        }
        Ok(state.finish())
    }

    fn fields(&self) -> (Vec<FieldInfo>, Vec<String>) {
        let mut fields: Vec<FieldInfo> = Vec::new();
        let mut left_out: Vec<String> = Vec::new();
        for association in [Association::Point, Association::Cell] {
            let mut judged = HashSet::new();
            for piece in self.pieces().map(|(_, piece)| piece) {
                for (i, array) in arrays(piece, association).iter().enumerate() {
                    let field = FieldInfo { name: array.name.clone(), components: array.components, association };
                    let is_second = arrays(piece, association)[..i].iter().any(|other| other.name == field.name);
                    // All pieces are asked once for each array that a piece may have.
                    if !judged.insert((field.name.clone(), field.components, is_second)) {
                        continue;
                    }
                    let is_same = |other: &ArrayInfo| other.components == field.components;
                    let reason = if field.name.is_empty() {
                        "has no name"
                    } else if is_second {
                        "a second array of that name"
                    } else if !self.pieces().all(|(_, piece)| find(piece, &field).is_some_and(is_same)) {
                        "not the same in all pieces"
                    } else {
                        fields.push(field);
                        continue;
                    };
                    left_out.push(format!("'{}' ({reason})", field.name));
                }
            }
        }
        let texts = self.files.iter().flat_map(|file| &file.header.skipped);
        left_out.extend(texts.map(|name| format!("'{name}' (holds no numbers)")));
        (fields, left_out)
    }

    fn decode(&self, field: &FieldInfo, step: usize) -> FileResult<Vec<ArrayBytes>> {
        let mut pieces = Vec::new();
        for (file, piece) in self.pieces() {
            let place = || format!("step {step}");
            let kind = if field.association == Association::Point { "point" } else { "cell" };
            let array = find(piece, field).ok_or_else(|| {
                FileError::invalid(&file.path, place(), format!("has no {kind} array '{}'", field.name))
                    .remedy("leave that step or that field out")
            })?;
            if array.components != field.components {
                let (name, new, old) = (&field.name, array.components, field.components);
                let problem = format!("array '{name}' has {new} components, but {old} in the first step");
                return Err(FileError::invalid(&file.path, place(), problem));
            }
            let tuples = if field.association == Association::Point { piece.points } else { piece.cells };
            pieces.push(file.decode(array, tuples)?);
        }
        Ok(pieces)
    }

    fn values<'a>(&'a self, decoded: &'a Vec<ArrayBytes>) -> Vec<Values<'a>> {
        decoded.iter().zip(self.pieces()).map(|(bytes, (file, _))| file.values(bytes)).collect()
    }
}

fn arrays(piece: &Piece, association: Association) -> &[ArrayInfo] {
    match association {
        Association::Point => &piece.point_data,
        Association::Cell => &piece.cell_data,
    }
}

fn find<'a>(piece: &'a Piece, field: &FieldInfo) -> Option<&'a ArrayInfo> {
    arrays(piece, field.association).iter().find(|array| array.name == field.name)
}
