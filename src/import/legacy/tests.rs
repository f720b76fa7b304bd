//! Whole files of all kinds, as text and binary, and what is wrong with others.

use super::*;
use crate::field::{Component, SeriesSource};
use crate::import::open_many;
use crate::mesh::RawMesh;
use crate::random::SplitMix64;
use std::fs;

/// Writes files, as text or binary.
struct File {
    is_binary: bool,
    bytes: Vec<u8>,
}

impl File {
    fn new(is_binary: bool, version: &str, dataset: &str) -> Self {
        let encoding = if is_binary { "BINARY" } else { "ASCII" };
        let start = format!("# vtk DataFile Version {version}\na title\n{encoding}\nDATASET {dataset}\n");
        Self { is_binary, bytes: start.into_bytes() }
    }

    fn line(mut self, text: &str) -> Self {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(b'\n');
        self
    }

    fn put<T: std::fmt::Display, const N: usize>(
        mut self,
        head: &str,
        numbers: &[T],
        bytes: impl Fn(&T) -> [u8; N],
    ) -> Self {
        self = self.line(head);
        for number in numbers {
            if self.is_binary {
                self.bytes.extend(bytes(number));
            } else {
                self.bytes.extend(format!("{number} ").into_bytes());
            }
        }
        self.line("")
    }

    fn floats(self, head: &str, numbers: &[f32]) -> Self {
        self.put(head, numbers, |v| v.to_be_bytes())
    }

    fn ints(self, head: &str, numbers: &[i32]) -> Self {
        self.put(head, numbers, |v| v.to_be_bytes())
    }

    fn longs(self, head: &str, numbers: &[i64]) -> Self {
        self.put(head, numbers, |v| v.to_be_bytes())
    }

    fn bytes(self, head: &str, numbers: &[u8]) -> Self {
        self.put(head, numbers, |v| [*v])
    }
}

const METADATA: &str =
    "METADATA\nCOMPONENT_NAMES\n\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n";

/// A triangle, a tetrahedron, another one as a polyhedron, and a ghost; points lie on a line that bends.
fn unstructured(is_binary: bool, has_offsets: bool, time: f64, value: f32) -> Vec<u8> {
    let version = if has_offsets { "5.1" } else { "4.2" };
    let file = File::new(is_binary, version, "UNSTRUCTURED_GRID").line("FIELD FieldData 1");
    let file = file.put("TimeValue 1 1 double", &[time], |v| v.to_be_bytes());
    let points: Vec<f32> = (0..5).flat_map(|i| [i as f32, (i * i) as f32, (i * i * i) as f32]).collect();
    let file = file.floats("POINTS 5 float", &points).line(METADATA);
    let faces = [4, 3, 1, 2, 3, 3, 1, 2, 4, 3, 2, 3, 4, 3, 1, 3, 4];
    let rows: [&[i32]; 4] = [&[0, 1, 2], &[0, 1, 2, 3], &faces, &[4, 3, 2, 1]];
    let file = if has_offsets {
        let ends: Vec<i64> = [0]
            .into_iter()
            .chain(rows.iter().scan(0, |end, row| {
                *end += row.len() as i64;
                Some(*end)
            }))
            .collect();
        let vertices: Vec<i64> = rows.concat().into_iter().map(i64::from).collect();
        let file = file.line("CELLS 5 28").longs("OFFSETS vtktypeint64", &ends);
        file.longs("CONNECTIVITY vtktypeint64", &vertices)
    } else {
        let words: Vec<i32> = rows.iter().flat_map(|row| [&[row.len() as i32], *row].concat()).collect();
        file.ints("CELLS 4 32", &words)
    };
    let file = file.ints("CELL_TYPES 4", &[5, 10, 42, 10]).line("CELL_DATA 4").line("FIELD FieldData 2");
    let file = file.bytes("vtkGhostType 1 4 unsigned_char", &[0, 0, 0, 1]).longs("ids 1 4 long", &[70, 71, 72, 73]);
    let file = file.line("POINT_DATA 5").line("SCALARS T float");
    file.floats("LOOKUP_TABLE default", &[value, 1.0, 2.0, 3.0, -0.5]).bytes
}

