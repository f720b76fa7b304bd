//! Raw volumes with a header in a file of its own.

use std::fs;
use tetreel::field::Component;
use tetreel::import;

#[test]
fn headers_lead_to_the_values_beside_them_and_several_are_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let meta = "NDims = 3\nDimSize = 2 2 2\nElementSpacing = 1 2 3\nElementType = MET_FLOAT\nElementDataFile = ";
    for step in [0_u8, 1] {
        let values: Vec<u8> = (0..8_u8).flat_map(|i| f32::from(10 * step + i).to_le_bytes()).collect();
        fs::write(at(&format!("v{step}.raw")), values).expect("a file");
        fs::write(at(&format!("v{step}.mhd")), format!("{meta}v{step}.raw\n")).expect("a file");
    }
    let source = import::open(folder.path()).expect("the files of the folder are a series");
    assert_eq!(source.times().values, [0.0, 1.0]);
    let mesh = source.mesh().expect("a mesh");
    assert_eq!((mesh.points.len(), mesh.cells.len(), mesh.points[7].to_array()), (8, 1, [1.0, 2.0, 3.0]));
    let mut values = Vec::new();
    source.read(&source.fields()[0], Component::Index(0), 1, &mut values).expect("values");
    assert_eq!(values, (10..18_u8).map(f32::from).collect::<Vec<_>>());
    assert_eq!(import::files(&at("v0.mhd")).expect("files").len(), 2);

    fs::remove_file(at("v1.raw")).expect("it is removed");
    let error = import::open(folder.path()).err().expect("is refused").to_string();
    assert!(error.contains("v1.raw is missing"), "{error}");
}
