//! Blocks of a source: parts, element blocks, regions, each with a number and a name.

use crate::mesh::gather;
use std::collections::HashMap;

/// A block of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its name in the files; its number if it has none.
    pub name: String,
    /// Its number in the files, or its place among the blocks, from 0.
    pub number: u32,
}

/// The blocks of a mesh, and which of them each cell is from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Blocks {
    /// All blocks, in the order of the files; no two have the same number.
    pub blocks: Vec<Block>,
    /// The number of the block of each cell.
    pub of_cell: Vec<u32>,
}

impl Blocks {
    /// The field of cells that has the numbers, and the name by which regions are chosen by them.
    pub const FIELD: &str = "block";

    /// The number of a block that the user names, by its name or its number.
    pub fn number_of(&self, name: &str) -> Option<u32> {
        let named = self.blocks.iter().find(|block| block.name == name);
        let numbered = || self.blocks.iter().find(|block| block.number.to_string() == name);
        named.or_else(numbered).map(|block| block.number)
    }

    /// The names, as in "1 (shell), 2 (core)", for messages.
    pub fn list(&self) -> String {
        let of = |Block { name, number }: &Block| {
            if *name == number.to_string() { name.clone() } else { format!("{number} ({name})") }
        };
        self.blocks.iter().map(of).collect::<Vec<_>>().join(", ")
    }

    /// Number of cells of each block.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts: HashMap<u32, usize> = HashMap::new();
        // Cells of a block follow each other.
        for run in self.of_cell.chunk_by(|a, b| a == b) {
            *counts.entry(run[0]).or_default() += run.len();
        }
        self.blocks.iter().map(|block| counts.get(&block.number).copied().unwrap_or(0)).collect()
    }

    /// The blocks of some cells, without those that none of these is from.
    pub fn of_cells(mut self, cells: &[u32]) -> Self {
        gather(&mut self.of_cell, cells);
        let counts = self.counts();
        let mut counts = counts.iter();
        self.blocks.retain(|_| counts.next().is_some_and(|&count| count > 0));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_found_by_name_before_number_and_counted_wherever_their_cells_are() {
        let block = |name: &str, number| Block { name: name.to_owned(), number };
        let blocks = Blocks { blocks: vec![block("7", 3), block("b", 7), block("c", 9)], of_cell: vec![3, 3, 7, 3] };
        assert_eq!(
            ["7", "b", "9", "3", "d"].map(|name| blocks.number_of(name)),
            [Some(3), Some(7), Some(9), Some(3), None]
        );
        assert_eq!(blocks.counts(), [3, 1, 0]);
        assert_eq!(blocks.list(), "3 (7), 7 (b), 9 (c)");
        let some = blocks.of_cells(&[2, 3]);
        assert_eq!((some.of_cell, some.blocks), (vec![7, 3], vec![block("7", 3), block("b", 7)]));
    }
}
