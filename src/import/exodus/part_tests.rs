//! Tests of decomposed files.

use super::built::{Classic, DOUBLE};
use super::*;
use crate::field::{Component, FieldInfo};
use std::fs;

/// A part of two hexahedra on top of each other, in a block each, both of which all parts list: part 0 has the lower one.
struct Part {
    number: usize,
    times: Vec<f64>,
    has_numbers: bool,
    /// Whether it has the variables `T` of nodes and `p` of elements.
    has_values: bool,
}

impl Part {
    fn new(number: usize) -> Self {
        Self { number, times: vec![0.5, 2.0], has_numbers: true, has_values: true }
    }

    fn file(&self) -> Classic {
        let mut file = Classic::new(2, self.times.len());
        file.dimension("num_dim", 3);
        let nodes = file.dimension("num_nodes", 8);
        let blocks = file.dimension("num_el_blk", 2);
        file.doubles("time_whole", &[0], self.times.iter().copied());
        file.ints("eb_prop1", &[blocks], [10, 20]);
        let base = self.number as f64;
        file.doubles("coordx", &[nodes], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
        file.doubles("coordy", &[nodes], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
        file.doubles("coordz", &[nodes], (0..8).map(|i| base + f64::from(i / 4)));
        if self.has_numbers {
            file.ints("node_num_map", &[nodes], (1..9).map(|i| 10 * (4 * self.number as i32 + i)));
        }
        let number = self.number + 1;
        let rows = file.dimension(&format!("num_el_in_blk{number}"), 1);
        let corners = file.dimension(&format!("num_nod_per_el{number}"), 8);
        file.ints(&format!("connect{number}"), &[rows, corners], 1..9).element_type = "HEX8";
        if self.has_values {
            file.names("name_nod_var", "num_nod_var", &["T"]);
            file.names("name_elem_var", "num_elem_var", &["p"]);
            let steps = || (0..self.times.len()).map(|step| 100.0 * step as f64);
            let of_step = |t: f64| (0..8).map(move |i| t + 4.0 * base + f64::from(i));
            file.doubles("vals_nod_var1", &[0, nodes], steps().flat_map(of_step));
            file.doubles(&format!("vals_elem_var1eb{number}"), &[0, rows], steps().map(|t| t + base));
        }
        file
    }
}

struct Run {
    folder: tempfile::TempDir,
}

impl Run {
    fn new(parts: &[Classic]) -> Self {
        let run = Self { folder: tempfile::tempdir().unwrap() };
        for (number, part) in parts.iter().enumerate() {
            fs::write(run.path(parts.len(), number), part.bytes()).unwrap();
        }
        run
    }

    fn path(&self, parts: usize, number: usize) -> PathBuf {
        self.folder.path().join(format!("out.e.{parts}.{number}"))
    }

    fn open(&self, parts: usize) -> FileResult<Box<dyn SeriesSource>> {
        super::super::open(&self.path(parts, 0))
    }

    fn refusal(&self, parts: usize) -> String {
        self.open(parts).err().expect("is refused").to_string()
    }
}

fn values(source: &dyn SeriesSource, name: &str, step: usize) -> Vec<f32> {
    let is_it = |field: &&FieldInfo| field.name == name;
    let field = source.fields().iter().find(is_it).unwrap_or_else(|| panic!("no field {name}"));
    let mut out = Vec::new();
    source.read(field, Component::Index(0), step, &mut out).unwrap();
    out
}

/// Values with -1 for NaN.
fn plain(values: Vec<f32>) -> Vec<f32> {
    values.into_iter().map(|value| if value.is_nan() { -1.0 } else { value }).collect()
}

#[test]
fn any_part_or_all_or_their_folder_open_the_whole() {
    for has_numbers in [true, false] {
        let part = |number| Part { has_numbers, ..Part::new(number) }.file();
        let run = Run::new(&[part(0), part(1)]);
        let [first, second] = [0, 1].map(|number| run.path(2, number));
        let all: &[&[PathBuf]] = &[
            std::slice::from_ref(&first),
            std::slice::from_ref(&second),
            &[second.clone(), first.clone()],
            &[run.folder.path().to_owned()],
        ];
        for paths in all {
            let source = super::super::open_many(paths).unwrap();
            let source = source.as_ref();
            assert!(source.describe().ends_with("out.e.2.1 (2 parts)"), "{}", source.describe());
            assert_eq!(source.times().values, [0.5, 2.0]);
            let mesh = source.mesh().unwrap();
            assert_eq!((mesh.points.len(), mesh.cells.len()), (12, 2), "{has_numbers}");
            assert_eq!(values(source, "T", 1), (0..12).map(|i| 100.0 + i as f32).collect::<Vec<_>>());
            assert_eq!((values(source, "p", 1), values(source, "block", 0)), (vec![100.0, 101.0], vec![10.0, 20.0]));
            let notes = source.notes().join("; ");
            assert!(notes.contains("joined 4 points") && notes.contains("10 (1 HEX8), 20 (1 HEX8)"), "{notes}");
            assert!(!notes.contains("NaN"), "{notes}");
        }
        for path in [&first, &second] {
            let mut files = super::super::files(path).unwrap();
            files.sort();
            assert_eq!(files, [first.clone(), second.clone()]);
        }
    }
}

#[test]
fn numbers_of_nodes_say_which_points_are_one() {
    // The lower hexahedron has its upper side, and the upper one its lower side, in two files that a crack divides.
    let mut cracked = Part::new(1).file();
    let numbers = cracked.variables.iter_mut().find(|variable| variable.name == "node_num_map").unwrap();
    numbers.bytes[..8].copy_from_slice(&[0, 0, 1, 0, 0, 0, 1, 1]);
    let run = Run::new(&[Part::new(0).file(), cracked]);
    assert_eq!(run.open(2).unwrap().mesh().unwrap().points.len(), 14);
    // Numbers that each part counts for itself are no names.
    let mut own = Part::new(1).file();
    let of_first = Part::new(0).file().variables.into_iter().find(|of| of.name == "node_num_map").unwrap();
    *own.variables.iter_mut().find(|variable| variable.name == "node_num_map").unwrap() = of_first;
    let run = Run::new(&[Part::new(0).file(), own]);
    assert_eq!(run.open(2).unwrap().mesh().unwrap().points.len(), 12);
}

#[test]
fn what_a_part_lacks_is_a_hole_and_a_part_may_be_empty() {
    let mut empty = Classic::new(2, 2);
    empty.dimension("num_dim", 3);
    empty.doubles("time_whole", &[0], [0.5, 2.0]);
    let run = Run::new(&[empty, Part { number: 0, has_values: false, ..Part::new(0) }.file(), Part::new(1).file()]);
    let source = run.open(3).unwrap();
    let source = source.as_ref();
    assert_eq!(plain(values(source, "p", 0)), [-1.0, 1.0]);
    let expected = [[-1.0; 8].as_slice(), &[108.0, 109.0, 110.0, 111.0]].concat();
    assert_eq!(plain(values(source, "T", 1)), expected);
    let notes = source.notes().join("; ");
    for expected in ["'p' has no values (NaN) in 1 of 2 blocks", "'T' has no values (NaN) in 1 of 2 parts"] {
        assert!(notes.contains(expected), "{notes}");
    }
    assert!(!notes.contains("left out"), "{notes}");
}

#[test]
fn the_steps_that_all_parts_have_are_read() {
    let part = |number, times: &[f64]| Part { times: times.to_vec(), ..Part::new(number) }.file();
    let run = Run::new(&[part(0, &[0.5, 2.0, 3.0]), part(1, &[0.5, 2.0])]);
    let source = run.open(2).unwrap();
    assert_eq!(
        (source.times().values.as_slice(), values(source.as_ref(), "p", 1)),
        (&[0.5, 2.0][..], vec![100.0, 101.0])
    );
    let notes = source.notes().join("; ");
    assert!(notes.contains("left out the last 1 steps") && notes.contains("out.e.2.1 has 2"), "{notes}");
    let error = Run::new(&[part(0, &[0.5, 2.0]), part(1, &[0.5, 2.5])]).refusal(2);
    assert!(error.contains("out.e.2.") && error.contains("step 1 is at 2"), "{error}");
    let error = Run::new(&[part(0, &[0.5]), part(1, &[])]).refusal(2);
    assert!(error.contains("out.e.2.1") && error.contains("has no steps"), "{error}");
}

#[test]
fn parts_that_are_missing_damaged_or_of_several_runs_are_named() {
    let run = Run::new(&[Part::new(0).file(), Part::new(1).file()]);
    let other = run.folder.path().join("other.e.2.0");
    fs::copy(run.path(2, 0), &other).unwrap();
    let error = super::super::open_many(&[run.path(2, 0), other.clone()]).err().unwrap().to_string();
    assert!(error.contains("open it alone"), "{error}");
    let error = super::super::open(&other).err().unwrap().to_string();
    assert!(error.contains("1 of 2 parts are missing: other.e.2.1"), "{error}");
    assert!(super::super::files(&other).is_err());
    let whole = fs::read(run.path(2, 1)).unwrap();
    for end in [0, 3, 100, whole.len() / 2, whole.len() - 9] {
        fs::write(run.path(2, 1), &whole[..end]).unwrap();
        let error = run.open(2).and_then(|source| super::super::read_all(source.as_ref())).unwrap_err().to_string();
        assert!(error.contains("out.e.2.1: "), "{error}");
    }
    fs::remove_file(run.path(2, 1)).unwrap();
    assert!(run.refusal(2).contains("missing: out.e.2.1"));
}

#[test]
fn coordinates_and_values_of_more_files_than_may_be_open_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e");
    let mut file = Part::new(0).file();
    let axes = file.dimensions.iter().position(|(name, _)| name == "num_nodes").unwrap();
    file.put("more", &[axes], DOUBLE, vec![0; 64]);
    fs::write(&path, file.bytes()).unwrap();
    let netcdf = netcdf::NetCdf::open(&path, 100_000).unwrap();
    assert_eq!(netcdf.read("coordz", &[], &[8]).unwrap()[4..], [1.0; 4]);
    assert_eq!(netcdf.read("vals_elem_var1eb1", &[1], &[1]).unwrap(), [100.0]);
    fs::remove_file(&path).unwrap();
    assert!(netcdf.read("more", &[], &[8]).is_err(), "it is opened for each read");
}