/// A mesh of 2 x 3 x 4 points of each structured kind, with a value for each and for each cell.
fn structured(is_binary: bool, dataset: &str) -> Vec<u8> {
    let file = File::new(is_binary, "2.0", dataset);
    let points: Vec<f32> = (0..24).flat_map(|i| [(i % 2) as f32, (i / 2 % 3) as f32, (i / 6) as f32]).collect();
    let file = match dataset {
        "STRUCTURED_POINTS" => file.line("EXTENT -1 0 0 2 5 8\nASPECT_RATIO 1 1 1\nORIGIN 1 0 -5"),
        "STRUCTURED_GRID" => file.line("DIMENSIONS 2 3 4").floats("POINTS 24 float", &points),
        _ => {
            let file = file.line("DIMENSIONS 2 3 4").floats("X_COORDINATES 2 float", &[0.0, 1.0]);
            file.floats("Y_COORDINATES 3 float", &[0.0, 1.0, 2.0]).ints("Z_COORDINATES 4 int", &[0, 1, 2, 3])
        }
    };
    let file = file.line("POINT_DATA 24").line("SCALARS T float 1");
    let file = file.floats("LOOKUP_TABLE default", &(0..24).map(|i| i as f32).collect::<Vec<_>>()).line("CELL_DATA 6");
    file.line("FIELD f 1").bytes("vtkGhostType 1 6 unsigned_char", &[0, 0, 8, 0, 0, 0]).bytes
}

/// Files in a folder, opened as one series.
fn open_files(files: &[(&str, &[u8])]) -> (tempfile::TempDir, FileResult<Box<dyn SeriesSource>>) {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.path().join(name)).collect();
    files.iter().zip(&paths).for_each(|((_, bytes), path)| fs::write(path, bytes).unwrap());
    let source = open_many(&paths);
    (folder, source)
}

/// All that a file has: its mesh, cell numbers, notes, and values of the first component of each field.
type Contents = (RawMesh, Vec<u32>, String, Vec<Vec<f32>>);

fn contents(bytes: &[u8]) -> Result<Contents, String> {
    let (_folder, source) = open_files(&[("a.vtk", bytes)]);
    let source = source.map_err(|error| error.to_string())?;
    let mesh = source.mesh().map_err(|error| error.to_string())?;
    let mut values = Vec::new();
    for field in source.fields() {
        let mut out = Vec::new();
        source.read(field, Component::Index(0), 0, &mut out).map_err(|error| error.to_string())?;
        values.push(out);
    }
    let numbers = (0..mesh.cells.len() as u32).map(|cell| source.cell_number(cell)).collect();
    Ok((mesh, numbers, source.notes().join("; "), values))
}

#[test]
fn unstructured_grids_are_the_same_in_all_layouts_as_text_and_binary() {
    for (is_binary, has_offsets) in [(false, false), (false, true), (true, false), (true, true)] {
        let (mesh, numbers, notes, values) = contents(&unstructured(is_binary, has_offsets, 0.5, 9.0)).unwrap();
        assert_eq!((mesh.points.len(), mesh.points[3].to_array()), (5, [3.0, 9.0, 27.0]));
        let cells: Vec<_> = mesh.cells.iter().map(<[u32]>::to_vec).collect();
        assert_eq!((cells, numbers), (vec![vec![0, 1, 2, 3], vec![1, 2, 3, 4]], vec![1, 2]));
        assert_eq!(values, [vec![9.0, 1.0, 2.0, 3.0, -0.5], vec![0.0, 0.0], vec![71.0, 72.0]]);
        assert!(notes.contains("1 triangle") && notes.contains("1 ghost cells"), "{notes}");
    }
}

#[test]
fn structured_grids_of_all_kinds_are_the_same_as_text_and_binary() {
    for dataset in ["STRUCTURED_POINTS", "STRUCTURED_GRID", "RECTILINEAR_GRID"] {
        for is_binary in [false, true] {
            let (mesh, numbers, notes, values) = contents(&structured(is_binary, dataset)).unwrap();
            let expected: Vec<_> = (0..24).map(|i| [i % 2, i / 2 % 3, i / 6].map(f64::from)).collect();
            assert_eq!(mesh.points.iter().map(|p| p.to_array()).collect::<Vec<_>>(), expected, "{dataset}");
            assert_eq!(numbers, [0, 1, 3, 4, 5]);
            assert_eq!(mesh.cells.iter().next().unwrap(), [0, 1, 3, 2, 6, 7, 9, 8]);
            assert_eq!(values[0], (0..24).map(|i| i as f32).collect::<Vec<_>>());
            assert!(notes.contains("5 voxel") || dataset == "STRUCTURED_GRID", "{notes}");
        }
    }
}

