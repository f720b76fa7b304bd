use super::*;
use crate::field::Component;
use crate::random::SplitMix64;
use flate2::write::DeflateEncoder;
use rawzip::{CompressionMethod, ZipArchiveWriter};
use std::fs;
use std::io::Write;

/// An array as NumPy writes it.
fn npy(descr: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    [&b"\x93NUMPY\x01\x00"[..], &(text.len() as u16).to_le_bytes(), text.as_bytes(), numbers].concat()
}

fn floats(shape: &str, numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    npy("'<f8'", shape, &numbers.into_iter().flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
}

fn integers(shape: &str, numbers: &[i32]) -> Vec<u8> {
    npy("'>i4'", shape, &numbers.iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<u8>>())
}

type Arrays = Vec<(&'static str, Vec<u8>)>;

fn packed(arrays: &Arrays, method: CompressionMethod) -> Vec<u8> {
    let mut out = Vec::new();
    let mut zip = ZipArchiveWriter::new(&mut out);
    for (name, bytes) in arrays {
        let name = format!("{name}.npy");
        let file = zip.new_file(&name).compression_method(method);
        let (mut entry, config) = file.start().expect("a member");
        let descriptor = if method == CompressionMethod::DEFLATE {
            let mut writer = config.wrap(DeflateEncoder::new(&mut entry, flate2::Compression::default()));
            writer.write_all(bytes).expect("is written");
            let (encoder, descriptor) = writer.finish().expect("is written");
            encoder.finish().expect("is written");
            descriptor
        } else {
            let mut writer = config.wrap(&mut entry);
            writer.write_all(bytes).expect("is written");
            writer.finish().expect("is written").1
        };
        entry.finish(descriptor).expect("is finished");
    }
    zip.finish().expect("is finished");
    out
}

/// Does something with the series of a file of these bytes; the error is the message.
fn with<T>(bytes: &[u8], run: impl FnOnce(&dyn SeriesSource) -> FileResult<T>) -> Result<T, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.npz");
    fs::write(&path, bytes).expect("a file");
    open(&[path]).and_then(|source| run(source.as_ref())).map_err(|error| error.to_string())
}

fn read(source: &dyn SeriesSource, name: &str, component: usize, step: usize) -> FileResult<Vec<f32>> {
    let field = source.fields().iter().find(|field| field.name == name).unwrap_or_else(|| panic!("no {name}"));
    let mut out = Vec::new();
    source.read(field, Component::Index(component), step, &mut out)?;
    Ok(out)
}

/// A pyramid's five points, and two tetrahedra.
fn mesh() -> Arrays {
    let points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]];
    vec![
        ("points", floats("(5, 3)", points.into_iter().flatten().map(f64::from))),
        ("cells", integers("(2, 4)", &[0, 1, 2, 4, 0, 2, 3, 4])),
    ]
}

fn counted(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(f64::from)
}

fn series() -> Arrays {
    let mut arrays = mesh();
    arrays.push(("time", floats("(3,)", [2.0, 0.5, 1.0])));
    arrays.push(("T", floats("(3, 5)", counted(15))));
    arrays.push(("U", floats("(3, 5, 2)", counted(30))));
    arrays.push(("c", integers("(3, 2)", &[0, 1, 2, 3, 4, 5])));
    arrays.push(("cell_on", npy("'|b1'", "(3, 2)", &[0, 1, 1, 0, 1, 1])));
    arrays.push(("still", floats("(5,)", counted(5))));
    arrays.push(("names", npy("'<U1'", "(5,)", &[0; 20])));
    arrays
}

#[test]
fn steps_are_rows_in_order_of_time_compressed_or_not() {
    for method in [CompressionMethod::STORE, CompressionMethod::DEFLATE] {
        with(&packed(&series(), method), |source| {
            assert_eq!(source.times().values, [0.5, 1.0, 2.0]);
            let mesh = source.mesh()?;
            assert_eq!((mesh.points.len(), &mesh.cells.tets[..]), (5, &[[0, 1, 2, 4], [0, 2, 3, 4]][..]));
            assert_eq!(read(source, "T", 0, 0)?, [5.0, 6.0, 7.0, 8.0, 9.0]);
            assert_eq!(read(source, "T", 0, 2)?, [0.0, 1.0, 2.0, 3.0, 4.0]);
            assert_eq!(read(source, "U", 1, 1)?, [21.0, 23.0, 25.0, 27.0, 29.0]);
            assert_eq!((read(source, "c", 0, 1)?, read(source, "on", 0, 1)?), (vec![4.0, 5.0], vec![1.0, 1.0]));
            let notes = source.notes().join("; ");
            assert!(notes.contains("'still' (has the shape [5]") && notes.contains("'names' (holds no"), "{notes}");
            assert_eq!(notes.contains("compressed"), method == CompressionMethod::DEFLATE, "{notes}");
            Ok(())
        })
        .expect("is read");
    }
}

