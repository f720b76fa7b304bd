//! Files that `tests/interop/write_vtkhdf.py` wrote, and damaged ones.

use super::*;
use crate::field::{Association, Component};
use crate::random::SplitMix64;
use std::fs;

const STEPS: &[u8] = include_bytes!("../../../tests/data/vtkhdf/steps.vtkhdf");
const SINGLE: &[u8] = include_bytes!("../../../tests/data/vtkhdf/single.hdf");
const MOVING: &[u8] = include_bytes!("../../../tests/data/vtkhdf/moving.vtkhdf");
const POLYHEDRON: &[u8] = include_bytes!("../../../tests/data/vtkhdf/polyhedron.vtkhdf");
const BLOCKS: &[u8] = include_bytes!("../../../tests/data/vtkhdf/blocks.vtkhdf");
const IMAGE: &[u8] = include_bytes!("../../../tests/data/vtkhdf/image.vtkhdf");
const SURFACE: &[u8] = include_bytes!("../../../tests/data/vtkhdf/surface.vtkhdf");
const AMR: &[u8] = include_bytes!("../../../tests/data/vtkhdf/amr.vtkhdf");
const OTHER: &[u8] = include_bytes!("../../../tests/data/vtkhdf/other.hdf");

/// Does something with the series of a file of these bytes; the error is the message.
fn with<T>(bytes: &[u8], run: impl FnOnce(&dyn SeriesSource) -> FileResult<T>) -> Result<T, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.vtkhdf");
    fs::write(&path, bytes).expect("a file");
    open(&[path]).and_then(|source| run(source.as_ref())).map_err(|error| error.to_string())
}

fn read(source: &dyn SeriesSource, name: &str, component: usize, step: usize) -> FileResult<Vec<f32>> {
    let field = source.fields().iter().find(|field| field.name == name).unwrap_or_else(|| panic!("no {name}"));
    let mut out = Vec::new();
    source.read(field, Component::Index(component), step, &mut out)?;
    Ok(out)
}

/// Values from `first` on.
fn from(first: u16, count: u16) -> Vec<f32> {
    (first..first + count).map(f32::from).collect()
}

#[test]
fn parts_of_steps_are_one_mesh_with_the_rows_of_each_step() {
    with(STEPS, |source| {
        assert_eq!(source.times().values, [0.25, 0.5, 2.0]);
        let mesh = source.mesh()?;
        assert_eq!((mesh.points.len(), mesh.points[9].to_array()), (16, [3.0, 0.0, 0.0]));
        let cells: Vec<_> = mesh.cells.iter().map(<[u32]>::to_vec).collect();
        assert_eq!(cells[2..], [vec![0, 2, 6, 7], vec![8, 9, 11, 10, 12, 13, 15, 14]]);
        for step in 0..3 {
            assert_eq!(read(source, "T", 0, step)?, from(100 * step as u16, 16), "{step}");
            let c = from(10 * step as u16, 5);
            assert_eq!(read(source, "c", 0, step)?, [c[0], c[1], c[3], c[4]], "{step}: the triangle is left out");
            assert_eq!(read(source, "still", 0, step)?, from(0, 16), "without offsets it is where the mesh is");
        }
        assert!(source.notes().join("; ").contains("'names' (holds no numbers)"));
        let kinds: Vec<_> = source.fields().iter().map(|field| (&field.name[..], field.components)).collect();
        assert_eq!(kinds, [("T", 1), ("still", 2), ("c", 1)]);
        Ok(())
    })
    .expect("is read");
}

#[test]
fn a_step_alone_has_the_time_of_its_field_data_and_booleans_are_numbers() {
    with(SINGLE, |source| {
        assert_eq!((source.times().values.as_slice(), source.mesh()?.cells.len()), (&[7.5][..], 1));
        assert_eq!((read(source, "is_solid", 0, 0)?, read(source, "T", 0, 0)?), (vec![1.0], from(0, 8)));
        let units: Vec<_> = source.fields().iter().map(|field| source.unit(field)).collect();
        assert_eq!(units, [Some("°C".to_owned()), None, None]);
        Ok(())
    })
    .expect("is read");
}

#[test]
fn steps_that_begin_where_the_first_one_does_have_its_mesh_and_others_are_compared() {
    with(MOVING, |source| {
        assert_eq!(read(source, "T", 0, 1)?, from(100, 8));
        let error = read(source, "T", 0, 2).expect_err("moves").to_string();
        assert!(error.contains("points move") && error.contains("step 2"), "{error}");
        Ok(())
    })
    .expect("opens");
}

#[test]
fn polyhedra_have_their_faces() {
    let cells = with(POLYHEDRON, |source| {
        let cells = source.mesh()?.cells;
        assert_eq!(read(source, "c", 0, 0)?, [1.0, 0.0]);
        Ok((cells.tets.len(), cells.len()))
    });
    assert_eq!(cells, Ok((1, 2)));
}