#[test]
fn the_bits_of_a_byte_are_in_order() {
    assert_eq!(unpacked(&[0b1011_0000, 0b0100_0000], 10), [1, 0, 1, 1, 0, 0, 0, 0, 0, 1]);
}

#[test]
fn files_are_a_series_with_their_times_and_lists_of_them_another() {
    let [a, b] = [(7.5, 1.0), (0.25, 2.0)].map(|(time, value)| unstructured(true, true, time, value));
    let first = |source: &dyn SeriesSource, step: usize| {
        let mut out = Vec::new();
        source.read(&source.fields()[0], Component::Index(0), step, &mut out).map(|()| out[0])
    };
    let (folder, source) = open_files(&[("s_10.vtk", &b), ("s_9.vtk", &a)]);
    let source = source.unwrap();
    assert_eq!((source.times().values.as_slice(), first(source.as_ref(), 0).ok()), (&[0.25, 7.5][..], Some(2.0)));
    assert!(source.notes()[0].contains("TIME or TimeValue of the files"));
    let (_same, source) = open_files(&[("s_10.vtk", &b), ("s_9.vtk", &b)]);
    assert_eq!(source.unwrap().times().values, [0.0, 1.0], "times are equal");

    let list = folder.path().join("s.vtk.series");
    let text = r#"{"files": [{"name": "s_9.vtk", "time": 3}, {"name": "s_10.vtk", "time": 4}]}"#;
    fs::write(&list, text).unwrap();
    let source = crate::import::open(&list).unwrap();
    assert_eq!((source.times().values.as_slice(), first(source.as_ref(), 1).ok()), (&[3.0, 4.0][..], Some(2.0)));
    assert_eq!(crate::import::files(&list).unwrap().len(), 3);
    fs::write(folder.path().join("c.vtu"), "").unwrap();
    fs::write(&list, text.replace("s_10.vtk", "c.vtu")).unwrap();
    let source = crate::import::open(&list).unwrap();
    assert!(first(source.as_ref(), 1).unwrap_err().to_string().contains("c.vtu"));

    fs::rename(folder.path().join("s_10.vtk"), folder.path().join("s_10")).unwrap();
    let list = folder.path().join("s.pvd");
    let entries = r#"<DataSet timestep="4" file="s_9.vtk"/><DataSet timestep="5" file="s_10"/>"#;
    let text = format!("<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>");
    fs::write(&list, text).unwrap();
    let source = crate::import::open(&list).unwrap();
    assert_eq!((source.times().values.as_slice(), first(source.as_ref(), 1).ok()), (&[4.0, 5.0][..], Some(2.0)));

    let (_moved, source) = open_files(&[("0.vtk", &a), ("1.vtk", &structured(true, "STRUCTURED_GRID"))]);
    let error = first(source.unwrap().as_ref(), 1).unwrap_err().to_string();
    assert!(error.contains("the mesh changes"), "{error}");
}

