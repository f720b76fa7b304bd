//! Blocks of a source: chosen at import, kept with the mesh of the store.

use crate::series::ingested;
use std::path::{Path, PathBuf};
use tetreel::field::{Component, SeriesSource};
use tetreel::import::{self, choose_blocks};

/// Hexahedra of block 10, two tetrahedra of block 30, and a quadrilateral between them.
pub fn two_blocks() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/exodus/cdf1.e")
}

fn chosen(names: &[&str]) -> Result<Box<dyn SeriesSource>, String> {
    let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
    choose_blocks(import::open(&two_blocks()).expect("opens"), &names).map_err(|error| error.to_string())
}

fn values(source: &dyn SeriesSource, name: &str) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == name).expect("a field");
    let mut values = Vec::new();
    source.read(field, Component::Index(0), 0, &mut values).expect("values");
    let mut precise = Vec::new();
    source.read_f64(field, 0, 0, &mut precise).expect("values");
    assert!(precise.iter().zip(&values).all(|(precise, value)| *precise as f32 == *value));
    values
}

#[test]
fn blocks_are_chosen_by_name_or_number_and_cells_keep_their_numbers() {
    let all = chosen(&[]).expect("all");
    let blocks = all.blocks().expect("reads").expect("blocks");
    assert_eq!(blocks.of_cell, [30, 30, 10], "tetrahedra come first");
    let by_number = chosen(&["30"]).expect("a block");
    assert_eq!(by_number.mesh().expect("a mesh").cells.tets, all.mesh().expect("a mesh").cells.tets);
    assert_eq!([0, 1].map(|cell| by_number.cell_number(cell)), [2, 3]);
    assert_eq!(values(&*by_number, "p"), values(&*all, "p")[..2]);
    assert_eq!(values(&*by_number, "T"), values(&*all, "T"), "points stay until the mesh is built");
    let name = &blocks.blocks[0].name;
    let by_name = chosen(&[name]).expect("a block");
    assert_eq!((by_name.mesh().expect("a mesh").cells.len(), by_name.cell_number(0)), (1, 0));
    assert_eq!(values(&*by_name, "block"), [10.0]);
    assert_eq!(by_name.blocks().expect("reads").expect("blocks").blocks.len(), 1);
    assert!(by_name.notes().iter().any(|note| note.contains("1 of 3 cells")), "{:?}", by_name.notes());
    let whole = |source: &dyn SeriesSource| source.mesh().expect("a mesh");
    assert_eq!(whole(&*chosen(&["10", "30"]).expect("both")), whole(&*all));

    let unknown = chosen(&["10", "nose"]).err().expect("is refused");
    assert!(unknown.contains("'nose'") && unknown.contains("10 (") && unknown.contains("30 ("), "{unknown}");
    let flat = chosen(&["20"]).err().expect("a surface");
    assert!(flat.contains("no cell with a volume"), "{flat}");
    let vtu = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtu/raw_zlib_64_le.vtu");
    let none = choose_blocks(import::open(&vtu).expect("opens"), &["a".to_owned()]).err().expect("no blocks");
    assert!(none.to_string().contains("has no blocks"), "{none}");
}

#[test]
fn a_store_keeps_the_block_of_each_cell_whatever_fields_it_has() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = import::open(&two_blocks()).expect("opens");
    let store = ingested(&*source, &folder.path().join("s.zarr"), "0..");
    let blocks = store.blocks().expect("reads").expect("blocks");
    let mesh = store.mesh().expect("a mesh");
    let expected: Vec<u32> = mesh.cell_source.iter().map(|&cell| [30, 30, 10][cell as usize]).collect();
    assert_eq!(blocks.of_cell, expected);
    assert!(expected.iter().filter(|&&number| number == 10).count() > 4, "the hexahedron is split");
    let info = store.info().expect("reads");
    let counts: Vec<_> = info.mesh.blocks.iter().map(|block| (block.number, block.cells)).collect();
    assert_eq!(counts, [(10, 1), (20, 0), (30, 2)]);
    assert!(info.to_string().contains("block    30 "), "{info}");
    // A single block is not worth an array.
    let one = ingested(&*chosen(&["30"]).expect("a block"), &folder.path().join("one.zarr"), "0..");
    assert_eq!(one.blocks().expect("reads"), None);
}