#[test]
fn blocks_are_merged_by_their_index() {
    with(BLOCKS, |source| {
        let mesh = source.mesh()?;
        assert_eq!((mesh.points.len(), mesh.points[8].x, mesh.cells.len()), (16, 2.0, 4), "b is before a");
        assert_eq!(read(source, "T", 0, 0)?, [from(0, 8), from(0, 8)].concat());
        assert!(source.notes().join("; ").contains("skipped 1 blocks that are surfaces"));
        Ok(())
    })
    .expect("is read");
}

#[test]
fn images_are_hexahedra_turned_as_their_direction_says() {
    with(IMAGE, |source| {
        let mesh = source.mesh()?;
        assert_eq!((mesh.points.len(), mesh.cells.len()), (24, 6));
        // As vtkImageData has them.
        assert_eq!((mesh.points[0].to_array(), mesh.points[1].to_array()), ([0.1, 0.5, 3.0], [0.1, 0.0, 3.0]));
        assert_eq!(mesh.points[4].to_array(), [0.35, 0.5, 3.0]);
        for step in 0..3 {
            assert_eq!(read(source, "T", 0, step)?, from(100 * step as u16, 24));
            assert_eq!(read(source, "c", 0, step)?, from(0, 6));
        }
        assert!(source.fields().iter().any(|field| field.association == Association::Cell));
        Ok(())
    })
    .expect("is read");
}

#[test]
fn other_data_sets_are_refused_by_name() {
    for (bytes, expected) in
        [(SURFACE, "type PolyData"), (AMR, "type OverlappingAMR"), (OTHER, "no VTKHDF file"), (b"HDF", "no HDF5 file")]
    {
        let error = with(bytes, |_| Ok(())).expect_err(expected);
        assert!(error.contains(expected) && error.contains("x.vtkhdf") && error.contains(';'), "{error}");
    }
}

/// The bytes with other numbers in place of the only ones that are these.
fn changed(bytes: &[u8], old: [f32; 3], new: [f32; 3]) -> Vec<u8> {
    let [old, new] = [old, new].map(|numbers| numbers.map(f32::to_le_bytes).concat());
    let places: Vec<_> = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(&old)).collect();
    let [at] = places[..] else { panic!("these numbers are at {places:?}") };
    [&bytes[..at], &new, &bytes[at + new.len()..]].concat()
}

#[test]
fn several_files_are_one_series_in_order_of_their_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = ["b_10.vtkhdf", "b_9.vtkhdf"].map(|name| folder.path().join(name));
    let earlier = changed(STEPS, [0.25, 0.5, 2.0], [-3.0, -2.0, -1.0]);
    fs::write(&paths[0], &earlier).expect("a file");
    fs::write(&paths[1], STEPS).expect("a file");
    let source = crate::import::open_many(&paths).expect("opens");
    let source = source.as_ref();
    assert_eq!(source.times().values, [-3.0, -2.0, -1.0, 0.25, 0.5, 2.0]);
    for step in 0..6 {
        assert_eq!(read(source, "T", 0, step).expect("values"), from(100 * (step as u16 % 3), 16), "{step}");
    }
    assert!(source.notes().join("; ").contains("times are the times of the files"));
    // A run that began anew before the end of the other: by names.
    fs::write(&paths[0], changed(STEPS, [0.25, 0.5, 2.0], [-3.0, -2.0, 1.0])).expect("a file");
    let source = crate::import::open_many(&paths).expect("opens");
    assert_eq!(source.times().values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let notes = source.notes().join("; ");
    assert!(notes.contains("b_9.vtkhdf have overlapping times"), "{notes}");
    // Equal places in other files are no equal meshes.
    fs::write(&paths[0], changed(&earlier, [3.0, 0.0, 0.0], [3.5, 0.0, 0.0])).expect("a file");
    let source = crate::import::open_many(&paths).expect("opens");
    let error = read(source.as_ref(), "T", 0, 3).expect_err("moves").to_string();
    assert!(error.contains("b_9.vtkhdf") && error.contains("points move"), "{error}");
    let files = crate::import::open_many(&[paths[0].clone(), folder.path().join("a.pvd")]);
    assert!(files.err().expect("of two kinds").to_string().contains("open it alone"));
}

/// Reads all that there is.
fn read_all(bytes: &[u8]) -> Result<(), String> {
    with(bytes, crate::import::read_all)
}

#[test]
fn files_that_are_cut_or_have_other_bytes_never_panic() {
    let (mut refused, mut random) = (0, SplitMix64::new(7));
    for bytes in [STEPS, POLYHEDRON, BLOCKS, IMAGE] {
        assert_eq!(read_all(bytes), Ok(()));
        for end in (0..bytes.len()).step_by(53) {
            refused += usize::from(read_all(&bytes[..end]).is_err());
        }
        for _ in 0..250 {
            let mut other = bytes.to_vec();
            for _ in 0..3 {
                let at = random.below(other.len());
                other[at] ^= 1 << random.below(8);
            }
            refused += usize::from(read_all(&other).is_err());
        }
    }
    assert!(refused > 300, "{refused}");
}
