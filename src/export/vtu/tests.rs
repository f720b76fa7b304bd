//! Files are read back by a minimal parser: declared arrays are there, bit for bit; failures leave no files.

use super::*;
use crate::field::TimeAxis;
use crate::task::Silent;
use glam::DVec3;
use std::collections::BTreeMap;

/// Two tets; a scalar, a vector and a cell field with an awkward name; odd values and times.
struct Two {
    times: TimeAxis,
    fields: Vec<FieldInfo>,
    mesh: RawMesh,
    /// Number of values missing at the end of each array read.
    missing: usize,
}

fn two() -> Two {
    let field = |name: &str, components, association| FieldInfo { name: name.to_owned(), components, association };
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1e9, 1.0 / 3.0, -0.0]];
    Two {
        times: TimeAxis { values: vec![-0.1, 0.1 + 0.2, 1e300] },
        fields: vec![
            field("T", 1, Association::Point),
            field("rate <&\"> of\tx", 1, Association::Cell),
            field("u", 3, Association::Point),
        ],
        mesh: RawMesh {
            points: points.map(DVec3::from_array).to_vec(),
            cells: vec![[0, 1, 2, 3], [4, 3, 2, 1]].into(),
        },
        missing: 0,
    }
}

fn value(field: &FieldInfo, component: usize, step: usize, i: usize) -> f32 {
    let odd = [f32::NAN, f32::NEG_INFINITY, f32::from_bits(1)];
    if i < 3 && component == 0 { odd[i] } else { (field.name.len() * 100 + component * 30 + step * 10 + i) as f32 }
}

impl SeriesSource for Two {
    fn describe(&self) -> String {
        "two tets".to_owned()
    }
    fn times(&self) -> &TimeAxis {
        &self.times
    }
    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }
    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }
    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let Component::Index(c) = component else { panic!("whole fields are written") };
        let count =
            if field.association == Association::Point { self.mesh.points.len() } else { self.mesh.cells.tets.len() };
        out.clear();
        out.extend((0..count - self.missing).map(|i| value(field, c, step, i)));
        Ok(())
    }
}

/// The arrays of a file by section and name: type, components and raw bytes.
type Arrays = BTreeMap<(String, String), (String, usize, Vec<u8>)>;

/// Splits at the underscore in front of the appended data, parses the head with quick-xml and cuts the blocks out.
fn parse(path: &Path) -> Arrays {
    let bytes = std::fs::read(path).unwrap();
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let head = std::str::from_utf8(&bytes[..at - mark.len()]).unwrap();
    let mut reader = quick_xml::Reader::from_str(head);
    let (mut section, mut arrays) = (String::new(), Arrays::new());
    let mut end = 0;
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Start(e) => section = e.name().as_ref().to_owned(),
            quick_xml::events::Event::Empty(e) => {
                let get = |n: &str| {
                    e.try_get_attribute(n)
                        .unwrap()
                        .map(|a| a.normalized_value(quick_xml::XmlVersion::Explicit1_0).unwrap().into_owned())
                };
                let block = at + get("offset").unwrap().parse::<usize>().unwrap();
                let length = u64::from_le_bytes(bytes[block..block + 8].try_into().unwrap()) as usize;
                let data = bytes[block + 8..block + 8 + length].to_vec();
                assert_eq!(block, at + end, "blocks touch");
                end += 8 + length;
                let components = get("NumberOfComponents").map_or(1, |n| n.parse().unwrap());
                arrays.insert((section.clone(), get("Name").unwrap()), (get("type").unwrap(), components, data));
            }
            quick_xml::events::Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(&bytes[at + end..], b"\n</AppendedData>\n</VTKFile>\n");
    arrays
}

fn export(source: &dyn SeriesSource, dir: &Path, options: &VtuOptions) -> Result<VtuReport, VtuError> {
    write_series(source, dir, options, &Silent, &Cancel::new())
}

#[test]
fn every_array_is_where_the_head_says_and_keeps_its_bits() {
    let (source, temp) = (two(), tempfile::tempdir().unwrap());
    let report = export(&source, &temp.path().join("run"), &VtuOptions::default()).unwrap();
    assert_eq!(report.pvd, temp.path().join("run/run.pvd"));
    let mut size = std::fs::metadata(&report.pvd).unwrap().len();
    for step in 0..3 {
        let path = temp.path().join(format!("run/run_{step:04}.vtu"));
        size += std::fs::metadata(&path).unwrap().len();
        let arrays = parse(&path);
        let array = |section: &str, name: &str| arrays[&(section.to_owned(), name.to_owned())].clone();
        for field in &source.fields {
            let (section, count) = match field.association {
                Association::Point => ("PointData", 5),
                Association::Cell => ("CellData", 2),
            };
            let expected: Vec<u8> = (0..count)
                .flat_map(|i| (0..field.components).flat_map(move |c| value(field, c, step, i).to_le_bytes()))
                .collect();
            assert_eq!(array(section, &field.name), ("Float32".to_owned(), field.components, expected));
        }
        assert_eq!(array("FieldData", "TimeValue").2, source.times.values[step].to_le_bytes());
        let points: Vec<u8> = source.mesh.points.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes).collect();
        assert_eq!(array("Points", "Points"), ("Float64".to_owned(), 3, points));
        let integers = |values: &[i64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        assert_eq!(array("Cells", "connectivity").2, integers(&[0, 1, 2, 3, 4, 3, 2, 1]));
        assert_eq!(array("Cells", "offsets").2, integers(&[4, 8]));
        assert_eq!(array("Cells", "types").2, [10, 10]);
        assert_eq!(arrays.len(), 8);
    }
    assert_eq!((report.steps, report.bytes), (3, size));
}

