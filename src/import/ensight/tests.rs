//! Cases in both encodings, refusals, and damage.

use super::open;
use crate::field::{Component, SeriesSource};
use crate::random::SplitMix64;
use std::fs;
use std::path::Path;

const CASE: &str = "# by hand
FORMAT
type:   ensight gold
GEOMETRY
model: mesh.geo
VARIABLE
scalar per node: 1 T T.**
tensor symm per node: S S.all
scalar per element: 1 p \"p.**\"
scalar per measured node: 1 m m.**
vector per node: 2 late late.*
TIME
time set: 1 main
number of steps: 2
filename start number: 3
filename increment: 2
time values: 0.5
1.5
time set: 2
number of steps: 2
filename numbers: 1 2
time values: 7 8
";

/// A file, written as text or binary.
enum Item<'a> {
    Line(&'a str),
    Count(i32),
    Counts(&'a [i32]),
    Floats(&'a [f32]),
}
use Item::{Count, Counts, Floats, Line};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Written {
    Text,
    Little,
    Big,
}

fn written(items: &[Item], how: Written) -> Vec<u8> {
    let mut out = Vec::new();
    for item in items {
        let words: Vec<(String, u32)> = match item {
            Line(line) if how == Written::Text => {
                out.extend(format!("{line}\n").into_bytes());
                continue;
            }
            Line(line) => {
                out.extend(line.bytes().chain(std::iter::repeat(0)).take(80));
                continue;
            }
            Count(count) => vec![(count.to_string(), count.cast_unsigned())],
            Counts(counts) => counts.iter().map(|count| (count.to_string(), count.cast_unsigned())).collect(),
            Floats(floats) => floats.iter().map(|float| (format!("{float:e}"), float.to_bits())).collect(),
        };
        for (text, bits) in words {
            match how {
                Written::Text => out.extend(format!("{text}\n").into_bytes()),
                Written::Little => out.extend(bits.to_le_bytes()),
                Written::Big => out.extend(bits.to_be_bytes()),
            }
        }
    }
    out
}

const POINTS: [f32; 15] = [0., 1., 0., 0., 0.25, 0., 0., 1., 0., 0.25, 0., 0., 0., 1., -0.5];

/// The geometry: part 2 of two tetrahedra, a triangle and a ghost, part 7 of a tetrahedron as a polyhedron.
fn geometry(how: Written) -> Vec<u8> {
    let mut items = if how == Written::Text { Vec::new() } else { vec![Line("C Binary")] };
    items.extend([Line("one"), Line(""), Line("node id given"), Line("element id off"), Line("extents")]);
    items.push(Floats(&[0., 1., 0., 1., -0.5, 1.]));
    items.extend([Line("part"), Count(2), Line("body"), Line("coordinates"), Count(5), Counts(&[1, 2, 3, 4, 5])]);
    items.extend([Floats(&POINTS), Line("tria3"), Count(1), Counts(&[1, 2, 3]), Line("tetra4"), Count(2)]);
    items.extend([Counts(&[1, 2, 3, 4, 1, 3, 2, 5]), Line("g_tetra4"), Count(1), Counts(&[1, 2, 3, 4])]);
    items.extend([Line("part"), Count(7), Line("other"), Line("coordinates"), Count(4), Counts(&[1, 2, 3, 4])]);
    items.extend([Floats(&[5., 6., 5., 5., 0., 0., 1., 0., 0., 0., 0., 1.]), Line("nfaced"), Count(1), Count(4)]);
    items.extend([Counts(&[3, 3, 3, 3]), Counts(&[1, 3, 2, 1, 2, 4, 2, 3, 4, 1, 4, 3])]);
    written(&items, how)
}

/// Writes a case to a folder and opens it.
fn write(folder: &Path, how: Written) {
    let put = |name: &str, bytes: Vec<u8>| fs::write(folder.join(name), bytes).expect("a file");
    put("run.case", CASE.as_bytes().to_vec());
    put("mesh.geo", geometry(how));
    for (number, t) in [("03", 0.0_f32), ("05", 10.0)] {
        let of_nodes: Vec<f32> = (0_u8..5).map(|i| t + f32::from(i)).collect();
        let (head, part) = (Line("T"), Line("part"));
        let items = [head, part, Count(2), Line("coordinates undef"), Floats(&[t + 3.0]), Floats(&of_nodes)];
        put(&format!("T.{number}"), written(&items, how));
        let (other, body) = ([t + 70.0], [t + 20.0, t + 21.0]);
        let mut items = vec![Line("p"), Line("part"), Count(7), Line("nfaced"), Floats(&other)];
        items.extend([Line("part"), Count(2), Line("tetra4"), Floats(&body)]);
        put(&format!("p.{number}"), written(&items, how));
    }
    let tensor: Vec<f32> = (0_u8..24).map(f32::from).collect();
    put("S.all", written(&[Line("S"), Line("part"), Count(7), Line("coordinates"), Floats(&tensor)], how));
    for number in ["1", "2"] {
        put(&format!("late.{number}"), written(&[Line("late")], how));
    }
}

fn opened(folder: &Path) -> Result<Box<dyn SeriesSource>, String> {
    open(&[folder.join("run.case")]).map_err(|error| error.to_string())
}

fn read(source: &dyn SeriesSource, name: &str, component: usize, step: usize) -> Vec<f32> {
    let field = source.fields().iter().find(|field| field.name == name).expect("the field");
    let mut out = Vec::new();
    source.read(field, Component::Index(component), step, &mut out).expect("values");
    out
}

/// Values with -1 for NaN.
fn plain(values: Vec<f32>) -> Vec<f32> {
    values.into_iter().map(|value| if value.is_nan() { -1.0 } else { value }).collect()
}

#[test]
fn text_and_binary_of_both_byte_orders_have_the_same_series() {
    for how in [Written::Text, Written::Little, Written::Big] {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), how);
        let source = opened(folder.path()).unwrap_or_else(|error| panic!("{how:?}: {error}"));
        let source = source.as_ref();
        assert_eq!(source.times().values, [0.5, 1.5]);
        let mesh = source.mesh().expect("a mesh");
        assert_eq!((mesh.points.len(), mesh.cells.len()), (9, 3), "{how:?}");
        assert_eq!(mesh.points[4].to_array(), [0.25, 0.25, -0.5]);
        assert_eq!(mesh.cells.tets, [[0, 1, 2, 3], [0, 2, 1, 4]]);
        let names: Vec<_> = source.fields().iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["T", "S", "p", "block"]);
        for (step, t) in [(0, 0.0), (1, 10.0)] {
            let mut expected = [0.0, 1.0, 2.0, 3.0, 4.0].map(|v| v + t).to_vec();
            expected[3] = -1.0;
            expected.extend([-1.0; 4]);
            assert_eq!(plain(read(source, "T", 0, step)), expected, "{how:?}");
            assert_eq!(read(source, "p", 0, step), [20.0, 21.0, 70.0].map(|v| v + t), "{how:?}");
            // YZ is EnSight's sixth component.
            assert_eq!(plain(read(source, "S", 4, step))[4..], [-1.0, 20.0, 21.0, 22.0, 23.0]);
            assert_eq!(plain(read(source, "S", 5, step))[4..], [-1.0, 16.0, 17.0, 18.0, 19.0]);
        }
        let notes = source.notes().join("; ");
        for expected in
            ["1 triangle", "skipped 1 ghost cells", "'m' (scalar per measured node)", "'late' (at other times"]
        {
            assert!(notes.contains(expected), "{notes}");
        }
        assert_eq!((super::FORMAT.files)(&folder.path().join("run.case")).expect("files").len(), 6);
    }
}