#[test]
fn without_times_there_is_one_step_whose_axis_may_be_missing() {
    let mut arrays = mesh();
    arrays.push(("T", floats("(5,)", counted(5))));
    arrays.push(("U", floats("(1, 5, 3)", counted(15))));
    arrays.push(("E", floats("(2, 3)", counted(6))));
    arrays.push(("late", floats("(3, 5)", counted(15))));
    with(&packed(&arrays, CompressionMethod::STORE), |source| {
        assert_eq!(source.times().values, [0.0]);
        assert_eq!((read(source, "T", 0, 0)?[4], read(source, "U", 2, 0)?[4]), (4.0, 14.0));
        assert_eq!(read(source, "E", 1, 0)?, [1.0, 4.0]);
        assert!(source.notes().join("; ").contains("there is no array 'time'"), "{:?}", source.notes());
        Ok(())
    })
    .expect("is read");
}

#[test]
fn lists_of_cells_say_where_each_begins_or_ends() {
    for offsets in [("(3,)", &[0, 5, 9][..]), ("(2,)", &[5, 9]), ("(2,)", &[0, 5])] {
        let mut arrays = mesh();
        arrays.truncate(1);
        arrays.push(("types", npy("'|u1'", "(2,)", &[14, 10])));
        arrays.push(("offsets", integers(offsets.0, offsets.1)));
        arrays.push(("connectivity", integers("(9,)", &[0, 1, 2, 3, 4, 0, 1, 2, 4])));
        let cells = with(&packed(&arrays, CompressionMethod::STORE), |source| {
            Ok(source.mesh()?.cells.iter().map(<[u32]>::to_vec).collect::<Vec<_>>())
        });
        assert_eq!(cells, Ok(vec![vec![0, 1, 2, 4], vec![0, 1, 2, 3, 4]]), "{offsets:?}");
    }
}

#[test]
fn points_without_cells_are_a_cloud_with_radii_if_they_are_there() {
    let mut arrays = series();
    arrays.retain(|(name, _)| *name != "cells");
    let mut with_radii = arrays.clone();
    with_radii.push(("radius", floats("(5,)", [1.0, 0.5, 0.0, -1.0, f64::NAN])));
    // Python objects are never made: they are left out with a note.
    let mut objects = arrays.clone();
    objects.push(("radius", npy("'|O'", "(5,)", &[0x80; 40])));
    let mut with_volumes = arrays.clone();
    with_volumes.push(("volume", floats("(5,)", counted(5))));
    for (arrays, [radii, volumes]) in
        [(arrays, [0, 0]), (with_radii, [5, 0]), (with_volumes, [0, 5]), (objects, [0, 0])]
    {
        let objects = arrays.iter().any(|(name, bytes)| *name == "radius" && bytes.contains(&b'O'));
        with(&packed(&arrays, CompressionMethod::DEFLATE), |source| {
            let mesh = source.mesh()?;
            assert_eq!((&mesh.cells.points[..], mesh.cells.radii.len()), (&[0, 1, 2, 3, 4][..], radii));
            assert_eq!(mesh.cells.volumes.len(), volumes);
            assert!(mesh.cells.are_points() && mesh.cells.len() == 5 && mesh.cells.tets.is_empty());
            assert_eq!(read(source, "T", 0, 2)?, [0.0, 1.0, 2.0, 3.0, 4.0]);
            assert!(source.fields().iter().all(|field| field.association == Association::Point));
            assert_eq!(source.notes().join("; ").contains("'radius' (holds no"), objects);
            Ok(())
        })
        .expect("is read");
    }
}

