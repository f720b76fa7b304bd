//! Fields that no file has: the numbers of blocks, and how far points have moved.

use super::pieces::{BlockName, Piece};
use super::series::StepReader;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Block, Blocks, Component, FieldInfo};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

/// A field that is made of what the mesh of a step is.
pub(super) struct Made {
    pub(super) info: FieldInfo,
    of: Of,
}

enum Of {
    /// The number of the block of each cell, the same at all steps.
    Blocks(Vec<u32>),
    Displacement(Displacement),
}

impl Made {
    /// The field of cells `block`, added to `fields`; `None` if there are no two blocks, or the files have such a field.
    pub(super) fn blocks(pieces: &[impl Piece], fields: &mut Vec<FieldInfo>) -> Option<Self> {
        let info = FieldInfo { name: Blocks::FIELD.to_owned(), components: 1, association: Association::Cell };
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
        Self { info, of: Of::Displacement(Displacement { first: points, last: Mutex::default() }) }
    }

    pub(super) fn is_displacement(&self) -> bool {
        matches!(self.of, Of::Displacement(_))
    }

    /// A value for each point or cell of all pieces of a step.
    ///
    /// # Errors
    /// If the mesh of the step cannot be read.
    pub(super) fn values(&self, component: Component, (at, step): (usize, &impl StepReader)) -> FileResult<Vec<f64>> {
        match &self.of {
            Of::Blocks(numbers) => Ok(numbers.iter().map(|&number| f64::from(number)).collect()),
            Of::Displacement(displacement) => {
                let of = |by: &DVec3| match component {
                    Component::Index(axis) => by.to_array().get(axis).copied().unwrap_or(f64::NAN),
                    Component::Magnitude => by.length(),
                };
                Ok(displacement.at(at, step)?.iter().map(of).collect())
            }
        }
    }
}

/// How far points are from where they are in the first step.
struct Displacement {
    /// The points of the first step.
    first: Vec<DVec3>,
    /// The step read last: its components are asked for one after the other.
    last: Mutex<Option<(usize, Arc<Vec<DVec3>>)>>,
}

impl Displacement {
    fn at(&self, at: usize, step: &impl StepReader) -> FileResult<Arc<Vec<DVec3>>> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, by)) = last.as_ref().filter(|(known, _)| *known == at) {
            return Ok(by.clone());
        }
        let now = step.read_grid()?.mesh.points;
        if now.len() != self.first.len() {
            let problem = format!("has {} points, but {} in the first step", now.len(), self.first.len());
            return Err(FileError::invalid(step.path(), "", problem));
        }
        let by = Arc::new(now.iter().zip(&self.first).map(|(now, first)| *now - *first).collect());
        *last = Some((at, Arc::clone(&by)));
        Ok(by)
    }
}

/// The blocks of all cells of pieces; `None` unless every piece with cells has some.
pub(super) fn blocks_of(pieces: &[impl Piece]) -> Option<Blocks> {
    let mut all = Blocks::default();
    let in_files: HashSet<u32> = pieces.iter().flat_map(Piece::blocks).filter_map(|(name, _)| name.number).collect();
    let (mut used, mut free) = (HashSet::new(), 0..);
    // The number of each block, by the name and number that it has in the files.
    let mut numbers: HashMap<BlockName, u32> = HashMap::new();
    for piece in pieces {
        let before = all.of_cell.len();
        for (block, cells) in piece.blocks() {
            let number = *numbers.entry(block).or_insert_with_key(|block| {
                let own = block.number.filter(|number| used.insert(*number));
                let number = own.or_else(|| free.find(|number| !in_files.contains(number))).unwrap_or_default();
                let name = if block.name.is_empty() { number.to_string() } else { block.name.clone() };
                all.blocks.push(Block { name, number });
                number
            });
            all.of_cell.extend(std::iter::repeat_n(number, cells));
        }
        if all.of_cell.len() - before != piece.counts().1 {
            return None;
        }
    }
    (!all.blocks.is_empty()).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::super::cells::GridReader;
    use super::super::numbers::{Number, Numbers, Values};
    use super::*;
    use std::hash::DefaultHasher;
    use std::path::Path;

    /// A piece with these blocks, and this number of cells.
    struct Listed(Vec<(BlockName, usize)>, usize);

    impl Piece for Listed {
        type Array = Numbers;

        fn path(&self) -> &Path {
            Path::new("a")
        }

        fn counts(&self) -> (usize, usize) {
            (0, self.1)
        }

        fn add_to(&self, _: &mut GridReader) -> FileResult<()> {
            Ok(())
        }

        fn hash_mesh(&self, _: &mut DefaultHasher) -> FileResult<()> {
            Ok(())
        }

        fn arrays(&self) -> Vec<FieldInfo> {
            Vec::new()
        }

        fn blocks(&self) -> Vec<(BlockName, usize)> {
            self.0.clone()
        }

        fn decode(&self, _: usize) -> FileResult<Numbers> {
            Ok(Numbers { number: Number::Float32, big_endian: false, bytes: Vec::new() })
        }

        fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
            array.values()
        }
    }

    #[test]
    fn blocks_keep_their_numbers_and_others_get_free_ones() {
        let block =
            |name: &str, number: Option<u32>, cells: usize| (BlockName { name: name.to_owned(), number }, cells);
        let first = Listed(vec![block("a", None, 2), block("b", Some(0), 1), block("", Some(4), 1)], 4);
        let second = Listed(vec![block("b", Some(0), 1), block("c", Some(4), 2), block("a", None, 1)], 4);
        let Blocks { blocks, of_cell } = blocks_of(&[first, second]).expect("blocks");
        let found: Vec<_> = blocks.iter().map(|block| (block.name.as_str(), block.number)).collect();
        // 0 and 4 are of the files, and the second block of number 4 is another one.
        assert_eq!(found, [("a", 1), ("b", 0), ("4", 4), ("c", 2)]);
        assert_eq!(of_cell, [1, 1, 0, 4, 0, 2, 2, 1]);
        assert_eq!(blocks_of(&[Listed(vec![block("a", None, 2)], 3)]), None, "a cell is of no block");
        assert_eq!(blocks_of(&[Listed(vec![block("a", None, 2)], 2), Listed(Vec::new(), 1)]), None);
        assert_eq!(blocks_of(&[Listed(Vec::new(), 0)]), None);
    }
}
