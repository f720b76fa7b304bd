//! Fields that no file has: the numbers of blocks, and how far points have moved.

use super::pieces::Piece;
use super::series::StepReader;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Block, Blocks, Component, FieldInfo};
use glam::DVec3;
use std::collections::BTreeSet;

/// A field that is made of what the mesh of a step is.
pub(super) struct Made {
    pub(super) info: FieldInfo,
    of: Of,
}

enum Of {
    /// The number of the block of each cell, the same at all steps.
    Blocks(Vec<u32>),
    /// The points of the first step.
    Displacement(Vec<DVec3>),
}

impl Made {
    /// The field of cells `block`, added to `fields`; `None` if there are no two blocks, or the files have such a field.
    pub(super) fn blocks(pieces: &[impl Piece], fields: &mut Vec<FieldInfo>) -> Option<Self> {
        let info = FieldInfo { name: "block".to_owned(), components: 1, association: Association::Cell };
        if fields.iter().any(|field| field.name == info.name) {
            return None;
        }
        let Blocks { blocks, of_cell } = blocks_of(pieces)?;
        (blocks.len() > 1).then(|| {
            fields.push(info.clone());
            Self { info, of: Of::Blocks(of_cell) }
        })
    }

    /// The field of points `displacement` from these, added to `fields`.
    pub(super) fn displacement(points: Vec<DVec3>, fields: &mut Vec<FieldInfo>) -> Self {
        let mut name = "displacement".to_owned();
        while fields.iter().any(|field| field.name == name) {
            name += " of points";
        }
        let info = FieldInfo { name, components: 3, association: Association::Point };
        fields.push(info.clone());
        Self { info, of: Of::Displacement(points) }
    }

    pub(super) fn is_displacement(&self) -> bool {
        matches!(self.of, Of::Displacement(_))
    }

    /// A value for each point or cell of all pieces of a step.
    ///
    /// # Errors
    /// If the mesh of the step cannot be read.
    pub(super) fn values(&self, component: Component, step: &impl StepReader) -> FileResult<Vec<f64>> {
        match &self.of {
            Of::Blocks(numbers) => Ok(numbers.iter().map(|&number| f64::from(number)).collect()),
            Of::Displacement(first) => {
                let now = step.read_grid()?.mesh.points;
                if now.len() != first.len() {
                    let problem = format!("has {} points, but {} in the first step", now.len(), first.len());
                    return Err(FileError::invalid(step.path(), "", problem));
                }
                let of = |by: DVec3| match component {
                    Component::Index(axis) => by.to_array().get(axis).copied().unwrap_or(f64::NAN),
                    Component::Magnitude => by.length(),
                };
                Ok(now.iter().zip(first).map(|(now, first)| of(*now - *first)).collect())
            }
        }
    }
}

/// The blocks of all cells of pieces; `None` unless every piece with cells has some.
pub(super) fn blocks_of(pieces: &[impl Piece]) -> Option<Blocks> {
    let mut all = Blocks::default();
    let mut taken: BTreeSet<u32> = pieces.iter().flat_map(Piece::blocks).filter_map(|(name, _)| name.number).collect();
    // The place of a block in the list, by the name and number that it has in the files.
    let mut known = Vec::new();
    for piece in pieces {
        let before = all.of_cell.len();
        for (block, cells) in piece.blocks() {
            let at = known.iter().position(|other| *other == block).unwrap_or_else(|| {
                let free = || (0..).find(|number| !taken.contains(number)).unwrap_or_default();
                let is_new = |number: &u32| all.blocks.iter().all(|other| other.number != *number);
                let number = block.number.filter(is_new).unwrap_or_else(free);
                taken.insert(number);
                let name = if block.name.is_empty() { number.to_string() } else { block.name.clone() };
                all.blocks.push(Block { name, number });
                known.push(block);
                known.len() - 1
            });
            all.of_cell.extend(std::iter::repeat_n(all.blocks[at].number, cells));
        }
        if all.of_cell.len() - before != piece.counts().1 {
            return None;
        }
    }
    (!all.blocks.is_empty()).then_some(all)
}
