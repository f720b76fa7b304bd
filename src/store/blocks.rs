//! Which block of the source each cell is from: an array of the mesh, if the source has several blocks.

use super::array::StoredArray;
use super::layout::MESH;
use super::mesh::{ArrayWriter, column};
use crate::codec::{Chunking, ElementType, ReadRange};
use crate::error::{FileError, FileResult};
use crate::field::{Block, Blocks};
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};
use std::fmt;
use std::path::Path;

/// Name of the array, and of its attribute that lists the blocks.
const NAME: &str = "cell_block";
const LIST: &str = "blocks";

/// A block as the list has it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BlockInfo {
    /// Its number, which the cells have.
    pub number: u32,
    /// Its name.
    pub name: String,
    /// Number of its cells in the source.
    pub cells: u64,
}

impl BlockInfo {
    /// The blocks, with the numbers of their cells of the source.
    pub fn all(blocks: &Blocks) -> Vec<Self> {
        let info = |(block, cells): (&Block, usize)| Self {
            number: block.number,
            name: block.name.clone(),
            cells: cells as u64,
        };
        blocks.blocks.iter().zip(blocks.counts()).map(info).collect()
    }
}

impl fmt::Display for BlockInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { number, name, cells } = self;
        let name = if *name == number.to_string() { String::new() } else { format!(" {name}") };
        write!(f, "block    {number}{name}: {cells} cells")
    }
}

/// Writes the number of the block of each cell of a mesh, `cell_source` being its cell of the source; nothing for a single block.
pub(super) fn write(root: &Path, blocks: &Blocks, cell_source: &[u32]) -> FileResult<()> {
    if blocks.blocks.len() < 2 {
        return Ok(());
    }
    let of_source = |&cell: &u32| {
        let missing = || FileError::invalid(root, MESH, format!("cell {cell} of the source is of no block"));
        blocks.of_cell.get(cell as usize).copied().ok_or_else(missing)
    };
    let numbers = cell_source.iter().map(of_source).collect::<FileResult<Vec<u32>>>()?;
    let attributes = Map::from_iter([(LIST.to_owned(), json!(BlockInfo::all(blocks)))]);
    ArrayWriter::new(root, MESH).write(NAME, column(&numbers), ["cell", ""], attributes)
}

/// The array of a store, if it has one.
fn open(root: &Path) -> FileResult<Option<StoredArray>> {
    if !root.join(MESH).join(NAME).exists() {
        return Ok(None);
    }
    StoredArray::open(root, &format!("{MESH}/{NAME}"), ElementType::U32, Chunking::Whole, 1).map(Some)
}

/// The blocks of a store; none if it has no list of them.
pub(super) fn list(root: &Path) -> FileResult<Vec<BlockInfo>> {
    let Some(array) = open(root)? else { return Ok(Vec::new()) };
    let list = array.attributes.get(LIST).cloned().unwrap_or_default();
    serde_json::from_value(list).map_err(|error| {
        let problem = format!("attribute '{LIST}' is damaged: {error}");
        FileError::invalid(root.join(MESH).join(NAME), "", problem).remedy("import the series again")
    })
}

/// The block of each of `cells` cells of the mesh; `None` if the source has none.
pub(super) fn read(root: &Path, source: &dyn ReadRange, cells: u64) -> FileResult<Option<Blocks>> {
    let Some(array) = open(root)? else { return Ok(None) };
    let of_cell = array.expect_shape(&[cells])?.read::<u32, 1>(source)?.into_flattened();
    let blocks = list(root)?.into_iter().map(|BlockInfo { number, name, .. }| Block { name, number }).collect();
    Ok(Some(Blocks { blocks, of_cell }))
}