#[test]
fn the_collection_gives_times_that_read_back_exactly() {
    let (source, temp) = (two(), tempfile::tempdir().unwrap());
    let options = VtuOptions { name: Some("a & b".to_owned()), steps: Some(vec![2, 0]), ..VtuOptions::default() };
    let report = export(&source, &temp.path().join("run"), &options).unwrap();
    let text = std::fs::read_to_string(&report.pvd).unwrap();
    let times: Vec<f64> =
        text.split("timestep=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect();
    assert_eq!(times, [1e300, -0.1]);
    assert!(text.contains("file=\"a &amp; b_0001.vtu\""), "{text}");
    assert!(temp.path().join("run/a & b_0001.vtu").is_file());
}

#[test]
fn chosen_fields_only_are_written() {
    let (source, temp) = (two(), tempfile::tempdir().unwrap());
    let options = VtuOptions { fields: vec!["u".to_owned()], steps: Some(vec![1]), ..VtuOptions::default() };
    export(&source, &temp.path().join("run"), &options).unwrap();
    let arrays = parse(&temp.path().join("run/run_0000.vtu"));
    let names: Vec<&str> =
        arrays.keys().filter(|(s, _)| s.ends_with("tData") || s == "CellData").map(|k| &*k.1).collect();
    assert_eq!(names, ["u"]);
}

#[test]
fn an_empty_mesh_and_no_steps_are_files_too() {
    let mut source = two();
    source.mesh = RawMesh::default();
    let temp = tempfile::tempdir().unwrap();
    export(&source, &temp.path().join("a"), &VtuOptions::default()).unwrap();
    assert!(parse(&temp.path().join("a/a_0002.vtu"))[&("Points".to_owned(), "Points".to_owned())].2.is_empty());
    let none = export(&source, &temp.path().join("b"), &VtuOptions { steps: Some(vec![]), ..Default::default() });
    assert_eq!(none.unwrap().steps, 0);
}

/// Exports, expecting a failure, and returns its message; only files that were there may be left.
fn failure(source: &dyn SeriesSource, dir: &Path, options: &VtuOptions) -> String {
    let list = || {
        let entries = std::fs::read_dir(dir.parent().unwrap()).map(|e| e.map(|e| e.unwrap().file_name()).collect());
        let mut names: Vec<std::ffi::OsString> = entries.unwrap_or_default();
        names.sort();
        names
    };
    let before = list();
    let message = export(source, dir, options).unwrap_err().to_string();
    assert_eq!(list(), before, "{message}");
    message
}

#[test]
fn places_that_are_taken_or_cannot_be_are_refused_and_left_alone() {
    let (source, temp) = (two(), tempfile::tempdir().unwrap());
    let options = VtuOptions { name: Some("x".to_owned()), ..VtuOptions::default() };
    let taken = temp.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("notes.txt"), "mine").unwrap();
    assert!(failure(&source, &taken, &options).contains("not empty; choose"));
    assert_eq!(std::fs::read(taken.join("notes.txt")).unwrap(), b"mine");
    assert!(failure(&source, &taken.join("notes.txt"), &options).contains("not a folder"));
    assert!(failure(&source, &temp.path().join("no/run"), &options).contains("create it first"));
    assert!(failure(&source, &temp.path().join(".."), &options).contains("not empty"));
    let empty = temp.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    export(&source, &empty, &options).unwrap();
}

#[test]
fn what_the_source_lacks_or_contradicts_is_named_and_nothing_is_left() {
    let temp = tempfile::tempdir().unwrap();
    let dir = temp.path().join("run");
    let with = |change: &dyn Fn(&mut Two, &mut VtuOptions)| {
        let (mut source, mut options) = (two(), VtuOptions::default());
        change(&mut source, &mut options);
        failure(&source, &dir, &options)
    };
    assert!(with(&|_, o| o.fields = vec!["V".to_owned()]).contains("field 'V': does not exist; choose from T, "));
    assert!(with(&|_, o| o.steps = Some(vec![3])).contains("step 3: does not exist"));
    assert!(with(&|s, _| s.missing = 1).contains("4 values at step 0 where the mesh needs 5"));
    assert!(with(&|s, _| s.mesh.cells.tets[1][2] = 5).contains("cell 1: has a vertex beyond"));
    assert!(with(&|s, _| s.times.values[1] = f64::NAN).contains("step 1: has the time NaN"));
    assert!(with(&|s, _| s.fields[0].name = "a\0b".to_owned()).contains("rename the field"));
    for name in ["", "..", "a/b", "a\\b", "a\nb\0"] {
        assert!(with(&|_, o| o.name = Some(name.to_owned())).contains("cannot begin"), "{name:?}");
    }
}

#[test]
fn a_cancelled_export_leaves_nothing() {
    /// Cancels during the second step.
    struct AfterOne(Cancel);
    impl Progress for AfterOne {
        fn begin(&self, _: &str, total: u64, _: &str) {
            assert_eq!(total, 3);
        }
        fn advance(&self, _: u64) {
            self.0.cancel();
        }
        fn end(&self) {}
        fn say(&self, _: &str) {}
    }
    let temp = tempfile::tempdir().unwrap();
    let cancel = Cancel::new();
    let progress = AfterOne(cancel.clone());
    let result = write_series(&two(), &temp.path().join("run"), &VtuOptions::default(), &progress, &cancel);
    assert!(matches!(result, Err(VtuError::Cancelled)));
    assert_eq!(std::fs::read_dir(temp.path()).unwrap().count(), 0);
}