#[test]
fn what_is_not_read_or_contradicts_itself_is_named() {
    let refusal = |name: &str, change: &dyn Fn(String) -> String| {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), Written::Text);
        let path = folder.path().join(name);
        let text = String::from_utf8(fs::read(&path).expect("a file")).expect("text");
        let changed = change(text.clone());
        assert_ne!(changed, text, "{name}");
        fs::write(&path, changed).expect("a file");
        let source = match opened(folder.path()) {
            Ok(source) => source,
            Err(error) => return error,
        };
        let mut out = Vec::new();
        let read = |field| source.read(field, Component::Index(0), 0, &mut out).err();
        source.fields().iter().find_map(read).map_or_else(|| panic!("{name} is read"), |error| error.to_string())
    };
    for (name, from, to, expected) in [
        ("run.case", "ensight gold", "ensight", "EnSight Gold alone"),
        ("run.case", "TIME\n", "FILE\n", "section FILE"),
        ("run.case", "1 T T.**", "1 1 T T.**", "file set"),
        ("run.case", "mesh.geo", "../mesh.geo", "outside"),
        ("run.case", "mesh.geo", "/mesh.geo", "outside"),
        ("run.case", "mesh.geo", "none.geo", "missing"),
        ("run.case", "model:", "modell:", "'model:' is missing"),
        ("run.case", "steps: 2", "steps: 3", "claims 3 steps"),
        ("run.case", "0.5", "1.5", "same time"),
        ("run.case", "0.5", "nan", "not finite"),
        ("run.case", "1 T T", "5 T T", "time set 5"),
        ("run.case", "number: 3", "number: -3", "'-3' is no number"),
        ("run.case", "increment: 2", "increment: 18446744073709551615", "too large"),
        ("mesh.geo", "one\n", "Fortran Binary\n", "Fortran"),
        ("mesh.geo", "tetra4\n2", "tetra5\n2", "'tetra5'"),
        ("mesh.geo", "tetra4\n2", "tetra4\n-2", "negative"),
        ("mesh.geo", "tetra4\n2", "tetra4\n4611686018427387904", "claims"),
        ("mesh.geo", "coordinates\n5", "coordinates\n9223372036854775807", "claims"),
        ("mesh.geo", "coordinates\n5", "block\n1 2 3", "structured"),
        ("mesh.geo", "part\n7", "part\n2", "twice"),
        ("mesh.geo", "tetra4\n2\n1\n2\n3\n4", "tetra4\n2\n1\n2\n3\n6", "vertex 5"),
        ("mesh.geo", "tetra4\n2\n1\n2\n3\n4", "tetra4\n2\n1\n2\n3\n0", "node 0"),
        ("mesh.geo", "one\n", "BEGIN TIME STEP\none\n", "several steps in one file"),
        ("T.03", "coordinates undef", "coordinates partial", "partial"),
        ("T.03", "part\n2", "part\n3", "part 3"),
        ("p.03", "nfaced", "hexa8", "'hexa8'"),
        ("p.03", "tetra4\n", "tetra4\nx", "'x2e1' is no"),
    ] {
        let error = refusal(name, &|text| text.replacen(from, to, 1));
        assert!(error.contains(expected), "{name}, {to}: {error}");
    }
}

/// Opens a case and reads all that it has.
fn read_all(folder: &Path) {
    let Ok(source) = opened(folder) else { return };
    let _ = source.mesh();
    let mut out = Vec::new();
    for field in source.fields() {
        for step in 0..source.times().len() {
            let _ = source.read(field, Component::Magnitude, step, &mut out);
        }
    }
}

#[test]
fn damaged_files_are_read_or_refused_but_never_panic() {
    let mut random = SplitMix64::new(11);
    for how in [Written::Text, Written::Big] {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), how);
        for name in ["run.case", "mesh.geo", "T.03", "p.03"] {
            let path = folder.path().join(name);
            let whole = fs::read(&path).expect("a file");
            for end in 0..whole.len() {
                fs::write(&path, &whole[..end]).expect("a file");
                read_all(folder.path());
            }
            for _ in 0..200 {
                let mut flipped = whole.clone();
                let at = random.below(whole.len());
                flipped[at] ^= 1 << random.below(8);
                fs::write(&path, flipped).expect("a file");
                read_all(folder.path());
            }
            fs::write(&path, whole).expect("a file");
        }
    }
}
