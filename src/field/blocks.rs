//! Blocks of a source: parts, element blocks, regions, each with a number and a name.

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
        let mut counts = vec![0; self.blocks.len()];
        let mut last = 0;
        for number in &self.of_cell {
            // Cells of a block follow each other.
            if self.blocks.get(last).is_none_or(|block| block.number != *number) {
                last = self.blocks.iter().position(|block| block.number == *number).unwrap_or(last);
            }
            if let Some(count) = counts.get_mut(last) {
                *count += 1;
            }
        }
        counts
    }
}