#[test]
fn what_is_missing_or_wrong_is_named_with_a_remedy() {
    let replaced = |name: &'static str, bytes: Vec<u8>| {
        let mut arrays = series();
        arrays.retain(|(other, _)| *other != name);
        arrays.push((name, bytes));
        arrays
    };
    let without = |name: &str| series().into_iter().filter(|(other, _)| *other != name).collect::<Arrays>();
    let equal = |name: &'static str| {
        let mut arrays = replaced("cells", integers("(5, 4)", &[0, 1, 2, 4].repeat(5)));
        arrays.retain(|(other, _)| ["points", "cells", "time"].contains(other));
        arrays.push((name, floats("(3, 5)", counted(15))));
        arrays
    };
    let fortran = |shape: &str| {
        let header = format!("{{'descr': '<f8', 'fortran_order': True, 'shape': {shape}, }}");
        let numbers: Vec<u8> = counted(15).flat_map(f64::to_le_bytes).collect();
        [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &numbers].concat()
    };
    let cloud = |name: &'static str, bytes: Vec<u8>| {
        let mut arrays = replaced(name, bytes);
        arrays.retain(|(other, _)| *other != "cells");
        arrays
    };
    for (arrays, expected) in [
        (without("points"), "no array 'points'"),
        (cloud("radius", floats("(4,)", counted(4))), "has the shape [4], not a radius for each of 5 points"),
        (cloud("radius", floats("(5, 1)", counted(5))), "write it as [n]"),
        (cloud("radius", floats("(9223372036854775808,)", counted(5))), "claims the shape"),
        (cloud("volume", floats("(9223372036854775808,)", counted(5))), "claims the shape"),
        (cloud("points", floats("(9223372036854775808, 3)", counted(15))), "claims the shape"),
        (cloud("points", npy("'|O'", "(5, 3)", &[0x80; 120])), "no array 'points'"),
        (replaced("points", floats("(5, 2)", counted(10))), "three coordinates"),
        (replaced("cells", integers("(2, 3)", &[0; 6])), "[m, 8]"),
        (replaced("cells", integers("(2, 4)", &[0, 1, 2, -4, 0, 1, 2, 3])), "negative"),
        (replaced("cells", integers("(2, 4)", &[0, 1, 2, 5, 0, 1, 2, 3])), "vertex 5"),
        (replaced("cells", integers("(4611686018427387904, 4)", &[0; 8])), "claims the shape"),
        (replaced("time", floats("(3,)", [0.0, 1.0, 0.0])), "steps 0 and 2"),
        (replaced("times", floats("(3,)", [0.0, 1.0, 2.0])), "beside 'time'"),
        (replaced("time", floats("(3, 1)", [0.0, 1.0, 2.0])), "not a time for each step"),
        (replaced("T", floats("(3, 6)", counted(15))), "claims the shape"),
        (replaced("T", npy("'<f2'", "(3, 5)", &[0; 30])), "astype('f4')"),
        (replaced("T", fortran("(3, 5)")), "ascontiguousarray"),
        (replaced("connectivity", integers("(3,)", &[0, 1, 2])), "beside 'connectivity'"),
        (equal("T"), "point_T or cell_T"),
        (replaced("T", b"no array".to_vec()), "NumPy"),
    ] {
        let error = with(&packed(&arrays, CompressionMethod::STORE), |_| Ok(())).expect_err(expected);
        assert!(error.contains(expected) && error.contains("x.npz"), "{error}");
    }
    let on = |name| {
        with(&packed(&equal(name), CompressionMethod::STORE), |source| {
            Ok(source.fields().iter().map(|field| (field.name.clone(), field.association)).collect::<Vec<_>>())
        })
    };
    assert_eq!(on("point_T"), Ok(vec![("T".to_owned(), Association::Point)]));
    assert_eq!(on("cell_T"), Ok(vec![("T".to_owned(), Association::Cell)]));
    assert!(with(b"PK", |_| Ok(())).unwrap_err().contains("zip"));
}

/// Reads all that there is.
fn read_all(bytes: &[u8]) -> Result<(), String> {
    with(bytes, crate::import::read_all)
}

#[test]
fn files_that_are_cut_or_have_other_bytes_never_panic() {
    let (mut refused, mut random) = (0, SplitMix64::new(3));
    for method in [CompressionMethod::STORE, CompressionMethod::DEFLATE] {
        let bytes = packed(&series(), method);
        assert_eq!(read_all(&bytes), Ok(()));
        for end in (0..bytes.len()).step_by(7) {
            assert!(read_all(&bytes[..end]).is_err(), "{end} of {}", bytes.len());
        }
        for _ in 0..400 {
            let mut other = bytes.clone();
            for _ in 0..2 {
                let at = random.below(other.len());
                other[at] ^= 1 << random.below(8);
            }
            refused += usize::from(read_all(&other).is_err());
        }
    }
    assert!(refused > 200, "{refused}");
}