#[test]
fn what_contradicts_itself_is_named() {
    let start = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET ";
    let tet = "UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    let even = "STRUCTURED_POINTS DIMENSIONS 2 2 2 ORIGIN 0 0 0 SPACING 1 1 1\n";
    for (text, expected) in [
        (format!("{tet}CELLS 1 5\n4 0 1 2 3\n"), "has no CELL_TYPES"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10 10\n"), "2 types for 1 cells"),
        (format!("{tet}CELLS 1 5\n5 0 1 2 3\nCELL_TYPES 1\n10\n"), "(numbers from line 8): ends in cell 0 of 1"),
        (format!("{tet}CELLS 1 5\n3 0 1 2 3\nCELL_TYPES 1\n10\n"), "1 numbers behind its cells"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n"), "vertex 4, but there are 4 points"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 -3\nCELL_TYPES 1\n10\n"), "number 4 is negative"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n41\n"), "Tetrahedralize"),
        (format!("{tet}CELLS 1 5\n4 3 1 2 3\nCELL_TYPES 1\n42\n"), "cell 0: has a list of faces that is cut"),
        (format!("{tet}CELLS 2 4\nOFFSETS int 1 4\nCONNECTIVITY int 0 1 2 3\nCELL_TYPES 1\n10\n"), "begin with 0"),
        (format!("{tet}CELLS 3 4\nOFFSETS int 0 4 3\nCONNECTIVITY int 0 1 2 3\nCELL_TYPES 2\n10 10\n"), "decrease"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 3\n"), "POINT_DATA: claims 3 values"),
        (format!("{tet}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nCELL_DATA 2\n"), "CELL_DATA: claims 2 values"),
        (tet.to_owned(), "no cells with a volume"),
        ("UNSTRUCTURED_GRID".to_owned(), "ends before the mesh"),
        ("STRUCTURED_POINTS ORIGIN 0 0 0 POINT_DATA 1 ".to_owned(), "has no DIMENSIONS"),
        ("STRUCTURED_POINTS DIMENSIONS 20 20 20 POINT_DATA 1 ".to_owned(), "claims 8000 points"),
        ("STRUCTURED_POINTS DIMENSIONS 0 9 9 POINT_DATA 1 ".to_owned(), "0 x 9 x 9"),
        ("STRUCTURED_POINTS EXTENT 0 -5 0 1 0 1 POINT_DATA 1 ".to_owned(), "before it begins"),
        (even.replace("SPACING 1", "SPACING nan") + "POINT_DATA 8 ", "finite"),
        ("STRUCTURED_GRID DIMENSIONS 2 2 2 POINTS 1 float 0 0 0 ".to_owned(), "has 1 points"),
        ("RECTILINEAR_GRID DIMENSIONS 2 1 1 X_COORDINATES 2 int 0 1 ".to_owned(), "has no Y_COORDINATES"),
        (
            "RECTILINEAR_GRID DIMENSIONS 2 1 1 X_COORDINATES 1 int 0 Y_COORDINATES 1 int 0 Z_COORDINATES 1 int 0 "
                .to_owned(),
            "along x",
        ),
        (format!("{even}POINT_DATA 8\nSCALARS T int\nLOOKUP_TABLE t\n1 2 3 4 5 6 7 8.5\n"), "'8.5' is no"),
        (format!("{even}FIELD f 1 TIME 1 1 float inf POINT_DATA 8 "), "the time inf is not finite"),
    ] {
        let error = contents(format!("{start}{text}").as_bytes()).unwrap_err();
        assert!(error.contains(expected) && error.contains("a.vtk"), "{expected}: {error}");
    }
}

/// A file of each kind, as text and binary.
fn all() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for is_binary in [false, true] {
        files.extend([false, true].map(|has_offsets| unstructured(is_binary, has_offsets, 0.5, 9.0)));
        let kinds = ["STRUCTURED_POINTS", "STRUCTURED_GRID", "RECTILINEAR_GRID"];
        files.extend(kinds.map(|dataset| structured(is_binary, dataset)));
    }
    files
}

#[test]
fn files_that_are_cut_anywhere_are_an_error_or_what_is_left_of_them() {
    for file in all() {
        let mut refused = 0;
        for end in 0..file.len() {
            refused += usize::from(contents(&file[..end]).is_err());
        }
        // What is behind the last cell can be cut without a loss of the mesh.
        assert!(refused > file.len() / 4, "{refused} of {}", file.len());
    }
}

#[test]
fn files_with_other_bits_are_read_or_an_error() {
    let mut random = SplitMix64::new(3);
    let mut refused = 0;
    for file in all() {
        for _ in 0..200 {
            let mut damaged = file.clone();
            for _ in 0..1 + random.below(3) {
                let at = random.below(8 * damaged.len());
                damaged[at / 8] ^= 1 << (at % 8);
            }
            refused += usize::from(contents(&damaged).is_err());
        }
    }
    assert!((200..1900).contains(&refused), "{refused} of 2000");
}
